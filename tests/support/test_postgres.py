import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import sqlalchemy

from tests.support import postgres as support
from tests.support.postgres import postgres, postgres_url  # noqa: F401 (fixtures)
from tests.support.processes import alive, family, wait_until

START_AND_WAIT = """
import time
from tests.support.postgres import PostgresServer
with PostgresServer() as server:
    print(server.pid, flush=True)
    time.sleep(60)
"""


def query(url, sql):
    engine = sqlalchemy.create_engine(url)
    try:
        with engine.begin() as connection:
            result = connection.execute(sqlalchemy.text(sql))
            return result.all() if result.returns_rows else None
    finally:
        engine.dispose()


def test_it_is_the_version_that_the_compose_file_runs(postgres_url):  # noqa: F811
    assert query(postgres_url, "SHOW server_version")[0][0].startswith("18.")


def test_it_dies_with_a_killed_test_process():
    command = [sys.executable, "-c", START_AND_WAIT]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        server = int(process.stdout.readline())
        tree = family(server)
        assert len(tree) > 3
        folder = Path(Path(f"/proc/{server}/cmdline").read_text().split("\0")[2]).parent
        process.send_signal(signal.SIGKILL)
    wait_until(lambda: not alive(tree))
    support.remove_abandoned_folders()
    assert folder.exists()
    os.utime(folder, times=(time.time() - 61,) * 2)
    support.remove_abandoned_folders()
    assert not folder.exists()
