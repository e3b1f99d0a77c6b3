"""How long PostgreSQL may take: limits that the server keeps, and one for a server out of reach."""

import asyncio
import math
import select
import time
from collections import deque
from collections.abc import Generator, Mapping
from typing import Any, TypeVar

import psycopg
from psycopg.abc import PQGen
from sqlalchemy import URL, Engine, create_engine, event
from sqlalchemy.dialects.postgresql.psycopg import PGDialect_psycopg
from sqlalchemy.exc import DBAPIError

Result = TypeVar("Result")

_CONNECT_WITHIN_S = 5.0
_PING_WITHIN_S = 2.0
_TRUSTED_FOR_S = 5.0  # after its last answer a connection is taken to live, unless its server has closed it
_WORD_ON_THE_WAY_S = 2.0  # by how much longer than the server's own limit an answer may take
_PLAN_ONCE = "SET plan_cache_mode = force_generic_plan"  # planning a statement again costs more than running
_MOST_ASKED = 8  # statements of an event loop under way at once


def postgres_engine(url: URL, *, answer_within_s: float | None) -> Engine:
    """Connect with limits of statements and locks, which the server keeps, and of its silence; None: without.

    A server out of reach ends nothing, and TCP alone may wait for a quarter of an hour, or for ever.
    """
    limit_s = answer_within_s
    engine = create_engine(
        url,
        pool_size=10,
        max_overflow=30,
        pool_pre_ping=True,
        # most connections are lent for reading, without a transaction
        isolation_level="AUTOCOMMIT",
        skip_autocommit_rollback=True,
        pool_timeout=min(10.0, limit_s or 10.0),
        connect_args=_limits(url, limit_s),
    )
    if limit_s is not None:
        silence_s = limit_s + _WORD_ON_THE_WAY_S

        @event.listens_for(engine, "do_connect")
        def connect(_dialect: object, _record: object, args: Any, values: Any) -> Any:  # noqa: ANN401
            connection = _Connection.connect(*args, **values)
            connection.silence_s = silence_s
            return connection

        ping = engine.dialect.do_ping

        def ping_briefly(connection: Any) -> bool:  # noqa: ANN401
            """Return whether a pooled connection still lives; one that has just answered is not asked."""
            if connection.is_fresh:
                return True
            connection.silence_s = min(_PING_WITHIN_S, silence_s)
            try:
                return ping(connection)
            finally:
                connection.silence_s = silence_s

        engine.dialect.do_ping = ping_briefly  # type: ignore[assignment,method-assign]

    return engine


class _Connection(psycopg.Connection[Any]):
    """Connection that is closed when the server has not answered for so long [s]."""

    silence_s: float
    _answered_at = -math.inf

    @property
    def is_fresh(self) -> bool:
        """Return True if it has just answered and nothing has come since, as does the end of a server."""
        if time.monotonic() - self._answered_at > _TRUSTED_FOR_S or self.closed:
            return False
        poll = select.poll()
        poll.register(self.fileno(), select.POLLIN)
        return not poll.poll(0)

    def wait(self, gen: PQGen[Result], interval: float = 0.1, timeout: float | None = None) -> Result:
        try:
            result = super().wait(_within(gen, self.silence_s), interval, timeout)
        except _Silent:
            # What the server has made of the statement is unknown: nothing else may use this connection.
            self.close()
            raise psycopg.OperationalError(f"no answer within {self.silence_s:g} s") from None
        except psycopg.errors.IdleInTransactionSessionTimeout as ended:
            # this process was stopped amid a transaction: not an error of ours, as its class would have it
            raise psycopg.OperationalError(str(ended)) from None
        self._answered_at = time.monotonic()
        return result


class _Asker(psycopg.AsyncConnection[Any]):
    """The same for an event loop; whatever goes wrong closes it."""

    silence_s: float

    async def wait(self, gen: PQGen[Result], interval: float = 0.1, timeout: float | None = None) -> Result:  # noqa: ASYNC109  the driver's own
        try:
            return await super().wait(_within(gen, self.silence_s), interval, timeout)
        except _Silent:
            self.pgconn.finish()
            raise psycopg.InterfaceError(f"no answer within {self.silence_s:g} s") from None
        except BaseException:
            self.pgconn.finish()
            raise


class Asking:
    """Connections that an event loop asks for rows, each statement a transaction, beside those of threads."""

    def __init__(self, url: URL, *, answer_within_s: float) -> None:
        self._silence_s = answer_within_s + _WORD_ON_THE_WAY_S
        _, options = PGDialect_psycopg().create_connect_args(url)  # type: ignore[no-untyped-call]
        self._options = options | _limits(url, answer_within_s) | {"autocommit": True}
        self._idle: deque[psycopg.AsyncCursor[Any]] = deque()
        self._loop: asyncio.AbstractEventLoop | None = None

    async def ask(self, statement: str, values: Mapping[str, Any]) -> list[tuple[Any, ...]]:
        """Return the rows, by another connection where the server has closed one since its last use."""
        if self._loop is not asyncio.get_running_loop():
            self._loop, self._room = asyncio.get_running_loop(), asyncio.Semaphore(_MOST_ASKED)
        try:
            async with self._room:
                while self._idle:
                    try:
                        return await self._ask(self._idle.pop(), statement, values)
                    except psycopg.errors.QueryCanceled:
                        raise
                    except psycopg.OperationalError:
                        continue
                return await self._ask(await self._connect(), statement, values)
        except psycopg.Error as error:
            raise DBAPIError.instance(statement, None, error, psycopg.Error) from error

    async def _connect(self) -> psycopg.AsyncCursor[Any]:
        connection = await _Asker.connect(**self._options)
        connection.silence_s = self._silence_s
        return await connection.execute(_PLAN_ONCE)

    async def _ask(
        self, cursor: psycopg.AsyncCursor[Any], statement: str, values: Mapping[str, Any]
    ) -> list[tuple[Any, ...]]:
        await cursor.execute(statement, values, prepare=True, binary=True)
        rows = await cursor.fetchall()
        self._idle.append(cursor)
        return rows

    def close(self) -> None:
        while self._idle:
            connection = self._idle.pop().connection  # a name keeps it: dropped while open, it complains
            connection.pgconn.finish()


class _Silent(Exception):  # noqa: N818  it is what happened
    """Nothing was heard for too long."""


def _within(gen: PQGen[Result], limit_s: float) -> Generator[Any, Any, Result]:
    """Pass on what the driver waits for, and what comes; as long as something comes, it may go on."""
    heard = time.monotonic()
    try:
        wanted = next(gen)
        while True:
            ready = yield wanted
            if ready:
                heard = time.monotonic()
            elif time.monotonic() - heard > limit_s:
                raise _Silent
            wanted = gen.send(ready)
    except StopIteration as end:
        result: Result = end.value
        return result


def _limits(url: URL, limit_s: float | None) -> dict[str, Any]:
    options = ""
    if limit_s is not None and "options" not in url.query:  # else the operator's own
        limits = {
            "statement_timeout": limit_s,
            "lock_timeout": limit_s / 3,
            "idle_in_transaction_session_timeout": limit_s / 6,  # sooner than others give up
        }
        options = " ".join(f"-c {name}={round(1000 * value)}" for name, value in limits.items())
    return {
        "connect_timeout": math.ceil(min(_CONNECT_WITHIN_S, limit_s or _CONNECT_WITHIN_S)),
        "keepalives": 1,
        "keepalives_idle": 10,
        "keepalives_interval": 5,
        "keepalives_count": 3,
        "tcp_user_timeout": 20_000,
        **({"options": options} if options else {}),
    }
