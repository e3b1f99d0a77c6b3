"""How long PostgreSQL may take: limits that the server keeps, and one for a server out of reach."""

import asyncio
import math
import select
import time
from collections import deque
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import ExitStack
from typing import Any, TypeVar

import psycopg
from psycopg.abc import PQGen
from psycopg.pq import ConnStatus, ExecStatus, Format
from psycopg.pq.abc import PGresult
from sqlalchemy import URL, Engine, create_engine, event

from store.database import ConnectionLost

Result = TypeVar("Result")

_CONNECT_WITHIN_S = 5.0
_PING_WITHIN_S = 2.0
_TRUSTED_FOR_S = 5.0
"""How long after its last answer a connection is taken to live, unless its server has closed it."""
_WORD_ON_THE_WAY_S = 2.0
"""By how much longer than the server's own limit an answer may take."""


def postgres_engine(url: URL, *, answer_within_s: float | None) -> Engine:
    """Connect with limits for statements, locks and silence; None: for work that may take its time.

    The server ends what lasts too long. A server that is gone, stopped or behind a firewall that drops
    packets ends nothing, and TCP alone may wait for a quarter of an hour, or for ever where a proxy still
    acknowledges: then the connection is given up on this side.
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
        connect_args=_network_limits(limit_s) | ({} if limit_s is None else _server_limits(url, limit_s)),
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


def prepare(
    connect: Callable[[], psycopg.Connection[Any]], statements: Mapping[str, str]
) -> psycopg.Connection[Any]:
    """Connect for a `Line`, which is then asked for these statements by name."""
    with ExitStack() as failing:
        try:
            connection = connect()
            failing.callback(connection.close)
            connection.autocommit = True
            # planning a statement again costs more than running it
            connection.execute("SET plan_cache_mode = force_generic_plan")
            for name, statement in statements.items():
                connection.execute(f"PREPARE {name} AS {statement}".encode())
        except psycopg.Error as error:
            raise ConnectionLost(str(error)) from error
        failing.pop_all()
    return connection


class Line:
    """A connection that an event loop asks for prepared statements: none waits for the answer to another."""

    def __init__(self, connection: psycopg.Connection[Any], *, answer_within_s: float) -> None:
        self._connection, self._server = connection, connection.pgconn
        self._silence_s = answer_within_s + _WORD_ON_THE_WAY_S
        self._open: deque[tuple[asyncio.Future[PGresult], float]] = deque()
        self._last: PGresult | None = None
        self._loop = asyncio.get_running_loop()
        self._watch: asyncio.TimerHandle | None = None
        self._server.nonblocking = 1
        self._server.enter_pipeline_mode()
        self._socket = self._server.socket
        self._loop.add_reader(self._socket, self._read)

    @property
    def closed(self) -> bool:
        return self._connection.closed

    async def ask(self, statement: bytes, values: Sequence[bytes | None]) -> list[tuple[bytes | None, ...]]:
        """Return the rows in PostgreSQL's binary format; ``values`` as text. Raises `ConnectionLost`."""
        answer: asyncio.Future[PGresult] = self._loop.create_future()
        try:
            self._server.send_query_prepared(statement, values, result_format=Format.BINARY)
            self._server.pipeline_sync()
            self._open.append((answer, self._loop.time()))
            if self._server.flush():
                self._loop.add_writer(self._socket, self._write)
        except psycopg.Error as error:
            answer.cancel()
            self._close(str(error))
            raise ConnectionLost(str(error)) from error
        if self._watch is None:
            self._watch = self._loop.call_later(self._silence_s, self._end_silence)
        found = await answer
        columns = range(found.nfields)
        return [tuple(found.get_value(row, column) for column in columns) for row in range(found.ntuples)]

    def _close(self, why: str) -> None:
        if not self._connection.closed:
            self._loop.remove_reader(self._socket)
            self._loop.remove_writer(self._socket)
            self._connection.close()
        while self._open:
            answer, _ = self._open.popleft()
            if not answer.done():
                answer.set_exception(ConnectionLost(why))

    def _write(self) -> None:
        try:
            if not self._server.flush():
                self._loop.remove_writer(self._socket)
        except psycopg.Error as error:
            self._close(str(error))

    def _read(self) -> None:
        try:
            self._server.consume_input()
            while self._open and not self._server.is_busy():
                result = self._server.get_result()
                if result is None:
                    if self._server.status != ConnStatus.OK:
                        raise psycopg.OperationalError("the server has ended the connection")
                    continue
                if result.status != ExecStatus.PIPELINE_SYNC:
                    self._last = result
                    continue
                assert self._last is not None  # noqa: S101  a statement is answered before its end
                if self._last.status != ExecStatus.TUPLES_OK:
                    raise psycopg.OperationalError(self._last.error_message.decode(errors="replace"))
                answer, _ = self._open.popleft()
                if not answer.done():
                    answer.set_result(self._last)
        except psycopg.Error as error:
            self._close(str(error))

    def _end_silence(self) -> None:
        self._watch = None
        if self._open:
            left_s = self._open[0][1] + self._silence_s - self._loop.time()
            if left_s <= 0:
                self._close(f"no answer within {self._silence_s:g} s")
            else:
                self._watch = self._loop.call_later(left_s, self._end_silence)


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


def _network_limits(limit_s: float | None) -> dict[str, Any]:
    return {
        "connect_timeout": math.ceil(min(_CONNECT_WITHIN_S, limit_s or _CONNECT_WITHIN_S)),
        "keepalives": 1,
        "keepalives_idle": 10,
        "keepalives_interval": 5,
        "keepalives_count": 3,
        "tcp_user_timeout": 20_000,
    }


def _server_limits(url: URL, limit_s: float) -> dict[str, str]:
    if "options" in url.query:
        return {}  # the operator's own
    limits = {
        "statement_timeout": limit_s,
        "lock_timeout": limit_s / 3,
        "idle_in_transaction_session_timeout": limit_s / 6,  # sooner than others give up
    }
    return {"options": " ".join(f"-c {name}={round(1000 * value)}" for name, value in limits.items())}
