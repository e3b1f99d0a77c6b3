"""Decisions about versions: who, what, when and why."""

from dataclasses import dataclass
from datetime import datetime
from typing import Literal

from sqlalchemy import Select, select
from sqlalchemy.orm import Session

from store.tables import AuditEntry, Calibration, Publication, Revocation, Slot


@dataclass(frozen=True, kw_only=True)
class Act:
    """One publishing of a version: by whom, when, and what was said."""

    by: str
    publication: Publication


@dataclass(frozen=True, kw_only=True)
class Decision:
    """One decision about a version.

    Attributes
    ----------
    by : str
        The id of the key.
    valid_from : datetime or None
        As it was published.
    """

    act: Literal["made", "published", "revoked"]
    calibration: Calibration
    at: datetime
    by: str
    reason: str | None = None
    valid_from: datetime | None = None
    valid_to: datetime | None = None


def list_publishings(session: Session, slot_ids: Select[int]) -> list[Act]:
    """List what was published in these slots, oldest first.

    When a newer version takes a part of an older one's time, its rest is written again in the same
    instant: of a slot's rows of one instant only the last one written is what somebody published.
    """
    rows = session.execute(
        select(Publication, AuditEntry)
        .join(AuditEntry, AuditEntry.subject_id == Publication.id)
        .where(AuditEntry.action == "publication.create", Publication.slot_id.in_(slot_ids))
        .order_by(AuditEntry.seq)
    )
    last = {(row[0].known_from, row[0].slot_id): Act(by=row[1].actor, publication=row[0]) for row in rows}
    return [act for _, act in sorted(last.items())]


def list_decisions(session: Session, camera_id: str) -> list[Decision]:
    """Everything that was decided of a camera's versions, newest first."""
    versions = {
        row.id: row for row in session.scalars(select(Calibration).where(Calibration.camera_id == camera_id))
    }
    found = [
        Decision(act="made", calibration=row, at=row.created_at, by=row.created_by)
        for row in versions.values()
    ]
    for act in list_publishings(session, select(Slot.id).where(Slot.camera_id == camera_id)):
        row = act.publication
        found.append(
            Decision(
                act="published",
                calibration=versions[row.calibration_id],
                at=row.known_from,
                by=act.by,
                reason=row.reason,
                valid_from=row.valid_from,
                valid_to=row.valid_to,
            )
        )
    for end in session.scalars(select(Revocation).where(Revocation.calibration_id.in_(versions))):
        version = versions[end.calibration_id]
        found.append(
            Decision(
                act="revoked", calibration=version, at=end.revoked_at, by=end.revoked_by, reason=end.reason
            )
        )
    return sorted(found, key=lambda each: (each.at, each.calibration.id), reverse=True)
