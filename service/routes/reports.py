"""The report of a measurement on paper."""

import struct

from fastapi import Request, Response

from radiometry.drawing.chart import find_step
from radiometry.findings import interface
from radiometry.methods import get_method
from radiometry.specification.application import SurfaceApplication
from service.auth import Reader
from service.cells import list_outlines
from service.certificate import lay_out_report
from service.certificate.report import Reported
from service.context import UsesContext
from service.lookup import Id, owned
from service.measurements import answer_measurements
from service.operations import Router
from service.press.orders import Order, order_sheets
from service.press.regions import draw_region
from service.problems import Problem
from service.routes import sends_stored_file
from service.routes.certificates import send_pdf
from store.files import Files
from store.queries.calibrations import read_version_statuses
from store.queries.organisations import name_laboratory
from store.tables import Calibration, Camera, Campaign, FrameRow, Measurement, Organisation

router = Router(prefix="/v1/measurements/{measurement_id}", tags=["measurements"])

_LINES = 'fill="none" stroke="#ffffff" stroke-opacity="0.9"'


@router.get("/report.pdf", response_class=Response, responses=sends_stored_file("application/pdf"))
async def get_measurement_report(
    measurement_id: Id, request: Request, caller: Reader, context: UsesContext
) -> Response:
    """The measurement of a surface on two pages of A4 (PDF/A): figures, map, cells, budget and flags.

    Without a map it has the frame's preview. Long tables end with a sentence that says so.
    """

    def order() -> tuple[str, Order]:
        with context.database.reading() as session:
            row = owned(session, Measurement, measurement_id, caller)
            spec = get_method(row.method)
            if not isinstance(spec.application, SurfaceApplication):
                detail = "Only the measurement of a surface has a report: this one has none."
                raise Problem(interface.NOT_FOUND, detail)
            frame = session.get_one(FrameRow, row.frame_id)
            version = session.get_one(Calibration, row.calibration_id)
            reported = Reported(
                quantity=spec.application.quantity,
                camera=session.get_one(Camera, version.camera_id),
                place=session.get_one(Campaign, row.campaign_id).place,
                exposure=frame.exposure,
                by=name_laboratory(session.get_one(Organisation, row.organisation_id)),
                label=spec.label,
                version=version,
                status=read_version_statuses(session, [version.id])[version.id],
                picture=_draw(row, frame, context.files),
                has_map=row.map_png_sha256 is not None,
            )
            return row.id, order_sheets(
                lay_out_report(answer_measurements(session, [row])[0].dump(), reported)
            )

    return await send_pdf(request, context, order)


def _draw(row: Measurement, frame: FrameRow, files: Files) -> str:
    """Draw region and cells on the map's picture, else on the frame's preview; "" without either."""
    sha256, header = row.map_png_sha256 or frame.preview_sha256, frame.header or {}
    if sha256 is None or not header:
        return ""
    png = b"".join(files.open(sha256)[1])
    width_px, height_px = header["width_px"], header["height_px"]
    if row.map_png_sha256:
        step = find_step(width_px)
        width_px, height_px = (step * side for side in struct.unpack(">II", png[16:24]))
    cells = list(list_outlines(row, "pixel")) if row.parameters.get("grid") else []
    return draw_region(png, width_px, height_px, [row.parameters["polygon"]], thin=cells, style=_LINES)
