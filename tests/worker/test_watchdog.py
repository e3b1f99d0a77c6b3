"""A worker that takes no job while one waits ends; one that works, or has nothing to do, lives."""

import subprocess
import sys

import pytest

from store import jobs
from store.tables import Organisation
from worker.watchdog import STALLED_EXIT

WATCHED = """
import sys, time
from store.database import Database
from worker.leases import Leases
from worker.watchdog import Watchdog

database = Database(sys.argv[1])
watchdog = Watchdog(database, Leases(database, 30.0), stall_s=0.2)
end = time.monotonic() + float(sys.argv[2])
while time.monotonic() < end:
    if sys.argv[3] == "works":
        watchdog.worked()
    time.sleep(0.02)
"""


@pytest.mark.parametrize(
    ("waits", "does", "lasts", "code"),
    [(True, "idles", "60", STALLED_EXIT), (True, "works", "1", 0), (False, "idles", "1", 0)],
)
def test_only_an_idle_worker_with_jobs_waiting_ends(database, database_url, waits, does, lasts, code):
    if waits:
        with database.writing("test") as session:
            session.add(Organisation(id="org_1", name="house"))
            session.flush()
            jobs.enqueue(
                session, kind="fit", subject_id="c", organisation_id="org_1", by="test", parameters={}
            )
    argv = [sys.executable, "-c", WATCHED, database_url, lasts, does]
    assert subprocess.run(argv, check=False, timeout=90).returncode == code
