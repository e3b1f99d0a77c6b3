"""Versions, and how each stands."""

from collections import defaultdict
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Literal

from sqlalchemy import Select, func, select
from sqlalchemy.orm import Session

from store.tables import Calibration, CoefficientRow, Publication, Revocation

State = Literal["draft", "published", "superseded", "revoked"]


@dataclass(frozen=True, kw_only=True)
class VersionStatus:
    """Decisions about a version since it was made."""

    state: State
    valid_from: datetime | None = None
    valid_to: datetime | None = None
    superseded_by: str | None = None
    successor: int | None = None
    """The number of the version that ``superseded_by`` is the id of."""
    revoked_reason: str | None = None


def read_version_statuses(session: Session, calibration_ids: list[str]) -> dict[str, VersionStatus]:
    """How each version stands now."""
    revoked = {
        row.calibration_id: row
        for row in session.scalars(select(Revocation).where(Revocation.calibration_id.in_(calibration_ids)))
    }
    published: dict[str, list[Publication]] = defaultdict(list)
    rows = session.scalars(
        select(Publication)
        .where(Publication.calibration_id.in_(calibration_ids))
        .order_by(Publication.known_from, Publication.valid_from)
    )
    for row in rows:
        published[row.calibration_id].append(row)
    return _name_successors(
        session, {key: _find_status(published[key], revoked.get(key)) for key in calibration_ids}
    )


def _name_successors(session: Session, found: dict[str, VersionStatus]) -> dict[str, VersionStatus]:
    ids = {status.superseded_by for status in found.values()} - {None}
    if not ids:
        return found
    rows = session.execute(select(Calibration.id, Calibration.version).where(Calibration.id.in_(ids)))
    numbers = {row[0]: row[1] for row in rows}
    return {
        key: replace(status, successor=numbers.get(status.superseded_by or ""))
        for key, status in found.items()
    }


def _find_status(rows: list[Publication], revocation: Revocation | None) -> VersionStatus:
    if revocation is not None:
        return VersionStatus(state="revoked", revoked_reason=revocation.reason)
    if not rows:
        return VersionStatus(state="draft")
    in_force = [row for row in rows if row.known_to is None]
    superseded_by = next((row.superseded_by for row in reversed(rows) if row.superseded_by), None)
    state: State = "published" if any(row.superseded_by is None for row in in_force) else "superseded"
    if not in_force:
        return VersionStatus(state=state, superseded_by=superseded_by)
    ends = [row.valid_to for row in in_force]
    return VersionStatus(
        state=state,
        valid_from=min(row.valid_from for row in in_force),
        valid_to=max((end for end in ends if end), default=None) if all(ends) else None,
        superseded_by=superseded_by if state == "superseded" else None,
    )


def history(camera_id: str, *, method: str | None, state: str | None) -> Select[Calibration]:
    """A camera's versions; the state is decided in the database, so that a page is a page."""
    rows = select(Calibration).where(Calibration.camera_id == camera_id)
    if method is not None:
        rows = rows.where(Calibration.method == method)
    revoked = select(Revocation.calibration_id)
    published = select(Publication.calibration_id)
    in_force = published.where(Publication.known_to.is_(None), Publication.superseded_by.is_(None))
    match state:
        case "revoked":
            return rows.where(Calibration.id.in_(revoked))
        case "draft":
            return rows.where(Calibration.id.not_in(published), Calibration.id.not_in(revoked))
        case "published":
            return rows.where(Calibration.id.in_(in_force), Calibration.id.not_in(revoked))
        case "superseded":
            return rows.where(
                Calibration.id.in_(published),
                Calibration.id.not_in(in_force),
                Calibration.id.not_in(revoked),
            )
        case _:
            return rows


def coefficients_of(session: Session, calibration_ids: list[str]) -> dict[str, list[CoefficientRow]]:
    found: dict[str, list[CoefficientRow]] = defaultdict(list)
    rows = session.scalars(
        select(CoefficientRow)
        .where(CoefficientRow.calibration_id.in_(calibration_ids))
        .order_by(CoefficientRow.calibration_id, CoefficientRow.position)
    )
    for row in rows:
        found[row.calibration_id].append(row)
    return found


def next_version(session: Session, camera_id: str, method: str) -> int:
    """The number after the last; two that ask at once collide on the unique key, and one asks again."""
    last = session.scalar(
        select(func.max(Calibration.version)).where(
            Calibration.camera_id == camera_id, Calibration.method == method
        )
    )
    return (last or 0) + 1
