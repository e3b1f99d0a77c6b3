"""Versions of a camera's method with the times for which they were in force, as known at a time."""

from collections import defaultdict
from dataclasses import dataclass, field
from datetime import datetime

from sqlalchemy import select
from sqlalchemy.orm import Session

from store.queries.calibrations import coefficients_of
from store.queries.decisions import Act, list_publishings
from store.tables import Calibration, CoefficientRow, Publication, Revocation, Slot


@dataclass(frozen=True, kw_only=True)
class Lifetime:
    """A published version as known at a time.

    Attributes
    ----------
    in_force, revoked_from : list of Publication
        Rows that hold then, and those that its revocation closed.
    published : list of Act
        Every publishing of it until then, oldest first.
    revocation : Revocation or None
        None if it was not revoked by then.
    """

    calibration: Calibration
    coefficients: list[CoefficientRow]
    in_force: list[Publication] = field(default_factory=list)
    revoked_from: list[Publication] = field(default_factory=list)
    published: list[Act] = field(default_factory=list)
    revocation: Revocation | None = None


def list_lifetimes(session: Session, camera_id: str, method: str, known_at: datetime) -> list[Lifetime]:
    """List every version that had been published by ``known_at``, newest first."""
    slots = select(Slot.id).where(Slot.camera_id == camera_id, Slot.method == method)
    acts: dict[str, list[Act]] = defaultdict(list)
    for act in list_publishings(session, slots):
        if act.publication.known_from <= known_at:
            acts[act.publication.calibration_id].append(act)
    rows: dict[str, list[Publication]] = defaultdict(list)
    of_slots = select(Publication).where(Publication.slot_id.in_(slots), Publication.known_from <= known_at)
    for row in session.scalars(of_slots.order_by(Publication.valid_from)):
        rows[row.calibration_id].append(row)
    ended = select(Revocation).where(Revocation.calibration_id.in_(acts), Revocation.revoked_at <= known_at)
    revoked = {row.calibration_id: row for row in session.scalars(ended)}
    versions = session.scalars(select(Calibration).where(Calibration.id.in_(acts)))
    coefficients = coefficients_of(session, list(acts))
    return [
        Lifetime(
            calibration=version,
            coefficients=coefficients[version.id],
            in_force=[row for row in rows[version.id] if row.known_to is None or row.known_to > known_at],
            revoked_from=[
                row
                for row in rows[version.id]
                if version.id in revoked and row.known_to == revoked[version.id].revoked_at
            ],
            published=acts[version.id],
            revocation=revoked.get(version.id),
        )
        for version in sorted(versions, key=lambda each: -each.version)
    ]
