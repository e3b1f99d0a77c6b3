"""What is wrong with a request is said by field, as a problem, in words."""

import gzip
import json
import time
import unicodedata

import pytest
from fastapi.testclient import TestClient

from radiometry.findings import InputRejected
from service.http import auth, middleware
from service.http.counts import LONGEST_WAIT_S, Attempts
from service.http.middleware import MAX_BODY_BYTES, STRANGER_BYTES
from store.database import Database

CAMERA = {"make": "DJI", "model": "FC6520", "serial": "1"}
TRIANGLE = [[0, 0], [9, 0], [0, 9]]
MEASURED = {"frame_id": "1", "roi": {"polygon": TRIANGLE}}
SITE_FEATURES = {"type": "FeatureCollection", "coordinates": "m", "features": []}


@pytest.fixture(scope="module")
def house(sqlite_house):
    """One for all of them: what is wrong is told before the database is asked."""
    return sqlite_house


def send(house, body: bytes, kind="application/json", path="/v1/cameras"):
    headers = {"Content-Type": kind} if kind else {}
    answer = house.http.post(path, content=body, headers=headers)
    assert answer.headers["content-type"] == "application/problem+json", answer.text
    problem = answer.json()
    assert (problem["status"], problem["retryable"]) == (answer.status_code, False)
    assert problem["type"] == f"/docs/errors#{problem['code']}"
    assert problem["title"]
    return problem


def with_pitch(text: str) -> bytes:
    return json.dumps(CAMERA).replace("}", f', "pixel_pitch_um": {text}}}').encode()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("NaN", "must be a finite number"),
        ("Infinity", "must be a finite number"),
        ("-Infinity", "must be a finite number"),
        ("1e400", "must be a finite number"),
        ("null", "null is not a value here; leave it out"),
        ('"3.3"', "must be a number"),
        ("true", "must be a number"),
        ("[]", "must be a number"),
        ("-1", "must be greater than or equal to 0.1"),
        ("0", "must be greater than or equal to 0.1"),
        ("0.00328", "must be greater than or equal to 0.1"),
        ("1e12", "must be less than or equal to 100"),
    ],
)
def test_a_wrong_number_is_named(house, text, message):
    problem = send(house, with_pitch(text))
    assert problem["errors"] == [{"field": "body.pixel_pitch_um", "message": message}]
    assert problem["detail"] == f"body.pixel_pitch_um: {message}"


NO_NAME = "must not be blank, nor hold control characters such as line breaks or tabs"


@pytest.mark.parametrize(
    ("change", "field", "message"),
    [
        ({"colour": 1}, "body.colour", "is not known here; check its spelling or leave it out"),
        ({"serial": 5}, "body.serial", "must be text"),
        ({"serial": "a\x00b"}, "body.serial", NO_NAME),
        ({"serial": " \u00a0 "}, "body.serial", NO_NAME),
        ({"note": "a\x00b"}, "body.note", "must not hold control characters other than line breaks and tabs"),
        ({"serial": "\ud800"}, "body.serial", "must be text in Unicode"),
        ({"serial": ""}, "body.serial", "must have at least 1 character"),
        ({"serial": "x" * 201}, "body.serial", "must have at most 200 characters"),
        ({"lens": {"make": "x"}}, "body.lens.model", "is missing"),
        ({"lens": {"make": "x", "model": None}}, "body.lens.model", "null is not a value here; leave it out"),
        ({"lens": 3}, "body.lens", "must be a JSON object"),
    ],
)
def test_a_wrong_field_is_named(house, change, field, message):
    problem = send(house, json.dumps(CAMERA | change).encode())
    assert problem["errors"] == [{"field": field, "message": message}]


@pytest.mark.parametrize(
    ("request_", "message"),
    [
        (
            ("post", "/v1/calibrations/x/revoke", {"reason": " \n"}),
            "must be words, without control characters other than line breaks and tabs",
        ),
        (("post", "/v1/keys", {"name": " ", "scopes": ["read"]}), NO_NAME),
        (("patch", "/v1/campaigns/x", {"recorder": " "}), NO_NAME),
        (
            ("get", "/v1/calibrations/x/certificate.xml?country=1", None),
            "must be two capital letters of ISO 3166, such as DE",
        ),
        (
            ("get", "/v1/measurements/x/isolines.geojson?levels=1,a", None),
            "must be 1 to 20 finite numbers with commas between, as in `0.5,1,2`",
        ),
    ],
)
def test_text_of_another_form_is_told_its_form(house, request_, message):
    method, path, body = request_
    problem = house.http.request(method, path, json=body).json()
    assert message in [error["message"] for error in problem["errors"]]


def test_every_null_is_named(house):
    problem = send(house, json.dumps(CAMERA | {"lens": None, "note": None}).encode())
    assert [error["field"] for error in problem["errors"]] == ["body.lens", "body.note"]


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (1767225600, "must begin with a date such as 2026-05-01"),
        ("1767225600", "must begin with a date such as 2026-05-01"),
        ("2026-05-01T08:00:00", "needs a time zone: 2026-05-01T08:00:00Z or 2026-05-01T10:00:00+02:00"),
        ("2026-02-30T08:00:00Z", "must be a time such as 2026-05-01T08:00:00Z"),
        ("9999-12-31T23:59:59-23:00", "the year must lie between 1900 and 9000"),
    ],
)
def test_a_time_is_written_out_with_its_zone(house, value, message):
    body = {"camera_id": house.camera()["id"], "method": "luminance", "started_at": value}
    problem = send(house, json.dumps(body).encode(), path="/v1/campaigns")
    assert problem["errors"] == [{"field": "body.started_at", "message": message}]


@pytest.mark.parametrize(
    ("body", "detail"),
    [
        (b'{"make": ', "The body is not JSON: Expecting value at character 9."),
        (b"\xff\xfe{", "The body cannot be read"),
        (b"[" * 100_000, "The body cannot be read"),
        (b'{"pixel_pitch_um": ' + b"1" * 5000 + b"}", "The body cannot be read"),
    ],
)
def test_a_body_that_is_no_json_is_a_problem(house, body, detail):
    problem = send(house, body)
    assert (problem["status"], problem["code"]) == (400, "bad_request")
    assert problem["detail"].startswith(detail)


@pytest.mark.parametrize(
    ("body", "kind"), [(b"[]", "application/json"), (b"{}", "text/plain"), (b"{}", None)]
)
def test_another_body_is_told_what_is_wanted(house, body, kind):
    detail = send(house, body, kind)["detail"]
    assert detail == "body: must be a JSON object, sent with Content-Type: application/json"


@pytest.mark.parametrize("announced", [True, False])
def test_a_huge_body_is_refused(house, announced):
    body = b" " * (MAX_BODY_BYTES + 1)
    campaign = f"/v1/campaigns/{house.campaign()['id']}"
    for method, path in (
        ("POST", "/v1/cameras"),
        ("POST", f"{campaign}/readings"),
        ("PATCH", f"{campaign}/frames"),
    ):
        content = body if announced else iter([body[:1000], body[1000:]])
        answer = house.http.request(
            method, path, content=content, headers={"Content-Type": "application/json"}
        )
        assert (answer.status_code, answer.json()["code"]) == (413, "upload_too_large"), path


def test_a_get_reads_no_body(house):
    """Also one that streams its answer, and listens meanwhile for the end of the connection."""
    for path in ("/v1/cameras", "/v1/audit/entries.jsonl"):
        assert house.http.request("GET", path, content=bytes(MAX_BODY_BYTES + 1)).status_code == 200


@pytest.mark.parametrize("key", [None, "Bearer nobody", "Basic eA=="])
@pytest.mark.parametrize("path", ["/v1/cameras", "/v1/tools/motion"])
def test_of_a_stranger_little_is_read(house, key, path):
    headers = {"Content-Type": "application/json"} | ({"Authorization": key} if key else {})
    for content in (b" " * (STRANGER_BYTES + 1), iter([b" "] * (STRANGER_BYTES + 1))):
        answer = TestClient(house.app).post(path, content=content, headers=headers)
        assert (answer.status_code, answer.json()["code"]) == (401, "unauthenticated")
        assert answer.headers["connection"] == "close"


def test_who_keeps_asking_without_a_key_is_answered_late_and_logged(house, monkeypatch, caplog):
    refused = Attempts(free=2)
    monkeypatch.setitem(house.app.state.context.__dict__, "refused", refused)
    caplog.set_level("INFO")
    with house.with_key("nobody") as wrong:
        # who waits an hour would not be answered here
        for client, latest_s in ((wrong, 3600.0), (wrong, 0.3), (house.http, 3600.0)):
            monkeypatch.setattr(auth, "LATEST_S", latest_s)
            begun = time.monotonic()
            client.get("/v1/cameras")
            assert latest_s == 3600.0 or time.monotonic() - begun >= 0.3
    told = [record.fields for record in caplog.records if record.message == "request"]
    assert [(each["status"], each.get("address")) for each in told[-3:]] == [
        *[(401, "testclient")] * 2,
        (200, None),
    ]
    for _ in range(1100):
        refused.fail("testclient")
    assert refused.wait_s("testclient") <= LONGEST_WAIT_S


def test_all_bodies_of_an_organisation_under_way_have_a_limit(house, monkeypatch):
    monkeypatch.setattr(middleware, "OPEN_BYTES", 40)
    answer = house.http.post("/v1/cameras", json=CAMERA)
    assert (answer.status_code, answer.json()["code"]) == (429, "too_many_requests")
    assert answer.headers["retry-after"] == "1"
    monkeypatch.setattr(middleware, "OPEN_BYTES", 60)
    for _ in range(2):  # what was answered no longer counts
        assert house.http.post("/v1/cameras", json=CAMERA).status_code in {200, 201}


def test_compressed_bodies_are_refused_by_name(house):
    campaign = house.campaign()["id"]
    for path in ("/v1/cameras", "/v1/uploads", f"/v1/campaigns/{campaign}/frames?role=dark"):
        headers = {"Content-Encoding": "gzip", "Content-Type": "application/octet-stream"}
        answer = house.http.post(path, content=gzip.compress(b"{}"), headers=headers)
        assert (answer.status_code, answer.json()["code"]) == (415, "content_encoded")
        assert answer.headers["Accept-Encoding"] == "identity"
    plain = {"Content-Encoding": "identity"}
    assert house.http.post("/v1/cameras", json=CAMERA, headers=plain).status_code in {200, 201}


def test_names_are_the_same_however_their_letters_are_put_together(house):
    apart = unicodedata.normalize("NFD", "Dämmerung")
    campaign = house.campaign()
    frame = house.upload(campaign, b"of a Mac", role="light", scene=apart)
    assert frame["scene"] == unicodedata.normalize("NFC", apart)


def test_lines_end_in_one_way_whoever_wrote_them(house):
    for note in ("one\r\ntwo\tthree", "one\rtwo\tthree"):
        camera = house.patch(f"/v1/cameras/{house.camera()['id']}", {"note": note})
        assert camera["note"] == "one\ntwo\tthree"


@pytest.mark.parametrize(
    ("reader", "method", "path", "body"),
    [
        ("radiometry.road.geojson.read_site", "PUT", "/v1/roads/1/site.geojson", SITE_FEATURES),
        ("radiometry.frame.roi.Polygon.from_points", "PUT", "/v1/campaigns/1/roi", {"polygon": TRIANGLE}),
        ("radiometry.frame.roi.Polygon.from_points", "PUT", "/v1/frames/1/roi", {"polygon": TRIANGLE}),
        ("radiometry.frame.roi.Polygon.from_points", "POST", "/v1/frames/1/region", {"polygon": TRIANGLE}),
        ("radiometry.frame.roi.Polygon.from_points", "POST", "/v1/measurements", MEASURED),
    ],
)
def test_a_body_is_read_before_the_database_is_locked(house, monkeypatch, reader, method, path, body):
    waited_for = Database(str(house.database.url), answer_within_s=0.5)

    def write_meanwhile(_):
        with waited_for.writing("test"):
            raise InputRejected("roi_invalid", "reached")

    monkeypatch.setattr(reader, write_meanwhile)
    assert house.ask(method, path, json=body, status=422)["detail"] == "reached"
    waited_for.dispose()


def test_an_unknown_address_and_a_wrong_method(house):
    lost = house.http.get("/v1/camera").json()
    assert (lost["status"], lost["code"]) == (404, "not_found")
    assert "/docs" in lost["detail"]
    answer = house.http.put("/v1/cameras", json=CAMERA)
    assert (answer.status_code, answer.json()["code"]) == (405, "method_not_allowed")
    assert answer.headers["allow"] == "GET, HEAD, POST"
    assert answer.json()["detail"] == "This address does not accept PUT; it accepts GET, HEAD, POST."


def test_a_field_of_the_query_is_stated_once(house):
    problem = house.ask("GET", "/v1/cameras?limit=1&limit=2", status=422)
    assert problem["detail"] == "query.limit: is stated twice; state it once"


def test_a_misspelt_filter_does_not_answer_with_everything(house):
    problem = house.get("/v1/jobs", stat="failed", status=422)
    assert problem["errors"][0]["field"] == "query.stat"


@pytest.mark.parametrize("limit", ["0", "1001", "-1", "abc", "1.5", "9" * 30])
def test_a_limit_has_bounds(house, limit):
    problem = house.get("/v1/cameras", limit=limit, status=422)
    assert problem["errors"][0]["field"] == "query.limit"


def test_a_hostile_id_does_not_exist(house):
    for hostile in ("%00", "%ff", "%F0%9F%98%80", "a%0Ab", "x" * 5000):
        assert house.get(f"/v1/cameras/{hostile}", status=404)["code"] == "not_found"


def test_an_unexpected_fault_is_a_problem_that_tells_nothing(house, monkeypatch):
    def fail(*_):
        raise RuntimeError("secret details")

    monkeypatch.setattr("service.system.health.count_queue", fail)
    with house.with_key("any") as client:
        answer = client.get("/metrics")
    assert (answer.status_code, answer.json()["code"]) == (500, "internal_error")
    assert "secret" not in answer.text
