"""The certificate of a version: as JSON, and the same as PDF."""

import hashlib
from collections.abc import Callable
from typing import Annotated

from anyio import to_thread
from fastapi import Query, Request, Response
from pydantic import Field
from sqlalchemy.orm import Session

from radiometry.findings import interface
from service.auth import Caller, Reader
from service.certificate import build_certificate, describe_dataset, write_dcc
from service.context import Context, UsesContext
from service.hosts import absolute
from service.immutable import not_modified, standing_headers
from service.lookup import Id, owned
from service.messages import COUNTRY
from service.operations import Router
from service.press.kept import find_rendered, name_source, render_and_keep
from service.press.orders import Order, order_certificate, write_order
from service.press.regions import draw_region
from service.press.sheet import Node, write_json
from service.problems import Problem
from service.routes import UNCHANGED, problems, sends_file, sends_stored_file
from service.schemas.base import Form
from service.schemas.certificates import CertificateAnswer
from store.files import Files
from store.queries.calibration_record import CalibrationRecord, read_calibration_record
from store.tables import Calibration

router = Router(prefix="/v1/calibrations/{calibration_id}", tags=["certificates"])


class DccOptions(Form):
    """Entries of a DCC that the certificate lacks."""

    country: str = Field(
        pattern=COUNTRY, description="Of the laboratory: two letters of ISO 3166.", examples=["DE"]
    )


@router.get("/certificate.json", response_model=CertificateAnswer, responses={**UNCHANGED, **problems(404)})
def get_certificate(calibration_id: Id, request: Request, caller: Reader, context: UsesContext) -> Response:
    """Everything that a laboratory hands out with a calibration, and what is needed to recompute it.

    Its figures never change; who published or revoked it and what was ticked may: the ETag follows all of it.
    """
    with context.database.reading() as session:
        certificate = build_certificate(_gather(context, session, calibration_id, caller)).dump()
    return send_certificate_json(request, certificate)


@router.get("/certificate.pdf", response_class=Response, responses=sends_stored_file("application/pdf"))
async def get_certificate_pdf(
    calibration_id: Id, request: Request, caller: Reader, context: UsesContext
) -> Response:
    """The certificate on paper (PDF/A-3): the very numbers of certificate.json, with plots and the region.

    certificate.json is attached to it, byte for byte.

    A table of more than 200 rows ends with a sentence that says so; certificate.json holds all of them.
    """

    def order() -> tuple[str, Order]:
        with context.database.reading() as session:
            record = _gather(context, session, calibration_id, caller)
        certificate = build_certificate(record).dump()
        return certificate["number"], order_certificate(certificate, _draw_preview(record, context.files))

    return await send_pdf(request, context, order)


@router.get("/certificate.xml", response_class=Response, responses=sends_file("application/xml"))
def get_certificate_dcc(
    calibration_id: Id,
    query: Annotated[DccOptions, Query()],
    request: Request,
    caller: Reader,
    context: UsesContext,
) -> Response:
    """The certificate as a Digital Calibration Certificate (DCC 3.1.2).

    certificate.json is its document. A DCC needs a customer and the days of the work: 422 without.
    """
    with context.database.reading() as session:
        certificate = build_certificate(_gather(context, session, calibration_id, caller)).dump()
    missing = {"customer": "customer", "first_day": "started_at"}
    lacking = [name for member, name in missing.items() if member not in certificate["work"]]
    if lacking:
        detail = f"A DCC needs more details of the campaign: enter its {' and '.join(lacking)}."
        raise Problem(interface.VALIDATION_FAILED, detail)
    return _answer(request, write_dcc(certificate, country=query.country), "application/xml")


@router.get("/dataset.jsonld", response_class=Response, responses=sends_file("application/ld+json"))
def get_dataset_jsonld(
    calibration_id: Id, request: Request, caller: Reader, context: UsesContext
) -> Response:
    """The certificate as a schema.org Dataset with Dublin Core terms (JSON-LD), for a catalogue."""
    with context.database.reading() as session:
        certificate = build_certificate(_gather(context, session, calibration_id, caller)).dump()
    described = describe_dataset(certificate, address=absolute(request, f"/v1/calibrations/{calibration_id}"))
    return _answer(request, write_json(described).encode(), "application/ld+json")


def send_certificate_json(request: Request, certificate: Node) -> Response:
    """Send a certificate as JSON, with an ETag of its content."""
    return _answer(request, write_json(certificate).encode(), "application/json")


async def send_pdf(request: Request, context: Context, order: Callable[[], tuple[str, Order]]) -> Response:
    """Send what is ordered, named by its number; few are made at once, and the others wait."""

    def make() -> Response:
        number, ordered = order()
        name = "".join(c if c.isascii() and (c.isalnum() or c in "-_.") else "_" for c in number)
        headers = {"Content-Disposition": f'inline; filename="{name}.pdf"'}
        written = write_order(ordered)
        source = name_source(written)
        pdf = find_rendered(context, source) or render_and_keep(context, source, written)
        return _answer(request, pdf, "application/pdf", headers)

    return await to_thread.run_sync(make, limiter=context.presses)


def _gather(context: Context, session: Session, calibration_id: str, caller: Caller) -> CalibrationRecord:
    calibration = owned(session, Calibration, calibration_id, caller)
    state = context.reviews.find(session, calibration.campaign_id).record
    return read_calibration_record(session, calibration, state)


def _draw_preview(record: CalibrationRecord, files: Files) -> str:
    """The largest frame of something lit that has a preview, with the region in which it was measured."""
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
    png = b"".join(files.open(sha256)[1])
    parts = inputs.get("roi_parts", {}).get(key) or [{"points": inputs["rois"][key]}]
    return draw_region(png, width_px, height_px, [part["points"] for part in parts])


def _answer(
    request: Request, content: bytes, media_type: str, headers: dict[str, str] | None = None
) -> Response:
    tag = hashlib.sha256(content).hexdigest()
    return not_modified(request, tag, standing_headers(tag)) or Response(
        content, headers={**standing_headers(tag), **(headers or {})}, media_type=media_type
    )
