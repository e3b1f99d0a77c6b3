"""A job's life: claimed once, fenced, taken back, quarantined."""

from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta

import pytest
from sqlalchemy import update

from store import jobs
from store.columns import utc_now
from store.tables import Job, Organisation


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
        return jobs.enqueue(
            session,
            kind="extract",
            subject_id=subject,
            organisation_id=organisation_id,
            by="test",
            parameters=parameters,
        ).id


def claim(database, job_id, lease_s=30.0):
    with database.writing("test") as session:
        return jobs.claim(session, job_id, lease_s=lease_s)


def state(database, job_id):
    with database.reading() as session:
        return session.get_one(Job, job_id)


def expire(database, job_id):
    with database.writing("test") as session:
        session.execute(
            update(Job).where(Job.id == job_id).values(lease_until=utc_now() - timedelta(seconds=1))
        )


def sweep(database):
    with database.writing("test") as session:
        return jobs.sweep(session)


def test_what_waits_already_is_not_queued_twice(database, organisation_id, job_id):
    assert add(database, organisation_id) == job_id
    assert add(database, organisation_id, model="affine") != job_id
    claim(database, job_id)
    assert add(database, organisation_id) != job_id


def test_twenty_with_the_same_hint_and_one_gets_it(database, job_id):
    with ThreadPoolExecutor(20) as threads:
        claims = list(threads.map(lambda _: claim(database, job_id), range(20)))
    assert len([c for c in claims if c]) == 1
    assert state(database, job_id).attempt == 1


def test_who_lost_the_lease_can_store_nothing(database, job_id):
    first = claim(database, job_id)
    expire(database, job_id)
    assert sweep(database) == [job_id]
    second = claim(database, job_id)
    assert second.fence > first.fence
    with pytest.raises(jobs.LeaseLost), database.writing("test") as session:
        jobs.succeed(session, first, {"by": "first"})
    with database.writing("test") as session:
        jobs.succeed(session, second, {"by": "second"})
    assert state(database, job_id).result == {"by": "second"}


def test_a_renewed_lease_is_not_taken_back(database, job_id):
    held = claim(database, job_id, lease_s=0.001)
    with database.writing("test") as session:
        jobs.renew(session, held, lease_s=30.0, progress=0.5)
    assert sweep(database) == []
    assert (state(database, job_id).state, state(database, job_id).progress) == ("running", 0.5)


def test_three_lost_workers_and_it_is_set_aside(database, job_id):
    for lost in (1, 2):
        claim(database, job_id)
        expire(database, job_id)
        assert sweep(database) == [job_id]
        assert (state(database, job_id).state, state(database, job_id).lost) == ("queued", lost)
    claim(database, job_id)
    expire(database, job_id)
    assert sweep(database) == []
    found = state(database, job_id)
    assert (found.state, found.error["code"]) == ("quarantined", "worker_lost")
    assert claim(database, job_id) is None


def test_a_passing_fault_is_tried_later_and_failed_at_last(database, job_id):
    for attempt in range(1, jobs.RETRY_LIMIT + 1):
        with database.writing("test") as session:
            session.execute(update(Job).values(due_at=utc_now()))
        held = claim(database, job_id)
        assert held.attempt == attempt
        with database.writing("test") as session:
            jobs.retry_later(session, held, {"code": "temporarily_unavailable"})
        if attempt < jobs.RETRY_LIMIT:
            assert state(database, job_id).due_at > utc_now()
            assert claim(database, job_id) is None
    assert state(database, job_id).state == "failed"


def test_a_hint_is_given_again_only_after_a_while(database, organisation_id):
    job_id = add(database, organisation_id, "frm_2")
    assert sweep(database) == []
    with database.writing("test") as session:
        session.execute(update(Job).values(hinted_at=utc_now() - timedelta(seconds=6)))
    assert sweep(database) == [job_id]
    assert sweep(database) == []


def test_the_oldest_wait(database, organisation_id):
    with database.reading() as session:
        assert jobs.oldest_wait_s(session) == 0.0
    add(database, organisation_id)
    with database.writing("test") as session:
        session.execute(update(Job).values(due_at=utc_now() - timedelta(seconds=90)))
    with database.reading() as session:
        assert 90 <= jobs.oldest_wait_s(session) < 100


def test_a_job_that_was_given_up_is_tried_again_as_if_new(database, job_id):
    held = claim(database, job_id)
    with database.writing("test") as session:
        jobs.fail(session, held, {"code": "internal_error", "detail": "x", "retryable": False}, "Traceback")
    with database.writing("test") as session:
        assert jobs.retry(session, job_id)
    renewed = state(database, job_id)
    assert (renewed.state, renewed.attempt, renewed.lost, renewed.error) == ("queued", 0, 0, None)
    assert (renewed.traceback, renewed.finished_at) == (None, None)
    # the fence goes on rising: whoever held it before stores nothing
    assert claim(database, job_id).fence == held.fence + 1


@pytest.mark.parametrize("stands", ["queued", "running", "succeeded"])
def test_a_job_that_goes_on_or_is_done_is_not_tried_again(database, job_id, stands):
    if stands != "queued":
        held = claim(database, job_id)
    with database.writing("test") as session:
        if stands == "succeeded":
            jobs.succeed(session, held, {})
        assert not jobs.retry(session, job_id)
    assert state(database, job_id).state == stands


def test_the_oldest_wait_of_one_organisation_is_its_own(database, job_id, organisation_id):
    with database.writing("test") as session:
        other = Organisation(name="another")
        session.add(other)
        session.flush()
        jobs.enqueue(
            session, kind="fit", subject_id="cmp_1", organisation_id=other.id, by="test", parameters={}
        )
        session.execute(update(Job).where(Job.id == job_id).values(due_at=utc_now() - timedelta(seconds=90)))
        assert 90 <= jobs.oldest_wait_s(session, organisation_id) < 100
        assert jobs.oldest_wait_s(session, other.id) < 10
