"""Two-page report of a measured surface: its figures as text, with the picture of its map."""

import struct
from collections.abc import Sequence
from typing import Any, Final

from fastapi import Request, Response

from radiometry.drawing.chart import find_step
from radiometry.drawing.text import in_step, write_exposure, write_unit
from radiometry.findings import interface
from radiometry.methods import findings, get_method
from radiometry.records import Record
from radiometry.specification.application import SurfaceApplication
from service.documents.issuing import send_pdf
from service.documents.rendered import write_order
from service.documents.sheets import Node, draw_region, percent, plain, stamp, table
from service.http import answers, lookup, operations, problems
from service.http.context import UsesContext
from service.measurements import exports, routes
from store.files import Files
from store.queries import calibrations, organisations
from store.tables import Calibration, Camera, Campaign, FrameRow, Measurement, Organisation

REGIONS: Final = {
    "request": "the region drawn for this measurement",
    "grid": "the outline of the surface with cells",
    "frame": "the frame's own region",
    "campaign": "the campaign's region",
    "whole_frame": "the whole frame",
}
_HEADLINES: Final = (
    ("mean", "Mean"),
    ("median", "Median"),
    ("min", "Darkest pixel"),
    ("max", "Brightest pixel"),
    ("illuminance", "Illuminance π L / reflectance"),
    ("grid_illuminance", "Illuminance of the cells"),
    ("l_av_cd_m2", "Mean of the cells L_av"),
    ("l_min_cd_m2", "Darkest cell L_min"),
    ("l_max_cd_m2", "Brightest cell L_max"),
    ("u_o", "Overall uniformity U_o"),
)
_MOST_CELLS: Final = 16  # along each side
_WIDE: Final = 8  # columns up to which a cell has its uncertainty beside its value
_MOST_FLAGS: Final = 10
_MOST_FRAMES: Final = 4
_LONGEST: Final = 120  # letters of what people type


class Reported(Record):
    """Statements beside the measurement's answer; `picture`: SVG of the map, else of the preview, or ""."""

    quantity: str
    camera: Camera
    place: str | None
    exposure: Node | None
    by: str
    label: str
    version: Calibration
    status: calibrations.VersionStatus
    picture: str
    has_map: bool


def lay_out_report(measurement: Node, reported: Reported) -> Node:
    number, repeats = measurement["id"], len(measurement.get("frame_ids", [""])) - 1
    more = f" and {repeats} more of the same scene" if repeats else ""
    return {
        "template": "report.typ",
        "title": f"Measurement of {reported.quantity}",
        "number": number,
        "created_at": measurement["created_at"],
        "by": reported.by,
        "footer": "Report of one measurement. It is not a calibration certificate.",
        "item": [
            ["Frame", _cut(measurement["filename"]) + more],
            ["Camera", _cut(f"{reported.camera.make} {reported.camera.model}")],
            ["Serial number", _cut(reported.camera.serial)],
            ["Exposure", _write_exposure(reported.exposure)],
        ],
        "work": [
            ["Taken", (measurement.get("taken_at") or "not in the file").replace("T", " ")],
            ["Position", _write_position(measurement)],
            ["Place", _cut(reported.place) if reported.place else "not recorded"],
            ["Measured", stamp(measurement["created_at"])],
        ],
        "results": _tabulate_results(measurement),
        "notes": list(_list_notes(measurement)),
        "picture": {"svg": reported.picture, "caption": _caption(measurement, reported)},
        "cells": tabulate_cells(measurement["grid"]) if "grid" in measurement else None,
        "budget": _tabulate_budget(measurement),
        "flags": tabulate_flags(measurement["flags"]),
        "calibration": _list_calibration(measurement, reported),
        "record": [
            ["Measurement", number],
            ["Software", ", ".join(f"{name} {made}" for name, made in measurement["software"].items())],
            ["Content, SHA-256", measurement["content_sha256"]],
            ["Frames", _list_frames(measurement.get("frame_ids", [measurement["frame_id"]]))],
        ],
    }


def _list_frames(frame_ids: Sequence[str]) -> str:
    more = len(frame_ids) - _MOST_FRAMES
    return "\n".join([*frame_ids[:_MOST_FRAMES], *([f"and {more} more"] if more > 0 else [])])


def _cut(text: str) -> str:
    line = " ".join(text.split())
    return line if len(line) <= _LONGEST else f"{line[:_LONGEST]}…"


def _write_position(measurement: Node) -> str:
    if "latitude_deg" not in measurement or "longitude_deg" not in measurement:
        return "not in the file"
    height = f", {plain(measurement['altitude_m'])} m" if "altitude_m" in measurement else ""
    return f"{measurement['latitude_deg']:.6f}°, {measurement['longitude_deg']:.6f}°{height}"


def _write_exposure(exposure: Node | None) -> str:
    if not exposure:
        return "not recorded"
    time = write_exposure(exposure["exposure_time_s"])
    return f"{time}, f/{plain(exposure['f_number'])}, ISO {plain(exposure['iso'])}"


def _tabulate_results(measurement: Node) -> Node:
    named = [(label, measurement[name]) for name, label in _HEADLINES if name in measurement]
    if measurement.get("u_l"):
        worst = min(measurement["u_l"], key=lambda each: each["value"])
        named.append(("Longitudinal uniformity U_l, worst row", worst))
    rows = []
    for label, each in named:
        value, u = in_step(each["value"], each["standard_uncertainty"])
        relative = percent(each["standard_uncertainty"] / abs(each["value"])) if each["value"] else "-"
        rows.append([label, value, u, relative, "" if each["unit"] == "1" else write_unit(each["unit"])])
    head = ["quantity", "value", "standard uncertainty u", "u, relative", "unit"]
    return table(head, rows, align="lrrrl", widths=[3, 1.2, 1.5, 1.1, 0.8])


def _list_notes(measurement: Node) -> Any:  # noqa: ANN401  a generator
    pixels = f" ({measurement['pixels']:,} pixels)" if measurement.get("pixels") else ""
    yield f"Mean, median and pixels: of {REGIONS[measurement['region_origin']]}{pixels}."
    if "coverage_factor" in measurement:
        _, expanded = in_step(measurement["mean"]["value"], measurement["expanded_uncertainty_cd_m2"])
        yield f"Mean: U = {expanded} cd/m² for 95 %, k = {measurement['coverage_factor']:.2f}."
    if measurement.get("uncertainty_scope") == "relative_only":
        yield (
            "Uncertainties are relative only: the calibration has no meter certificate, so that the error of "
            "the meter's scale is not in them. They hold for ratios."
        )
    if measurement.get("saturated_share"):
        yield f"Saturated: {percent(measurement['saturated_share'])} of the region's samples."
    if "u_o" in measurement:
        yield "U_o is the smallest cell mean divided by the mean of all cells: 1 is uniform."
    if "seen_from" in measurement:
        yield f"Seen from {measurement['seen_from']}. {measurement['seen_from_detail']}"


def _caption(measurement: Node, reported: Reported) -> str:
    cells = "; the thin lines are the cells, row 1 and column 1 at the grid's first corner"
    drawn = f"The white outline is the region{cells if 'grid' in measurement else ''}."
    if reported.has_map:
        return f"Luminance in false colours with its scale. {drawn}"
    missing = "Measured without a map: measure again with a map for false colours and their scale."
    return f"Preview of the frame. {drawn} {missing}" if reported.picture else missing


def tabulate_cells(grid: Node) -> Node:
    rows, columns = grid["rows"], grid["columns"]
    shown, between = grid["cells"][:_MOST_CELLS], " ± " if columns <= _WIDE else "\n± "
    wide = min(columns, _MOST_CELLS)
    caption = "Mean of each cell ± standard uncertainty in cd/m², in order of the surface."
    if rows > _MOST_CELLS or columns > _MOST_CELLS:
        caption += f" The first {len(shown)} of {rows} rows and {wide} of {columns} columns; "
        caption += "all are in cells.csv."
    written = [
        [
            str(n),
            *(between.join(in_step(each["value"], each["standard_uncertainty"])) for each in line[:wide]),
        ]
        for n, line in enumerate(shown, start=1)
    ]
    head = ["", *(str(n) for n in range(1, wide + 1))]
    return table(head, written, align="l" + "r" * wide, widths=[0.5] + [1.0] * wide, caption=caption)


def _tabulate_budget(measurement: Node) -> Node:
    mean = abs(measurement["mean"]["value"])
    rows = []
    for each in sorted(measurement["budget"], key=lambda each: -each["variance_share"]):
        u = each["standard_uncertainty_cd_m2"]
        kind = "the same in every pixel" if each["shared"] else "of this region only"
        relative = percent(u / mean) if mean else "-"
        rows.append([each["source"], kind, plain(u, 2), relative, percent(each["variance_share"])])
    head = ["source", "error", "u in cd/m²", "u, relative", "share of variance"]
    return table(
        head,
        rows,
        align="llrrr",
        widths=[2.2, 2, 1, 1, 1.2],
        caption="No mean over pixels reduces an error that is the same in every pixel.",
    )


def tabulate_flags(flags: Sequence[Node]) -> Node:
    rows = []
    for each in flags[:_MOST_FLAGS]:
        finding = findings.FINDINGS[each["flag"]]
        where = f"{each['where']}: " if each["where"] else ""
        rows.append([f"{finding.sentence}\n{where}{each['detail']}", finding.remedy.replace("`", "")])
    others = ", ".join(dict.fromkeys(each["flag"] for each in flags[_MOST_FLAGS:]))
    caption = f"The first {_MOST_FLAGS} of {len(flags)}; also raised: {others}." if others else ""
    return table(["flag", "what to do"], rows, align="ll", widths=[3, 2], caption=caption)


def _list_calibration(measurement: Node, reported: Reported) -> list[list[str]]:
    used, status = measurement["calibration"], reported.status
    start, end = (stamp(each.isoformat()) if each else "" for each in (status.valid_from, status.valid_to))
    interval = f"from {start} {f'to {end}' if end else 'on'}" if start else "not in force"
    falloff = {"none": "none", "file": "as stated in the file"}
    rows = [
        ["Version", f"{reported.label}, version {used['version']} ({used['state']}), {used['id']}"],
        ["In force", interval],
        ["Chosen because", used["why"]],
        ["Content, SHA-256", reported.version.content_sha256],
        ["Vignetting", falloff.get(measurement["vignetting"], f"corrected by {measurement['vignetting']}")],
    ]
    if "revoked_reason" in used:
        rows.append(["Revoked because", _cut(used["revoked_reason"])])
    for each in measurement["corrections"]:
        made = "" if each["factor"] == 1 else f"factor {plain(each['factor'], 4)}, "
        taken = f"minus {plain(each['offset_cd_m2'], 3)} cd/m², " if each["offset_cd_m2"] else ""
        rows.append([each["source"].capitalize(), f"{made}{taken}{each['basis']}"])
    return rows


router = operations.Router(prefix="/v1/measurements/{measurement_id}", tags=["measurements"])

_LINES = 'fill="none" stroke="#ffffff" stroke-opacity="0.9"'


@router.get("/report.pdf", **answers.sends_stored_file("application/pdf"))
async def get_measurement_report(
    measurement: lookup.Own[Measurement], request: Request, context: UsesContext
) -> Response:
    """The measurement of a surface on two pages of A4 (PDF/A): figures, map, cells, budget and flags.

    Without a map it has the frame's preview. Long tables end with a sentence that says so.
    """
    spec = get_method(measurement.method)
    if not isinstance(application := spec.application, SurfaceApplication):
        detail = "Only the measurement of a surface has a report: this one has none."
        raise problems.Problem(interface.NOT_FOUND, detail)

    def order() -> tuple[str, bytes]:
        with context.database.reading() as session:
            frame = session.get_one(FrameRow, measurement.frame_id)
            version = session.get_one(Calibration, measurement.calibration_id)
            laboratory = session.get_one(Organisation, measurement.organisation_id)
            reported = Reported(
                quantity=application.quantity,
                camera=session.get_one(Camera, version.camera_id),
                place=session.get_one(Campaign, measurement.campaign_id).place,
                exposure=frame.exposure,
                by=organisations.name_laboratory(laboratory),
                label=spec.label,
                version=version,
                status=calibrations.read_version_statuses(session, [version.id])[version.id],
                picture=_draw(measurement, frame, context.files),
                has_map=measurement.map_png_sha256 is not None,
            )
            answer = routes.answer_measurements(session, [measurement])[0].dump()
        return measurement.id, write_order("sheets", sheets=lay_out_report(answer, reported))

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
    cells = list(exports.list_outlines(row, "pixel")) if row.parameters.get("grid") else []
    return draw_region(png, width_px, height_px, [row.parameters["polygon"]], thin=cells, style=_LINES)
