"""/livez and /readyz: quick whatever hangs, and true."""

import gc
import os
import sqlite3
import subprocess
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import httpx
import pytest
from alembic.script import ScriptDirectory
from sqlalchemy import text, update

from service import __main__ as serve
from service.system.health import Health
from service.up import WORKER
from store.blobs import StorageFull, StorageUnavailable
from store.blobs.objects import ObjectBlobs
from store.database import OTHER_SCHEMA_EXIT, Database
from store.jobs.processes import Presence
from store.migrate import alembic_config
from store.software import own_schema
from store.tables import PartRow, utc_now
from tests.support.alone import alone
from tests.support.house import CAMERA
from tests.support.processes import wait_until
from tests.support.proxy import Proxy
from tests.support.waiting import PATIENCE_S

pytestmark = pytest.mark.either_database


def ready(house, *, status=200):
    answer = house.http.get("/readyz")
    assert answer.status_code == status, answer.text
    return answer.json()


def look_anew(house, *, check=None, blobs=None, database=None):
    """Forget what the checks have found; `check` stands for that of the file store."""
    blobs = SimpleNamespace(check=check) if check else blobs or house.blobs
    health = Health(database or house.database, blobs)
    house.app.state.context = replace(house.app.state.context, health=health)


@pytest.fixture(autouse=True)
def _soon_stale(monkeypatch):
    """What was found a moment ago is looked at again."""
    monkeypatch.setattr("service.system.health._FRESH_S", STALE_AFTER_S / 2)


STALE_AFTER_S = 0.2


def test_who_does_the_work_is_told_and_without_them_it_serves_and_says_so(house):
    found = ready(house)
    no_worker = "no worker is at work: jobs wait"
    assert (found["status"], found["warnings"]) == ("degraded", [no_worker])
    Presence(house.database, "worker", sandbox="full").beat()
    look_anew(house)
    found = ready(house)
    assert (found["status"], found["warnings"]) == ("ok", [])
    assert [(part["kind"], part["state"]) for part in found["parts"]] == [("worker", "working")]
    assert found["parts"][0]["details"] == {"sandbox": "full"}
    with house.database.writing("test") as session:
        session.execute(update(PartRow).values(worked_at=utc_now().replace(year=2020)))
    look_anew(house)
    found = ready(house)
    assert (found["status"], found["warnings"]) == ("degraded", [no_worker, "a worker hangs"])


@pytest.mark.parametrize("error", [StorageUnavailable("no"), StorageFull("no"), PermissionError("no")])
def test_a_file_store_that_takes_nothing(house, error):
    look_anew(house, check=Mock(side_effect=error))
    found = ready(house, status=503)
    assert (found["code"], found["retryable"]) == ("storage_unavailable", True)
    assert found["checks"] == {"database": "ok", "writing": "ok", "files": "The file store takes no files."}


def test_a_file_store_that_hangs_costs_one_thread_however_many_ask(house):
    go_on = threading.Event()
    check = Mock(side_effect=lambda: go_on.wait(600))
    look_anew(house, check=check)
    try:
        with ThreadPoolExecutor(8) as pool:
            answers = list(pool.map(lambda _: house.http.get("/readyz"), range(8)))
        assert {answer.json()["code"] for answer in answers} == {"storage_unavailable"}
        assert check.call_count == 1
    finally:
        go_on.set()
    wait_until(lambda: house.http.get("/readyz").status_code == 200)


def test_a_passing_slowness_is_named_and_does_not_end_readiness(house):
    go_on = threading.Event()
    go_on.set()
    look_anew(house, check=lambda: go_on.wait(600))
    assert ready(house)["warnings"][1:] == []
    go_on.clear()
    time.sleep(STALE_AFTER_S)
    try:
        slow = ready(house)
        assert slow["status"] == "degraded"
        assert slow["warnings"][1].startswith("the check of files has taken ")
        assert ready(house, status=503)["checks"]["files"].startswith("It has not answered for ")
    finally:
        go_on.set()
    wait_until(lambda: house.http.get("/readyz").json().get("warnings", [])[2:] == [])


def test_what_a_slow_look_found_long_ago_is_not_news(house):
    """Nobody was there to hear of it: the store answered in the end, and went away since."""
    answers, away = threading.Semaphore(1), threading.Event()

    def check():
        answers.acquire()
        if away.is_set():
            raise StorageUnavailable("away")

    look_anew(house, check=check)
    ready(house)
    time.sleep(STALE_AFTER_S)
    assert ready(house)["warnings"][1].startswith("the check of files has taken ")
    answers.release()
    time.sleep(3 * STALE_AFTER_S)
    away.set()
    answers.release()
    assert ready(house, status=503)["code"] == "storage_unavailable"


def test_s3_that_is_away_ends_readiness_at_the_first_look(
    house, s3_bucket, s3_endpoint, tmp_path, monkeypatch
):
    host, port = s3_endpoint.removeprefix("http://").split(":")
    monkeypatch.setattr("service.system.health._TRUSTED_FOR_S", 0.0)
    with Proxy((host, int(port))) as proxy:
        blobs = ObjectBlobs(f"s3://{s3_bucket}/x", tmp_path, endpoint=f"http://{proxy.address}")
        look_anew(house, blobs=blobs)
        for mode in ("away", "failing", "silent"):
            wait_until(lambda: house.http.get("/readyz").status_code == 200)
            time.sleep(STALE_AFTER_S)
            with proxy.being(mode):
                assert ready(house, status=503)["code"] == "storage_unavailable", mode


@pytest.mark.both_databases
def test_a_schema_of_another_stilb(house, caplog, monkeypatch):
    house.database.guard_schema()
    with house.database.reading() as session:
        session.execute(text("UPDATE alembic_version SET version_num = '9999'"))
        session.commit()
    look_anew(house)
    found = ready(house, status=503)
    assert found["code"] == "schema_mismatch"
    assert "9999, which is newer than this stilb" in found["detail"]
    assert house.post("/v1/cameras", CAMERA, status=503)["code"] == "schema_mismatch"
    # A read that meets what was changed is no fault of ours either.
    with house.database.reading() as session:
        session.execute(text("ALTER TABLE camera RENAME COLUMN note TO remark"))
        session.commit()
    assert house.get("/v1/cameras", status=503)["code"] == "schema_mismatch"
    gc.collect()
    assert not [record for record in caplog.records if record.exc_info]
    # nor does a service start on it
    monkeypatch.setattr("store.logs.configure_logging", lambda _: None)
    monkeypatch.setattr(serve, "build_context", lambda _: house.app.state.context)
    monkeypatch.setenv("STILB_DATA", str(house.folder))
    assert serve.main() == OTHER_SCHEMA_EXIT
    assert "the database has schema 9999, which is" in caplog.text


def test_a_database_that_only_reads(postgres, migrated_postgres, house):
    url = postgres.new_database(like=migrated_postgres)
    copy = Database(f"{url}&options=-c%20default_transaction_read_only=on")
    look_anew(house, database=copy)
    assert ready(house, status=503)["checks"]["writing"] == "The database takes no writes."
    copy.dispose()
    postgres.drop_database(url)


def test_a_database_that_swallows_packets(postgres, migrated_postgres, house):
    url = postgres.new_database(like=migrated_postgres)
    folder, name = Path(url.partition("?host=")[2]), url.partition("?")[0].rpartition("/")[2]
    with Proxy(folder / ".s.PGSQL.5432") as proxy:
        silent = Database(f"postgresql+psycopg://stilb@{proxy.address}/{name}", answer_within_s=1.0)
        look_anew(house, database=silent)
        ready(house)
        threads = threading.active_count()
        with proxy.being("silent"):
            time.sleep(STALE_AFTER_S)
            answers = [house.http.get("/readyz") for _ in range(3)]
            # The first may be the last one that trusts what was found before.
            assert {answer.json().get("code") for answer in answers[1:]} == {"database_unavailable"}
            assert threading.active_count() <= threads + 1
        wait_until(lambda: house.http.get("/readyz").status_code == 200)
        silent.dispose()
    postgres.drop_database(url)


def test_it_lives_while_every_thread_waits_for_a_lock(migrated_sqlite, tmp_path):
    """64 requests want to write behind a lock, more than there are threads."""
    with (
        alone(tmp_path, migrated_sqlite) as service,
        service.team() as team,
        team.http() as http,
        closing(sqlite3.connect(tmp_path / "stilb.sqlite", isolation_level=None)) as other,
        ThreadPoolExecutor(64) as pool,
    ):
        other.execute("BEGIN IMMEDIATE")
        posts = [pool.submit(http.post, "/v1/cameras", json=CAMERA) for _ in range(64)]
        time.sleep(1.0)
        assert httpx.get(f"{service.url}/livez", timeout=PATIENCE_S).status_code == 200
        assert not any(post.done() for post in posts)
        other.execute("ROLLBACK")
        assert {post.result().status_code for post in posts} <= {200, 201}


def test_no_worker_starts_on_the_schema_of_another_stilb(migrated_sqlite, tmp_path):
    path = tmp_path / "stilb.sqlite"
    path.write_bytes(migrated_sqlite.read_bytes())
    with closing(sqlite3.connect(path)) as database:
        database.execute("UPDATE alembic_version SET version_num = '0001'")
        database.commit()
    environment = os.environ | {"STILB_DATA": str(tmp_path)}
    ended = subprocess.run(WORKER, env=environment, capture_output=True, text=True, check=False)
    assert ended.returncode == OTHER_SCHEMA_EXIT
    (line,) = [line for line in ended.stderr.splitlines() if " ERROR " in line]
    assert "the database has schema 0001, which is" in line
    assert "Traceback" not in ended.stderr


def test_the_own_schema_is_the_head_of_the_migrations():
    assert own_schema() == ScriptDirectory.from_config(alembic_config()).get_current_head()
