"""The logs of the processes: what a person follows from a request to what it made."""

import json

FITS = 3


def read_lines(path, message, begin=0):
    """JSON lines with this message; other programs' lines are not of this form."""
    lines = (json.loads(line) for line in path.read_text()[begin:].split("\n")[:-1] if line.startswith("{"))
    return [line for line in lines if line["message"] == message]


def test_each_request_leads_to_its_version_in_the_logs(embedded, shots_of_one_iso):
    """X-Request-ID, then the line of the service with its job, then that of the worker with its version."""
    service, worker = (embedded.logs / f"{name}.log" for name in ("service", "worker"))
    begin = len(worker.read_text())
    with embedded.team() as team, team.http() as http:
        campaign = team.campaign()
        frames = team.push(campaign, shots_of_one_iso)
        embedded.wait_for_jobs([frame.id for frame in frames])
        asked = {}
        for number in range(FITS):
            path = f"/v1/campaigns/{campaign.id}/calibrations"
            answer = http.post(path, json={"meter_repeatability_rel": 0.001 + number * 1e-5})
            asked[answer.json()["id"]] = answer.headers["X-Request-ID"]
        jobs = {job.id: job for job in embedded.wait_for_jobs([campaign.id])}
    lines = read_lines(service, "request")
    queued = {job: line["request_id"] for line in lines for job in line.get("jobs", ())}
    done = {}

    def are_told():  # a job's line follows its commit
        done.update({line["job_id"]: line for line in read_lines(worker, "job", begin)})
        return asked.keys() <= done.keys()

    embedded.wait_until(are_told)
    assert '"celery' not in worker.read_text()[begin:]
    assert len(asked) == FITS
    for job_id, request_id in asked.items():
        line = done[job_id]
        assert queued[job_id] == line["request_id"] == request_id
        assert line["calibration_id"] == jobs[job_id].result["calibration_id"]
        assert (line["kind"], line["subject_id"], line["state"]) == ("fit", campaign.id, "succeeded")
        assert line["duration_s"] > 0
    assert {frame.job_id for frame in frames} < done.keys()
