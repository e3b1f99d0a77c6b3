"""Brings a database to the schema of this code. ``python -m store.migrate`` does it and says so."""

import sys
from typing import TYPE_CHECKING

from sqlalchemy import Connection, inspect, text
from sqlalchemy.orm import Session

from store.database import Database
from store.revision import MIGRATIONS, list_revisions, own_schema
from store.settings import read_settings

if TYPE_CHECKING:
    from alembic.config import Config

_ADVISORY_LOCK = 0x5711B
_LOCK_WITHIN_S = 60


class NewerSchema(Exception):  # noqa: N818  it says what was found
    """The database was written by a newer stilb than this one."""


def migrate(database: Database, revision: str = "head") -> None:
    """Upgrade to a revision; refuse a database that knows revisions this code does not.

    What today's code derives from rows (store/ready) is then written for the rows of before.

    On PostgreSQL several processes may start at once: an advisory lock lets one migrate, the others wait.
    """
    with database.engine.connect() as connection, connection.begin():
        if not database.is_sqlite:
            connection.execute(text("SET LOCAL lock_timeout = 0"))
            connection.execute(text("SELECT pg_advisory_xact_lock(:lock)"), {"lock": _ADVISORY_LOCK})
            # Everybody who comes after one that waits to change a table waits too.
            connection.execute(text(f"SET LOCAL lock_timeout = '{_LOCK_WITHIN_S} s'"))
        current = _read_revision(connection)
        if current == own_schema() and revision == "head":
            return
        if current is not None and current not in list_revisions():
            raise NewerSchema(f"the database has schema {current}, which is newer than this stilb")
        from alembic import command

        config = alembic_config()
        config.attributes["connection"] = connection
        command.upgrade(config, revision)
        if _read_revision(connection) == own_schema():
            from store.ready.backfill import write_missing

            with Session(connection, join_transaction_mode="rollback_only") as session:
                write_missing(session)
                session.flush()


def _read_revision(connection: Connection) -> str | None:
    known = inspect(connection).has_table("alembic_version")
    found: str | None = (known and connection.scalar(text("SELECT version_num FROM alembic_version"))) or None
    return found


def alembic_config() -> "Config":
    """Return Alembic's configuration, without a file: where the migrations are is known."""
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS))
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
