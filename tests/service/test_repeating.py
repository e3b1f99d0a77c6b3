"""Sending the same thing again: idempotency keys, natural keys, pages that stay stable, answers kept."""

from concurrent.futures import ThreadPoolExecutor

import pytest
from sqlalchemy import func, select

from store.tables import Camera, FrameRow, Meter, Reading
from tests.support.campaigns import ROI, calibrated_campaign
from tests.support.house import CAMERA
from tests.support.meters import CERTIFICATE, METER

pytestmark = pytest.mark.either_database

READING = {"scene": "s", "quantity": "luminance", "value": 1, "unit": "cd/m2"}
KEY = {"Idempotency-Key": "visit 7, page 3"}


def rows(house, table):
    with house.database.reading() as session:
        return session.scalar(select(func.count()).select_from(table))


def test_the_same_key_with_another_request_is_refused(house):
    house.http.post("/v1/meters", json=METER, headers=KEY)
    for path, body in (("/v1/meters", METER | {"serial": "2"}), ("/v1/cameras", CAMERA)):
        answer = house.http.post(path, json=body, headers=KEY)
        assert (answer.status_code, answer.json()["code"]) == (422, "idempotency_key_reused")
    assert rows(house, Meter) == 1


def test_a_refused_request_leaves_its_key_free(house):
    assert house.http.post("/v1/meters", json=METER | {"serial": ""}, headers=KEY).status_code == 422
    assert house.http.post("/v1/meters", json=METER, headers=KEY).status_code == 201


def test_the_key_of_one_organisation_is_free_for_another(house, stranger):
    ours = house.http.post("/v1/meters", json=METER, headers=KEY).json()
    theirs = stranger.post("/v1/meters", json=METER, headers=KEY)
    assert theirs.status_code == 201
    assert theirs.json()["id"] != ours["id"]


@pytest.mark.parametrize("headers", [KEY, {}], ids=["idempotency key", "natural key"])
def test_requests_sent_at_once_are_done_once(house, headers):
    def send(_):
        return house.http.post("/v1/cameras", json=CAMERA, headers=headers)

    with ThreadPoolExecutor(8) as threads:
        answers = list(threads.map(send, range(8)))
    assert len({answer.json()["id"] for answer in answers}) == 1
    assert sorted(a.status_code for a in answers) == ([201] * 8 if headers else [200] * 7 + [201])
    assert rows(house, Camera) == 1


def test_what_two_supply_of_a_frame_at_once_is_kept_of_both(house):
    frame = house.upload(house.campaign(), b"no raw file", role="light")

    def supply_iso():
        return house.http.patch(f"/v1/frames/{frame['id']}", json={"iso": 100})

    with ThreadPoolExecutor(1) as threads:
        with house.database.writing("test") as session:
            row = session.get_one(FrameRow, frame["id"], with_for_update=True)
            row.supplied = {**row.supplied, "f_number": 4.0}
            session.flush()
            supplied = threads.submit(supply_iso)
            # long enough to read all that can be read before the lock
            with pytest.raises(TimeoutError):
                supplied.result(0.5)
        assert supplied.result().status_code == 200
    with house.database.reading() as session:
        assert session.get_one(FrameRow, frame["id"]).supplied == {"f_number": 4.0, "iso": 100.0}


def test_every_post_can_be_repeated(house, staged):
    version = staged(calibrated_campaign, isos=(3200,))
    campaign = {"id": version["campaign_id"], "camera_id": version["camera_id"]}
    key = {"Idempotency-Key": "fit"}
    first, again = (
        house.http.post(f"/v1/campaigns/{campaign['id']}/calibrations", json={}, headers=key)
        for _ in range(2)
    )
    assert (first.status_code, first.json()) == (202, again.json())
    assert first.headers["location"] == again.headers["location"] == f"/v1/jobs/{first.json()['id']}"
    content = house.frame_bytes(seed=99)
    requests = [
        ("/v1/organisations", {"json": {"name": "New"}}),
        ("/v1/keys", {"json": {"name": "k", "scopes": ["read"]}}),
        ("/v1/cameras", {"json": CAMERA | {"serial": "2"}}),
        ("/v1/meters", {"json": METER}),
        ("/v1/campaigns", {"json": {"camera_id": campaign["camera_id"], "method": "luminance"}}),
        (f"/v1/campaigns/{campaign['id']}/readings", {"json": READING}),
        (f"/v1/campaigns/{campaign['id']}/frames", {"params": {"role": "dark"}, "content": content}),
        (
            f"/v1/calibrations/{version['id']}/publish",
            {"json": {"valid_from": "2026-05-01T00:00:00Z", "reason": "r"}},
        ),
        (f"/v1/calibrations/{version['id']}/revoke", {"json": {"reason": "r"}}),
    ]
    for number, (path, request) in enumerate(requests):
        key = {"Idempotency-Key": f"request {number}"}
        first = house.http.post(path, **request, headers=key)
        again = house.http.post(path, **request, headers=key)
        assert again.headers.get("idempotent-replayed") == "true", path
        assert "idempotent-replayed" not in first.headers
        assert (again.status_code, again.json()["id"]) == (first.status_code, first.json()["id"])


def test_a_natural_key_answers_with_what_exists(house):
    camera = house.http.post("/v1/cameras", json=CAMERA)
    same = house.http.post("/v1/cameras", json=CAMERA | {"note": "not taken over"})
    assert (camera.status_code, same.status_code) == (201, 200)
    assert same.json() == camera.json()
    padded = {"make": "dji", "serial": f"{CAMERA['serial']} "}
    assert house.post("/v1/cameras", CAMERA | padded, status=200)["id"] == camera.json()["id"]
    other = house.post("/v1/cameras", CAMERA | {"serial": "another"})
    assert (
        house.patch(f"/v1/cameras/{other['id']}", padded, status=422)["errors"][0]["field"] == "body.serial"
    )
    content = house.frame_bytes()
    campaign = house.campaign()
    frame = house.upload(campaign, content, role="light", scene="a")
    assert house.upload(campaign, content, status=200, role="light", scene="a")["id"] == frame["id"]
    assert house.upload(campaign, content, status=200, role="dark", iso=9)["kept"] == ["role", "iso"]
    house.post("/v1/meters", METER)
    certified = house.post("/v1/meters", METER | {"certificate": CERTIFICATE}, status=200)
    assert certified["certificate"] == CERTIFICATE


def test_pages_hold_every_row_once_while_rows_are_added(house):
    serials = [f"{number:02}" for number in range(7)]
    for serial in serials:
        house.camera(serial=serial)
    seen, address = [], "/v1/cameras?limit=3"
    while address:
        page = house.get(address)
        seen += [camera["serial"] for camera in page["items"]]
        address = page["next"]
        house.camera(serial=f"late {len(seen)}")
        assert address is None or address.startswith("http://testserver/v1/cameras?limit=3&cursor=")
    assert seen[:7] == serials
    assert len(seen) == len(set(seen))


def test_jobs_come_newest_first_and_their_pages_too(house):
    campaign = house.campaign()
    for number in range(5):
        house.upload(campaign, b"%d" % number, role="light")
    whole = [job["id"] for job in house.get("/v1/jobs")["items"]]
    first = house.get("/v1/jobs", limit=2)
    second = house.get(first["next"])
    assert [job["id"] for job in first["items"] + second["items"]] == whole[:4]
    assert whole == sorted(whole, reverse=True)


def test_waiting_for_a_job(house):
    frame = house.upload(house.campaign(), b"no raw file", role="light")
    path = f"/v1/jobs/{frame['job_id']}"
    waited = house.http.get(path, headers={"Prefer": 'Wait = "1"'})
    assert (waited.json()["state"], waited.headers["preference-applied"]) == ("queued", "wait=1")
    with ThreadPoolExecutor(1) as threads:
        answer = threads.submit(house.http.get, path, headers={"Prefer": "respond-async, wait=99"})
        house.work()
        ended = answer.result()
    assert ended.json()["state"] == "failed"
    assert ended.json()["error"]["code"] == "not_a_raw_file"
    assert ended.headers["preference-applied"] == "wait=60"
    assert "preference-applied" not in house.http.get(path, headers={"Prefer": "wait=soon"}).headers


def test_what_never_changes_is_sent_once(house, staged):
    version = staged(calibrated_campaign, isos=(3200,))
    frame = version["points"][0]["frame_id"]
    for path in (
        f"/v1/frames/{frame}/content",
        f"/v1/frames/{frame}/preview.png",
        f"/v1/calibrations/{version['id']}/points.csv",
        f"/v1/calibrations/{version['id']}/plot.svg",
    ):
        first = house.http.get(path)
        tag = first.headers["etag"]
        assert first.status_code == 200
        assert tag.startswith('"')
        assert "immutable" in first.headers["cache-control"]
        for named in (tag, f'"other", {tag}', f"W/{tag}", "*"):
            again = house.http.get(path, headers={"If-None-Match": named})
            assert (again.status_code, again.content) == (304, b"")
            # what is in any form is there: which form it would be is not asked
            assert named == "*" or again.headers["etag"] == tag
        assert house.http.get(path, headers={"If-None-Match": '"other"'}).status_code == 200


def test_a_reading_sent_without_a_key_is_another_reading(house):
    campaign = house.campaign()
    house.http.put(f"/v1/campaigns/{campaign['id']}/roi", json=ROI)
    for _ in range(2):
        house.post(f"/v1/campaigns/{campaign['id']}/readings", READING)
    assert rows(house, Reading) == 2
