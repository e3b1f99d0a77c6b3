"""The launcher's promises with what it really launches; the dummies of tests/service ask for more of them."""

import os
import shutil
import sqlite3
import subprocess
import sys
import uuid
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from service.up import ROSTER
from tests.support.compose import ROOT
from tests.support.deployments import short_folder, spawn, wait_for
from tests.support.processes import alive, family, marked

UP = [sys.executable, "-m", "service.up"]


@pytest.fixture
def data():
    with short_folder() as folder:
        yield folder / "data"


@contextmanager
def started(command, data):
    """Start it, and give the process and the mark that all its descendants bear."""
    name, value = "STILB_TEST_MARK", str(uuid.uuid4())
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    port = data.with_name("port")
    port.write_text("0\n")
    environment = os.environ | {
        "STILB_DATA": str(data), "STILB_PORT_FILE": str(port), "PATH": path, name: value
    }  # fmt: skip
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with spawn(command, environment, **pipes) as process:
        try:
            yield process, f"{name}={value}"
        finally:
            process.kill()


def refused(data):
    with started(UP, data) as (process, mark):
        out, err = process.communicate(timeout=60)
        assert (out, err.count("\n")) == ("", 1)
        assert not marked(mark)
        return process.returncode, err.strip()


def test_a_second_start_on_the_same_data_is_refused_and_the_first_goes_on(embedded):
    data, pid = embedded.data, embedded.launcher.pid
    assert refused(data) == (4, f"stilb: stilb already runs on {data}, as process {pid}")
    assert embedded.serves()


def test_data_of_a_newer_stilb_are_refused_and_left_alone(data, migrated_sqlite):
    data.mkdir(mode=0o700)
    shutil.copy(migrated_sqlite, data / "stilb.sqlite")
    with closing(sqlite3.connect(data / "stilb.sqlite")) as database:
        database.execute("UPDATE alembic_version SET version_num = '9999'")
        database.commit()
    code, line = refused(data)
    assert code == 3
    assert line == "stilb: the database has schema 9999, which is newer than this stilb; start the newer one"
    with closing(sqlite3.connect(data / "stilb.sqlite")) as database:
        assert database.execute("SELECT version_num FROM alembic_version").fetchall() == [("9999",)]


def test_where_no_database_answers_a_supervisor_may_start_it_again(data, monkeypatch):
    monkeypatch.setenv("STILB_DATABASE_URL", "postgresql+psycopg://stilb@127.0.0.1:1/stilb")
    code, line = refused(data)
    assert (code, "Connection refused" in line) == (1, True)
    unit = (ROOT / "docs/deploy/stilb.service").read_text()
    assert "RestartPreventExitStatus=2 3 4" in unit


def test_nothing_outlives_a_killed_make(data):
    """Nor the launcher, which ends with it."""
    up = ["make", "-s", "-C", str(ROOT), "-o", ".venv/run", "up"]
    with started(up, data) as (process, mark):
        assert process.stdout.readline().startswith("ready ")
        tree = family(process.pid)
        assert len(tree) >= 2 + len(ROSTER.parts)  # the launcher, Valkey and its parts
        process.kill()
        # A decoder looks for its parent twice a second.
        wait_for(lambda: not alive(tree) and not marked(mark))
