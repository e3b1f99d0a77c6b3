"""A worker as Celery runs it: what its tools show, and how a job ends that is stopped, revoked or lost."""

import itertools
import os
import signal
import sys
from contextlib import contextmanager, suppress

import pytest
from sqlalchemy import text

from store.database import OTHER_SCHEMA_EXIT
from store.jobs import FINAL_STATES
from store.jobs.queues import QUEUES, Post, make_celery
from store.tables import Job
from tests.support.broker import own_broker
from tests.support.compose import ROOT
from tests.support.deployments import short_folder, spawn
from tests.support.house import furnished
from tests.support.printed import read_blocks, type_in
from tests.support.processes import children, command, family
from tests.support.waiting import wait_for
from worker import consumer

QUICK = {"STILB_LEASE_S": "3", "STILB_WORKER_THREADS": "1"}


@pytest.fixture
def house(migrated_sqlite, tmp_path):
    with furnished(migrated_sqlite, tmp_path) as built:
        yield built


@pytest.fixture(scope="module")
def worker(migrated_sqlite, tmp_path_factory):
    """One for the tests that leave it as it is; a lost job's lease has a minute left."""
    folder = tmp_path_factory.mktemp("celery")
    with furnished(migrated_sqlite, folder) as built, working(built, STILB_LEASE_S="60") as begun:
        yield begun


class Worker:
    """`celery -A worker.app worker` on the house's database, and its broker."""

    def __init__(self, house, process, log, broker, valkey, celery):
        self.house = house
        self.process = process
        self.log = log
        self.broker = broker
        self.valkey = valkey
        self.celery = celery
        self._seeds = itertools.count()

    def inspect(self, what):
        (found,) = getattr(self.celery.control.inspect(timeout=20, limit=1), what)().values()
        return found

    def pool(self):
        found = {pid: "worker.decode" in command(pid) for pid in children(self.process.pid)}
        return [pid for pid in found if not found[pid]], [pid for pid in found if found[pid]]

    @contextmanager
    def decoders_stopped(self):
        """Whoever reads a frame meanwhile works on it, and does not come further."""
        _, zygotes = self.pool()
        for pid in zygotes:
            os.kill(pid, signal.SIGSTOP)
        # the next frame's cell may have been born already
        stopped = set().union(*map(family, zygotes))
        for pid in stopped.difference(zygotes):
            os.kill(pid, signal.SIGSTOP)
        try:
            yield
        finally:
            for pid in stopped:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGCONT)

    def upload(self):
        """Send a frame that nobody has read yet; the id of its job."""
        content = self.house.frame_bytes(seed=next(self._seeds))
        return self.house.upload(self.house.campaign(), content, role="dark")["job_id"]

    def job(self, job_id):
        with self.house.database.reading() as session:
            return session.get_one(Job, job_id)

    def wait_for_job(self, job_id, *states):
        wait_for(lambda: self.job(job_id).state in states, seen=lambda: vars(self.job(job_id)))
        return self.job(job_id)


@contextmanager
def working(house, *options, app="worker.app", **settings):
    log = house.folder / "worker.log"
    with short_folder() as folder, own_broker(folder) as (url, broker, valkey):
        environment = (
            os.environ | QUICK | {"STILB_DATA": str(house.folder), "STILB_BROKER_URL": url} | settings
        )
        words = [sys.executable, "-m", "celery", "-A", app, "worker", "-Q", ",".join(QUEUES)]
        with log.open("ab") as file:
            process = spawn([*words, *options], environment, stdout=file, stderr=file)
        house.database.post = Post(url)
        with make_celery(url) as celery:
            worker = Worker(house, process, log, broker, valkey, celery)
            try:
                wait_for(lambda: celery.control.ping(timeout=2), "the worker's answer", seen=log.read_text)
                yield worker
            finally:
                house.database.post = None
                process.kill()
                process.wait()


def test_the_tools_of_celery_see_the_work(worker):
    with worker.decoders_stopped():
        job_id = worker.upload()
        running = worker.wait_for_job(job_id, "running")
        (active,) = worker.inspect("active")
        assert (active["id"], active["name"]) == (job_id, "stilb.extract")
        assert active["args"] == [running.subject_id]
        assert running.holder.endswith(f":{active['worker_pid']}")
    worker.wait_for_job(job_id, "succeeded")
    assert {queue["name"] for queue in worker.inspect("active_queues")} == set(QUEUES)
    tasks = ["cancel", "extract", "fit", "look", "measure", "review"]
    assert sorted(worker.inspect("registered")) == [f"stilb.{task}" for task in tasks]
    wait_for(lambda: worker.inspect("stats")["total"].get("stilb.extract"))
    (printed,) = (each for each in read_blocks("docs/operations.md") if "inspect" in each)
    told = type_in(
        worker.house.folder, f"cd {ROOT}\n{printed}", STILB_BROKER_URL=worker.celery.conf.broker_url
    )
    assert "pong" in told
    assert "stilb.extract" in told


def test_a_revoked_job_has_failed_and_may_be_tried_again(worker):
    with worker.decoders_stopped():
        job_id = worker.upload()
        worker.wait_for_job(job_id, "running")
        worker.celery.control.revoke(job_id, terminate=True)
        revoked = worker.wait_for_job(job_id, *FINAL_STATES)
        assert (revoked.state, revoked.error["code"], revoked.lost) == ("failed", "job_cancelled", 0)


def test_a_worker_grows_with_its_work_and_gives_back_what_does_not_end_within_the_grace(house):
    with working(house, "--autoscale", "3,1", STILB_STOP_GRACE_S="0.3") as worker, worker.decoders_stopped():
        jobs = [worker.upload() for _ in range(3)]
        wait_for(lambda: len(worker.inspect("active")) == 3)
        worker.process.send_signal(signal.SIGTERM)
        assert worker.process.wait() == 0
        for job in map(worker.job, jobs):
            assert (job.state, job.attempt, job.lost, job.lease_until) == ("queued", 0, 0, None)
        assert worker.broker.llen("frames") >= 1
        assert "Traceback" not in worker.log.read_text()


def test_the_job_of_a_killed_pool_process_begins_again_at_once(worker):
    with worker.decoders_stopped():
        job_id = worker.upload()
        worker.wait_for_job(job_id, "running")
        (pid,), _ = worker.pool()
        os.kill(pid, signal.SIGKILL)
        wait_for(lambda: worker.job(job_id).lost == 1, timeout_s=30)
    assert worker.wait_for_job(job_id, *FINAL_STATES).state == "succeeded"


def test_a_job_beyond_its_time_limit_is_lost_and_a_changed_schema_ends_the_worker(house):
    with working(house, app="tests.worker.impatient") as worker:
        with worker.decoders_stopped():
            job_id = worker.upload()
            wait_for(lambda: worker.job(job_id).lost == 1, seen=worker.log.read_text)
        worker.wait_for_job(job_id, *FINAL_STATES)
        before = len(worker.log.read_text())
        with house.database.reading() as session:
            session.execute(text("UPDATE alembic_version SET version_num = '9999'"))
            session.commit()
        assert worker.process.wait() == OTHER_SCHEMA_EXIT
        assert "schema 9999" in worker.log.read_text()
        assert "Traceback" not in worker.log.read_text()[before:]


def test_a_stop_waits_for_the_job_that_runs(house):
    with working(house) as worker:
        with worker.decoders_stopped():
            job_id = worker.upload()
            worker.wait_for_job(job_id, "running")
            worker.process.send_signal(signal.SIGTERM)
        assert worker.process.wait() == 0
        assert worker.job(job_id).state == "succeeded"
        assert "Traceback" not in worker.log.read_text()


def test_a_broker_that_froze_is_connected_anew_and_one_that_went_leaves_no_traceback(house):
    """It froze as a job ended, whose acknowledgement timed out: Celery alone would hold its place."""
    with working(house) as worker:
        with worker.decoders_stopped():
            first, second = worker.upload(), worker.upload()
            worker.wait_for_job(first, "running")
            worker.valkey.send_signal(signal.SIGSTOP)
        worker.wait_for_job(first, "succeeded")
        # a loop that is held up comes to it only when the broker goes on, and has nothing to take up then
        with suppress(AssertionError):
            wait_for(lambda: "Couldn't ack" in worker.log.read_text(), timeout_s=8)
        worker.valkey.send_signal(signal.SIGCONT)
        assert worker.wait_for_job(second, "succeeded").attempt == 1
        before = len(worker.log.read_text())
        worker.valkey.kill()
        for said in ("Connection to broker lost", "Cannot connect"):
            wait_for(lambda said=said: said in worker.log.read_text()[before:])
        assert "Traceback" not in worker.log.read_text()[before:]


def test_a_job_that_ends_once_its_connection_is_half_closed_connects_anew(worker, monkeypatch):
    """Which ended the worker, in one of sixty restarts of the broker under load."""
    with worker.celery.connection_for_write() as connection, monkeypatch.context() as patch:
        (queue := connection.SimpleQueue("half closed")).put({})
        message = queue.get(timeout=5)
        message.channel._disconnect_pools()
        patch.setattr(connection.transport, "client", None)
        patch.setattr(consumer, "asynloop", lambda *_: message.ack())
        with pytest.raises(consumer.BrokerLost):
            consumer.Consumer.loop(None)
