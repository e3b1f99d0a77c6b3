"""Clocks that are set: nothing waits for as long as the clock was wrong, and no worker loses its lease."""

from datetime import timedelta

import pytest
from sqlalchemy import update

from store import jobs
from store.tables import Job, Organisation, utc_now
from worker.upkeep import ClockWatch, mend_times

pytestmark = pytest.mark.usefixtures("job")
LEASE_S = 30.0
HOUR = timedelta(hours=1)


@pytest.fixture
def job(database):
    """Reads the one job that there is."""
    owner = {"organisation_id": "org_1", "by": "test"}
    with database.writing("test") as session:
        session.add(Organisation(id="org_1", name="house"))
        session.flush()
        jobs.enqueue(session, kind="fit", subject_id="cmp_1", parameters={}, **owner)

    def read():
        with database.reading() as session:
            return session.query(Job).one()

    return read


def set_clock(database, by):
    """What is written down already moves the other way."""
    with database.writing("test") as session:
        row = session.query(Job).one()
        row.due_at -= by
        if row.lease_until:
            row.lease_until -= by


def sweep(database, *, jumped=False):
    with database.writing("sweeper") as session:
        mend_times(session, lease_s=LEASE_S, jumped=jumped)
        jobs.take_back(session, Job.lease_until < utc_now())


def claim(database):
    with database.writing("test") as session:
        return jobs.begin(session, session.query(Job).one().id, lease_s=LEASE_S)


def test_a_job_that_waits_is_due_at_once_when_the_clock_is_set_back(database):
    set_clock(database, -HOUR)
    assert claim(database) is None
    sweep(database)
    assert claim(database) is not None


def test_a_pause_that_a_rule_set_is_kept(database, job):
    later = utc_now() + timedelta(seconds=60)
    with database.writing("test") as session:
        session.execute(update(Job).values(due_at=later))
    sweep(database)
    assert job().due_at == later


def test_the_lease_of_a_dead_worker_ends_in_time_when_the_clock_is_set_back(database, job):
    claim(database)
    set_clock(database, -HOUR)
    sweep(database)
    found = job()
    # Not taken from it: if it lives, it renews it.
    assert found.state == "running"
    assert found.lease_until <= utc_now() + timedelta(seconds=LEASE_S)


def test_a_living_worker_keeps_its_job_when_the_clock_is_set_forward(database, job):
    held = claim(database)
    set_clock(database, HOUR)
    sweep(database, jumped=True)
    assert (job().state, job().lost) == ("running", 0)
    with database.writing("test") as session:
        jobs.succeed(session, held, {})


def test_a_lease_that_ended_by_a_clock_that_was_not_set_is_taken_back(database, job):
    claim(database)
    set_clock(database, HOUR)
    sweep(database)
    assert (job().state, job().lost) == ("queued", 1)


def test_only_a_jump_is_one():
    wall, steady = [1e9], [50.0]
    watch = ClockWatch(wall=lambda: wall[0], steady=lambda: steady[0])
    for passed, shown, jump in [(2, 2, 0), (2, 2.4, 0), (2, 3602, 3600), (600, 600, 0), (2, -3598, -3600)]:
        steady[0] += passed
        wall[0] += shown
        assert watch.jumped_s() == pytest.approx(jump, abs=0.5)
