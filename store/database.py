"""One database, two ways in: reading sessions and writing transactions."""

import asyncio
import logging
import sqlite3
import time
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Dialect, Engine, Executable, Select, create_engine, event, text
from sqlalchemy.engine import make_url
from sqlalchemy.exc import OperationalError, ProgrammingError, SQLAlchemyError
from sqlalchemy.orm import Session

from store import audit, revisions, software
from store.jobs.queues import Post, choose_messages


class Conflict(Exception):  # noqa: N818  it says what happened
    """The request contradicts what is recorded; the message says what."""

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code, self.message = code, message


_VERSION = text("SELECT version_num FROM alembic_version")

OTHER_SCHEMA_EXIT = 3  # the exit code of a process that finds a database of another stilb


class SchemaDiffers(SQLAlchemyError):  # noqa: N818  it says what was found
    def __init__(self, found: str | None) -> None:
        if found is None:
            what = "has no schema yet"
        elif found > software.own_schema():
            what = f"has schema {found}, which is newer than this stilb"
        else:
            what = f"has schema {found}, which is older than this stilb's {software.own_schema()}"
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
    if found != software.own_schema():
        raise SchemaDiffers(found)


def is_about_missing_parts(error: ProgrammingError | OperationalError) -> bool:
    """Return whether a table or column is missing, which SQLite reports as it reports a locked file."""
    words = str(error.orig)
    return isinstance(error, ProgrammingError) or "no such" in words or "has no column" in words


ANSWER_WITHIN_S = 30.0
_ASK_AGAIN_S = 1.0
_POSTGRES_FULL = "53100"

log = logging.getLogger(__name__)


class Database:
    """SQLite or PostgreSQL behind one face.

    ``answer_within_s`` limits a statement, on SQLite the wait for the write lock; None is for work without
    a limit, such as a migration. ``post`` sends the messages of jobs.
    """

    def __init__(
        self, url: str, *, answer_within_s: float | None = ANSWER_WITHIN_S, post: Post | None = None
    ) -> None:
        self.url = make_url(url)
        self.post = post
        self._guarded = False
        self._statements: dict[Select[*tuple[Any, ...]], tuple[str, Mapping[str, Any]]] = {}
        self._cursors: deque[sqlite3.Cursor] = deque()
        self._asking: Any = None
        wait_s = answer_within_s or ANSWER_WITHIN_S
        self.is_sqlite = self.url.get_backend_name() == "sqlite"
        if self.is_sqlite:
            self._reader = _sqlite_engine(url, begin="BEGIN", wait_s=wait_s)
            # at once: two that read, then write, would end in "database is locked" whatever the timeout
            self._writer = _sqlite_engine(url, begin="BEGIN IMMEDIATE", wait_s=wait_s)
            kind: Any = type(self._reader.dialect)
            self._dialect: Dialect = kind(paramstyle="named")
        else:
            from store.postgres import Asking, postgres_engine

            # in a transaction too a statement sees what is committed by then, and costs three more answers
            self._reader = postgres_engine(self.url, answer_within_s=answer_within_s)
            self._writer = self._reader.execution_options(isolation_level="READ COMMITTED")
            self._dialect = self._reader.dialect
            self._asking = Asking(self.url, answer_within_s=wait_s)

    async def ask(
        self, wanted: Select[*tuple[Any, ...]], values: Mapping[str, str | int | datetime]
    ) -> list[tuple[Any, ...]]:
        """Return rows as the driver has them, in the event loop; ``wanted`` is kept: make it once."""
        if wanted not in self._statements:
            compiled = wanted.compile(dialect=self._dialect)
            self._statements[wanted] = compiled.string, compiled.params
        statement, constants = self._statements[wanted]
        bound = {name: self._bind(value) for name, value in values.items()}
        if self._asking is not None:
            found: list[tuple[Any, ...]] = await self._asking.ask(statement, {**constants, **bound})
            return found
        return await self._ask_sqlite(statement, {**constants, **bound})

    def _bind(self, value: str | int | datetime) -> str | int | datetime:
        if not isinstance(value, datetime):
            return value
        # in UTC for PostgreSQL too: it reads no offset from 16 hours on
        utc = value.astimezone(UTC)
        return utc.replace(tzinfo=None).isoformat(" ", "microseconds") if self.is_sqlite else utc

    async def _ask_sqlite(self, statement: str, values: dict[str, Any]) -> list[tuple[Any, ...]]:
        """Ask at once, as each statement is a transaction; only a file that is locked is waited for."""
        try:
            cursor = self._cursors.pop() if self._cursors else self._open_cursor()
            rows = cursor.execute(statement, values).fetchall()
        except sqlite3.OperationalError:
            return await asyncio.to_thread(self._ask_patiently, statement, values)
        self._cursors.append(cursor)
        return rows

    def _ask_patiently(self, statement: str, values: dict[str, Any]) -> list[tuple[Any, ...]]:
        with self._reader.connect() as connection:
            return list(connection.exec_driver_sql(statement, values).cursor.fetchall())

    def _open_cursor(self) -> sqlite3.Cursor:
        pooled = self._reader.raw_connection()
        connection: Any = pooled.driver_connection
        pooled.detach()
        cursor: sqlite3.Cursor = connection.cursor()
        cursor.execute("PRAGMA busy_timeout = 0")
        return cursor

    @property
    def engine(self) -> Engine:
        return self._writer

    def guard_schema(self) -> None:
        """Return once the database answers with this schema; from then on no other is written to."""
        complained = False
        while True:
            try:
                with self.reading() as session:
                    require_own_schema(session)
            except SchemaDiffers:
                raise
            except SQLAlchemyError as error:
                if not complained:
                    log.warning("the database does not answer yet: %s", summarise(error))
                complained = True
                time.sleep(_ASK_AGAIN_S)
            else:
                self._guarded = True
                return

    @contextmanager
    def reading(self, *, snapshot: bool = False) -> Iterator[Session]:
        """Lend a session for reading; with a snapshot all its statements see the same moment."""
        with Session(self._reader, expire_on_commit=False) as session:
            if snapshot and not self.is_sqlite:
                session.connection(execution_options={"isolation_level": "REPEATABLE READ"})
            yield session

    @contextmanager
    def writing(self, actor: str, organisation_id: str | None = None) -> Iterator[Session]:
        """A transaction that commits when the block ends well; its changes are audited as the actor's."""
        with Session(self._writer, expire_on_commit=False) as session:
            session.info["actor"] = actor
            session.info["organisation_id"] = organisation_id
            event.listen(session, "after_flush", audit.record_changes)
            event.listen(session, "after_flush", revisions.note_changes)
            event.listen(session, "after_rollback", _forget_noted)
            if self._guarded:
                require_own_schema(session)
            yield session
            session.flush()
            revisions.raise_revisions(session)
            audit.append_entries(session)
            messages = choose_messages(session) if self.post else []
            session.commit()
        if self.post:
            self.post.send(messages)

    def dispose(self) -> None:
        while self._cursors:
            self._cursors.pop().connection.close()
        if self._asking is not None:
            self._asking.close()
        self._reader.dispose()
        self._writer.dispose()


def _forget_noted(session: Session) -> None:
    """Forget what was noted of changes that were rolled back; a part that is leaves the rest standing."""
    if session.in_nested_transaction():
        return
    for name in ("audit_entries", "changes"):
        session.info.pop(name, None)


def read_plainly(session: Session, wanted: Executable) -> list[Any]:
    """Return rows as the driver has them: SQLAlchemy's own cost more than reading text and numbers."""
    cursor: Any = session.connection().execute(wanted).cursor
    return list(cursor.fetchall())


def summarise(error: Exception) -> str:
    """Return what a driver says in one line, without the statement and the addresses of manuals."""
    words = str(getattr(error, "orig", None) or error).split()
    return " ".join(words)[:300]


def is_full(error: Exception) -> bool:
    cause = getattr(error, "orig", None)
    code, state = (getattr(cause, name, None) for name in ("sqlite_errorcode", "sqlstate"))
    return code == sqlite3.SQLITE_FULL or state == _POSTGRES_FULL


def _sqlite_engine(url: str, *, begin: str, wait_s: float) -> Engine:
    # a pooled connection changes threads, never two at a time
    engine = create_engine(
        url, pool_size=10, max_overflow=30, connect_args={"timeout": wait_s, "check_same_thread": False}
    )

    @event.listens_for(engine, "connect")
    def prepare(connection: sqlite3.Connection, _record: Any) -> None:  # noqa: ANN401
        connection.isolation_level = None  # we say BEGIN ourselves
        cursor = connection.cursor()
        cursor.execute("PRAGMA journal_mode = WAL")
        cursor.execute("PRAGMA synchronous = FULL")  # what was acknowledged survives a power cut
        cursor.execute("PRAGMA foreign_keys = ON")
        cursor.close()

    @event.listens_for(engine, "begin")
    def start(connection: Any) -> None:  # noqa: ANN401
        connection.exec_driver_sql(begin)

    return engine
