"""Measurements by the list: of a campaign as CSV or GeoJSON, of a time as a series."""

import csv
from collections.abc import Iterator
from typing import Annotated, Any, Literal

import numpy as np
from fastapi import Query, Request, Response
from fastapi.responses import JSONResponse

from radiometry.findings import interface
from radiometry.frame.grid import find_homography, map_plane
from service.coefficients import series
from service.http import answers, lookup, operations, tables
from service.http.auth import Caller, Reader
from service.http.context import Context, UsesContext
from service.http.models import Instant, Text, maybe
from service.http.problems import Problem
from service.measurements.routes import OfCalibration
from store.ready.rows import COLUMNS, read_row
from store.ready.series import Asked, MeasurementSeries
from store.tables import Campaign, Measurement

Coordinates = Literal["pixel", "road_m"]


def list_cells(row: Measurement) -> Iterator[dict[str, Any]]:
    """Yield each cell, row by row: its place, its luminance, and its centre in the frame and on the road."""
    points = (row.parameters.get("lanes") or {}).get("points_m")
    middles = _project(row, np.arange(0.5, _rows(row)), np.arange(0.5, _columns(row)))
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


def list_outlines(row: Measurement, coordinates: Coordinates) -> Iterator[list[list[float]]]:
    """Yield the closed outline of each cell, in the same order."""
    across, along = np.arange(_rows(row) + 1.0), np.arange(_columns(row) + 1.0)
    if coordinates == "road_m":
        lanes = row.parameters["lanes"]
        y, x = np.meshgrid(across * lanes["across_m"], along * lanes["along_m"], indexing="ij")
        lattice = np.stack([x, y], axis=-1)
    else:
        lattice = _project(row, across, along)
    for line in range(_rows(row)):
        for place in range(_columns(row)):
            ring = [(line, place), (line, place + 1), (line + 1, place + 1), (line + 1, place), (line, place)]
            yield [lattice[corner].tolist() for corner in ring]


def _rows(row: Measurement) -> int:
    return int(row.parameters["grid"]["rows"])


def _columns(row: Measurement) -> int:
    return int(row.parameters["grid"]["columns"])


def _project(row: Measurement, across: Any, along: Any) -> Any:  # noqa: ANN401  arrays
    """Return the images (x, y) of lattice lines, counted in cells."""
    lattice = np.stack(np.meshgrid(along / _columns(row), across / _rows(row)), axis=-1)
    return map_plane(find_homography(row.parameters["grid"]["corners"]), lattice)


router = operations.Router(prefix="/v1", tags=["measurements"])


class MeasurementSeriesQuery(series.SeriesQuery):
    campaign_id: Text | None = None
    calibration_id: OfCalibration = None
    start: Instant | None = maybe(
        "Of frames taken at this time or later, as far as the file names a time zone.", alias="from"
    )
    end: Instant | None = maybe("Of frames taken before this time.", alias="to")


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
    campaign_id: lookup.Id, caller: Reader, context: UsesContext, calibration_id: OfCalibration = None
) -> Response:
    """Every measurement of a campaign as a feature where its frame was taken, by that time."""
    with context.database.reading() as session:
        lookup.owned(session, Campaign, campaign_id, caller)
    asked = Asked(
        organisation_id=caller.organisation_id, campaign_id=campaign_id, calibration_id=calibration_id
    )
    pages = MeasurementSeries(context.database, asked).read(after=None, until=None)
    features = [_make_feature(row) for page in pages for row in csv.reader(page)]
    return GeoJson({"type": "FeatureCollection", "features": features})


@router.get(
    "/series/measurements",
    response_model=series.MeasurementSeriesAnswer,
    responses={**series.sends_series(), **answers.problems(404)},
)
def get_measurement_series(
    query: Annotated[MeasurementSeriesQuery, Query()], request: Request, caller: Reader, context: UsesContext
) -> Response:
    """Every measurement, flat, in one answer, for a panel or a spreadsheet.

    The rows are ordered by the time at which the frame was taken; a frame without a time is placed where its
    measurement was computed, and is left out by `from` and `to`. An answer has at most `limit` rows, 200,000
    without it; if more follow, `next` and the header `Link` (`rel="next"`) are their address.
    """
    return series.answer_series(request, context, caller, MeasurementSeries, query, _COLUMNS)


@router.get(
    "/measurements/{measurement_id}/cells.csv",
    response_class=Response,
    responses={200: {"content": {"text/csv": {"schema": {"type": "string"}}}}},
)
def get_measurement_cells_csv(measurement_id: lookup.Id, caller: Reader, context: UsesContext) -> Response:
    """The cells of a measurement's grid, a line each, with their place in the frame and on the road."""
    cells = list(list_cells(_require_grid(context, measurement_id, caller)))
    return Response(tables.write_csv(cells), media_type=series.MEDIA_TYPES["csv"])


@router.get(
    "/measurements/{measurement_id}/cells.geojson", response_model=series.CellsAnswer, response_class=GeoJson
)
def get_measurement_cells_geojson(
    measurement_id: lookup.Id,
    caller: Reader,
    context: UsesContext,
    coordinates: Annotated[
        Coordinates | None, Query(description="Left out: `road_m` of lanes, else `pixel`.")
    ] = None,
) -> Response:
    """The cells of a measurement's grid as polygons, whose coordinates `coordinates_in` names: not WGS 84."""
    row = _require_grid(context, measurement_id, caller)
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


def _require_grid(context: Context, measurement_id: str, caller: Caller) -> Measurement:
    with context.database.reading() as session:
        row = lookup.owned(session, Measurement, measurement_id, caller)
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
