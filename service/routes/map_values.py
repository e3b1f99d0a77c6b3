"""The numbers of a measurement's map as JSON, and its STAC item."""

import hashlib
from typing import Annotated

from fastapi import Query, Request, Response

from radiometry.findings import interface
from service.auth import Caller, Reader
from service.context import Context, UsesContext
from service.hosts import absolute
from service.immutable import immutable_headers, not_modified
from service.lookup import Id, owned
from service.map_tools import map_uncertainty, open_map
from service.map_values import MOST_VALUES, Layout, Window, read_values
from service.operations import Router
from service.problems import Problem, invalid
from service.routes import UNCHANGED, problems
from service.routes.measurement_lists import GeoJson
from service.schemas.maps import MapValuesAnswer, MapWindow, StacItem
from service.stac import describe_map, make_item
from store.blobs import prove_file
from store.tables import Calibration, FrameRow, Measurement

router = Router(prefix="/v1", tags=["measurements"])


@router.get(
    "/measurements/{measurement_id}/map.json",
    response_model=MapValuesAnswer,
    responses={**UNCHANGED, **problems(404, 500)},
)
def get_measurement_map_values(
    measurement_id: Id,
    request: Request,
    caller: Reader,
    context: UsesContext,
    asked: Annotated[MapWindow, Query()],
) -> Response:
    """A window of the map: with step 1 the very values of map.tif, else the means of squares.

    With `layer` their relative expanded uncertainty in place of the values.
    """
    with open_map(context, measurement_id, caller) as found:
        tag = found.tag(asked.tag)
        unchanged = not_modified(request, tag)
        if unchanged is not None:
            return unchanged
        layout = found.layout
        window = _cut(layout, asked)
        values = read_values(found.path, layout, window, step=asked.step)
        if asked.layer == "expanded_uncertainty_rel":
            values = map_uncertainty(found, window, values, step=asked.step)
        answer = MapValuesAnswer.of(found.row, layout, window, values, asked, notes=found.list_notes())
    return answer.respond(immutable_headers(tag))


@router.get(
    "/measurements/{measurement_id}/stac.json",
    response_model=StacItem,
    response_class=GeoJson,
    responses={**UNCHANGED, **problems(404, 500)},
)
def get_measurement_stac(
    measurement_id: Id, request: Request, caller: Reader, context: UsesContext
) -> Response:
    """Return the map as a STAC item, with the extensions eo, processing, projection and raster.

    Its geometry is null where the map is not placed. A local time without a zone becomes the interval that
    it lies in.
    """
    row, sha256 = _require_map(context, measurement_id, caller)
    base = absolute(request, "")
    tag = hashlib.sha256(f"{sha256}-{row.id}-{base}".encode()).hexdigest()
    unchanged = not_modified(request, tag)
    if unchanged is not None:
        return unchanged
    with context.files.local(sha256) as file:
        prove_file(file)
        found = describe_map(file.path)
    with context.database.reading() as session:
        frame = session.get_one(FrameRow, row.frame_id)
        calibration = session.get_one(Calibration, row.calibration_id)
        item = make_item(row, frame, calibration, found, base=base)
    return GeoJson(item, headers=immutable_headers(tag))


def _require_map(context: Context, measurement_id: str, caller: Caller) -> tuple[Measurement, str]:
    """Return a measurement that was made with a map, and the hash of that."""
    with context.database.reading() as session:
        row = owned(session, Measurement, measurement_id, caller)
    if row.map_tif_sha256 is None:
        detail = 'This measurement was made without a map: ask for one with "products": ["map"].'
        raise Problem(interface.NOT_FOUND, detail)
    return row, row.map_tif_sha256


def _cut(layout: Layout, asked: MapWindow) -> Window:
    bottom = min(layout.height_px, asked.top + (asked.height or layout.height_px))
    right = min(layout.width_px, asked.left + (asked.width or layout.width_px))
    rows, cols = (bottom - asked.top) // asked.step, (right - asked.left) // asked.step
    if rows < 1 or cols < 1:
        size = f"{layout.height_px} rows and {layout.width_px} columns"
        message = f"the map has {size}: the window holds no whole square of it"
        raise invalid([{"type": "window", "loc": ("query", "top"), "msg": message}])
    if rows * cols > MOST_VALUES:
        message = f"{rows * cols} values at once are too many: take a larger step, or a smaller window"
        raise invalid([{"type": "window", "loc": ("query", "step"), "msg": message}])
    return Window(top=asked.top, left=asked.left, bottom=bottom, right=right)
