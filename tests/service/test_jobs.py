"""Jobs over HTTP: what they are about, how many wait, and trying again."""

from sqlalchemy import update

from store.tables import Job


def failed_job(house):
    frame = house.upload(house.campaign(), b"no raw file", role="light", filename="DJI_0001.DNG")
    house.work()
    return frame


def test_a_job_names_the_frame_and_the_campaign_that_it_is_about(house):
    frame = failed_job(house)
    job = house.get(f"/v1/jobs/{frame['job_id']}")
    assert (job["filename"], job["campaign_id"]) == ("DJI_0001.DNG", frame["campaign_id"])
    (listed,) = house.get("/v1/jobs")["items"]
    assert listed == job


def test_the_summary_counts_by_state_and_tells_the_oldest_wait(house, stranger):
    failed_job(house)
    assert house.get("/v1/jobs/summary") == {
        "queued": 0,
        "running": 0,
        "succeeded": 0,
        "failed": 1,
        "quarantined": 0,
        "oldest_wait_s": 0.0,
    }
    house.upload(house.campaign(), b"another", role="light")
    summary = house.get("/v1/jobs/summary")
    assert summary["queued"] == 1
    assert 0 < summary["oldest_wait_s"] < 60
    assert stranger.get("/v1/jobs/summary").json()["queued"] == 0


def test_a_failed_job_is_tried_again_and_the_trail_says_by_whom(house):
    frame = failed_job(house)
    address = f"/v1/jobs/{frame['job_id']}"
    answer = house.http.post(f"{address}/retry")
    assert (answer.status_code, answer.headers["location"]) == (202, address)
    assert (answer.json()["state"], answer.json()["attempt"]) == ("queued", 0)
    assert "error" not in answer.json()
    (entry,) = house.get("/v1/audit", subject_id=frame["job_id"])["items"]
    assert (entry["action"], entry["after"]) == ("job.retry", {"state": "queued"})
    assert entry["before"]["error"]["code"] == "not_a_raw_file"
    assert entry["actor"].startswith("key_")
    assert house.work() == 1
    assert house.get(address)["state"] == "failed"


def test_a_quarantined_job_is_tried_again(house):
    frame = failed_job(house)
    with house.database.writing("test") as session:
        session.execute(update(Job).values(state="quarantined", lost=3))
    assert house.http.post(f"/v1/jobs/{frame['job_id']}/retry").status_code == 202


def test_only_what_was_given_up_is_tried_again(house):
    frame = house.upload(house.campaign(), b"waits", role="light")
    answer = house.http.post(f"/v1/jobs/{frame['job_id']}/retry")
    assert (answer.status_code, answer.json()["code"]) == (409, "conflict")
    assert "is queued" in answer.json()["detail"]
    assert house.get("/v1/audit", subject_id=frame["job_id"])["items"] == []


def test_trying_again_needs_the_scope_that_starting_needed(house):
    frame = failed_job(house)
    made = house.post("/v1/keys", {"name": "other", "scopes": ["read", "calibrate"]})
    with house.with_key(made["secret"]) as client:
        answer = client.post(f"/v1/jobs/{frame['job_id']}/retry")
    assert (answer.status_code, answer.json()["code"]) == (403, "scope_missing")
    assert "'upload'" in answer.json()["detail"]
