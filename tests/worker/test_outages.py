"""The file store or the database is away for a while: few attempts, one line in the log, and all goes on."""

import logging
import threading
from contextlib import contextmanager
from dataclasses import replace
from datetime import timedelta

import pytest
from sqlalchemy import update
from sqlalchemy.exc import OperationalError

from store.blobs import StorageUnavailable
from store.jobs import begin, queues
from store.jobs.processes import Presence, list_parts
from store.jobs.queues import WINDOW
from store.tables import Job, utc_now
from tests.support.campaigns import ROI
from tests.support.processes import wait_until
from worker import runner
from worker.runner import run
from worker.upkeep import Upkeep

pytestmark = pytest.mark.either_database

FRAMES = 6


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


class Broker:
    """Has what was sent of jobs until the test does it."""

    def __init__(self):
        self.waiting = []

    def send(self, messages):
        self.waiting += [message for message in messages if message.task_id]

    def count(self):
        return {}


class Worker:
    """What a pool process does: jobs as messages come, and upkeep beside them."""

    def __init__(self, house, context):
        self.context = context
        self.broker = house.database.post = Broker()
        self.upkeep = Upkeep(context, Presence(context.database, "worker"), lead=lambda: None)

    def do_all(self):
        while self.broker.waiting:
            run(self.context, self.broker.waiting.pop(0).task_id)


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    monkeypatch.setattr(runner, "_PAUSE_S", 0.02)


@pytest.fixture
def store(house):
    return Store(house.blobs)


@pytest.fixture(autouse=True)
def worker(house, store):
    yield Worker(house, replace(house.worker, blobs=store))
    house.database.post = None


@pytest.fixture
def frames(house):
    campaign = house.campaign()
    house.http.put(f"/v1/campaigns/{campaign['id']}/roi", json=ROI)
    return [house.upload(campaign, house.frame_bytes(seed=each), role="dark") for each in range(FRAMES)]


def states(house, frames):
    return [house.get(f"/v1/jobs/{frame['job_id']}")["state"] for frame in frames]


def away(house):
    """What the processes say that they do without."""
    with house.database.reading() as session:
        return [list(part.details.get("away", {})) for part in list_parts(session)]


def test_a_store_that_is_away_is_asked_for_by_few_jobs_and_comes_back_to_all(
    house, store, worker, frames, caplog
):
    caplog.set_level(logging.WARNING)
    store.away = True
    worker.do_all()
    (tried,) = [job for job in house.get("/v1/jobs")["items"] if job["attempt"]]
    assert tried["error"]["waits_for"] == "blobs"
    assert tried["created_at"] < tried["next_attempt_at"]
    assert [job for job in house.get("/v1/jobs")["items"] if "next_attempt_at" in job] == [tried]
    for _ in range(3):
        worker.upkeep.do_turn()
        worker.do_all()
    assert store.asked == 1
    assert set(states(house, frames)) == {"queued"}
    assert away(house) == [["blobs"]]
    store.away = False
    worker.upkeep.do_turn()
    worker.do_all()
    worker.upkeep.do_turn()
    assert set(states(house, frames)) == {"succeeded"}
    assert sum(house.get(f"/v1/jobs/{frame['job_id']}")["attempt"] for frame in frames) == FRAMES + 1
    assert away(house) == [[]]
    assert [(record.getMessage(), record.exc_info) for record in caplog.records] == [
        ("The file store does not serve; what needs it waits", None),
        ("The file store serves again", None),
    ]


def test_a_broker_that_is_away_is_told_while_jobs_wait_for_it(house, worker, frames, monkeypatch, caplog):
    caplog.set_level(logging.WARNING)
    monkeypatch.setattr(queues, "LOST_AFTER_S", 0.0)
    monkeypatch.setattr(worker.broker, "count", lambda: None)
    worker.upkeep.do_turn()
    worker.upkeep.do_turn()
    ready = house.http.get("/readyz").json()
    assert ready["warnings"] == ["the broker does not serve the workers: jobs wait"]
    assert 'stilb_workers_without{dependency="broker"} 1.0' in house.http.get("/metrics").text
    monkeypatch.undo()
    worker.upkeep.do_turn()
    worker.upkeep.do_turn()
    assert (away(house), set(states(house, frames))) == ([[]], {"queued"})
    assert [record.getMessage() for record in caplog.records] == [
        "The broker does not serve; what needs it waits",
        "The broker serves again",
    ]


def test_while_the_store_is_away_a_job_without_files_is_done(house, store, worker, frames):
    store.away = True
    worker.do_all()
    with house.database.writing("test") as session:
        waiting = session.get_one(Job, frames[-1]["job_id"])
        waiting.kind, waiting.lane = "fit", "fit"
    worker.upkeep.do_turn()
    assert [message.task_id for message in worker.broker.waiting] == [frames[-1]["job_id"]]


def test_one_object_that_cannot_be_had_holds_up_no_other(house, store, worker, frames):
    store.lacking = house.get(f"/v1/frames/{frames[0]['id']}")["sha256"]
    worker.do_all()
    assert states(house, frames) == ["queued", *["succeeded"] * (FRAMES - 1)]


class Away:
    """A database that does not answer those who write, as long as it is told so."""

    def __init__(self, database, *, away=False):
        self._database = database
        self.away = away
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


@contextmanager
def computing(house, monkeypatch, frame):
    """A frame's job, computed while the database goes away."""
    database, work = Away(house.database), runner.work

    def compute(context, claim):
        outcome = work(context, claim)
        database.away = True
        return outcome

    monkeypatch.setattr(runner, "work", compute)
    context = replace(house.worker, database=database)
    thread = threading.Thread(target=run, args=(context, frame["job_id"]), daemon=True)
    thread.start()
    wait_until(lambda: database.refused > 20, what="the result to be kept for a while")
    yield
    database.away = False
    thread.join(10)


def test_a_job_that_cannot_begin_costs_no_attempt(house, frames):
    database = Away(house.database, away=True)
    context = replace(house.worker, database=database)
    assert run(context, frames[0]["job_id"]) == {"state": "dropped"}
    assert states(house, frames[:1]) == ["queued"]
    database.away = False
    assert run(context, frames[0]["job_id"])["state"] == "succeeded"
    assert house.get(f"/v1/jobs/{frames[0]['job_id']}")["attempt"] == 1


def test_what_was_computed_is_stored_when_the_database_is_back(house, frames, caplog, monkeypatch):
    caplog.set_level(logging.WARNING)
    with computing(house, monkeypatch, frames[0]):
        assert states(house, frames[:1]) == ["running"]
    job = house.get(f"/v1/jobs/{frames[0]['job_id']}")
    assert (job["state"], job["attempt"]) == ("succeeded", 1)
    assert caplog.records == []


def test_what_another_worker_did_meanwhile_is_not_stored_twice(house, frames, monkeypatch):
    with computing(house, monkeypatch, frames[0]), house.database.writing("test") as session:
        session.get_one(Job, frames[0]["job_id"]).fence += 1
    assert house.get(f"/v1/frames/{frames[0]['id']}")["state"] == "received"


@pytest.mark.usefixtures("frames")
def test_upkeep_says_once_that_the_database_is_away_and_goes_on_by_itself(house, worker, caplog):
    caplog.set_level(logging.WARNING)
    database = Away(house.database, away=True)
    upkeep = Upkeep(replace(worker.context, database=database), Presence(database, "worker"), lead=int)
    worker.broker.waiting.clear()
    with house.database.writing("test") as session:
        session.execute(update(Job).values(sent_at=None))
    for _ in range(3):
        upkeep.do_turn()
    assert worker.broker.waiting == []
    database.away = False
    upkeep.do_turn()
    assert len(worker.broker.waiting) == WINDOW
    first, second = (record.getMessage() for record in caplog.records)
    assert first.startswith("the database does not serve")
    assert second.startswith("the database serves again")


def test_every_lease_begins_again_after_the_database_was_away(house, frames, worker):
    """Nobody could renew one meanwhile; what is lost is found a lease later."""
    with house.database.writing("test") as session:
        begin(session, frames[0]["job_id"], lease_s=30.0)

    def let_end():
        with house.database.writing("test") as session:
            session.get_one(Job, frames[0]["job_id"]).lease_until = utc_now() - timedelta(minutes=1)

    let_end()
    database = Away(house.database)
    upkeep = Upkeep(replace(worker.context, database=database), Presence(database, "worker"), lead=int)
    for database.away in (True, False):
        upkeep.do_turn()
    assert states(house, frames[:1]) == ["running"]
    let_end()
    upkeep.do_turn()
    assert states(house, frames[:1]) == ["queued"]
