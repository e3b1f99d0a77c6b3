"""Brings a database to the schema of this code. ``python -m store.migrate`` does it and says so."""

import argparse
import os
import sys
import traceback
from pathlib import Path
from typing import TYPE_CHECKING

from sqlalchemy import Connection, create_engine, inspect, make_url, text
from sqlalchemy.exc import OperationalError, SQLAlchemyError
from sqlalchemy.orm import Session

from store.database import Database, SchemaDiffers, summarise
from store.settings import read_settings
from store.software import MIGRATIONS, list_revisions, own_schema

if TYPE_CHECKING:
    from alembic.config import Config

_ADVISORY_LOCK = 0x5711B
_LOCK_WITHIN_S = 60


def migrate(database: Database, revision: str = "head") -> None:
    """Upgrade to a revision; refuse a database that knows revisions this code does not."""
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
            raise SchemaDiffers(current)
        from alembic import command

        config = alembic_config()
        config.attributes["connection"] = connection
        command.upgrade(config, revision)
        if current is not None and _read_revision(connection) == own_schema():
            from store.ready.rows import write_missing  # noqa: PLC0415  it loads all methods

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


def find_difference(url: str) -> str | None:
    """Return in a sentence how a database's schema differs from that of this code; None where it does not."""
    address = make_url(url)
    is_sqlite = address.get_backend_name() == "sqlite"
    if is_sqlite and not Path(address.database or "").is_file():
        return f"there is no database at {address.database}: `stilb-server migrate` makes it"
    read_only = f"sqlite:///file:{address.database}?mode=ro&uri=true"
    engine = create_engine(read_only) if is_sqlite else Database(url).engine
    try:
        with engine.connect() as connection:
            current = _read_revision(connection)
    except SQLAlchemyError as error:
        return f"the database cannot be read: {summarise(error)}"
    finally:
        engine.dispose()
    if current == own_schema():
        return None
    if current is not None and current not in list_revisions():
        return f"{SchemaDiffers(current)}; start the newer one"
    found = f"schema {current}" if current else "no schema of stilb"
    return f"the database has {found}, and this stilb needs {own_schema()}: run `stilb-server migrate`"


def main() -> int:
    parser = argparse.ArgumentParser(prog="stilb-server migrate", description=__doc__)
    parser.add_argument("--check", action="store_true", help="change nothing")
    asked, url = parser.parse_args(), read_settings().effective_database_url
    if asked.check:
        if (difference := find_difference(url)) is not None:
            print(f"stilb: {difference}", file=sys.stderr)  # noqa: T201
        return 1 if difference else 0
    database = Database(url, answer_within_s=None)
    try:
        migrate(database)
    except SchemaDiffers as error:
        print(f"stilb: {error}; start the newer one", file=sys.stderr)  # noqa: T201
        return 3
    except SQLAlchemyError as error:
        if not (is_away := isinstance(error, OperationalError)):
            traceback.print_exc()
        reason = f"the database cannot be used: {summarise(error)}; see STILB_DATABASE_URL"
        print(f"stilb: {reason}", file=sys.stderr)  # noqa: T201
        return os.EX_TEMPFAIL if is_away else 2
    finally:
        database.dispose()
    return 0


if __name__ == "__main__":
    sys.exit(main())
