"""Jobs over HTTP: what they are about, how many wait, and trying again."""

import pytest
from sqlalchemy import select, update

from store.tables import Job, new_id
from tests.support.campaigns import published_campaign
from tests.support.measuring import field_frame, measure
from tests.support.resumable import PIECE, describe

pytestmark = pytest.mark.either_database


def failed_job(house):
    frame = house.upload(house.campaign(), b"no raw file", role="light", filename="DJI_0001.DNG")
    house.work()
    return frame


def test_a_request_keeps_the_id_that_it_brings_and_gets_one_in_place_of_an_odd_one(house):
    for given, kept in (("proxy-1", "proxy-1"), ("two words", "req_")):
        answered = house.http.get("/v1/jobs", headers={"X-Request-ID": given}).headers["x-request-id"]
        assert answered.startswith(kept)


def test_the_summary_counts_by_state_and_tells_the_oldest_wait(house, stranger, monkeypatch):
    failed_job(house)
    assert house.get("/v1/jobs/summary") == {
        "queued": 0,
        "running": 0,
        "succeeded": 0,
        "failed": 1,
        "quarantined": 0,
        "more": [],
        "oldest_wait_s": 0.0,
    }
    house.upload(house.campaign(), b"another", role="light")
    summary = house.get("/v1/jobs/summary")
    assert summary["queued"] == 1
    assert 0 < summary["oldest_wait_s"] < 60
    house.upload(house.campaign(), b"one more", role="light")
    monkeypatch.setattr("store.queries.jobs.MOST_COUNTED", 1)
    summary = house.get("/v1/jobs/summary")
    assert (summary["queued"], summary["failed"], summary["more"]) == (1, 1, ["queued"])
    assert stranger.get("/v1/jobs/summary").json()["queued"] == 0


def test_only_what_was_given_up_is_tried_again_and_the_trail_says_by_whom(house):
    """It names its frame and its campaign, and needs the scope that starting it needed."""
    frame = failed_job(house)
    address = f"/v1/jobs/{frame['job_id']}"
    job = house.get(address)
    assert (job["filename"], job["campaign_id"]) == ("DJI_0001.DNG", frame["campaign_id"])
    assert house.get("/v1/jobs")["items"] == [job]
    with house.with_scopes("read", "calibrate") as client:
        answer = client.post(f"{address}/retry")
    assert (answer.status_code, answer.json()["code"]) == (403, "scope_missing")
    assert "'upload'" in answer.json()["detail"]
    answer = house.http.post(f"{address}/retry")
    assert (answer.status_code, answer.headers["location"]) == (202, address)
    assert (answer.json()["state"], answer.json()["attempt"]) == ("queued", 0)
    assert "error" not in answer.json()
    answer = house.http.post(f"{address}/retry")
    assert (answer.status_code, answer.json()["code"]) == (409, "conflict")
    assert "is queued" in answer.json()["detail"]
    (entry,) = house.get("/v1/audit", subject_id=frame["job_id"])["items"]
    assert (entry["action"], entry["after"]) == ("job.retry", {"state": "queued"})
    assert entry["before"]["error"]["code"] == "not_a_raw_file"
    assert entry["actor"].startswith("key_")
    assert house.work() == 1
    assert house.get(address)["state"] == "failed"
    with house.database.writing("test") as session:
        session.execute(update(Job).values(state="quarantined", lost=3))
    assert house.http.post(f"{address}/retry").status_code == 202


def retry(house, status=202, **chosen):
    return house.post("/v1/jobs/retry", chosen, status=status)


def test_all_jobs_that_failed_are_tried_again_at_once_and_the_trail_says_by_whom(house, stranger):
    campaign = house.campaign()
    frames = [house.upload(campaign, b"no raw file %d" % each, role="light") for each in range(5)]
    house.work()
    for other in ({"state": "quarantined"}, {"state": "failed", "kind": "fit"}):
        assert retry(house, **other) == {"retried": 0}
    assert retry(house, state="failed", code="truncated") == {"retried": 0}
    other = house.upload(house.campaign(), b"none either", role="light")
    house.work()
    assert retry(house, 404, state="failed", campaign_id="cmp_none")["code"] == "not_found"
    for chosen in ({}, {"state": "succeeded"}):
        assert retry(house, 422, **chosen)["code"] == "validation_failed"
    assert stranger.post("/v1/jobs/retry", json={"state": "failed"}).json() == {"retried": 0}
    chosen = {"state": "failed", "kind": "extract", "code": "not_a_raw_file", "campaign_id": campaign["id"]}
    assert retry(house, **chosen) == {"retried": 5}
    assert retry(house, **chosen) == {"retried": 0}
    assert house.get("/v1/jobs/summary")["queued"] == 5
    (entry,) = [each for each in house.get("/v1/audit")["items"] if each["action"].endswith("retry_jobs")]
    assert (entry["before"], entry["after"]) == (chosen, {"state": "queued", "jobs": 5})
    assert entry["actor"].startswith("key_")
    assert house.work() == len(frames)
    assert retry(house, state="failed", campaign_id=other["campaign_id"]) == {"retried": 1}


def test_trying_many_again_needs_every_scope_that_starting_them_needed_and_repeated_answers_the_same(house):
    failed_job(house)
    with house.with_scopes("read", "calibrate") as client:
        answer = client.post("/v1/jobs/retry", json={"state": "failed"})
        assert (answer.status_code, answer.json()["code"]) == (403, "scope_missing")
        assert client.post("/v1/jobs/retry", json={"state": "failed", "kind": "fit"}).status_code == 202
    assert house.get("/v1/jobs/summary")["failed"] == 1
    headers = {"Idempotency-Key": "again"}
    first = house.http.post("/v1/jobs/retry", json={"state": "failed"}, headers=headers)
    house.work()
    second = house.http.post("/v1/jobs/retry", json={"state": "failed"}, headers=headers)
    assert (first.json(), second.json()) == ({"retried": 1}, {"retried": 1})
    assert second.headers["idempotent-replayed"] == "true"
    assert house.get("/v1/jobs/summary")["failed"] == 1


def test_failures_are_grouped_by_cause_and_dismissed_until_they_are_tried_again(house, stranger):
    one, other = house.campaign(), house.campaign()
    for campaign, count in ((one, 2), (other, 1)):
        for number in range(count):
            content, name = f"none {campaign['id']} {number}".encode(), f"DJI_{number}.DNG"
            house.upload(campaign, content, role="light", filename=name)
    house.work()
    causes = house.get("/v1/jobs/causes")["items"]
    assert [(each["count"], each["newest"]["campaign_id"]) for each in causes] == [
        (2, one["id"]),
        (1, other["id"]),
    ]
    assert causes[0]["newest"]["filename"] == "DJI_1.DNG"
    chosen = {"state": "failed", "code": causes[0]["newest"]["error"]["code"], "campaign_id": one["id"]}

    def dismiss(**more):
        return house.post("/v1/jobs/dismiss", chosen | more, status=200)

    assert dismiss() == {"dismissed": 2}
    assert dismiss() == {"dismissed": 0}
    assert [each["count"] for each in house.get("/v1/jobs/causes")["items"]] == [1]
    assert len(house.get("/v1/jobs", dismissed=True)["items"]) == 2
    assert house.get("/v1/jobs/summary")["failed"] == 3
    assert dismiss(dismissed=False) == {"dismissed": 2}
    assert dismiss() == {"dismissed": 2}
    assert retry(house, **chosen) == {"retried": 2}
    house.work()
    assert [each["count"] for each in house.get("/v1/jobs/causes")["items"]] == [2, 1]
    assert stranger.get("/v1/jobs/causes").json() == {"items": []}
    assert stranger.post("/v1/jobs/dismiss", json={"state": "failed"}).json() == {"dismissed": 0}
    with house.with_scopes("read") as client:
        assert client.post("/v1/jobs/dismiss", json=chosen).json()["code"] == "scope_missing"


def test_a_failure_that_was_done_since_is_no_cause(house):
    campaign = house.campaign()
    house.upload(campaign, b"none at all", role="light", filename="DJI_1.DNG")
    house.work()
    assert [each["count"] for each in house.get("/v1/jobs/causes")["items"]] == [1]
    with house.database.writing("test") as session:
        (job,) = session.scalars(select(Job))
        kept = {
            name: getattr(job, name)
            for name in ("organisation_id", "kind", "lane", "subject_id", "created_by")
        }
        session.add(Job(id=new_id("job"), state="succeeded", **kept))
    assert house.get("/v1/jobs/causes")["items"] == []


def test_only_the_operator_sees_the_health_of_the_whole_service(house, stranger):
    failed_job(house)
    health = house.get("/v1/health")
    assert (health["files"], health["damaged_files"], health["jobs_waiting"]) == (1, 0, 0)
    assert 0 < health["disk_free_bytes"] < health["disk_total_bytes"]
    assert 0 <= health["oldest_proof_s"] < 60
    assert stranger.get("/v1/health").json()["code"] == "scope_missing"


def test_every_upload_names_the_job_that_reads_its_frame(house):
    campaign, content = house.campaign(), house.frame_bytes()
    address = f"/v1/campaigns/{campaign['id']}/frames"
    by_tus = house.http.post(
        "/v1/uploads", content=content, headers=describe(campaign["id"], content) | PIECE
    )
    frame = house.get(by_tus.headers["Content-Location"])
    job = frame["job_id"]
    assert by_tus.headers["Link"] == f'</v1/jobs/{job}>; rel="status"'
    asked = house.http.head(by_tus.headers["Location"], headers=PIECE)
    assert asked.headers["Link"] == by_tus.headers["Link"]
    house.work()
    assert house.upload(campaign, content, status=200, role="light")["job_id"] == job
    form = house.http.post(address, params={"role": "light"}, files={"file": ("a.DNG", content)})
    assert form.json()["job_id"] == job
    (known,) = house.post(f"{address}/known", {"sha256": [frame["sha256"]]}, status=200)["known"]
    (listed,) = house.get(address, brief=True)["items"]
    assert (known["job_id"], listed["job_id"]) == (job, job)
    # a preview of a region reads the frame too, and is not what makes it a frame
    house.post(f"/v1/frames/{frame['id']}/region", {"polygon": [[0, 0], [9, 0], [9, 9]]}, status=202)
    assert house.get(f"/v1/frames/{frame['id']}")["job_id"] == job


@pytest.fixture
def version(staged):
    return staged(published_campaign, isos=(3200,))


def test_jobs_are_found_by_what_they_work_on_and_what_they_made(house, version, stranger):
    campaign = version["campaign_id"]
    frame = field_frame(house, campaign)
    measured = [
        measure(house, frame, version),
        measure(house, field_frame(house, campaign, seed=10), version),
    ]

    def kinds(subject):
        found = house.get("/v1/jobs", subject=subject)
        assert found["next"] is None
        return [job["kind"] for job in found["items"]]

    assert kinds(frame["id"]) == ["measure", "extract"]
    assert kinds(campaign) == kinds(version["id"]) == ["fit"]
    (job,) = house.get("/v1/jobs", subject=measured[1]["id"])["items"]
    assert job["result"]["measurement_id"] == measured[1]["id"]
    assert house.get("/v1/jobs", subject=frame["id"], kind="extract")["items"][0]["id"] == frame["job_id"]
    assert house.get("/v1/jobs", status=404, subject="frm_none")["code"] == "not_found"
    for subject in (frame["id"], version["id"], measured[0]["id"]):
        assert stranger.get("/v1/jobs", params={"subject": subject}).status_code == 404
