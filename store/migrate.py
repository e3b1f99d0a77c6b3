"""Brings a database to the schema of this code. ``python -m store.migrate`` does it and says so."""

import sys
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import text
from sqlalchemy.orm import Session

from store.database import Database
from store.ready.backfill import write_missing
from store.schema import own_schema
from store.settings import read_settings

_ADVISORY_LOCK = 0x5711B
_LOCK_WITHIN_S = 60


class NewerSchema(Exception):  # noqa: N818  it says what was found
    """The database was written by a newer stilb than this one."""


def migrate(database: Database, revision: str = "head") -> None:
    """Upgrade to a revision; refuse a database that knows revisions this code does not.

    What today's code derives from rows (store/ready) is then written for the rows of before.

    On PostgreSQL several processes may start at once: an advisory lock lets one migrate, the others wait.
    """
    config = alembic_config()
    with database.engine.connect() as connection, connection.begin():
        if not database.is_sqlite:
            connection.execute(text("SET LOCAL lock_timeout = 0"))
            connection.execute(text("SELECT pg_advisory_xact_lock(:lock)"), {"lock": _ADVISORY_LOCK})
            # Everybody who comes after one that waits to change a table waits too.
            connection.execute(text(f"SET LOCAL lock_timeout = '{_LOCK_WITHIN_S} s'"))
        current = MigrationContext.configure(connection).get_current_revision()
        known = {script.revision for script in ScriptDirectory.from_config(config).walk_revisions()}
        if current is not None and current not in known:
            raise NewerSchema(f"the database has schema {current}, which is newer than this stilb")
        config.attributes["connection"] = connection
        command.upgrade(config, revision)
        if MigrationContext.configure(connection).get_current_revision() == own_schema():
            with Session(connection, join_transaction_mode="rollback_only") as session:
                write_missing(session)
                session.flush()


def alembic_config() -> Config:
    """Alembic's configuration, without a file: where the migrations are is known."""
    config = Config()
    config.set_main_option("script_location", str(Path(__file__).parent.parent / "migrations"))
    config.set_main_option("path_separator", "os")
    return config


def main() -> int:
    database = Database(read_settings().effective_database_url, answer_within_s=None)
    try:
        migrate(database)
    except NewerSchema as error:
        print(f"stilb: {error}; start the newer one", file=sys.stderr)  # noqa: T201
        return 3
    finally:
        database.dispose()
    return 0


if __name__ == "__main__":
    sys.exit(main())
