"""Certificates are kept as issued, with amendments beside them; without one nothing is published."""

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from hashlib import sha256
from itertools import chain, repeat
from unittest.mock import DEFAULT, Mock

import pytest
from sqlalchemy import func, select, update
from sqlalchemy.exc import DBAPIError

from service.documents.issuing import Backlog
from service.documents.pages import lay_out
from service.documents.rendering import render
from store.blobs import StorageFull
from store.tables import FrameRow, IssuedCertificate, Publication
from tests.support.blobs import put, zero
from tests.support.campaigns import calibrate, calibrated_campaign
from tests.support.certificates import complete_version
from tests.support.house import KEY, PUBLICATION
from verify.audit import check_rows

pytestmark = pytest.mark.either_database

PLAIN = {"Accept-Encoding": "identity"}


@pytest.fixture
def version(staged):
    return staged(calibrated_campaign, isos=(3200,))


@pytest.fixture
def unissued(house, version, monkeypatch):
    """Two versions as at an upgrade: rows of publications, and nothing issued."""
    versions = (version, calibrate(house, {"id": version["campaign_id"]}, tolerance=0.05))
    with monkeypatch.context() as before:
        before.setattr("store.publications.keep_issued", lambda *_: None)
        for each in versions:
            publish(house, each)
    return versions


def publish(house, version, *, key=None, **changes):
    headers = {"Idempotency-Key": key} if key else {}
    path = f"/v1/calibrations/{version['id']}/publish"
    return house.post(path, PUBLICATION | changes, status=200, **headers)


def fetch(house, version, form, amendment=None):
    query = {} if amendment is None else {"amendment": amendment}
    answer = house.http.get(
        f"/v1/calibrations/{version['id']}/certificate.{form}", params=query, headers=PLAIN
    )
    assert answer.status_code == 200, answer.text
    return answer


def count(house, table):
    with house.database.reading() as session:
        return session.scalar(select(func.count()).select_from(table))


def revise(monkeypatch):
    """What a later release may do: fit, word and set otherwise."""
    monkeypatch.setattr("store.software.FIT_CODE_VERSION", "9.9.9")
    monkeypatch.setattr("service.documents.certificate._RELATES", "Another sentence.")
    monkeypatch.setattr("service.documents.certificate.SCHEMA_VERSION", 2)
    monkeypatch.setattr("store.software.RENDERER", "render-99")
    monkeypatch.setattr("service.documents.pages.STAMPS", dict.fromkeys(("draft", "published"), "Other"))
    monkeypatch.setattr(
        "service.documents.rendered.render_apart", lambda *_, **__: b"%PDF of a later release"
    )


def test_what_was_issued_keeps_its_bytes_whatever_comes_later(house, staged, monkeypatch):
    version = staged(complete_version)
    published = publish(house, version)
    before = {form: fetch(house, version, form) for form in ("json", "pdf")}
    (issued,) = published["certificates"]
    for form, answer in before.items():
        digest = sha256(answer.content).hexdigest()
        assert (answer.headers["ETag"], issued[f"{form}_sha256"]) == (f'"{digest}"', digest)
        assert answer.headers["Link"] == f'</v1/calibrations/{version["id"]}>; rel="status"'
    assert before["json"].json()["issued"] == {"at": issued["issued_at"], "at_upgrade": False}
    assert issued["approved_by"] == issued["fitted_by"] == {"name": "A. Meier", "role": "physicist"}

    revise(monkeypatch)
    house.patch(f"/v1/campaigns/{version['campaign_id']}", {"customer": "Another"})
    house.patch("/v1/organisation", {"name": "Renamed"})
    newer = calibrate(house, {"id": version["campaign_id"]}, tolerance=0.05)
    publish(house, newer)
    house.revoke(version)
    for form, answer in before.items():
        assert fetch(house, version, form).content == answer.content
    assert fetch(house, newer, "json").json()["statements"][0] == "Another sentence."
    # what was decided since stands beside it
    now = house.get(f"/v1/calibrations/{version['id']}")
    assert (now["state"], now["revoked_reason"]) == ("revoked", "wrong lamp")
    assert now["certificates"] == published["certificates"]
    assert check_rows(house.database).faults == []
    # nor does the database let go of it
    for change in (update(IssuedCertificate).values(number="x"), IssuedCertificate.__table__.delete()):
        with pytest.raises(DBAPIError, match=r"never (change|deleted)"), house.database.engine.begin() as c:
            c.execute(change)


def test_a_later_publication_issues_an_amendment_beside_the_original(house, version):
    first = publish(house, version)["certificates"][0]
    original = {form: fetch(house, version, form).content for form in ("json", "pdf")}
    house.patch(f"/v1/campaigns/{version['campaign_id']}", {"customer": "Lansing"})
    _, second = publish(house, version, reason="the customer was missing")["certificates"]
    amended = fetch(house, version, "json", 1).json()
    assert second["number"] == amended["number"] == f"{first['number']}-amendment-1"
    assert amended["work"]["customer"] == "Lansing"
    assert amended["issued"]["amends"] == {
        **{name: first[name] for name in ("number", "issued_at", "json_sha256")},
        "amendment": 1,
    }
    said = amended["statements"][0]
    assert said.startswith(f"Amendment 1 to certificate {first['number']}, issued {first['issued_at']}")
    assert said.endswith("Reason: the customer was missing")
    assert dict(lay_out(amended, "")["validity"])["Amends"].startswith(f"certificate {first['number']}, ")
    assert sha256(fetch(house, version, "pdf", 1).content).hexdigest() == second["pdf_sha256"]
    assert {form: fetch(house, version, form).content for form in original} == original
    answer = house.http.get(f"/v1/calibrations/{version['id']}/certificate.pdf", params={"amendment": 2})
    assert (answer.status_code, answer.json()["code"]) == (404, "not_found")


@pytest.mark.parametrize("fault", ["typesetter", "room", "commit"])
def test_nothing_is_published_without_its_certificate(house, version, monkeypatch, fault):
    def fail(*_, **__):
        raise StorageFull if fault == "room" else RuntimeError(fault)

    place = {
        "typesetter": "service.documents.rendered.render_apart",
        "room": "store.blobs.spool.Blobs.keep",
        "commit": "store.publications.keep_issued",
    }[fault]
    client = house.with_key(KEY)
    with monkeypatch.context() as during:
        during.setattr(place, fail)
        answer = client.post(f"/v1/calibrations/{version['id']}/publish", json=PUBLICATION)
    assert (answer.status_code, answer.json()["code"]) == {"room": (507, "storage_full")}.get(
        fault, (500, "internal_error")
    )
    assert (count(house, Publication), count(house, IssuedCertificate)) == (0, 0)
    assert house.get(f"/v1/calibrations/{version['id']}")["state"] == "draft"
    assert len(publish(house, version)["certificates"]) == 1


def test_a_repeated_request_issues_once(house, version, monkeypatch):
    ordered, context = [], house.app.state.context
    settings = context.settings.model_copy(update={"decoder_sandbox": "require"})
    house.app.state.context = replace(context, settings=settings)

    def note(order, **how):
        ordered.append(how)
        return render(order)

    monkeypatch.setattr("service.documents.rendered.render_apart", note)
    first = publish(house, version, key="once")
    # shut in as all that is rendered, and before what nobody waits for
    assert ordered == [{"require": True, "first": True}]
    monkeypatch.setattr("service.documents.rendered.render_apart", None)
    assert publish(house, version, key="once") == first
    assert count(house, IssuedCertificate) == 1


def test_publishers_of_one_version_at_once_leave_no_gap(house, version):
    def post(number):
        body = PUBLICATION | {"reason": f"number {number}"}
        return house.http.post(f"/v1/calibrations/{version['id']}/publish", json=body)

    with ThreadPoolExecutor(3) as pool:
        statuses = sorted(answer.status_code for answer in pool.map(post, range(3)))
    assert statuses[0] == 200
    assert set(statuses) <= {200, 409}
    issued = house.get(f"/v1/calibrations/{version['id']}")["certificates"]
    assert [each["amendment"] for each in issued] == list(range(statuses.count(200)))
    assert len({each["reason"] for each in issued}) == len(issued)


def test_a_certificate_that_rots_is_noticed_and_nothing_takes_its_place(house, version):
    (issued,) = publish(house, version)["certificates"]
    pdf, digest = fetch(house, version, "pdf").content, issued["pdf_sha256"]
    zero(house.folder, digest, first=900, count=2000)
    answer = house.get(f"/v1/calibrations/{version['id']}/certificate.pdf", status=500)
    assert answer["code"] == "stored_file_damaged"
    assert f"{digest} of certificate {issued['number']} is damaged" in answer["detail"]
    assert house.get("/readyz")["damaged_files"] == 1
    # the operator brings it back
    put(house.blobs, pdf)
    house.worker.files.prove(digest)
    assert fetch(house, version, "pdf").content == pdf


def test_what_was_published_before_is_issued_once_also_if_it_is_killed(house, unissued, monkeypatch):
    version, _ = unissued
    backlog = Backlog(house.app.state.context)
    with monkeypatch.context() as during:
        during.setattr("service.documents.rendered.render_apart", Mock(side_effect=KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            backlog.issue_next()
    assert count(house, IssuedCertificate) == 0
    # whoever asks need not wait for its turn
    asked = fetch(house, version, "json")
    assert (backlog.issue_next(), backlog.issue_next()) == (1.0, 3600.0)
    assert count(house, IssuedCertificate) == 2
    before = [fetch(house, each, "pdf").content for each in unissued]
    revise(monkeypatch)
    assert backlog.issue_next() == 3600.0
    assert [fetch(house, each, "pdf").content for each in unissued] == before
    assert fetch(house, version, "json").content == asked.content
    certificate = json.loads(asked.content)
    assert certificate["issued"]["at_upgrade"] is True
    assert certificate["validity"]["state"] == "published"
    assert "approved_by" not in certificate
    assert house.get(f"/v1/calibrations/{version['id']}")["state"] == "superseded"
    # published again it is amended, and the original stays
    assert [each["at_upgrade"] for each in publish(house, version)["certificates"]] == [True, False]


@pytest.mark.usefixtures("unissued")
def test_one_that_cannot_be_issued_yet_keeps_no_other_waiting(house, monkeypatch):
    reviews = house.app.state.context.reviews
    fail_first = Mock(side_effect=chain([KeyError("a damaged record")], repeat(DEFAULT)), wraps=reviews.find)
    monkeypatch.setattr(reviews, "find", fail_first)
    backlog = Backlog(house.app.state.context)
    assert [backlog.issue_next() for _ in range(3)] == [1.0, 1.0, 3600.0]
    assert count(house, IssuedCertificate) == 1
    assert backlog.issue_next() == 1.0
    assert count(house, IssuedCertificate) == 2


def test_a_lost_preview_costs_the_picture_alone(house, version):
    with house.database.reading() as session:
        previews = session.scalars(select(FrameRow.preview_sha256).distinct()).all()
    for each in previews:
        zero(house.folder, each, first=60, count=9)
    publish(house, version)
    assert fetch(house, version, "pdf").content.startswith(b"%PDF-")
