"""Workers get lost while they fit and measure, and one job takes three with it; no figure changes by a bit.

What else gets lost is drilled in tests/faults.
"""

from dataclasses import replace

import pytest
from sqlalchemy import text

import stilb
from store.broker import RUN_TASK, make_celery
from store.jobs import FINAL_STATES
from store.tables import FrameRow
from tests.support.campaigns import ROI
from tests.support.fieldwork import figures_of

pytestmark = pytest.mark.either_database

QUEUE = "celery"


def runs(deployment, subjects):
    """The runs of this moment: a job that runs again is another run."""
    return {(job.id, job.fence) for job in deployment.jobs(subjects=subjects) if job.state == "running"}


def kill_at_work(deployment, subjects):
    """Kill the worker while it runs one of these jobs; the runs it was killed in; none if too late."""

    def too_late():
        return all(job.state in FINAL_STATES for job in deployment.jobs(subjects=subjects))

    killed = set()
    # What it ran when it was looked at may have ended before it was killed.
    while not killed and not too_late():
        deployment.wait_until(lambda: too_late() or runs(deployment, subjects))
        deployment.kill("worker")
        # Nobody lives to end them.
        killed = runs(deployment, subjects)
    return killed


def test_a_worker_killed_while_it_fits(deployment, shots, quiet_figures):
    with deployment.team() as team, team.http() as http:
        campaign = team.campaign()
        deployment.wait_for_jobs([frame.id for frame in team.push(campaign, shots)])
        # A fit is quick: the tolerance, which does not change K, makes the next one of the same campaign.
        for number in range(1, 5):
            body = {"tolerance": 0.01 * number}
            job = http.post(f"/v1/campaigns/{campaign.id}/calibrations", json=body).json()["id"]
            if killed := kill_at_work(deployment, [campaign.id]):
                break
        assert [of for of, _ in killed] == [job]
        deployment.wait_for_jobs([campaign.id])
        result = team.client.wait(job).result
        assert figures_of(team.client.calibration(result["calibration_id"])) == quiet_figures
        assert [c.version for c in team.client.calibrations(campaign.id)] == list(range(number, 0, -1))
        (row,) = (row for row in deployment.jobs(subjects=[campaign.id]) if row.id == job)
        assert (row.attempt, row.lost) == (2, 1)


def test_a_worker_killed_while_it_measures_a_flight(embedded, shots, tmp_path):
    """Every map once, of all frames but the one that ends too soon, which is named and spoils no other."""
    half = tmp_path / "half.DNG"
    half.write_bytes(shots[12].path.read_bytes()[:-4000])
    with embedded.team() as team, team.http() as http:
        campaign = team.campaign()
        embedded.wait_for_jobs([frame.id for frame in team.push(campaign, shots)])
        version = team.client.calibrate(campaign.id)
        lit = [replace(shot, role="field", scene=None) for shot in shots if shot.scene]
        lit[12:12] = [replace(lit[0], path=half)]
        flight = team.client.create_campaign(campaign.camera_id)
        team.client.set_roi(flight.id, polygon=ROI["polygon"])
        frames = [frame.id for frame in team.push(flight, lit)]
        embedded.wait_for_jobs(frames)
        body = {"calibration_id": version.id, "products": ["map"]}
        told = http.post(f"/v1/campaigns/{flight.id}/measurements", json=body).json()
        assert [(each["filename"], each["code"]) for each in told["not_measured"]] == [
            ("half.DNG", "frame_not_read")
        ]
        ids = {job["id"] for job in told["jobs"]}
        killed = kill_at_work(embedded, frames)
        jobs = [job for job in embedded.wait_for_jobs(frames) if job.kind == "measure"]
        assert {job.id for job in jobs} == ids
        assert {(job.state, job.progress) for job in jobs} == {("succeeded", 1.0)}
        assert {(job.id, 1) for job in jobs if job.lost} == killed != set()
        measured = list(team.client.measurements(campaign_id=flight.id))
        assert len({one.frame_id for one in measured}) == len(measured) == len(lit) - 1


def test_a_job_that_kills_its_worker_three_times_is_set_aside(composed, shots):
    with composed.team() as team:
        campaign = team.campaign()
        with composed.stopped("worker") as resume, composed.database.writing("test") as session:
            (victim,) = team.push(campaign, shots[:1])
            # On a busy machine three ends of a worker take longer than a session may idle.
            session.execute(text("SET LOCAL idle_in_transaction_session_timeout = 0"))
            # While this row is locked no worker can store what it has read: it is killed at work, not after.
            session.get_one(FrameRow, victim.id, with_for_update=True)
            resume()
            for lost in (1, 2, 3):
                assert kill_at_work(composed, [victim.id]) == {(victim.job_id, lost)}
                composed.wait_until(lambda lost=lost: composed.jobs(subjects=[victim.id])[0].lost == lost)
        with pytest.raises(stilb.JobFailed, match="worker_lost") as failed:
            team.client.wait(victim.job_id)
        assert failed.value.job.state == "quarantined"
        others = team.push(campaign, shots[1:])
        ended = composed.wait_for_jobs([frame.id for frame in others])
        assert {job.state for job in ended} == {"succeeded"}
        # It stays where it is, whoever hints at it.
        with make_celery(composed.broker_url) as celery:
            celery.send_task(RUN_TASK, args=[victim.job_id])
        composed.wait_until(lambda: not composed.broker.llen(QUEUE))
        assert composed.jobs(subjects=[victim.id])[0].state == "quarantined"
