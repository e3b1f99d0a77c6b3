"""The certificate of a version: as JSON, and the same as PDF."""

import hashlib
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Annotated

from anyio import to_thread
from fastapi import Query, Request, Response
from fastapi.concurrency import run_in_threadpool

from radiometry.findings import interface
from service.documents import pages, rendered, schemas, sheets
from service.documents.certificate import build_certificate
from service.documents.dcc import write_dcc
from service.documents.issuing import draw_preview, find_issued, gather
from service.http import answers, lookup, models, operations, problems
from service.http.context import Context, UsesContext
from store import blobs, publications
from store.queries.calibration_record import CalibrationRecord
from store.queries.calibrations import read_version_statuses
from store.tables import Calibration, IssuedCertificate

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

    def send() -> Response:
        if issued is not None:
            return _send_issued(request, context, issued, "application/json")
        certificate, _ = _derive(context, calibration)
        return _answer(request, sheets.write_json(certificate).encode(), "application/json")

    return await run_in_threadpool(send)


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

    def order() -> tuple[str, rendered.Order]:
        certificate, record = _derive(context, calibration)
        return certificate["number"], rendered.order_certificate(
            certificate, draw_preview(record, context.files)
        )

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
        certificate, document, validity = _read(context, calibration, issued)
        missing = {"customer": "customer", "first_day": "started_at"}
        if lacking := [name for member, name in missing.items() if member not in certificate["work"]]:
            detail = f"A DCC needs more details of the campaign: enter its {' and '.join(lacking)}."
            raise problems.Problem(interface.VALIDATION_FAILED, detail)
        state = pages.find_state(certificate | {"validity": validity})
        dcc = write_dcc(certificate, country=query.country, state=state, document=document)
        return _answer(request, dcc, "application/xml")

    return await run_in_threadpool(send)


async def send_pdf(
    request: Request, context: Context, order: Callable[[], tuple[str, rendered.Order]]
) -> Response:
    """Send what is ordered, named by its number; few are made at once, and the others wait."""

    def make() -> Response:
        number, ordered = order()
        written = rendered.write_order(ordered)
        source = rendered.name_source(written)
        pdf = rendered.find_rendered(context, source) or rendered.render_and_keep(context, source, written)
        return _answer(request, pdf, "application/pdf", _name_pdf(number))

    return await to_thread.run_sync(make, limiter=context.presses)


async def _find(context: Context, calibration_id: str, amendment: int) -> IssuedCertificate | None:
    """Return what was issued of a version; None of a draft."""

    def find() -> list[IssuedCertificate] | None:
        with context.database.reading() as session:
            found = publications.list_issued(session, calibration_id)
            return None if not found and publications.is_published(session, calibration_id) else found

    found = await run_in_threadpool(find)
    if found is None:
        found = await to_thread.run_sync(find_issued, context, calibration_id, limiter=context.presses)
    if amendment and amendment >= len(found):
        raise problems.not_found("amendment")
    return found[amendment] if found else None


def _read(
    context: Context, calibration: Calibration, issued: IssuedCertificate | None
) -> tuple[sheets.Node, bytes, sheets.Node]:
    with context.database.reading() as session:
        status = read_version_statuses(session, [calibration.id])[calibration.id]
    if issued is None:
        certificate, _ = _derive(context, calibration)
        content = sheets.write_json(certificate).encode()
    else:
        with _naming(issued):
            content = b"".join(context.files.open(issued.json_sha256)[1])
        certificate = json.loads(content)
    return certificate, content, schemas.Validity.restate(status).dump()


def _derive(context: Context, calibration: Calibration) -> tuple[sheets.Node, CalibrationRecord]:
    with context.database.reading() as session:
        record = gather(context, session, calibration)
    return build_certificate(record).dump(), record


def _send_issued(request: Request, context: Context, issued: IssuedCertificate, media_type: str) -> Response:
    headers, sha256 = (
        {"Link": f'</v1/calibrations/{issued.calibration_id}>; rel="status"'},
        issued.json_sha256,
    )
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
    tag = hashlib.sha256(content).hexdigest()
    return answers.not_modified(request, tag, answers.standing_headers(tag)) or Response(
        content, headers={**answers.standing_headers(tag), **(headers or {})}, media_type=media_type
    )
