"""Workers, brokers and messages get lost; frames, statistics and K do not.

Every test ends the same: each frame has its statistics once, and the figures are those of a quiet run, to the
last bit.
"""

from collections import Counter
from dataclasses import replace

import pytest
from sqlalchemy import func, select

import stilb
from store.broker import RUN_TASK, make_celery
from store.jobs import FINAL_STATES
from store.tables import ChannelRow, Extraction, FrameRow, Job
from tests.support.campaigns import ROI
from tests.support.deployments import Embedded, short_folder, wait_for
from tests.support.fieldwork import CHANNELS, Team, figures_of
from tests.support.processes import alive, family

QUEUE = "celery"


def states(deployment, subjects):
    return Counter(job.state for job in deployment.jobs(subjects=subjects))


def runs(deployment, subjects):
    """The runs of this moment: a job that runs again is another run."""
    return {(job.id, job.fence) for job in deployment.jobs(subjects=subjects) if job.state == "running"}


def kill_at_work(deployment, subjects, dead=frozenset()):
    """Kill the worker while it runs one of these jobs; the runs it was killed in; none if too late.

    `dead`: the runs of earlier kills, which seem to go on until their leases end.
    """

    def at_work_or_too_late():
        ended = all(job.state in FINAL_STATES for job in deployment.jobs(subjects=subjects))
        return ended or runs(deployment, subjects) - dead

    deployment.wait_until(at_work_or_too_late)
    deployment.kill("worker")
    # Nobody lives to end them.
    return runs(deployment, subjects) - dead


def check_each_once(deployment, campaign, frames):
    """Every frame is extracted, its statistics are there once a channel, and no job is left."""
    ids = [frame.id for frame in frames]
    with deployment.database.reading() as session:
        rows = session.execute(
            select(FrameRow.id, FrameRow.state, Extraction.id, ChannelRow.channel)
            .outerjoin(Extraction, Extraction.frame_id == FrameRow.id)
            .outerjoin(ChannelRow, ChannelRow.extraction_id == Extraction.id)
            .where(FrameRow.campaign_id == campaign.id)
        ).all()
        jobs = session.scalar(select(func.count()).where(Job.subject_id.in_(ids)))
    found = sorted((frame, state, channel) for frame, state, _, channel in rows)
    assert found == sorted((frame, "extracted", channel) for frame in ids for channel in CHANNELS)
    assert jobs == len(frames)
    assert states(deployment, ids) == {"succeeded": len(frames)}


def check_all(deployment, team, campaign, frames, quiet_figures):
    deployment.wait_for_jobs([frame.id for frame in frames])
    check_each_once(deployment, campaign, frames)
    assert figures_of(team.client.calibrate(campaign.id)) == quiet_figures


def test_a_worker_killed_while_it_extracts(deployment, shots, quiet_figures):
    with deployment.team() as team:
        campaign = team.campaign()
        with deployment.stopped("worker"):
            frames = team.push(campaign, shots)
        ids = [frame.id for frame in frames]
        killed = kill_at_work(deployment, ids)
        deployment.wait_until(lambda: states(deployment, ids)["succeeded"] >= 10)
        killed |= kill_at_work(deployment, ids, killed)
        assert killed
        check_all(deployment, team, campaign, frames, quiet_figures)
        lost = {job.id: job.lost for job in deployment.jobs(subjects=ids)}
        assert lost == {job: [of for of, _ in killed].count(job) for job in lost}


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


def test_everything_killed_and_started_again_on_the_same_data(shots, quiet_figures):
    with short_folder() as folder, Embedded(folder / "data") as deployment:
        with deployment.team() as team:
            campaign = team.campaign()
            frames = team.push(campaign, shots[:20])
            ids = [frame.id for frame in frames]
            deployment.wait_until(lambda: states(deployment, ids)["running"])
            tree = family(deployment.launcher.pid)
            # The launcher, Valkey, service, worker and sweeper at least.
            assert len(tree) >= 5
            deployment.tree_is_killed()
            wait_for(lambda: not alive(tree))
        before = deployment.key
        deployment.start()
        assert deployment.key == before
        with Team(deployment.url, team.key) as again:
            frames += again.push(campaign, shots[20:])
            check_all(deployment, again, campaign, frames, quiet_figures)


def test_a_broker_that_forgets_everything(composed, shots, quiet_figures):
    with composed.team() as team:
        campaign = team.campaign()
        with composed.stopped("worker"):
            frames = team.push(campaign, shots)
            assert composed.broker.llen(QUEUE) > 0
            composed.broker.flushall()
        check_all(composed, team, campaign, frames, quiet_figures)


def test_every_message_delivered_three_times_and_once_more_afterwards(deployment, shots, quiet_figures):
    with deployment.team() as team, make_celery(deployment.broker_url) as celery:
        campaign = team.campaign()
        with deployment.stopped("worker"):
            frames = team.push(campaign, shots)
            for frame in frames:
                for _ in range(2):
                    celery.send_task(RUN_TASK, args=[frame.job_id])
        check_all(deployment, team, campaign, frames, quiet_figures)
        for frame in frames:
            celery.send_task(RUN_TASK, args=[frame.job_id])
        deployment.wait_until(lambda: deployment.broker.keys() and not deployment.broker.llen(QUEUE))
        check_each_once(deployment, campaign, frames)
        jobs = deployment.jobs(subjects=[frame.id for frame in frames])
        assert {(job.attempt, job.fence, job.lost) for job in jobs} == {(1, 1, 0)}


def test_a_broker_that_hangs_while_frames_arrive(embedded, shots, quiet_figures):
    with embedded.team(timeout=8.0, retries=0) as team:
        campaign = team.campaign()
        frames = team.push(campaign, shots[:10])
        with embedded.stopped("valkey"):
            frames += team.push(campaign, shots[10:])
        check_all(embedded, team, campaign, frames, quiet_figures)


def test_a_broker_that_is_gone_while_frames_arrive(composed, shots, quiet_figures):
    with composed.team(timeout=8.0, retries=0) as team:
        campaign = team.campaign()
        frames = team.push(campaign, shots[:10])
        composed.kill("valkey")
        frames += team.push(campaign, shots[10:])
        check_all(composed, team, campaign, frames, quiet_figures)


def test_a_job_that_kills_its_worker_three_times_is_set_aside(composed, shots):
    with composed.team() as team:
        campaign = team.campaign()
        (victim,) = team.push(campaign, shots[:1])
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
