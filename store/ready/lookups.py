"""Look-ups of what is in force."""

from dataclasses import dataclass
from datetime import datetime
from functools import cache
from typing import Any

from sqlalchemy import ColumnElement, Select, Text, bindparam, cast, select
from sqlalchemy.orm import aliased

from store.database import Database
from store.queries.organisations import IS_HOLDERS
from store.tables import ApiKey, ReadyAnswer, ReadyRow, Slot, UtcDateTime


@dataclass(frozen=True)
class Held:
    organisation_id: str
    calibration_id: str
    etag: str
    foreseen: str | None
    version: int
    whole: bool
    items: bytes


async def find_ready(
    database: Database,
    *,
    camera_id: str,
    method: str,
    at: datetime,
    known_at: datetime | None,
    **who: str | datetime,
) -> tuple[Held, ...]:
    """Return the ready answers of what holds at a time as known then, or last: one for each configuration.

    ``who``: `organisation_id`; or `sha256` of a key that was used since `used_after`, as most are, and may
    read: then one statement checks it and finds the answers.
    """
    moments = {"at": at} if known_at is None else {"at": at, "known_at": known_at}
    wanted = select_held(now=known_at is None, by_key="sha256" in who)
    rows = await database.ask(wanted, {"camera_id": camera_id, "method": method, **moments, **who})
    return tuple(Held(*row) for row in rows)


@cache
def select_held(*, now: bool, by_key: bool) -> Select[Any]:
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
    columns: list[Any] = [ReadyRow.organisation_id, ReadyRow.calibration_id, answer.etag, answer.foreseen]
    held: Select[Any] = (
        select(*columns, ReadyRow.version, answer.whole, answer.items)
        .select_from(Slot)
        .join(ReadyRow, ReadyRow.publication_id == last)
        .join(ReadyAnswer, ReadyAnswer.publication_id == ReadyRow.publication_id)
        .where(Slot.camera_id == bindparam("camera_id"), Slot.method == bindparam("method"))
        .where(ReadyRow.valid_to.is_(None) | (ReadyRow.valid_to > at))
        .order_by(Slot.configuration)
    )
    if not by_key:
        return held.where(ReadyRow.organisation_id == bindparam("organisation_id"))
    return (
        held.join(ApiKey, ApiKey.organisation_id == ReadyRow.organisation_id)
        .where(IS_HOLDERS, cast(ApiKey.scopes, Text).contains('"read"'))
        .where(ApiKey.last_used_at > bindparam("used_after", type_=UtcDateTime))
    )
