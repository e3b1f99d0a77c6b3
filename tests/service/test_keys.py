"""Who may: keys, scopes, and organisations that do not see each other."""

import re
from datetime import timedelta

import pytest
from sqlalchemy import select
from sqlalchemy.exc import OperationalError

from store.queries.organisations import find_key
from store.tables import ApiKey, IdempotentAnswer, utc_now
from tests.support.everything import make_one_of_each

pytestmark = pytest.mark.either_database


def every_operation(house):
    for path, methods in house.app.openapi()["paths"].items():
        for method, operation in methods.items():
            if operation["security"]:
                yield method, path, operation


def fill(path: str, ids: dict) -> str:
    return path.format_map(ids)


def smallest_body(operation):
    return operation.get("requestBody", {}).get("content", {}).get("application/json", {}).get("example")


def smallest_query(operation):
    asked = [p for p in operation.get("parameters", ()) if p["in"] == "query" and p.get("required")]
    schemas = {parameter["name"]: parameter["schema"] for parameter in asked}
    return {
        name: (schema.get("enum") or schema.get("examples") or [schema.get("maximum", "1")])[0]
        for name, schema in schemas.items()
    }


def test_a_scope_that_is_missing_is_named(house):
    with house.with_scopes("read") as weak:
        assert weak.get("/v1/cameras").status_code == 200
        for path in (
            "/v1/cameras",
            "/v1/campaigns/x/frames?role=light",
            "/v1/calibrations/x/publish",
            "/v1/recalls/x/confirm",
            "/v1/keys",
        ):
            answer = weak.post(
                path, json=CAMERA if "cameras" in path else PUBLICATION if "publish" in path else KEY
            )
            assert (answer.status_code, answer.json()["code"]) == (403, "scope_missing"), answer.text
            assert "needs a key with the scope" in answer.json()["detail"]


def test_a_scope_is_missing_whether_or_not_there_is_such_a_row(house):
    """The scope is judged first, at every address: what a key may not do tells nothing of what there is."""
    with house.with_scopes("publish") as weak:
        for path, operations in house.get("/openapi.json")["paths"].items():
            for method in operations:
                if "{" not in path or path.startswith(_OF_ANY_KEY) or path.endswith(_NEED_PUBLISH):
                    continue
                answer = weak.request(method, re.sub(r"\{\w+\}", "1", path))
                assert answer.status_code == 403, (method, path, answer.text)


_OF_ANY_KEY = ("/v1/sessions", "/v1/uploads")
_NEED_PUBLISH = ("/publish", "/revoke", "/confirm")

CAMERA = {"make": "DJI", "model": "FC6520", "serial": "1"}
PUBLICATION = {"valid_from": "2026-05-01T00:00:00Z", "reason": "r"}
KEY = {"name": "k", "scopes": ["read"]}


def test_a_revoked_key_is_refused_at_once_and_stays_in_the_record(house):
    made = house.post("/v1/keys", KEY)
    with house.with_key(made["secret"]) as client:
        assert client.get("/v1/cameras").status_code == 200
        assert house.http.delete(f"/v1/keys/{made['id']}").status_code == 200
        answer = client.get("/v1/cameras")
    assert answer.status_code == 401
    assert "revoked" in answer.json()["detail"]
    kept = next(k for k in house.get("/v1/keys")["items"] if k["id"] == made["id"])
    assert kept["revoked_at"]


def test_the_last_key_that_manages_keys_stays(stranger):
    (only,) = (key for key in stranger.get("/v1/keys").json()["items"] if "admin" in key["scopes"])
    refused = stranger.delete(f"/v1/keys/{only['id']}")
    assert (refused.status_code, refused.json()["code"]) == (409, "conflict")
    soon = (utc_now() + timedelta(days=1)).isoformat()
    stranger.post("/v1/keys", json=KEY | {"scopes": ["admin"], "expires_at": soon})
    assert stranger.delete(f"/v1/keys/{only['id']}").json()["revoked_at"]


def test_a_secret_is_shown_once_and_kept_nowhere(house):
    headers = {"Idempotency-Key": "once"}
    first = house.http.post("/v1/keys", json=KEY, headers=headers).json()
    again = house.http.post("/v1/keys", json=KEY, headers=headers)
    assert again.json() == {name: first[name] for name in first if name != "secret"}
    founded = house.http.post(
        "/v1/organisations", json={"name": "O"}, headers={"Idempotency-Key": "o"}
    ).json()
    assert "secret" not in str(house.get("/v1/keys"))
    with house.database.reading() as session:
        kept = [row.body for row in session.scalars(select(IdempotentAnswer))]
        assert len(kept) == 2
        for secret in (first["secret"], founded["key"]["secret"]):
            assert find_key(session, secret) is not None
            assert secret not in str(kept)


def test_only_the_operator_founds_organisations(house, stranger):
    answer = stranger.post("/v1/organisations", json={"name": "Third"})
    assert (answer.status_code, answer.json()["code"]) == (403, "scope_missing")
    for status in (201, 409):
        told = house.post("/v1/organisations", {"name": "Third"}, status=status)
    assert told["code"] == "conflict"


@pytest.fixture
def owned(staged):
    """The ids of what one organisation has."""
    return staged(make_one_of_each)


def test_what_is_another_organisations_does_not_exist(house, owned, stranger):
    tried = 0
    for method, path, operation in every_operation(house):
        if "{" not in path:
            continue
        query, body = smallest_query(operation), smallest_body(operation)
        answer = stranger.request(method, fill(path, owned), params=query, json=body)
        assert (answer.status_code, answer.json()["code"]) == (404, "not_found"), (method, path, answer.text)
        tried += 1
    assert tried > 20


def test_no_list_of_another_organisation_names_it(house, owned, stranger):
    lists = [
        (path, operation)
        for method, path, operation in every_operation(house)
        if method == "get" and "{" not in path
    ]
    assert len(lists) > 15
    for path, operation in lists:
        text = stranger.get(path, params=smallest_query(operation)).text
        assert not [each for each in owned.values() if len(str(each)) > 9 and each in text], path
    for path in ("/v1/cameras", "/v1/meters", "/v1/campaigns", "/v1/jobs", "/v1/measurements", "/v1/recalls"):
        assert stranger.get(path).json() == {"items": [], "next": None}
    assert stranger.get("/v1/series/coefficients").json() == {"rows": []}
    series = stranger.get("/v1/series/coefficients", params={"camera_id": owned["camera_id"]})
    assert series.status_code == 404


def test_nothing_can_be_hung_on_what_is_another_organisations(owned, stranger):
    camera = stranger.post("/v1/cameras", json=CAMERA).json()
    forms = {"camera_id": owned["camera_id"], "method": "luminance"}
    assert stranger.post("/v1/campaigns", json=forms).status_code == 404
    mine = stranger.post("/v1/campaigns", json=forms | {"camera_id": camera["id"]}).json()
    reading = {
        "scene": "s",
        "quantity": "luminance",
        "value": 1,
        "unit": "cd/m2",
        "meter_id": owned["meter_id"],
    }
    answer = stranger.post(f"/v1/campaigns/{mine['id']}/readings", json=reading)
    assert (answer.status_code, answer.json()["detail"].split(".")[0]) == (404, "There is no such meter")
    frame = {"frame_id": owned["frame_id"]}
    assert stranger.post("/v1/measurements", json=frame).status_code == 404
    exclude = {"exclude": [frame | {"reason": "r"}]}
    answer = stranger.post(f"/v1/campaigns/{mine['id']}/calibrations", json=exclude)
    assert (answer.status_code, answer.json()["code"]) == (422, "validation_failed")


def test_a_key_expires_and_says_so(house):
    soon = utc_now() + timedelta(hours=1)
    made = house.post("/v1/keys", KEY | {"expires_at": soon.isoformat()})
    assert made["expires_at"] == soon.isoformat().replace("+00:00", "Z")
    with house.with_key(made["secret"]) as client:
        assert client.get("/v1/keys/own").json()["expires_at"] == made["expires_at"]
        signed_in = client.post("/sign-in", data={"key": made["secret"]}, follow_redirects=False)
        assert signed_in.status_code == 303
        with house.database.writing("test") as session:
            session.get_one(ApiKey, made["id"]).expires_at = utc_now() - timedelta(seconds=1)
        answer = client.get("/v1/cameras")
        assert (answer.status_code, answer.json()["code"]) == (401, "unauthenticated")
        assert answer.json()["detail"].startswith("This key expired at ")
        del client.headers["Authorization"]
        assert client.get("/v1/cameras").status_code == 401
    past = house.post("/v1/keys", KEY | {"expires_at": "2020-01-01T00:00:00Z"}, status=422)
    assert past["errors"][0]["field"] == "body.expires_at"


def test_a_use_is_written_once_in_ten_minutes_and_nowhere_else(house, monkeypatch):
    made = house.post("/v1/keys", KEY)
    assert "last_used_at" not in made

    def last_used():
        return next(k for k in house.get("/v1/keys")["items"] if k["id"] == made["id"]).get("last_used_at")

    writes = []
    writing = house.database.writing
    monkeypatch.setattr(house.database, "writing", lambda *a: writes.append(a) or writing(*a))
    assert last_used() is None
    writes.clear()
    with house.with_key(made["secret"]) as client:
        for _ in range(5):
            client.get("/v1/cameras")
        assert len(writes) == 1
        first = last_used()
        assert first is not None
        later = utc_now() + timedelta(minutes=11)
        monkeypatch.setattr("service.http.counts.utc_now", lambda: later)
        monkeypatch.setattr("service.http.auth.utc_now", lambda: later)
        house.app.state.context.__dict__.pop("uses")
        client.get("/v1/cameras")
    assert last_used() > first
    assert {entry["action"] for entry in house.get("/v1/audit", subject_id=made["id"])["items"]} == {
        "api_key.create"
    }


def test_a_use_that_cannot_be_written_disturbs_nobody(house, monkeypatch):
    made = house.post("/v1/keys", KEY)
    tries = []

    def refuse(*_):
        tries.append(1)
        raise OperationalError("UPDATE", {}, Exception("disk full"))

    monkeypatch.setattr(house.database, "writing", refuse)
    with house.with_key(made["secret"]) as client:
        assert [client.get("/v1/cameras").status_code for _ in range(3)] == [200] * 3
    assert len(tries) == 1
