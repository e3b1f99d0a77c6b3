"""Certificates as they were issued: the original of a published version, and its amendments."""

from collections.abc import Collection
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from radiometry.findings import interface
from store.blobs import StoredBlob
from store.errors import Conflict
from store.files import keep_blobs
from store.tables import Calibration, IssuedCertificate, Publication
from store.tables.base import Json


@dataclass(frozen=True, kw_only=True)
class PrintedCertificate:
    """A certificate whose files are stored, and of which no row says so yet."""

    amendment: int
    number: str
    json: StoredBlob
    pdf: StoredBlob
    fitted_by: Json | None
    approved_by: Json | None
    at_upgrade: bool
    issued_at: datetime


def list_issued(session: Session, calibration_id: str) -> list[IssuedCertificate]:
    """Return the original of a version and its amendments in their order; a draft has none."""
    mine = select(IssuedCertificate).where(IssuedCertificate.calibration_id == calibration_id)
    return list(session.scalars(mine.order_by(IssuedCertificate.amendment)))


def is_published(session: Session, calibration_id: str) -> bool:
    """Return True if a version is or was in force."""
    mine = select(Publication.id).where(Publication.calibration_id == calibration_id)
    return session.scalar(mine.limit(1)) is not None


def keep_issued(session: Session, publication: Publication, printed: PrintedCertificate) -> None:
    """Issue a printed certificate with its publication; whoever publishes holds the lock of its slot."""
    if len(list_issued(session, publication.calibration_id)) != printed.amendment:
        raise Conflict(
            interface.CONFLICT,
            "Another request has just published this version. Look at it, and publish again.",
        )
    keep_blobs(session, [printed.json, printed.pdf])
    session.add(
        IssuedCertificate(
            calibration_id=publication.calibration_id,
            amendment=printed.amendment,
            number=printed.number,
            publication_id=publication.id,
            json_sha256=printed.json.sha256,
            pdf_sha256=printed.pdf.sha256,
            fitted_by=printed.fitted_by,
            approved_by=printed.approved_by,
            at_upgrade=printed.at_upgrade,
            issued_at=printed.issued_at,
        )
    )
    session.flush()


def find_unissued(session: Session, *, without: Collection[str] = ()) -> str | None:
    """Return a published version that has no certificate yet, any of them: several processes look."""
    published = select(Publication.calibration_id)
    rows = select(Calibration.id).where(
        Calibration.id.in_(published),
        Calibration.id.not_in(select(IssuedCertificate.calibration_id)),
        Calibration.id.not_in(without),
    )
    return session.scalar(rows.order_by(func.random()).limit(1))
