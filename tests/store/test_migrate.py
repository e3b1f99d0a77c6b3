"""Migrations go up and down on both databases, and end where the tables say."""

from concurrent.futures import ThreadPoolExecutor

import pytest
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import inspect, text

from store.database import Database
from store.migrate import NewerSchema, alembic_config, migrate
from store.tables import Base

pytestmark = pytest.mark.slow


@pytest.fixture(params=["sqlite", "postgresql"])
def empty(request, tmp_path):
    if request.param == "sqlite":
        database = Database(f"sqlite:///{tmp_path / 'empty.sqlite'}")
    else:
        database = Database(request.getfixturevalue("postgres").new_database())
    yield database
    database.dispose()


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


def test_up_down_and_up_again(empty):
    migrate(empty)
    downgrade(empty, "base")
    assert set(inspect(empty.engine).get_table_names()) <= {"alembic_version"}
    migrate(empty)
    assert "publication" in inspect(empty.engine).get_table_names()


def test_each_step_down_leaves_the_one_before(empty):
    migrate(empty)
    downgrade(empty, "-1")
    migrate(empty)
    with empty.engine.connect() as connection:
        assert MigrationContext.configure(connection).get_current_revision() is not None


def test_a_newer_database_is_refused_and_left_alone(empty):
    migrate(empty)
    with empty.engine.begin() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '9999'"))
    with pytest.raises(NewerSchema, match="9999"):
        migrate(empty)
    with empty.engine.connect() as connection:
        assert connection.scalar(text("SELECT version_num FROM alembic_version")) == "9999"


def test_several_that_start_at_once_migrate_once(postgres):
    url = postgres.new_database()

    def start(_):
        database = Database(url)
        migrate(database)
        database.dispose()

    with ThreadPoolExecutor(4) as threads:
        list(threads.map(start, range(4)))
