"""A worker that is asked to stop: it finishes, or gives back at once what it cannot finish."""

import os
import signal
import subprocess
import sys
from contextlib import contextmanager

import pytest
import redis
from sqlalchemy import select, text

from service.launch.valkey import valkey_binary
from store import jobs
from store.columns import utc_now
from store.database import Database
from store.jobs import LeaseLost, Turn, claim_next
from store.schema import OTHER_SCHEMA_EXIT
from store.tables import Job
from tests.support.deployments import spawn
from tests.support.house import House
from tests.support.ports import pick_port
from tests.support.processes import family
from tests.support.proxy import Proxy
from tests.support.waiting import wait_for


@pytest.fixture
def house(migrated_sqlite, tmp_path):
    (tmp_path / "stilb.sqlite").write_bytes(migrated_sqlite.read_bytes())
    database = Database(f"sqlite:///{tmp_path / 'stilb.sqlite'}")
    with House(database, tmp_path) as built:
        yield built
    database.dispose()


@contextmanager
def working(house, *, answers=False, **settings):
    """`python -m worker` on the house's database; with a broker that takes connections and never answers."""
    log = house.folder / "worker.log"
    with Proxy(("127.0.0.1", 1)) as silent:
        silent.become("silent")
        environment = os.environ | {
            "STILB_DATA": str(house.folder),
            "STILB_BROKER_URL": f"redis://{silent.address}/0",
            "STILB_SWEEP_INTERVAL_S": "0.2",
        }
        with log.open("ab") as file:
            process = spawn(
                [sys.executable, "-m", "worker"], environment | settings, stdout=file, stderr=file
            )
        try:
            if not answers:
                wait_for(lambda: silent.struck, "the worker asks the broker")
            yield process, log
        finally:
            process.kill()
            process.wait()


def upload(house, **changes):
    house.upload(house.campaign(), house.frame_bytes(**changes), role="dark")


def newest_job(house):
    with house.database.reading() as session:
        return session.scalars(select(Job).order_by(Job.id.desc()).limit(1)).one()


def test_a_stop_waits_for_the_job_that_runs(house):
    with working(house) as (process, log):
        upload(house)
        wait_for(lambda: newest_job(house).state != "queued", "the job is claimed")
        process.send_signal(signal.SIGTERM)
        assert process.wait() == 0
    assert newest_job(house).state == "succeeded"
    assert "Traceback" not in log.read_text()


def test_what_does_not_end_within_the_grace_is_given_back(house):
    upload(house)
    with working(house, STILB_STOP_GRACE_S="0.3", STILB_WORKER_THREADS="1") as (process, log):
        wait_for(lambda: newest_job(house).state == "succeeded", "the decoder is there")
        for pid in family(process.pid) - {process.pid}:
            os.kill(pid, signal.SIGSTOP)
        upload(house, seed=2)
        wait_for(lambda: newest_job(house).state == "running", "the job is claimed")
        process.send_signal(signal.SIGTERM)
        assert process.wait() == 0
    job = newest_job(house)
    assert (job.state, job.attempt, job.lost, job.lease_until) == ("queued", 0, 0, None)
    assert job.due_at <= utc_now()
    assert "Traceback" not in log.read_text()


def test_a_job_that_was_given_back_is_another_workers(house):
    upload(house)
    with house.database.writing("test") as session:
        first = claim_next(session, Turn(), lease_s=30.0)
    with house.worker.leases.hold(first):
        house.worker.leases.give_back()
        with house.database.writing("test") as session:
            second = claim_next(session, Turn(), lease_s=30.0)
    assert (second.job_id, second.attempt, second.fence) == (first.job_id, 1, first.fence + 1)
    with pytest.raises(LeaseLost), house.database.writing("test") as session:
        jobs.succeed(session, first, {})


def test_a_renewal_that_meets_the_end_of_its_job_says_nothing(house, caplog):
    upload(house)
    with house.database.writing("test") as session:
        claim = claim_next(session, Turn(), lease_s=30.0)
    with house.worker.leases.hold(claim):
        with house.database.writing("test") as session:
            jobs.succeed(session, claim, {})
        assert house.worker.leases.renew() == 1
    assert caplog.messages == []


def test_a_worker_ends_when_the_schema_is_changed_under_it(house):
    with working(house) as (process, log):
        with house.database.reading() as session:
            session.execute(text("UPDATE alembic_version SET version_num = '9999'"))
            session.commit()
        assert process.wait() == OTHER_SCHEMA_EXIT
    assert "schema 9999" in log.read_text()
    assert "Traceback" not in log.read_text()


def test_a_broker_that_goes_away_leaves_no_traceback(house):
    port = pick_port()
    command = [str(valkey_binary()), "--port", str(port), "--bind", "127.0.0.1", "--save", ""]
    with spawn(command, dict(os.environ), stdout=subprocess.DEVNULL) as valkey:
        address = f"redis://127.0.0.1:{port}/0"
        with working(house, STILB_BROKER_URL=address, answers=True) as (_, log):
            broker = redis.Redis(port=port)
            wait_for(
                lambda: any("brpop" in client["cmd"] for client in broker.client_list()), "the worker listens"
            )
            broker.close()
            valkey.kill()
            wait_for(lambda: "Connection to broker lost" in log.read_text(), "the worker notices")
            wait_for(lambda: "Cannot connect" in log.read_text(), "the worker tries again")
        assert "Traceback" not in log.read_text()
