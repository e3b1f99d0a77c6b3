"""A job takes three workers with it; what else gets lost, while it fits and measures, tests/faults drills."""

import pytest
from sqlalchemy import text

import stilb
from store.jobs import FINAL_STATES
from store.jobs.queues import LANES, Message, Post
from store.tables import FrameRow


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
        others = team.push(campaign, shots[1:8])
        ended = composed.wait_for_jobs([frame.id for frame in others])
        assert {job.state for job in ended} == {"succeeded"}
        # It stays where it is, whatever message comes.
        Post(composed.broker_url).send([Message(LANES["extract"], victim.job_id, victim.id)])
        composed.wait_until(lambda: not composed.broker.llen("frames"))
        assert composed.jobs(subjects=[victim.id])[0].state == "quarantined"
