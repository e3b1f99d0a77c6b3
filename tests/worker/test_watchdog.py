"""A worker that takes no job while one waits ends; one that works, or has nothing to do, lives."""

import os
import signal
import subprocess
import sys
import time

import pytest

from store import jobs
from store.pulse import read_beat
from store.tables import Organisation
from tests.support.processes import wait_until
from worker.leases import Leases
from worker.watchdog import STALLED_EXIT

pytestmark = pytest.mark.either_database

WATCHED = """
import sys, time
from store.database import Database
from store.parts import Presence
from store.pulse import Pulse
from worker.leases import Leases
from worker.watchdog import Watchdog

database = Database(sys.argv[1])
presence = Presence(database, "worker")
pulse = Pulse(sys.argv[5] if sys.argv[5:] else "")
watchdog = Watchdog(database, Leases(database, 30.0), presence, pulse, stall_s=float(sys.argv[4]))
print("up", flush=True)
end = time.monotonic() + float(sys.argv[2])
while time.monotonic() < end:
    if sys.argv[3] != "idles":
        watchdog.worked()
    if sys.argv[3] != "sweeps not":
        watchdog.swept()
    time.sleep(0.02)
"""
STALL_S = 1.0


def enqueue(database):
    with database.writing("test") as session:
        session.add(Organisation(id="org_1", name="house"))
        session.flush()
        jobs.enqueue(session, kind="fit", subject_id="c", organisation_id="org_1", by="test", parameters={})


@pytest.mark.parametrize(
    ("waits", "does", "lasts", "code"),
    [(True, "idles", "60", STALLED_EXIT), (True, "works", "1", 0), (False, "idles", "1", 0)],
)
def test_only_an_idle_worker_with_jobs_waiting_ends(database, database_url, waits, does, lasts, code):
    if waits:
        enqueue(database)
    argv = [sys.executable, "-c", WATCHED, database_url, lasts, does, "0.2"]
    assert subprocess.run(argv, check=False).returncode == code


def test_the_time_in_which_the_worker_was_stopped_itself_does_not_count(database, database_url):
    enqueue(database)
    argv = [sys.executable, "-c", WATCHED, database_url, "60", "works", str(STALL_S)]
    with subprocess.Popen(argv, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"up\n"
        os.kill(process.pid, signal.SIGSTOP)
        time.sleep(2 * STALL_S)
        os.kill(process.pid, signal.SIGCONT)
        time.sleep(STALL_S / 4)
        assert process.poll() is None
        process.kill()


def test_a_worker_whose_threads_stand_still_has_no_pulse(database_url, tmp_path):
    """The watchdog's own thread lives on; that alone is no sign of work, nor is work if lost jobs wait."""
    for does, beats in (("idles", False), ("sweeps not", False), ("works", True)):
        path = tmp_path / does
        argv = [sys.executable, "-c", WATCHED, database_url, "60", does, "0.4", path]
        with subprocess.Popen(argv, stdout=subprocess.PIPE) as process:
            assert process.stdout.readline() == b"up\n"
            time.sleep(0.5)
            before, until = read_beat(path), time.monotonic() + (30.0 if beats else 0.5)
            while read_beat(path) == before and time.monotonic() < until:
                time.sleep(0.05)
            assert (read_beat(path) != before) is beats
            process.kill()


def test_a_job_that_comes_no_further_is_not_held_for_ever(database):
    enqueue(database)
    leases = Leases(database, 0.3, stuck_s=0.5)
    with database.writing("test") as session:
        claim = jobs.claim_next(session, jobs.Turn(), lease_s=0.3)
    with leases.hold(claim):
        assert leases.count == 1
        wait_until(lambda: leases.count == 0, "the end of patience")
        leases.report(claim, 0.5)
        assert leases.count == 1
