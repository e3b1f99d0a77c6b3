"""Entries of an organisation's audit trail: chosen, named, and its chain checked piece by piece."""

from collections.abc import Callable, Iterator, Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import Select, select
from sqlalchemy.orm import Session

from radiometry.methods import get_method
from store import tables
from store.database import Database
from store.queries import by_id, group_by

_PAGE = 1000
_RECENT = 20

NAMES: dict[str, tuple[Any, Callable[[Any], str | None], str | None]] = {
    "cal": (tables.Calibration, lambda row: f"{get_method(row.method).label}, version {row.version}", "id"),
    "cam": (tables.Camera, lambda row: f"{row.make} {row.model} {row.serial}", "id"),
    "cmp": (tables.Campaign, lambda row: row.project_number, "id"),
    "ext": (tables.Extraction, lambda _: None, "frame_id"),
    "frm": (tables.FrameRow, lambda row: row.filename, "campaign_id"),
    "key": (tables.ApiKey, lambda row: row.name, None),
    "man": (tables.Manifest, lambda _: None, "campaign_id"),
    "met": (tables.Meter, lambda row: f"{row.make} {row.model} {row.serial}", None),
    "msr": (tables.Measurement, lambda _: None, "id"),
    "org": (tables.Organisation, lambda row: row.name, None),
    "pnl": (tables.Panel, lambda row: row.serial, None),
    "pub": (tables.Publication, lambda _: None, "calibration_id"),
    "rdg": (tables.Reading, lambda row: row.scene, "campaign_id"),
    "rig": (tables.Rig, lambda row: row.name, "id"),
    "roa": (tables.Road, lambda row: row.name, "id"),
    "rrs": (tables.RoadResult, lambda row: f"evaluation {row.number}", "road_id"),
    "ses": (tables.WebSession, lambda _: None, "key_id"),
}
"""By the beginning of an id: its table, its own name, and the column of what it is about."""


def select_entries(
    organisation_id: str, *, start: datetime | None = None, end: datetime | None = None, **equal: str | None
) -> Select[tables.AuditEntry]:
    """Return the query of an organisation's entries from `start` until before `end`, with these values."""
    chosen = {name: value for name, value in equal.items() if value is not None}
    rows = select(tables.AuditEntry).filter_by(organisation_id=organisation_id, **chosen)
    if start is not None:
        rows = rows.where(tables.AuditEntry.at >= start)
    return rows if end is None else rows.where(tables.AuditEntry.at < end)


def read_entries(
    database: Database, rows: Select[tables.AuditEntry]
) -> Iterator[tuple[tables.AuditEntry, dict[str, str]]]:
    """Read entries oldest first with the names of each, a page at a time; none that is appended meanwhile."""
    after, last = -1, None
    while True:
        with database.reading() as session:
            last = last or session.scalar(rows.order_by(tables.AuditEntry.seq.desc()).limit(1))
            if last is None:
                return
            within = rows.where(tables.AuditEntry.seq > after, tables.AuditEntry.seq <= last.seq)
            page = list(session.scalars(within.order_by(tables.AuditEntry.seq).limit(_PAGE)))
            named = name_entries(session, page)
        yield from zip(page, named, strict=True)
        if len(page) < _PAGE:
            return
        after = page[-1].seq


def name_entries(session: Session, entries: Sequence[tables.AuditEntry]) -> list[dict[str, str]]:
    """Return for each entry, where known: `actor_name`, `subject_name`, and the id `about_id` of its subject.

    What a row without a name is about gives it one: a session its key, a publication its version.
    """
    ids = {each for entry in entries for each in (entry.actor, entry.subject_id)}
    found = _read_rows(session, ids)
    found |= _read_rows(session, {about for row in found.values() if (about := _about(row))} - found.keys())
    named = []
    for entry in entries:
        told = {"actor_name": _name(found, entry.actor), "subject_name": _name(found, entry.subject_id)}
        told["about_id"] = _about(found.get(entry.subject_id))
        named.append({name: value for name, value in told.items() if value})
    return named


def name_last_actor(session: Session, subject_id: str) -> str | None:
    rows = select(tables.AuditEntry).filter_by(subject_id=subject_id).order_by(tables.AuditEntry.seq.desc())
    named = name_entries(session, session.scalars(rows.limit(_RECENT)).all())
    return next((each["actor_name"] for each in named if "actor_name" in each), None)


def _read_rows(session: Session, ids: set[str]) -> dict[str, Any]:
    kinds = group_by(ids, lambda each: each[:3])
    found: dict[str, Any] = {}
    for kind in kinds.keys() & NAMES.keys():
        found |= by_id(session, NAMES[kind][0], kinds[kind])
    return found


def _about(row: Any) -> str | None:  # noqa: ANN401  of one of the tables above
    column = NAMES[row.id[:3]][2] if row is not None else None
    return getattr(row, column) if column else None


def _name(found: dict[str, Any], row_id: str) -> str | None:
    if (row := found.get(row_id)) is None:
        return None
    about = _about(row)
    return NAMES[row_id[:3]][1](row) or (_name(found, about) if about and about != row_id else None)
