"""Issuing certificates: made and stored before a publication begins, for which no transaction waits."""

import logging
from typing import Final

from sqlalchemy.exc import IntegrityError, SQLAlchemyError
from sqlalchemy.orm import Session

from radiometry.findings import interface
from radiometry.records import Record
from service.calibrations.schemas import Gap, NewPublication
from service.documents import rendered, schemas, sheets
from service.documents.certificate import build_certificate, list_published
from service.http import lookup, problems
from service.http.auth import Caller
from service.http.context import Context
from store import blobs, database, publications, tables
from store.files import Files
from store.queries.calibration_record import CalibrationRecord, read_calibration_record

log = logging.getLogger(__name__)

_LOOK_AGAIN_S: Final = 3600.0
_REST_S: Final = 1.0


class Prepared(Record):
    """A certificate that is stored, and what it lacks of what ISO/IEC 17025 asks for."""

    printed: publications.PrintedCertificate
    gaps: list[Gap]


def prepare(context: Context, calibration_id: str, caller: Caller, publication: NewPublication) -> Prepared:
    """Make and store the certificate that a publication issues; 409 if one with gaps is refused."""
    with context.database.reading() as session:
        calibration = lookup.owned(session, tables.Calibration, calibration_id, caller)
        publications.require_not_revoked(session, calibration)
    find_issued(context, calibration_id)
    with context.database.reading(snapshot=True) as session:
        record = gather(context, session, calibration)
        certificate = build_issued(session, record, caller, publication)
    if certificate.gaps and record.organisation.refuses_incomplete_certificates:
        raise problems.Problem(
            interface.CERTIFICATE_INCOMPLETE,
            "Your organisation refuses to publish a version whose certificate lacks items of ISO/IEC 17025. "
            f"Add them, then publish again: {' '.join(gap.message for gap in certificate.gaps)}",
            gaps=[gap.dump() for gap in certificate.gaps],
        )
    return Prepared(printed=_print(context, record, certificate, first=True), gaps=certificate.gaps)


def build_issued(
    session: Session, record: CalibrationRecord, caller: Caller, publication: NewPublication
) -> schemas.CertificateAnswer:
    now, earlier = tables.utc_now(), publications.list_issued(session, record.calibration.id)
    amends = schemas.Amended.restate(earlier[0], amendment=earlier[-1].amendment + 1) if earlier else None
    act = schemas.PublishedBy.restate(publication, by=caller.named, at=now)
    issued = schemas.Issued(at=now, at_upgrade=False, amends=amends)
    return build_certificate(record, issued=issued, approved_by=caller.person, published=[act])


def find_issued(context: Context, calibration_id: str) -> list[tables.IssuedCertificate]:
    """Return what was issued of a version; one that was published before that was kept is issued now."""
    with context.database.reading() as session:
        found = publications.list_issued(session, calibration_id)
        if found or not publications.is_published(session, calibration_id):
            return found
    _issue_late(context, calibration_id)
    with context.database.reading() as session:
        return publications.list_issued(session, calibration_id)


class Backlog:
    """Issues what was published before certificates were kept: a version is whole or still to come."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._failed: set[str] = set()

    def issue_next(self) -> float:
        """Issue one; return the pause until the next [s]."""
        with self._context.database.reading() as session:
            calibration_id = publications.find_unissued(session, without=self._failed)
        if calibration_id is None:
            self._failed.clear()
            return _LOOK_AGAIN_S
        try:
            _issue_late(self._context, calibration_id)
        except (SQLAlchemyError, blobs.StorageUnavailable):
            raise
        except Exception:  # of one version, whose record may be damaged: the others go on
            log.exception("the certificate of %s is not issued yet", calibration_id)
            self._failed.add(calibration_id)
        return _REST_S


def gather(context: Context, session: Session, calibration: tables.Calibration) -> CalibrationRecord:
    state = context.reviews.find(session, calibration.campaign_id).record
    return read_calibration_record(session, calibration, state)


def draw_preview(record: CalibrationRecord, files: Files) -> str:
    """Draw the largest frame of something lit with its region; "" where no preview is left to be read."""
    inputs = record.calibration.inputs
    shown = [
        (size_px, sha256, used["roi_sha256"])
        for used in inputs["frames"]
        if used["role"] != "dark"
        and (size_px := record.frames[used["sha256"]].size_px)
        and (sha256 := record.frames[used["sha256"]].preview_sha256)
    ]
    if not shown:
        return ""
    (width_px, height_px), sha256, key = max(shown, key=lambda one: one[0][0] * one[0][1])
    try:
        png = b"".join(files.open(sha256)[1])
    except blobs.BlobDamaged as damage:
        log.warning("a certificate is printed without its picture: %s", damage)
        return ""
    parts = inputs.get("roi_parts", {}).get(key) or [{"points": inputs["rois"][key]}]
    return sheets.draw_region(png, width_px, height_px, [part["points"] for part in parts])


def _issue_late(context: Context, calibration_id: str) -> None:
    with context.database.reading(snapshot=True) as session:
        record = gather(context, session, session.get_one(tables.Calibration, calibration_id))
    issued = schemas.Issued(at=tables.utc_now(), at_upgrade=True)
    certificate = build_certificate(record, issued=issued, published=list_published(record))
    printed = _print(context, record, certificate, first=False)
    try:
        with context.database.writing("service", record.organisation.id) as session:
            publications.keep_issued(session, record.acts[-1].publication, printed)
    except (IntegrityError, database.Conflict):
        log.info("another process has issued the certificate of %s", calibration_id)


def _print(
    context: Context, record: CalibrationRecord, certificate: schemas.CertificateAnswer, *, first: bool
) -> publications.PrintedCertificate:
    content, issued = certificate.dump(), certificate.issued
    assert issued is not None  # noqa: S101  narrows the type
    order = rendered.order_certificate(content, draw_preview(record, context.files))
    require = context.settings.decoder_sandbox == "require"
    pdf = rendered.render_apart(rendered.write_order(order), require=require, first=first)
    kept = [context.blobs.keep([each]) for each in (sheets.write_json(content).encode(), pdf)]
    row = tables.IssuedCertificate(
        amendment=issued.amends.amendment if issued.amends else 0,
        number=certificate.number,
        json_sha256=kept[0].sha256,
        pdf_sha256=kept[1].sha256,
        fitted_by=content.get("fitted_by"),
        approved_by=content.get("approved_by"),
        at_upgrade=issued.at_upgrade,
        issued_at=issued.at,
    )
    return publications.PrintedCertificate(row=row, files=kept)
