"""The audit trail over HTTP: of one organisation, for its admins, newest first."""

import csv
import json

import pytest
from sqlalchemy import text

from service.pages.rendering import Assets, build_environment
from store.queries.audit import NAMES
from store.tables.base import Audited, AuditedTogether, Base
from tests.support.house import CAMERA

pytestmark = pytest.mark.either_database


def test_who_did_what_newest_first_and_a_page_at_a_time(house):
    campaign = house.campaign()
    house.patch(f"/v1/campaigns/{campaign['id']}", {"recorder": "B. Schulz"})
    entries = house.get("/v1/audit", subject_id=campaign["id"])["items"]
    assert [e["action"] for e in entries] == ["campaign.change", "campaign.create"]
    assert entries[0]["before"] == {"recorder": None}
    assert entries[0]["after"] == {"recorder": "B. Schulz"}
    assert entries[0]["actor"].startswith("key_")
    everything = house.get("/v1/audit")
    assert everything["next"] is None
    seqs = [e["seq"] for e in everything["items"]]
    assert seqs == sorted(seqs, reverse=True)
    paged, page = [], house.get("/v1/audit", limit=2)
    while True:
        paged += page["items"]
        if page["next"] is None:
            break
        page = house.http.get(page["next"]).json()
    assert paged == everything["items"]
    frame = house.upload(campaign, house.frame_bytes(), role="dark")
    house.work()
    read, made = house.get("/v1/audit", subject_id=frame["id"])["items"]
    assert (read["actor"], made["action"], made["actor"][:4]) == ("worker", "frame.create", "key_")
    assert (read["before"]["state"], read["after"]["state"]) == ("received", "read")


def test_another_organisation_sees_its_own_only(house, stranger):
    campaign = house.campaign()
    own = stranger.post("/v1/cameras", json=CAMERA).json()
    entries = stranger.get("/v1/audit").json()["items"]
    assert [e["subject_id"] for e in entries] == [own["id"]]
    assert stranger.get("/v1/audit", params={"subject_id": campaign["id"]}).json()["items"] == []


def test_only_an_admin_reads_it(house):
    with house.with_scopes("read", "publish") as client:
        assert client.get("/v1/audit").json()["code"] == "scope_missing"


def test_what_names_an_entry_is_in_its_table():
    assert [name for name, (table, _, about) in NAMES.items() if about and not hasattr(table, about)] == []


def test_entries_are_chosen_named_and_exported(house):
    campaign = house.campaign()
    house.http.put(f"/v1/campaigns/{campaign['id']}/roi", json={"polygon": [[0, 0], [9, 0], [9, 9]]})
    (region,) = house.get("/v1/audit", action="roi.create")["items"]
    assert region["subject_id"].startswith("roi_")
    other = house.post("/v1/keys", {"name": "=other", "scopes": ["calibrate"]})
    with house.with_key(other["secret"]) as client:
        client.patch(f"/v1/campaigns/{campaign['id']}", json={"recorder": "B. Schulz"})
    (entry,) = house.get("/v1/audit", actor=other["id"])["items"]
    assert (entry["actor_name"], entry["about_id"]) == ("=other", campaign["id"])
    made = house.get("/v1/audit", action="campaign.create")["items"]
    assert [each["subject_id"] for each in made] == [campaign["id"]]
    assert house.get("/v1/audit", subject_type="campaign", to=made[0]["at"])["items"] == []
    since = house.get("/v1/audit", **{"from": entry["at"]})["items"]
    assert since == [entry]
    rows = list(csv.DictReader(house.http.get("/v1/audit/entries.csv").text.splitlines()))
    lines = [json.loads(line) for line in house.http.get("/v1/audit/entries.jsonl").text.splitlines()]
    assert [int(row["seq"]) for row in rows] == [line["seq"] for line in lines]
    assert lines[::-1] == house.get("/v1/audit")["items"]
    assert rows[-1]["actor_name"] == "'=other"
    assert json.loads(rows[-1]["after"]) == {"recorder": "B. Schulz"}
    assert len(house.http.get("/v1/audit/entries.csv", params={"actor": other["id"]}).text.splitlines()) == 2
    assert house.get("/v1/audit", order="x", status=422)["code"] == "validation_failed"


def check(house):
    """The whole chain, a request at a time: its state, how many entries hold, the first that does not."""
    path, entries = "/v1/audit/chain", 0
    while path:
        answer = house.http.get(path).json()
        entries, path = entries + answer["entries"], answer.get("next")
    return answer["state"], entries, answer.get("broken_at")


def tamper(house, statement, seq):
    with house.database.engine.begin() as connection:
        table = "" if house.database.is_sqlite else " ON audit_entry"
        for trigger in ("changes", "goes"):
            connection.execute(text(f"DROP TRIGGER IF EXISTS audit_entry_never_{trigger}{table}"))
        connection.execute(text(statement), {"seq": seq})


def test_the_chain_is_checked_in_pieces_and_names_what_was_edited_or_deleted(house, stranger, monkeypatch):
    monkeypatch.setattr("service.organisation.routes._MOST_CHECKED", 2)
    for number in range(3):
        house.campaign(project_number=str(number))
        stranger.post("/v1/cameras", json=CAMERA | {"serial": str(number)})
    last, before, edited, *_ = entries = house.get("/v1/audit")["items"]
    assert check(house) == ("intact", len(entries), None)
    answer = house.get("/v1/audit/chain", after=before["seq"])
    assert answer == {"state": "intact", "entries": 1, "head": f"{last['seq']}:{last['sha256']}"}
    tamper(house, "UPDATE audit_entry SET actor = 'x' WHERE seq = :seq", edited["seq"])
    assert check(house) == ("broken", len(entries) - 3, edited["seq"])
    tamper(house, "DELETE FROM audit_entry WHERE seq = :seq", edited["seq"])
    assert check(house) == ("broken", len(entries) - 3, before["seq"])
    gone = house.get("/v1/audit/chain", after=edited["seq"])
    assert (gone["state"], gone["broken_at"]) == ("broken", edited["seq"])
    tamper(house, "DELETE FROM audit_entry WHERE seq > :seq", edited["seq"])
    state, holding, broken_at = check(house)
    assert (state, holding, broken_at > entries[3]["seq"]) == ("broken", len(entries) - 3, True)
    # of the stranger's entries those after that one were deleted too
    assert stranger.get("/v1/audit/chain").json()["state"] == "broken"


def test_every_act_on_an_audited_table_has_its_words():
    acts = build_environment(Assets()).get_template("organisation/acts.html").module.ACTS
    tables = {mapper.class_ for mapper in Base.registry.mappers}
    audited = {each.__tablename__ for each in tables if issubclass(each, Audited | AuditedTogether)}
    assert {f"{name}.create" for name in audited} <= acts.keys()
    assert {act.partition(".")[0] for act in acts} <= audited | {"job"}
