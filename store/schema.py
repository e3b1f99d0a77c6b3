"""Which schema a database has, and whether it is the one that this code was written for."""

from sqlalchemy import text
from sqlalchemy.exc import OperationalError, ProgrammingError, SQLAlchemyError
from sqlalchemy.orm import Session

from store.revision import own_schema

_VERSION = text("SELECT version_num FROM alembic_version")

OTHER_SCHEMA_EXIT = 3
"""The exit code of a process that finds a database of another stilb."""


class SchemaDiffers(SQLAlchemyError):  # noqa: N818  it says what was found
    """The database has the schema of another stilb than this one."""

    def __init__(self, found: str | None) -> None:
        if found is None:
            what = "has no schema yet"
        elif found > own_schema():
            what = f"has schema {found}, which is newer than this stilb"
        else:
            what = f"has schema {found}, which is older than this stilb's {own_schema()}"
        super().__init__(f"the database {what}")
        self.found = found


def require_own_schema(session: Session) -> None:
    """Raise `SchemaDiffers` unless the database is this code's."""
    try:
        found = session.scalar(_VERSION)
    except (ProgrammingError, OperationalError) as error:
        if not is_about_missing_parts(error):
            raise
        found = None
    if found != own_schema():
        raise SchemaDiffers(found)


def is_about_missing_parts(error: ProgrammingError | OperationalError) -> bool:
    """Return whether a table or column is missing, which SQLite reports as it reports a locked file."""
    words = str(error.orig)
    return isinstance(error, ProgrammingError) or "no such" in words or "has no column" in words
