"""Look-ups of what is in force: one query for the key and the ready answers, on a connection of its own."""

import hashlib
import time
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

from sqlalchemy import ColumnElement, Select, Text, bindparam, cast, select
from sqlalchemy.dialects.postgresql.psycopg import PGDialect_psycopg
from sqlalchemy.dialects.sqlite.pysqlite import SQLiteDialect_pysqlite
from sqlalchemy.exc import OperationalError
from sqlalchemy.orm import Session, aliased

from store.columns import UtcDateTime, utc_now
from store.database import ConnectionLost, Database
from store.tables import ApiKey, ReadyAnswer, ReadyRow, Slot

_AT_ONCE_S = 1.0
"""A connection that fails sooner was closed since its last use; later, the database does not answer."""


@dataclass(frozen=True, kw_only=True)
class Held:
    """The ready answer of one publication in force."""

    calibration_id: str
    version: int
    etag: str
    whole: bool
    foreseen: str | None
    items: bytes


@dataclass(frozen=True, kw_only=True)
class Found:
    """A key with the scope `read`, used lately, and what is in force; ``held`` is never empty."""

    organisation_id: str
    held: tuple[Held, ...]


def find_ready(
    session: Session, *, camera_id: str, method: str, at: datetime, known_at: datetime | None
) -> tuple[Held, ...]:
    """Return the ready answers of what holds at ``at`` as known at ``known_at``, one for each configuration.

    Without ``known_at``, as known last: also if that was recorded by a clock that has been set back since.
    """
    values = {"camera_id": camera_id, "method": method, "at": at, "known_at": known_at}
    return tuple(Held(**row) for row in session.execute(_hold(now=known_at is None), values).mappings())


class Lookups:
    """Finds ready answers for whoever holds a key, without an ORM session.

    A key is checked with each look-up, in its query: nothing about it is remembered here.
    """

    def __init__(self, database: Database, *, used_within: timedelta) -> None:
        self._database = database
        self._used_within = used_within
        dialect = SQLiteDialect_pysqlite(paramstyle="named") if database.is_sqlite else PGDialect_psycopg()  # type: ignore[no-untyped-call]
        compiled = {now: _with_key(now=now).compile(dialect=dialect) for now in (True, False)}
        self._statements = {now: (each.string, dict(each.params)) for now, each in compiled.items()}

    def find(
        self, secret: str, *, camera_id: str, method: str, at: datetime | None, known_at: datetime | None
    ) -> Found | None:
        """Return what is in force; None where nothing is, and wherever the usual way must say why."""
        now = utc_now()
        values = {
            "camera_id": camera_id,
            "method": method,
            "at": self._bind(at or now),
            "sha256": hashlib.sha256(secret.encode("utf-8", "surrogatepass")).hexdigest(),
            "now": self._bind(now),
            "used_after": self._bind(now - self._used_within),
        }
        if known_at is not None:
            values["known_at"] = self._bind(known_at)
        statement, constants = self._statements[known_at is None]
        rows = self._fetch(statement, constants | values)
        if not rows or '"read"' not in rows[0][1]:
            return None
        held = tuple(
            Held(calibration_id=r[2], version=r[3], etag=r[4], whole=bool(r[5]), foreseen=r[6], items=r[7])
            for r in rows
        )
        return Found(organisation_id=rows[0][0], held=held)

    def _bind(self, instant: datetime) -> Any:  # noqa: ANN401
        if not self._database.is_sqlite:
            return instant
        return instant.astimezone(UTC).replace(tzinfo=None).isoformat(" ", "microseconds")

    def _fetch(self, statement: str, values: dict[str, Any]) -> Sequence[Any]:
        began = time.monotonic()
        try:
            with self._database.reading_alone() as cursor:
                rows: Sequence[Any] = cursor.execute(statement, values).fetchall()
        except ConnectionLost as error:
            if time.monotonic() - began < _AT_ONCE_S:
                return ()
            raise OperationalError(statement, None, error) from error
        return rows


def _hold(*, now: bool) -> Select[Any]:
    """Select the ready answers: of each slot the last one to begin, as no two of a slot hold at once."""
    at = bindparam("at", type_=UtcDateTime)
    inner = aliased(ReadyRow)
    known: ColumnElement[bool] = inner.known_to.is_(None)
    if not now:
        known_at = bindparam("known_at", type_=UtcDateTime)
        known = (inner.known_from <= known_at) & (inner.known_to.is_(None) | (inner.known_to > known_at))
    last = (
        select(inner.publication_id)
        .where(inner.slot_id == Slot.id, inner.valid_from <= at, known)
        .order_by(inner.valid_from.desc())
        .limit(1)
        .correlate(Slot)
        .scalar_subquery()
    )
    answer = ReadyAnswer
    columns: list[Any] = [
        *(ReadyRow.calibration_id, ReadyRow.version),
        *(answer.etag, answer.whole, answer.foreseen, answer.items),
    ]
    return (
        select(*columns)
        .select_from(Slot)
        .join(ReadyRow, ReadyRow.publication_id == last)
        .join(ReadyAnswer, ReadyAnswer.publication_id == ReadyRow.publication_id)
        .where(Slot.camera_id == bindparam("camera_id"), Slot.method == bindparam("method"))
        .where(ReadyRow.valid_to.is_(None) | (ReadyRow.valid_to > at))
        .order_by(Slot.configuration)
    )


def _with_key(*, now: bool) -> Select[Any]:
    moment = bindparam("now", type_=UtcDateTime)
    held = _hold(now=now)
    return (
        held.with_only_columns(ApiKey.organisation_id, cast(ApiKey.scopes, Text), *held.selected_columns)
        .join(ApiKey, ApiKey.organisation_id == ReadyRow.organisation_id)
        .where(ApiKey.sha256 == bindparam("sha256"), ApiKey.revoked_at.is_(None))
        .where(ApiKey.expires_at.is_(None) | (ApiKey.expires_at > moment))
        .where(ApiKey.last_used_at > bindparam("used_after", type_=UtcDateTime))
    )
