"""Publishing a version with its certificate, taking it back, and what was in force when, as known when."""

import json
from collections.abc import Collection, Sequence
from datetime import datetime, timedelta

from sqlalchemy import ColumnElement, func, select
from sqlalchemy.orm import Session

from radiometry.findings import interface, shared
from radiometry.records import Record
from store import blobs, database, files
from store.queries import add
from store.ready.rows import close_ready, describe_validity, write_ready
from store.tables import Calibration, IssuedCertificate, Publication, Revocation, Slot, utc_now


class InForce(Record):
    calibration: Calibration
    publication: Publication

    def holds(self, earliest: datetime, latest: datetime) -> bool:
        """Return True if it holds at all times from ``earliest`` to ``latest``."""
        start, end = self.publication.valid_from, self.publication.valid_to
        return start <= earliest and (end is None or latest < end)

    def sentence(self) -> str:
        """Which version it is and for how long; what it is told for, and why, follows behind a comma."""
        return describe_validity(self.calibration.version, self.publication)


def publish(
    session: Session, version: Calibration, *, valid_from: datetime, valid_to: datetime | None, reason: str
) -> Publication:
    """Put a version in force in [valid_from, valid_to); it replaces what held there before."""
    slot = _lock_slot(session, version)
    # under the lock only: whoever held it before may have revoked this version
    require_not_revoked(session, version)
    now = _next_instant(session, slot)
    row = Publication(
        slot_id=slot.id,
        calibration_id=version.id,
        valid_from=valid_from,
        valid_to=valid_to,
        known_from=now,
        known_to=None,
        reason=reason,
    )
    ends_later = Publication.valid_to.is_(None) | (Publication.valid_to > valid_from)
    remainders = [
        rest
        for older in _open_rows(session, slot, ends_later)
        if valid_to is None or older.valid_from < valid_to
        for rest in _give_way(session, older, row)
    ]
    session.flush()
    write_ready(session, [*remainders, add(session, row)])
    return row


def require_not_revoked(session: Session, calibration: Calibration) -> None:
    """Raise Conflict for a version that can never be published again."""
    if session.get(Revocation, calibration.id):
        raise database.Conflict(
            shared.CALIBRATION_REVOKED, "This version was revoked; a revoked version stays revoked."
        )


def revoke(session: Session, calibration: Calibration, *, reason: str, by: str) -> None:
    """End a version permanently. Nothing takes its place: the time it held has no version in force."""
    slot = _lock_slot(session, calibration)
    if session.get(Revocation, calibration.id):
        return
    now = _next_instant(session, slot)
    session.add(Revocation(calibration_id=calibration.id, reason=reason, revoked_by=by, revoked_at=now))
    for row in _open_rows(session, slot):
        if row.calibration_id == calibration.id:
            row.known_to = now
            close_ready(session, row)
    session.flush()


def list_held(session: Session, *where: ColumnElement[bool]) -> list[InForce]:
    """The validities that stand, by configuration and time."""
    rows = session.execute(
        select(Calibration, Publication)
        .join(Publication, Publication.calibration_id == Calibration.id)
        .join(Slot, Slot.id == Publication.slot_id)
        .where(Publication.known_to.is_(None), *where)
        .order_by(Slot.configuration, Publication.valid_from)
    )
    return [InForce(calibration=calibration, publication=publication) for calibration, publication in rows]


def in_force(
    session: Session, *, camera_id: str, method: str, at: datetime, until: datetime | None = None
) -> list[InForce]:
    """The versions that hold at a time, or at any time until another, by configuration and time."""
    return list_held(session, Slot.camera_id == camera_id, Slot.method == method, overlaps(at, until or at))


def overlaps(earliest: datetime, latest: datetime) -> ColumnElement[bool]:
    """Return the condition that a publication holds at any time from ``earliest`` to ``latest``."""
    ends = Publication.valid_to.is_(None) | (Publication.valid_to > earliest)
    return (Publication.valid_from <= latest) & ends


def _lock_slot(session: Session, calibration: Calibration) -> Slot:
    configuration = json.dumps(calibration.configuration, sort_keys=True)
    of = {"camera_id": calibration.camera_id, "method": calibration.method, "configuration": configuration}
    # the version's own row is locked first: two first publications would otherwise both make the slot
    first = select(Calibration.id).filter_by(camera_id=calibration.camera_id).order_by(Calibration.version)
    session.execute(first.limit(1).with_for_update())
    return session.scalar(select(Slot).filter_by(**of).with_for_update()) or add(session, Slot(**of))


def _next_instant(session: Session, slot: Slot) -> datetime:
    """Now, but later than anything this slot has recorded: knowledge is ordered, whatever the clock does."""
    last = [
        session.scalar(select(func.max(column)).where(Publication.slot_id == slot.id))
        for column in (Publication.known_from, Publication.known_to)
    ]
    # a version that held nothing was revoked without closing a row
    mine = (Calibration.camera_id == slot.camera_id) & (Calibration.method == slot.method)
    ends = select(func.max(Revocation.revoked_at)).where(mine)
    last.append(session.scalar(ends.join(Calibration, Calibration.id == Revocation.calibration_id)))
    return max([utc_now(), *(known + timedelta(microseconds=1) for known in last if known)])


def _open_rows(session: Session, slot: Slot, *where: ColumnElement[bool]) -> list[Publication]:
    rows = select(Publication).where(Publication.slot_id == slot.id, Publication.known_to.is_(None), *where)
    return list(session.scalars(rows.order_by(Publication.valid_from)))


def _give_way(session: Session, older: Publication, newer: Publication) -> list[Publication]:
    """Close a row, and record again what of its validity lies before and after the newer one's."""
    successor = newer.calibration_id if newer.calibration_id != older.calibration_id else None
    keeps_end = newer.valid_to is not None and (older.valid_to is None or older.valid_to > newer.valid_to)
    rests: list[tuple[datetime, datetime | None, str | None]] = []
    if older.valid_from < newer.valid_from:
        # where a part of it goes on afterwards it is not superseded, only interrupted
        taken_by = older.superseded_by if keeps_end else successor
        rests.append((older.valid_from, newer.valid_from, taken_by))
    if newer.valid_to is not None and keeps_end:
        rests.append((newer.valid_to, older.valid_to, older.superseded_by))
    older.known_to, older.superseded_by = newer.known_from, successor
    session.flush()
    close_ready(session, older)
    same = {name: getattr(older, name) for name in ("slot_id", "calibration_id", "reason")}
    same |= {"known_from": newer.known_from, "known_to": None}
    rows = [Publication(valid_from=start, valid_to=end, superseded_by=by, **same) for start, end, by in rests]
    session.add_all(rows)
    return rows


def list_issued(session: Session, calibration_id: str) -> list[IssuedCertificate]:
    """Return the original of a version and its amendments in their order; a draft has none."""
    mine = select(IssuedCertificate).where(IssuedCertificate.calibration_id == calibration_id)
    return list(session.scalars(mine.order_by(IssuedCertificate.amendment)))


def is_published(session: Session, calibration_id: str) -> bool:
    mine = select(Publication.id).where(Publication.calibration_id == calibration_id)
    return session.scalar(mine.limit(1)) is not None


class PrintedCertificate(Record):
    """A certificate whose files are stored; its row still lacks the publication that issues it."""

    row: IssuedCertificate
    files: Sequence[blobs.StoredBlob]


def keep_issued(session: Session, publication: Publication, printed: PrintedCertificate) -> None:
    """Issue a printed certificate with its publication; whoever publishes holds the lock of its slot."""
    if len(list_issued(session, publication.calibration_id)) != printed.row.amendment:
        message = "Another request has just published this version. Look at it, and publish again."
        raise database.Conflict(interface.CONFLICT, message)
    files.keep_blobs(session, printed.files)
    printed.row.calibration_id, printed.row.publication_id = publication.calibration_id, publication.id
    add(session, printed.row)


def find_unissued(session: Session, *, without: Collection[str] = ()) -> str | None:
    """Return a published version that has no certificate yet, any of them: several processes look."""
    published, issued = select(Publication.calibration_id), select(IssuedCertificate.calibration_id)
    rows = select(Calibration.id).where(Calibration.id.in_(published), Calibration.id.not_in(issued))
    return session.scalar(rows.where(Calibration.id.not_in(without)).order_by(func.random()).limit(1))
