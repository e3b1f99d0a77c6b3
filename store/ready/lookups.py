"""Look-ups of what is in force: one query for the key and the ready answers, on a connection of its own."""

import asyncio
import hashlib
import time
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import cache
from typing import TYPE_CHECKING, Any

from sqlalchemy import Boolean, ColumnElement, Select, Text, bindparam, case, cast, select
from sqlalchemy.exc import OperationalError
from sqlalchemy.orm import Session, aliased

from store.database import ConnectionLost, Database
from store.tables import ApiKey, ReadyAnswer, ReadyRow, Slot
from store.tables.base import UtcDateTime, utc_now

if TYPE_CHECKING:
    from store.postgres import Line

_NOW, _THEN = "ready_now", "ready_then"
_AT_ONCE_S = 1.0
"""A connection that fails sooner was closed since its last use; later, the database does not answer."""


@dataclass(frozen=True)
class Held:
    """The ready answer of one publication in force; without `items` where only tags were asked for."""

    calibration_id: str
    etag: str
    foreseen: str | None
    version: int
    whole: bool
    items: bytes | None


@dataclass(frozen=True, kw_only=True)
class Found:
    """A key with the scope `read`, used lately, and what is in force; ``held`` is never empty."""

    organisation_id: str
    held: tuple[Held, ...]


def find_ready(
    session: Session, *, camera_id: str, method: str, at: datetime, known_at: datetime | None
) -> tuple[Held, ...]:
    """Return the ready answers of what holds at a time as known then, or last: one for each configuration."""
    values = {"camera_id": camera_id, "method": method, "at": at, "known_at": known_at}
    return tuple(Held(**row) for row in session.execute(_hold(now=known_at is None), values).mappings())


class Lookups:
    """Finds ready answers for whoever holds a key, in the event loop, without an ORM session."""

    def __init__(self, database: Database, *, used_within: timedelta) -> None:
        self._database = database
        self._used_within = used_within
        self._line: asyncio.Task[Line] | None = None
        kind: Any = type(database.engine.dialect)
        dialect = kind(paramstyle="named" if database.is_sqlite else "numeric_dollar")
        compiled = {name: _with_key(now=name == _NOW).compile(dialect=dialect) for name in (_NOW, _THEN)}
        self._statements = {name: each.string for name, each in compiled.items()}
        self._constants = {name: dict(each.params) for name, each in compiled.items()}
        self._orders = {name: getattr(each, "positiontup", None) or () for name, each in compiled.items()}

    async def find(
        self,
        secret: str,
        *,
        camera_id: str,
        method: str,
        at: datetime | None,
        known_at: datetime | None,
        tags_only: bool,
    ) -> Found | None:
        """Return what is in force; None where nothing is, and wherever the usual way must say why."""
        now = utc_now()
        name = _NOW if known_at is None else _THEN
        values: dict[str, Any] = self._constants[name] | {
            "camera_id": camera_id,
            "method": method,
            "at": self._bind(at or now),
            "sha256": hashlib.sha256(secret.encode("utf-8", "surrogatepass")).hexdigest(),
            "now": self._bind(now),
            "used_after": self._bind(now - self._used_within),
            "tags_only": tags_only,
        }
        if known_at is not None:
            values["known_at"] = self._bind(known_at)
        began = time.monotonic()
        try:
            rows = self._fetch(name, values) if self._database.is_sqlite else await self._ask(name, values)
        except ConnectionLost as error:
            if time.monotonic() - began < _AT_ONCE_S:
                return None
            raise OperationalError(name, None, error) from error
        if not rows or '"read"' not in rows[0][1]:
            return None
        return Found(organisation_id=rows[0][0], held=tuple(Held(*row[2:]) for row in rows))

    def _bind(self, instant: datetime) -> str:
        # in UTC for PostgreSQL too: it reads no offset from 16 hours on
        utc = instant.astimezone(UTC)
        return (utc.replace(tzinfo=None) if self._database.is_sqlite else utc).isoformat(" ", "microseconds")

    def _fetch(self, name: str, values: dict[str, Any]) -> list[Any]:
        with self._database.reading_alone() as cursor:
            return cursor.execute(self._statements[name], values).fetchall()

    async def _ask(self, name: str, values: dict[str, Any]) -> list[Any]:
        line = await self._open_line()
        rows = await line.ask(name.encode(), [str(values[each]).encode() for each in self._orders[name]])
        return [
            (
                *(text and text.decode() for text in row[:5]),
                int.from_bytes(row[5] or b""),
                row[6] == b"\1",
                row[7],
            )
            for row in rows
        ]

    async def _open_line(self) -> "Line":
        opening = self._line
        if (
            opening is None
            or opening.get_loop() is not asyncio.get_running_loop()
            or (opening.done() and (opening.exception() or opening.result().closed))
        ):
            opening = self._line = asyncio.create_task(self._database.open_line(self._statements))
        return await asyncio.shield(opening)


@cache
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
        *(ReadyRow.calibration_id, answer.etag, answer.foreseen, ReadyRow.version, answer.whole),
        case((bindparam("tags_only", False, Boolean), None), else_=answer.items).label("items"),
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
