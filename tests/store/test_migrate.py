"""Migrations go up and down on both databases, and end where the tables say."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from threading import Barrier

import pytest
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import CheckConstraint, func, inspect, select, text
from sqlalchemy.exc import IntegrityError

from service.__main__ import found
from store.database import Database, SchemaDiffers
from store.migrate import alembic_config, find_difference, main, migrate
from store.publications import publish
from store.software import own_schema
from store.tables import ApiKey, Base, Calibration, ReadyAnswer, ReadyCells, ReadyRow
from tests.support.compose import ROOT
from tests.support.versions import add_versions
from verify.audit import main as check_audit


def downgrade(database, revision):
    config = alembic_config()
    with database.engine.connect() as connection, connection.begin():
        config.attributes["connection"] = connection
        command.downgrade(config, revision)


def test_the_migrations_make_exactly_the_tables(empty):
    migrate(empty)
    with empty.engine.connect() as connection:
        context = MigrationContext.configure(connection, opts={"compare_type": True})
        assert compare_metadata(context, Base.metadata) == []
    made = inspect(empty.engine)
    for table in Base.metadata.sorted_tables:
        prefix = f"ck_{table.name}_"  # which some names have twice
        stated = {each.name for each in table.constraints if isinstance(each, CheckConstraint)}
        found = {each["name"].removeprefix(prefix) for each in made.get_check_constraints(table.name)}
        assert {each.removeprefix(prefix) for each in found} == {each.removeprefix(prefix) for each in stated}


def test_a_check_tells_another_schema_and_a_newer_one_is_left_alone(empty):
    url = empty.url.render_as_string(hide_password=False)
    migrate(empty, "0031")
    before = inspect(empty.engine).get_table_names()
    assert "has schema 0031, and this stilb needs" in find_difference(url)
    assert inspect(empty.engine).get_table_names() == before
    migrate(empty)
    assert find_difference(url) is None
    with empty.engine.begin() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '9999'"))
    assert "9999, which is newer" in find_difference(url)
    with pytest.raises(SchemaDiffers, match="9999"):
        migrate(empty)
    with empty.engine.connect() as connection:
        assert connection.scalar(text("SELECT version_num FROM alembic_version")) == "9999"


def test_a_database_that_cannot_be_used_is_a_line_that_says_why(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("STILB_DATABASE_URL", "postgresql+psycopg://stilb@127.0.0.1:1/stilb")
    monkeypatch.setenv("STILB_DATA", str(tmp_path))
    monkeypatch.setattr("sys.argv", ["migrate"])
    assert (main(), check_audit([])) == (os.EX_TEMPFAIL, 1)
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 2
    assert all("Connection refused" in line for line in told)


def test_the_console_commands_check_and_show_the_schema(tmp_path, monkeypatch, capsys):
    """`alembic` reads its settings from the checkout; nothing makes a database to check it."""
    path = tmp_path / "stilb.sqlite"
    monkeypatch.setenv("STILB_DATABASE_URL", f"sqlite:///{path}")
    monkeypatch.setenv("STILB_DATA", str(tmp_path))

    def run(*arguments):
        monkeypatch.setattr("sys.argv", ["migrate", *arguments])
        return main(), *capsys.readouterr()

    code, _, said = run("--check")
    assert (code, "there is no database" in said, path.exists()) == (1, True, False)
    assert run()[0] == 0
    assert run("--check") == (0, "", "")

    def ask_alembic(*words):
        command = [sys.executable, "-m", "alembic", *words]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)
        return done.returncode, done.stdout + done.stderr

    code, said = ask_alembic("current")
    assert (code, f"{own_schema()} (head)" in said) == (0, True)
    code, said = ask_alembic("downgrade", "-1")
    assert (code, "stilb-server migrate" in said) == (255, True)


def test_kinds_of_campaigns_are_kept_and_no_other_is_taken(database):
    add_versions(database, 1)
    renamed = "UPDATE campaign SET kind = :kind"
    with database.engine.begin() as connection:
        connection.execute(text(renamed), {"kind": "measurement"})
    downgrade(database, "0031")
    migrate(database)
    with database.engine.connect() as connection:
        assert connection.scalar(text("SELECT kind FROM campaign")) == "measurement"
    with pytest.raises(IntegrityError), database.engine.begin() as connection:
        connection.execute(text(renamed), {"kind": "other"})


def test_one_step_down_all_the_way_down_and_up_again(database):
    downgrade(database, "-1")
    migrate(database)
    with database.engine.connect() as connection:
        assert MigrationContext.configure(connection).get_current_revision() == own_schema()
    downgrade(database, "base")
    assert set(inspect(database.engine).get_table_names()) <= {"alembic_version"}
    migrate(database)
    assert "publication" in inspect(database.engine).get_table_names()


def test_several_that_start_at_once_migrate_and_make_the_first_key_once(postgres):
    url, together = postgres.new_database(), Barrier(4)

    def start(_):
        database = Database(url)
        migrate(database)
        together.wait(60)
        found(database, "first")
        with database.reading() as session:
            keys = session.scalar(select(func.count()).select_from(ApiKey))
        database.dispose()
        return keys

    with ThreadPoolExecutor(4) as threads:
        assert list(threads.map(start, range(4))) == [1] * 4


def test_ready_rows_are_written_for_what_was_published_before(database):
    first, second = add_versions(database, 2)
    with database.writing("test") as session:
        for version, month in ((first, 1), (second, 3)):
            start = datetime(2026, month, 1, tzinfo=UTC)
            calibration = session.get_one(Calibration, version)
            publish(session, calibration, valid_from=start, valid_to=None, reason="r")

    def read():
        with database.reading() as session:
            return [
                session.execute(select(table.__table__).order_by(table.publication_id)).all()
                for table in (ReadyRow, ReadyAnswer, ReadyCells)
            ]

    rows = read()
    assert [len(each) for each in rows] == [3, 3, 3]
    downgrade(database, "0013")
    migrate(database)
    assert read() == rows
