"""A job's life: claimed once, fenced, taken back, quarantined."""

import os
import subprocess
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta

import pytest
from sqlalchemy import event, select, update

from store import jobs
from store.database import Database
from store.jobs import Dependency
from store.queries import campaigns
from store.queries.jobs import count_queue, oldest_wait_s
from store.tables import Campaign, Job, Organisation, utc_now

pytestmark = pytest.mark.either_database


@pytest.fixture
def organisation_id(database):
    with database.writing("test") as session:
        organisation = Organisation(name="house")
        session.add(organisation)
        session.flush()
        return organisation.id


@pytest.fixture
def job_id(database, organisation_id):
    return add(database, organisation_id)


def add(database, organisation_id, subject="frm_1", **parameters):
    with database.writing("test") as session:
        asked = {"kind": "extract", "subject_id": subject, "by": "test", "parameters": parameters}
        return jobs.enqueue(session, organisation_id=organisation_id, **asked).id


def claim(database, lease_s=30.0, job_id=None):
    """Begin a job, as a message names it; without a name one that is due."""
    with database.writing("test") as session:
        due = select(Job.id).where(Job.state == "queued", Job.due_at <= utc_now()).order_by(Job.due_at)
        return jobs.begin(session, job_id or session.scalar(due.limit(1)) or "", lease_s=lease_s)


def state(database, job_id):
    with database.reading() as session:
        return session.get_one(Job, job_id)


def expire(database, job_id):
    with database.writing("test") as session:
        session.get_one(Job, job_id).lease_until = utc_now() - timedelta(seconds=1)


def retry(database, job_id):
    with database.writing("test") as session:
        return jobs.retry(session, Job.id == job_id)


def check_that_it_stores_nothing(database, claim):
    with pytest.raises(jobs.LeaseLost), database.writing("test") as session:
        jobs.succeed(session, claim, {"by": "somebody else"})


def sweep(database):
    with database.writing("test") as session:
        return jobs.take_back(session, Job.lease_until < utc_now())


def test_what_waits_already_is_not_queued_twice(database, organisation_id, job_id):
    assert add(database, organisation_id) == job_id
    assert add(database, organisation_id, model="affine") != job_id
    claim(database)
    assert add(database, organisation_id) != job_id


@pytest.mark.both_databases
def test_twenty_messages_of_three_jobs_at_once_begin_each_once(database, organisation_id, job_id):
    waiting = [job_id, *(add(database, organisation_id, f"frm_{number}") for number in (2, 3))]
    with ThreadPoolExecutor(20) as threads:
        begun = threads.map(lambda number: claim(database, job_id=waiting[number % 3]), range(20))
        assert sorted(each.job_id for each in begun if each) == sorted(waiting)
    assert state(database, job_id).attempt == 1


def test_a_message_of_a_job_whose_process_has_died_begins_it_again(database, job_id):
    """Of another machine's process nothing is known but the lease."""
    claim(database)
    with subprocess.Popen(["true"]) as died:
        died.wait()
    here = (jobs.name_holder(pid) for pid in (os.getpid(), died.pid))
    for holder, lost in zip(["elsewhere:1", *here], [0, 0, 1], strict=True):
        with database.writing("test") as session:
            session.execute(update(Job).values(holder=holder))
        again = claim(database, job_id=job_id)
        assert (again is not None, state(database, job_id).lost) == (bool(lost), lost)


def test_a_message_that_comes_before_its_job_is_due_begins_nothing(database, job_id):
    fault(database, claim(database))
    assert claim(database, job_id=job_id) is None
    assert (state(database, job_id).state, state(database, job_id).sent_at) == ("queued", None)
    assert claim(database, job_id="job_of_another_database") is None


def test_a_cancelled_job_stores_nothing_and_may_be_tried_again(database, job_id):
    held = claim(database)
    with database.writing("test") as session:
        jobs.cancel(session, job_id)
    check_that_it_stores_nothing(database, held)
    found = state(database, job_id)
    assert (found.state, found.error["code"]) == ("failed", "job_cancelled")
    assert retry(database, job_id) == 1
    with database.writing("test") as session:
        session.execute(update(Job).values(state="succeeded"))
        jobs.cancel(session, job_id)
    assert state(database, job_id).state == "succeeded"


def test_what_a_stopped_worker_held_is_given_back_as_if_it_had_not_begun(database, job_id):
    first = claim(database)
    with database.writing("test") as session:
        assert jobs.give_back(session, [os.getpid() + 1]) == 0
        assert jobs.give_back(session, [os.getpid()]) == 1
    found = state(database, job_id)
    assert (found.state, found.attempt, found.lost, found.lease_until) == ("queued", 0, 0, None)
    second = claim(database)
    assert (second.job_id, second.attempt, second.fence) == (first.job_id, 1, first.fence + 1)
    check_that_it_stores_nothing(database, first)


@pytest.mark.both_databases
def test_who_lost_the_lease_can_store_nothing(database, job_id):
    first = claim(database)
    expire(database, job_id)
    assert sweep(database) == 1
    second = claim(database)
    assert second.fence > first.fence
    check_that_it_stores_nothing(database, first)
    with database.writing("test") as session:
        jobs.succeed(session, second, {"by": "second"})
    assert state(database, job_id).result == {"by": "second"}


def test_a_renewed_lease_is_not_taken_back(database, job_id):
    held = claim(database, lease_s=0.001)
    with database.writing("test") as session:
        jobs.renew(session, held, lease_s=30.0, progress=0.5)
    assert sweep(database) == 0
    assert (state(database, job_id).state, state(database, job_id).progress) == ("running", 0.5)


def test_three_lost_workers_and_it_is_set_aside(database, job_id):
    for lost in (1, 2):
        claim(database)
        expire(database, job_id)
        assert sweep(database) == 1
        assert (state(database, job_id).state, state(database, job_id).lost) == ("queued", lost)
    claim(database)
    expire(database, job_id)
    assert sweep(database) == 0
    found = state(database, job_id)
    assert (found.state, found.error["code"]) == ("quarantined", "worker_lost")
    assert claim(database) is None


def fault(database, held):
    with database.writing("test") as session:
        jobs.retry_later(session, held, waits_for=Dependency.BLOBS)


def let_pass(database, job_id, passed):
    """Let a job be as if that much time had passed."""
    with database.writing("test") as session:
        job = session.get_one(Job, job_id)
        job.due_at -= passed
        job.faulty_since -= passed


def test_a_passing_fault_is_tried_again_quickly_at_first_and_every_few_minutes_later(
    database, job_id, monkeypatch
):
    now = utc_now()
    monkeypatch.setattr(jobs, "utc_now", lambda: now)
    pauses = []
    while sum(pauses, timedelta(0)) < timedelta(minutes=20):
        fault(database, claim(database))
        found = state(database, job_id)
        assert (found.state, found.waits_for, found.error["waits_for"]) == ("queued", "blobs", "blobs")
        assert found.error["retryable"]
        assert claim(database) is None
        pauses.append(found.due_at - now)
        let_pass(database, job_id, pauses[-1])
    assert timedelta(seconds=0.9) < pauses[0] <= timedelta(seconds=2)
    assert timedelta(minutes=1) < pauses[-1] <= timedelta(minutes=3)
    assert 12 < len(pauses) < 40


def test_a_passing_fault_that_lasts_for_a_day_is_failed_and_may_be_tried_again(database, job_id):
    fault(database, claim(database))
    for passed, becomes in [(timedelta(hours=23.9), "queued"), (timedelta(hours=0.2), "failed")]:
        let_pass(database, job_id, passed)
        fault(database, claim(database))
        assert state(database, job_id).state == becomes
    error = state(database, job_id).error
    assert (error["code"], error["retryable"]) == ("temporarily_unavailable", True)
    assert "for a day" in error["detail"]
    assert retry(database, job_id) == 1
    fault(database, claim(database))
    assert state(database, job_id).state == "queued"


def test_what_waited_for_a_dependency_is_due_when_it_is_back(database, organisation_id, job_id):
    fault(database, claim(database))
    other = add(database, organisation_id, "frm_2")
    assert claim(database, job_id=other) is None, "it needs the file store too"
    with database.writing("test") as session:
        assert jobs.resume(session, Dependency.DECODER) == 0
    assert claim(database, job_id=job_id) is None
    with database.writing("test") as session:
        assert jobs.resume(session, Dependency.BLOBS) == 1
    again = claim(database, job_id=job_id)
    assert (again.attempt, again.faulty_since is None) == (2, False)


@pytest.mark.both_databases
def test_the_oldest_wait_of_all_and_of_one_organisation(database, organisation_id):
    with database.reading() as session:
        assert oldest_wait_s(session) == 0.0
    job_id = add(database, organisation_id)
    with database.writing("test") as session:
        other = Organisation(name="another")
        session.add(other)
        session.flush()
        asked = {"kind": "fit", "subject_id": "cmp_1", "by": "test", "parameters": {}}
        jobs.enqueue(session, organisation_id=other.id, **asked)
        session.execute(update(Job).where(Job.id == job_id).values(due_at=utc_now() - timedelta(seconds=90)))
        assert 90 <= oldest_wait_s(session) < 180
        assert 90 <= oldest_wait_s(session, organisation_id) < 180
        assert oldest_wait_s(session, other.id) < 60


def test_a_job_that_was_given_up_is_tried_again_as_if_new(database, job_id):
    held = claim(database)
    with database.writing("test") as session:
        jobs.fail(session, held, {"code": "internal_error", "detail": "x", "retryable": False}, "Traceback")
    assert retry(database, job_id) == 1
    renewed = state(database, job_id)
    assert (renewed.state, renewed.attempt, renewed.lost, renewed.error) == ("queued", 0, 0, None)
    assert (renewed.traceback, renewed.finished_at) == (None, None)
    # the fence goes on rising: whoever held it before stores nothing
    assert claim(database).fence == held.fence + 1


def test_a_job_that_goes_on_or_is_done_is_not_tried_again(database, job_id):
    assert (retry(database, job_id), state(database, job_id).state) == (0, "queued")
    held = claim(database)
    assert (retry(database, job_id), state(database, job_id).state) == (0, "running")
    with database.writing("test") as session:
        jobs.succeed(session, held, {})
    assert (retry(database, job_id), state(database, job_id).state) == (0, "succeeded")


@pytest.mark.parametrize("few", [500, -1])
def test_counting_what_waits_reads_narrow_indexes(migrated_sqlite, monkeypatch, few):
    database, plans = Database(f"sqlite:///{migrated_sqlite}"), []

    def explain(_connection, cursor, statement, parameters, *_):
        plans.extend(
            row[3] for row in cursor.connection.execute(f"EXPLAIN QUERY PLAN {statement}", parameters)
        )

    monkeypatch.setattr(campaigns, "_FEW", few)
    with database.reading() as session:
        session.connection()  # begun: a BEGIN has no plan
        event.listen(session.get_bind(), "before_cursor_execute", explain)
        count_queue(session)
        campaigns.count_being_read(session, Campaign(id="cmp_1", organisation_id="org_1"))
    database.dispose()
    used = [plan.partition(" USING ")[2] for plan in plans if plan.startswith(("SEARCH job", "SCAN job"))]
    assert "COVERING INDEX ix_job_state_waits_for (state=?)" in used
    expected = "organisation_id=?" if few > 0 else "organisation_id=? AND subject_id=?"
    assert f"INDEX ix_job_reading ({expected})" in used
