"""Revisions of the schema that this code knows, read without a database library."""

import sqlite3
from contextlib import closing
from functools import cache
from pathlib import Path

MIGRATIONS = Path(__file__).parent.parent / "migrations"


@cache
def list_revisions() -> list[str]:
    """Return the revisions in their order: migrations are numbered, and their files begin with the number."""
    return sorted(path.name.partition("_")[0] for path in (MIGRATIONS / "versions").glob("[0-9]*.py"))


def own_schema() -> str:
    """Return the last revision of this code."""
    return list_revisions()[-1]


def is_current(url: str) -> bool:
    """Return True if an SQLite database is known to have this code's schema; False for any other."""
    scheme, _, path = url.partition(":///")
    if scheme != "sqlite" or not Path(path).is_file():
        return False
    try:
        with closing(sqlite3.connect(path, timeout=1.0)) as connection:
            return connection.execute("SELECT version_num FROM alembic_version").fetchall() == [
                (own_schema(),)
            ]
    except sqlite3.Error:
        return False
