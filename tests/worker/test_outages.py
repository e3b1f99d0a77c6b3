"""The file store or the database is away for a while: few attempts, one line in the log, and all goes on."""

import logging
import threading
from contextlib import contextmanager
from dataclasses import replace

import pytest
from sqlalchemy.exc import OperationalError

from store.blobs import StorageUnavailable
from store.jobs import Dependency, Turn
from store.tables import Job
from tests.support.campaigns import ROI
from tests.support.processes import wait_until
from worker import breaker, runner
from worker.breaker import Breaker
from worker.leases import Leases
from worker.needs import Needs
from worker.runner import claim_next, run
from worker.threads import JobThreads

pytestmark = pytest.mark.either_database

FRAMES = 8


class Store:
    """The house's own file store, which can be away, or lack one object."""

    def __init__(self, blobs):
        self.blobs = blobs
        self.away = False
        self.lacking = None
        self.asked = self.checked = 0

    def check(self):
        self.checked += 1
        if self.away:
            raise StorageUnavailable("the store is away")

    @contextmanager
    def local_file(self, blob):
        self.asked += 1
        if self.away or blob.sha256 == self.lacking:
            raise StorageUnavailable("the store is away")
        with self.blobs.local_file(blob) as file:
            yield file

    def __getattr__(self, name):
        return getattr(self.blobs, name)


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    monkeypatch.setattr(breaker, "FIRST_PAUSE_S", 0.02)
    monkeypatch.setattr(breaker, "LONGEST_PAUSE_S", 0.05)
    monkeypatch.setattr(runner, "_PAUSE_S", 0.02)


@pytest.fixture
def store(house):
    return Store(house.blobs)


@pytest.fixture
def worker(house, store):
    return replace(house.worker, blobs=store, needs=Needs(store))


@pytest.fixture
def frames(house):
    campaign = house.campaign()
    house.http.put(f"/v1/campaigns/{campaign['id']}/roi", json=ROI)
    return [house.upload(campaign, house.frame_bytes(seed=each), role="dark") for each in range(FRAMES)]


@contextmanager
def working(context):
    """Threads that do the jobs; yields what they noted of what does not serve."""
    noted = []
    threads = JobThreads(
        context, count=3, look_s=0.05, looked=lambda: None, swept=lambda: None, noted=noted.append
    )
    threads.start()
    try:
        yield noted
    finally:
        assert threads.stop(10.0)


def states(house, frames):
    return [house.get(f"/v1/jobs/{frame['job_id']}")["state"] for frame in frames]


def attempts(house, frames):
    return sum(house.get(f"/v1/jobs/{frame['job_id']}")["attempt"] for frame in frames)


def test_a_store_that_is_away_is_asked_for_by_few_jobs_and_comes_back_to_all(
    house, store, worker, frames, caplog
):
    caplog.set_level(logging.WARNING)
    store.away = True
    with working(worker) as noted:
        wait_until(lambda: store.checked > 20, what="the store to be checked twenty times")
        # as many as there are threads, and none after the breaker has opened
        assert store.asked <= 3
        assert worker.needs.list_away().keys() == {Dependency.BLOBS}
        assert set(states(house, frames)) == {"queued"}
    # for those that begin while it is away, too
    with working(worker) as noted:
        wait_until(lambda: noted, what="the outage to be noted")
        store.away = False
        wait_until(lambda: set(states(house, frames)) == {"succeeded"}, what="every frame to be read")
        wait_until(lambda: noted[-1:] == [{}], what="the return of the store to be noted")
    assert attempts(house, frames) <= FRAMES + 3
    assert [list(each) for each in noted] == [[Dependency.BLOBS], []]
    said = [record.getMessage() for record in caplog.records if "does not serve" in record.getMessage()]
    assert len(said) == 1
    assert not [record for record in caplog.records if record.exc_info]


def test_while_the_store_is_away_a_job_without_files_is_done(house, store, worker, frames):
    store.away = True
    while (claim := claim_next(worker, Turn())) is not None:
        run(worker, claim)
    with house.database.writing("test") as session:
        session.get_one(Job, frames[-1]["job_id"]).kind = "fit"
    assert claim_next(worker, Turn()).job_id == frames[-1]["job_id"]


def test_a_job_that_waits_names_what_for_and_when_it_is_tried_next(house, store, worker, frames):
    store.away = True
    run(worker, claim_next(worker, Turn()))
    (tried,) = [job for job in house.get("/v1/jobs")["items"] if job["attempt"]]
    assert tried["error"]["waits_for"] == "blobs"
    assert tried["created_at"] < tried["next_attempt_at"]
    assert [job for job in house.get("/v1/jobs")["items"] if "next_attempt_at" in job] == [tried]
    assert len(frames) == FRAMES


def test_one_object_that_cannot_be_had_holds_up_no_other(house, store, worker, frames):
    store.lacking = house.get(f"/v1/frames/{frames[0]['id']}")["sha256"]
    with working(worker):
        wait_until(
            lambda: states(house, frames).count("succeeded") == FRAMES - 1, what="the other frames to be read"
        )
    assert states(house, frames)[0] == "queued"


def test_an_open_breaker_lets_one_thread_through_at_a_time():
    store = Store(None)
    store.away = True
    found = Breaker(Dependency.BLOBS, store.check, faults=(StorageUnavailable,))
    found.failed(StorageUnavailable("away"))
    assert not found.permits()
    store.away = False
    wait_until(found.permits, what="a trial to be allowed")
    assert not found.permits()
    # what other threads began before it opened says nothing
    for report in (found.served, found.withdraw):
        other = threading.Thread(target=report)
        other.start()
        other.join()
        assert not found.permits()
    found.withdraw()
    assert found.permits()
    found.failed(StorageUnavailable("away after all"))
    assert found.open_since is not None
    wait_until(found.permits, what="another trial")
    assert found.served()
    assert found.permits()
    assert found.permits()


class Away:
    """A database that does not answer those who write, as long as it is told so."""

    def __init__(self, database):
        self._database = database
        self.away = False
        self.refused = 0

    @contextmanager
    def writing(self, *who):
        if self.away:
            self.refused += 1
            raise OperationalError("COMMIT", {}, Exception("server closed the connection unexpectedly"))
        with self._database.writing(*who) as session:
            yield session

    def __getattr__(self, name):
        return getattr(self._database, name)


def test_what_was_computed_is_stored_when_the_database_is_back(house, frames, caplog):
    caplog.set_level(logging.WARNING)
    database = Away(house.database)
    leases = Leases(house.database, lease_s=0.3, stuck_s=0.2)
    context = replace(house.worker, database=database, leases=leases)
    claim = claim_next(context, Turn())
    database.away = True
    worker = threading.Thread(target=run, args=(context, claim), daemon=True)
    worker.start()
    wait_until(lambda: database.refused > 40, what="the result to be kept for a while")
    # what waits for the database does not hang, so that nobody ends the worker for it
    assert leases.count == 1
    assert house.get(f"/v1/jobs/{claim.job_id}")["state"] == "running"
    database.away = False
    worker.join(10)
    job = house.get(f"/v1/jobs/{claim.job_id}")
    assert (job["state"], job["attempt"]) == ("succeeded", 1)
    assert caplog.records == []
    assert len(frames) == FRAMES


def test_what_another_worker_did_meanwhile_is_not_stored_twice(house, frames):
    database = Away(house.database)
    context = replace(house.worker, database=database)
    claim = claim_next(context, Turn())
    database.away = True
    worker = threading.Thread(target=run, args=(context, claim), daemon=True)
    worker.start()
    wait_until(lambda: database.refused > 2, what="the result to be kept for a while")
    with house.database.writing("test") as session:
        session.get_one(Job, claim.job_id).fence += 1
    database.away = False
    worker.join(10)
    assert house.get(f"/v1/frames/{claim.subject_id}")["state"] == "received"
    assert len(frames) == FRAMES


def test_a_worker_says_once_that_it_can_claim_nothing_and_goes_on_by_itself(house, frames, caplog):
    caplog.set_level(logging.WARNING)
    database = Away(house.database)
    database.away = True
    with working(replace(house.worker, database=database)):
        wait_until(lambda: database.refused > 10, what="ten looks at a database that is away")
        database.away = False
        wait_until(lambda: set(states(house, frames)) == {"succeeded"}, what="every frame to be read")
    said = [record.getMessage() for record in caplog.records]
    assert len(said) == 2
    assert said[0].startswith("the database does not serve")
    assert said[1].startswith("the database serves again")
