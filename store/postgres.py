"""How long PostgreSQL may take: limits that the server keeps, and one for a server out of reach."""

import math
import time
from collections.abc import Generator
from typing import Any, TypeVar

import psycopg
from psycopg.abc import PQGen
from sqlalchemy import URL, Engine, create_engine, event

Result = TypeVar("Result")

_CONNECT_WITHIN_S = 5.0
_PING_WITHIN_S = 2.0
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
            """Ask whether a connection of the pool still lives, which takes no time where it does."""
            connection.silence_s = min(_PING_WITHIN_S, silence_s)
            try:
                return ping(connection)
            finally:
                connection.silence_s = silence_s

        engine.dialect.do_ping = ping_briefly  # type: ignore[assignment,method-assign]

    return engine


class _Connection(psycopg.Connection[Any]):
    """Gives up a server that has not answered for so long [s]."""

    silence_s: float

    def wait(self, gen: PQGen[Result], interval: float = 0.1, timeout: float | None = None) -> Result:
        try:
            return super().wait(_within(gen, self.silence_s), interval, timeout)
        except _Silent:
            # What the server has made of the statement is unknown: nothing else may use this connection.
            self.close()
            raise psycopg.OperationalError(f"no answer within {self.silence_s:g} s") from None


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
        "idle_in_transaction_session_timeout": 2 * limit_s,
    }
    return {"options": " ".join(f"-c {name}={round(1000 * value)}" for name, value in limits.items())}
