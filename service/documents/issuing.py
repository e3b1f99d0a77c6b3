"""Certificates of versions: issued with their publication, and sent as JSON, PDF and DCC."""

import hashlib
import json
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Annotated, Final

from anyio import to_thread
from fastapi import Query, Request, Response
from fastapi.concurrency import run_in_threadpool
from sqlalchemy.exc import IntegrityError, SQLAlchemyError
from sqlalchemy.orm import Session

from radiometry.findings import interface
from service.calibrations.schemas import Gap, NewPublication
from service.documents import pages, rendered, schemas, sheets
from service.documents.certificate import build_certificate, list_published
from service.documents.dcc import write_dcc
from service.documents.rendered import write_order
from service.http import answers, lookup, models, operations, problems
from service.http.auth import Caller
from service.http.context import Context, UsesContext
from store import blobs, database, publications, tables
from store.files import Files
from store.queries.calibration_record import CalibrationRecord, read_calibration_record
from store.queries.calibrations import read_version_statuses
from store.tables import Calibration, IssuedCertificate

log = logging.getLogger(__name__)

_LOOK_AGAIN_S: Final = 3600.0
_REST_S: Final = 1.0


def prepare(
    context: Context, calibration_id: str, caller: Caller, publication: NewPublication
) -> tuple[publications.PrintedCertificate, list[Gap]]:
    """Make and store the certificate that a publication issues, and list its gaps; 409 if they refuse it."""
    with context.database.reading() as session:
        calibration = lookup.owned(session, Calibration, calibration_id, caller)
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
    return _print(context, record, certificate, first=True), certificate.gaps


def build_issued(
    session: Session, record: CalibrationRecord, caller: Caller, publication: NewPublication
) -> schemas.CertificateAnswer:
    now, earlier = tables.utc_now(), publications.list_issued(session, record.calibration.id)
    amends = schemas.Amended.restate(earlier[0], amendment=earlier[-1].amendment + 1) if earlier else None
    act = schemas.PublishedBy.restate(publication, by=caller.named, at=now)
    issued = schemas.Issued(at=now, at_upgrade=False, amends=amends)
    return build_certificate(record, issued=issued, approved_by=caller.person, published=[act])


def find_issued(context: Context, calibration_id: str) -> list[IssuedCertificate]:
    """Return what was issued of a version; one that was published before that was kept is issued now."""
    if (found := _look_up(context, calibration_id)) is None:
        _issue_late(context, calibration_id)
        found = _look_up(context, calibration_id)
    return found or []


def _look_up(context: Context, calibration_id: str) -> list[IssuedCertificate] | None:
    """Return what was issued of a version; None of one that is published and still to be issued."""
    with context.database.reading() as session:
        found = publications.list_issued(session, calibration_id)
        return None if not found and publications.is_published(session, calibration_id) else found


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


def gather(context: Context, session: Session, calibration: Calibration) -> CalibrationRecord:
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
        record = gather(context, session, session.get_one(Calibration, calibration_id))
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
    order = write_order("certificate", certificate=content, preview=draw_preview(record, context.files))
    require = context.settings.decoder_sandbox == "require"
    pdf = rendered.render_apart(order, require=require, first=first)
    kept = [context.blobs.keep([each]) for each in (sheets.write_json(content).encode(), pdf)]
    row = IssuedCertificate(
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


router = operations.Router(prefix="/v1/calibrations/{calibration_id}", tags=["certificates"])


class Chosen(models.Form):
    """Which of the certificates that were issued of a version."""

    amendment: int = models.told("The number of an amendment; without it, the original.", default=0, ge=0)


WhichOne = Annotated[Chosen, Query()]


class DccOptions(Chosen):
    """Entries of a DCC that the certificate lacks."""

    country: str = models.told(
        "Of the laboratory: two letters of ISO 3166.", pattern=problems.COUNTRY, examples=["DE"]
    )


@router.get("/certificate.json", **answers.sends(schemas.CertificateAnswer, 404, 416, 500))
async def get_certificate(
    calibration: lookup.Own[Calibration], query: WhichOne, request: Request, context: UsesContext
) -> Response:
    """Everything that a laboratory hands out with a calibration, and what is needed to recompute it.

    Of a published version these are the bytes that were issued with its publication. What was decided since
    stands with the version, which the header `Link` names (rel `status`). Of a draft it is derived when it is
    read: the ETag follows all of it.
    """
    issued = await _find(context, calibration.id, query.amendment)
    if issued is not None:
        return await run_in_threadpool(_send_issued, request, context, issued, "application/json")
    document = await run_in_threadpool(_read, context, calibration, None)
    return _answer(request, document, "application/json")


@router.get("/certificate.pdf", **answers.sends_stored_file("application/pdf"))
async def get_certificate_pdf(
    calibration: lookup.Own[Calibration], query: WhichOne, request: Request, context: UsesContext
) -> Response:
    """The certificate on paper (PDF/A-3): the very numbers of certificate.json, with plots and the region.

    certificate.json is attached to it, byte for byte; of a published version it is kept as issued, too.

    A table of more than 200 rows ends with a sentence that says so; certificate.json holds all of them.
    """
    issued = await _find(context, calibration.id, query.amendment)
    if issued is not None:
        return await run_in_threadpool(_send_issued, request, context, issued, "application/pdf")

    def order() -> tuple[str, bytes]:
        certificate, record = _derive(context, calibration)
        preview = draw_preview(record, context.files)
        return certificate["number"], write_order("certificate", certificate=certificate, preview=preview)

    return await send_pdf(request, context, order)


@router.get("/certificate.xml", **answers.sends_file("application/xml"))
async def get_certificate_dcc(
    calibration: lookup.Own[Calibration],
    query: Annotated[DccOptions, Query()],
    request: Request,
    context: UsesContext,
) -> Response:
    """The certificate as a Digital Calibration Certificate (DCC 3.1.2), marked as the version stands now.

    certificate.json is its document. A DCC needs a customer and the days of the work: 422 without.
    """
    issued = await _find(context, calibration.id, query.amendment)

    def send() -> Response:
        document = _read(context, calibration, issued)
        certificate = json.loads(document)
        missing = {"customer": "customer", "first_day": "started_at"}
        if lacking := [name for member, name in missing.items() if member not in certificate["work"]]:
            detail = f"A DCC needs more details of the campaign: enter its {' and '.join(lacking)}."
            raise problems.Problem(interface.VALIDATION_FAILED, detail)
        with context.database.reading() as session:
            status = read_version_statuses(session, [calibration.id])[calibration.id]
        state = pages.find_state(certificate | {"validity": {"state": status.state}})
        dcc = write_dcc(certificate, country=query.country, state=state, document=document)
        return _answer(request, dcc, "application/xml")

    return await run_in_threadpool(send)


async def send_pdf(request: Request, context: Context, order: Callable[[], tuple[str, bytes]]) -> Response:
    """Send what is ordered, named by its number; few are made at once, and the others wait."""

    def make() -> Response:
        number, ordered = order()
        source = rendered.name_source(ordered)
        pdf = rendered.find_rendered(context, source) or rendered.render_and_keep(context, source, ordered)
        return _answer(request, pdf, "application/pdf", _name_pdf(number))

    return await to_thread.run_sync(make, limiter=context.presses)


async def _find(context: Context, calibration_id: str, amendment: int) -> IssuedCertificate | None:
    """Return what was issued of a version; None of a draft."""
    found = await run_in_threadpool(_look_up, context, calibration_id)
    if found is None:
        found = await to_thread.run_sync(find_issued, context, calibration_id, limiter=context.presses)
    if amendment and amendment >= len(found):
        raise problems.not_found("amendment")
    return found[amendment] if found else None


def _read(context: Context, calibration: Calibration, issued: IssuedCertificate | None) -> bytes:
    """Return the certificate as JSON: as it was issued, or what a draft would be now."""
    if issued is None:
        return sheets.write_json(_derive(context, calibration)[0]).encode()
    with _naming(issued):
        return b"".join(context.files.open(issued.json_sha256)[1])


def _derive(context: Context, calibration: Calibration) -> tuple[sheets.Node, CalibrationRecord]:
    with context.database.reading() as session:
        record = gather(context, session, calibration)
    return build_certificate(record).dump(), record


def _send_issued(request: Request, context: Context, issued: IssuedCertificate, media_type: str) -> Response:
    headers = {"Link": f'</v1/calibrations/{issued.calibration_id}>; rel="status"'}
    sha256 = issued.json_sha256
    if media_type == "application/pdf":
        headers, sha256 = headers | _name_pdf(issued.number), issued.pdf_sha256
    with _naming(issued):
        return answers.send_blob(request, context.files, sha256, media_type, headers)


@contextmanager
def _naming(issued: IssuedCertificate) -> Iterator[None]:
    """Name the certificate if its file is damaged: no upload brings it back."""
    try:
        yield
    except blobs.BlobDamaged as damage:
        raise problems.Problem(
            interface.STORED_FILE_DAMAGED,
            f"The stored file {damage.sha256} of certificate {issued.number} is {damage.damage}, and nothing "
            "is handed out in its place. The operator of the service restores it from a backup or an export.",
        ) from damage


def _name_pdf(number: str) -> dict[str, str]:
    name = "".join(c if c.isascii() and (c.isalnum() or c in "-_.") else "_" for c in number)
    return {"Content-Disposition": f'inline; filename="{name}.pdf"'}


def _answer(
    request: Request, content: bytes, media_type: str, headers: dict[str, str] | None = None
) -> Response:
    standing = answers.standing(request, hashlib.sha256(content).hexdigest())
    return Response(content, headers=standing | (headers or {}), media_type=media_type)
