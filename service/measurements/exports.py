"""Measurements for other programs: as series and GeoJSON, maps as numbers and as STAC items."""

import csv
import hashlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Final, Literal
from xml.etree import ElementTree as ET
from xml.sax.saxutils import unescape

import numpy as np
from fastapi import Query, Request, Response
from fastapi.responses import JSONResponse

from radiometry import maps as science
from radiometry.findings import interface
from radiometry.frame.grid import Grid
from radiometry.frame.roi import Window
from service.coefficients import series
from service.http import answers, connections, models, operations, tables
from service.http.auth import Reader
from service.http.context import UsesContext
from service.http.lookup import Own
from service.http.problems import Problem, wrong
from service.measurements import maps, routes
from store.blobs import prove_file
from store.codec import decode
from store.queries.frame_times import Zones, read_frame_time
from store.ready.rows import COLUMNS, read_row, write_instant
from store.ready.series import Asked, MeasurementSeries
from store.tables import Calibration, Campaign, FrameRow, Measurement

Coordinates = Literal["pixel", "road_m"]


def list_cells(row: Measurement) -> Iterator[dict[str, Any]]:
    """Yield each cell, row by row: its place, its luminance, and its centre in the frame and on the road."""
    points = (row.parameters.get("lanes") or {}).get("points_m")
    middles = decode(Grid, row.parameters["grid"]).find_middles()
    for line, cells in enumerate(row.result["surface"]["cells"]):
        for place, cell in enumerate(cells):
            x_px, y_px = middles[line, place].tolist()
            yield {
                "row": line + 1,
                "column": place + 1,
                "luminance_cd_m2": cell["value"],
                "standard_uncertainty_cd_m2": cell["standard_uncertainty"],
                "x_px": x_px,
                "y_px": y_px,
                **(dict(zip(("x_m", "y_m"), points[line][place], strict=True)) if points else {}),
                "seen_from": "above",
            }


def list_outlines(row: Measurement, coordinates: Coordinates) -> list[list[list[float]]]:
    grid: Grid = decode(Grid, row.parameters["grid"])
    if coordinates == "road_m":
        lanes = row.parameters["lanes"]
        return grid.outline_cells((lanes["along_m"], lanes["across_m"]))
    return grid.outline_cells()


router = operations.Router(prefix="/v1", tags=["measurements"])


class MeasurementSeriesQuery(series.SeriesQuery):
    campaign_id: models.Text | None = None
    calibration_id: routes.OfCalibration = None
    start: models.Instant | None = models.maybe(
        "Of frames taken at this time or later, as far as the file names a time zone.", alias="from"
    )
    end: models.Instant | None = models.maybe("Of frames taken before this time.", alias="to")


_COLUMNS = series.describe_columns(series.MeasurementSeriesRow)  # type: ignore[arg-type]


class GeoJson(JSONResponse):
    """A JSON answer with the media type of RFC 7946."""

    media_type = "application/geo+json"


@router.get(
    "/campaigns/{campaign_id}/measurements.geojson",
    response_model=series.FeaturesAnswer,
    response_class=GeoJson,
)
def get_campaign_measurements_geojson(
    campaign: Own[Campaign], context: UsesContext, calibration_id: routes.OfCalibration = None
) -> Response:
    """Every measurement of a campaign as a feature where its frame was taken, by that time."""
    asked = Asked(
        organisation_id=campaign.organisation_id, campaign_id=campaign.id, calibration_id=calibration_id
    )
    pages = MeasurementSeries(context.database, asked).read(after=None, until=None)
    features = [_make_feature(row) for page in pages for row in csv.reader(page)]
    return GeoJson({"type": "FeatureCollection", "features": features})


@router.get("/series/measurements", response_model=series.MeasurementSeriesAnswer, responses=series.RESPONSES)
def get_measurement_series(
    query: Annotated[MeasurementSeriesQuery, Query()], request: Request, caller: Reader, context: UsesContext
) -> Response:
    """Every measurement, flat, in one answer, for a panel or a spreadsheet.

    The rows are ordered by the time at which the frame was taken; a frame without a time is placed where its
    measurement was computed, and is left out by `from` and `to`. An answer has at most `limit` rows, 200,000
    without it; if more follow, `next` and the header `Link` (`rel="next"`) are their address.
    """
    return series.answer_series(request, context, caller, MeasurementSeries, query, _COLUMNS)


@router.get("/measurements/{measurement_id}/cells.csv", response_class=Response, responses=answers.text())
def get_measurement_cells_csv(measurement: Own[Measurement]) -> Response:
    """The cells of a measurement's grid, a line each, with their place in the frame and on the road."""
    cells = list(list_cells(_require_grid(measurement)))
    return Response(tables.write_csv(cells), media_type=series.MEDIA_TYPES["csv"])


@router.get(
    "/measurements/{measurement_id}/cells.geojson", response_model=series.CellsAnswer, response_class=GeoJson
)
def get_measurement_cells_geojson(
    measurement: Own[Measurement],
    coordinates: Annotated[
        Coordinates | None, Query(description="Left out: `road_m` of lanes, else `pixel`.")
    ] = None,
) -> Response:
    """The cells of a measurement's grid as polygons, whose coordinates `coordinates_in` names: not WGS 84."""
    row = _require_grid(measurement)
    chosen = coordinates or ("road_m" if row.parameters.get("lanes") else "pixel")
    if chosen == "road_m" and not row.parameters.get("lanes"):
        raise Problem(interface.NOT_FOUND, "This grid has no lanes: its cells have pixel coordinates only.")
    features = [
        {
            "type": "Feature",
            "id": f"{cell['row']}-{cell['column']}",
            "geometry": {"type": "Polygon", "coordinates": [outline]},
            "properties": cell,
        }
        for cell, outline in zip(list_cells(row), list_outlines(row, chosen), strict=True)
    ]
    return GeoJson({"type": "FeatureCollection", "coordinates_in": chosen, "features": features})


def _require_grid(row: Measurement) -> Measurement:
    if not row.parameters.get("grid") or not row.result.get("surface"):
        raise Problem(interface.NOT_FOUND, "This measurement has no cells: measure the frame with a `grid`.")
    return row


def _make_feature(cells: list[str]) -> dict[str, Any]:
    """Make a feature of RFC 7946: longitude first, and no geometry where the file names no place."""
    row = read_row(dict(zip(COLUMNS, cells, strict=True)))
    place = [row[name] for name in ("longitude_deg", "latitude_deg", "altitude_m") if name in row]
    geometry = (
        {"type": "Point", "coordinates": place} if {"longitude_deg", "latitude_deg"} <= row.keys() else None
    )
    return {"type": "Feature", "id": row["id"], "geometry": geometry, "properties": row}


STAC_VERSION: Final = "1.0.0"
_EXTENSION: Final = "https://stac-extensions.github.io/{}/v1.1.0/schema.json"
_GDAL_METADATA: Final = "GDAL_METADATA"
_FIRST_DAY: Final = "1970-01-01T00:00:00Z"


def describe_map(path: Path) -> dict[str, Any]:
    import tifffile

    with tifffile.TiffFile(path) as file:
        page = file.pages.first
        tag = page.tags.get(_GDAL_METADATA)
        metadata = tag.value if tag else "<GDALMetadata/>"
        said: dict[str, Any] = {
            "shape": [page.imagelength, page.imagewidth],
            "data_type": str(page.dtype),
            "description": json.loads(page.description),
        }
    planes: dict[int, dict[str, str]] = {}
    # written by this product: no document of a stranger
    for each in ET.fromstring(metadata):  # noqa: S314
        if "sample" in each.attrib:
            planes.setdefault(int(each.attrib["sample"]), {})[each.attrib["name"]] = unescape(each.text or "")
    return said | {"planes": [planes[number] for number in sorted(planes)]}


def make_item(
    row: Measurement, frame: FrameRow, calibration: Calibration, found: dict[str, Any], *, base: str
) -> dict[str, Any]:
    """Make the item of a map of `describe_map`; `base`: address of the service, ahead of its paths."""
    place, quantity = row.result.get("place", {}), found["description"]["quantity"]
    own, placed = f"{base}/v1/measurements/{row.id}", place.get("corners") or []
    ring = [*placed[:1], *placed[::-1]]  # counterclockwise
    area = {} if not placed else {"bbox": [f(at) for f in (min, max) for at in zip(*placed, strict=True)]}
    bands = [_describe_band(plane, found["data_type"], place) for plane in found["planes"]]
    colours = [_describe_colour(plane) for plane in found["planes"]]
    projection = {} if not placed else {"proj:epsg": 4326, "proj:shape": found["shape"]}
    if place.get("form") == "affine":
        a, b, c, d, e, f = place["transform"]
        projection["proj:transform"] = [b, c, a, e, f, d]
    lineage = (
        f"{quantity} of {frame.filename} (SHA-256 {frame.sha256}) with version {calibration.version} of "
        f"{calibration.method} (SHA-256 {calibration.content_sha256}), {row.software['measurer']}"
    )
    uncertainty = {f"stilb:{name}": place[name] for name in ("u_centre_m", "u_corner_m") if name in place}
    return {
        "type": "Feature",
        "stac_version": STAC_VERSION,
        "stac_extensions": [_EXTENSION.format(name) for name in ("eo", "processing", "projection", "raster")],
        "id": row.id,
        "geometry": {"type": "Polygon", "coordinates": [ring]} if placed else None,
        **area,
        "properties": {
            **_describe_time(row, frame),
            "created": write_instant(row.created_at),
            "processing:lineage": lineage,
            "processing:software": {"stilb": str(row.software["stilb"])},
            **({"stilb:place": place["detail"]} if "detail" in place else {}),
            **uncertainty,
        },
        "links": [
            {"rel": "self", "href": f"{own}/stac.json", "type": "application/geo+json"},
            {"rel": "derived_from", "href": f"{base}/v1/frames/{frame.id}", "type": "application/json"},
            {"rel": "via", "href": f"{base}/v1/calibrations/{calibration.id}", "type": "application/json"},
        ],
        "assets": {
            "map": {
                "href": f"{own}/map.tif",
                "type": "image/tiff; application=geotiff" if placed else "image/tiff",
                "title": f"{quantity} of {frame.filename}",
                "roles": ["data"],
                **({"raster:bands": bands, "eo:bands": colours} if bands else {}),
                **projection,
            },
            "picture": {"href": f"{own}/map.png", "type": "image/png", "roles": ["overview"]},
        },
    }


def _describe_band(plane: dict[str, str], data_type: str, place: dict[str, Any]) -> dict[str, Any]:
    side = {"spatial_resolution": place["pixel_m"]} if "pixel_m" in place else {}
    unit = {"unit": plane["UNITTYPE"], "nodata": "nan", "sampling": "area", "scale": 1, "offset": 0}
    return {"data_type": data_type, **unit, **side}


def _describe_colour(plane: dict[str, str]) -> dict[str, Any]:
    """Return the name of a plane, and its band's wavelength and width in the extension's um."""
    names = {"wavelength_nm": "center_wavelength", "width_nm": "full_width_half_max"}
    told = {name: float(plane[key]) / 1000.0 for key, name in names.items() if key in plane}
    return {"name": plane["DESCRIPTION"], **told}


def _describe_time(row: Measurement, frame: FrameRow) -> dict[str, Any]:
    """Return when the frame was taken; of a local time without its zone, when that can have been."""
    taken = read_frame_time(frame, Zones(campaign=row.parameters.get("time_zone")))
    if taken is not None and taken.is_known:
        return {"datetime": write_instant(taken.earliest)}
    start = write_instant(taken.earliest) if taken else _FIRST_DAY
    end = write_instant(taken.latest if taken else frame.created_at)
    return {"datetime": None, "start_datetime": start, "end_datetime": end}


@router.get("/measurements/{measurement_id}/map.json", **answers.sends(maps.MapValuesAnswer, 500))
def get_measurement_map_values(
    measurement: Own[Measurement],
    request: Request,
    context: UsesContext,
    asked: Annotated[maps.MapWindow, Query()],
) -> Response:
    """A window of the map: with step 1 the very values of map.tif, else the means of squares.

    With `layer` their relative expanded uncertainty in place of the values.
    """
    with maps.open_map(context, measurement) as found:
        headers = answers.immutable(request, found.tag(asked.tag))
        layout = found.layout
        window = _cut(layout, asked)
        values = maps.read_values(found.path, layout, window, step=asked.step)
        if asked.layer == "expanded_uncertainty_rel":
            values = maps.map_uncertainty(found, window, values, step=asked.step)
        is_value = asked.layer == "value"
        answer = maps.MapValuesAnswer.restate(
            layout,
            asked,
            unit=layout.unit if is_value else "1",
            # the shortest decimals that are the same float32: as doubles they would be twice as long
            values=[[None if np.isnan(value) else float(str(value)) for value in line] for line in values],
            uncertainty=science.read_uncertainty(found.row.result) if is_value else None,
            notes=found.list_notes(),
        )
    return answer.respond(headers)


@router.get(
    "/measurements/{measurement_id}/stac.json", response_class=GeoJson, **answers.sends(maps.StacItem, 500)
)
def get_measurement_stac(measurement: Own[Measurement], request: Request, context: UsesContext) -> Response:
    """Return the map as a STAC item, with the extensions eo, processing, projection and raster.

    Its geometry is null where the map is not placed. A local time without a zone becomes the interval that
    it lies in.
    """
    sha256 = maps.require_map(measurement.map_tif_sha256)
    base = connections.absolute(request, "")
    tag = hashlib.sha256(f"{sha256}-{measurement.id}-{base}".encode()).hexdigest()
    headers = answers.immutable(request, tag)
    with context.files.local(sha256) as file:
        prove_file(file)
        found = describe_map(file.path)
    with context.database.reading() as session:
        frame = session.get_one(FrameRow, measurement.frame_id)
        calibration = session.get_one(Calibration, measurement.calibration_id)
        item = make_item(measurement, frame, calibration, found, base=base)
    return GeoJson(item, headers=headers)


def _cut(layout: maps.Layout, asked: maps.MapWindow) -> Window:
    height = min(layout.height_px - asked.top, asked.height or layout.height_px)
    width = min(layout.width_px - asked.left, asked.width or layout.width_px)
    rows, cols = height // asked.step, width // asked.step
    if rows < 1 or cols < 1:
        size = f"{layout.height_px} rows and {layout.width_px} columns"
        raise wrong("query.top", f"the map has {size}: the window holds no whole square of it")
    if rows * cols > maps.MOST_VALUES:
        message = f"{rows * cols} values at once are too many: take a larger step, or a smaller window"
        raise wrong("query.step", message)
    return Window(row0=asked.top, col0=asked.left, height=height, width=width)
