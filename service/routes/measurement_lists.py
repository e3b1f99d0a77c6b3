"""Measurements by the list: of a campaign as CSV or GeoJSON, of a time as a series."""

import csv
from collections.abc import Iterator
from typing import Annotated, Any

from fastapi import Query, Request, Response
from fastapi.responses import JSONResponse, StreamingResponse
from pydantic import Field

from radiometry.findings import interface
from service.auth import Caller, Reader
from service.cells import Coordinates, list_cells, list_outlines
from service.context import Context, UsesContext
from service.lookup import Id, owned
from service.measurements import OfCalibration
from service.operations import Router
from service.problems import Problem
from service.routes import problems
from service.schemas.base import Instant, Text
from service.schemas.series import CellsAnswer, FeaturesAnswer, MeasurementSeriesAnswer, MeasurementSeriesRow
from service.series import (
    MEDIA_TYPES,
    SeriesQuery,
    answer_series,
    sends_series,
)
from service.series_texts import describe_columns, gather, write_csv
from service.tabular import write_csv as write_table
from store.ready.rows import COLUMNS, read_row
from store.ready.series import Asked, MeasurementSeries, Page
from store.tables import Campaign, Measurement

router = Router(prefix="/v1", tags=["measurements"])


class MeasurementSeriesQuery(SeriesQuery):
    campaign_id: Text | None = None
    calibration_id: OfCalibration = None
    start: Instant | None = Field(
        default=None,
        alias="from",
        description="Of frames taken at this time or later, as far as the file names a time zone.",
    )
    end: Instant | None = Field(default=None, alias="to", description="Of frames taken before this time.")


_COLUMNS = describe_columns(MeasurementSeriesRow)  # type: ignore[arg-type]


class GeoJson(JSONResponse):
    """A JSON answer with the media type of RFC 7946."""

    media_type = "application/geo+json"


@router.get(
    "/campaigns/{campaign_id}/measurements.csv",
    response_class=Response,
    responses={200: {"content": {"text/csv": {"schema": {"type": "string"}}}}, **problems(404)},
)
def get_campaign_measurements_csv(
    campaign_id: Id, caller: Reader, context: UsesContext, calibration_id: OfCalibration = None
) -> Response:
    """Every measurement of a campaign, a line each, by the time at which its frame was taken."""
    pages = _of_campaign(context, campaign_id, caller, calibration_id)
    return StreamingResponse(gather(write_csv(pages, _COLUMNS)), media_type=MEDIA_TYPES["csv"])


@router.get(
    "/campaigns/{campaign_id}/measurements.geojson",
    response_model=FeaturesAnswer,
    response_class=GeoJson,
    responses=problems(404),
)
def get_campaign_measurements_geojson(
    campaign_id: Id, caller: Reader, context: UsesContext, calibration_id: OfCalibration = None
) -> Response:
    """Every measurement of a campaign as a feature where its frame was taken, by that time."""
    pages = _of_campaign(context, campaign_id, caller, calibration_id)
    features = [_make_feature(row) for page in pages for row in csv.reader(page)]
    return GeoJson({"type": "FeatureCollection", "features": features})


@router.get(
    "/series/measurements",
    response_model=MeasurementSeriesAnswer,
    responses={**sends_series(), **problems(404)},
)
def get_measurement_series(
    query: Annotated[MeasurementSeriesQuery, Query()], request: Request, caller: Reader, context: UsesContext
) -> Response:
    """Every measurement, flat, in one answer, for a panel or a spreadsheet.

    The rows are ordered by the time at which the frame was taken; a frame without a time is placed where its
    measurement was computed, and is left out by `from` and `to`. An answer has at most `limit` rows, 200,000
    without it; if more follow, `next` and the header `Link` (`rel="next"`) are their address.
    """
    return answer_series(request, context, caller, MeasurementSeries, query, _COLUMNS)


@router.get(
    "/measurements/{measurement_id}/cells.csv",
    response_class=Response,
    responses={200: {"content": {"text/csv": {"schema": {"type": "string"}}}}, **problems(404)},
)
def get_measurement_cells_csv(measurement_id: Id, caller: Reader, context: UsesContext) -> Response:
    """The cells of a measurement's grid, a line each, with their place in the frame and on the road."""
    cells = list(list_cells(_require_grid(context, measurement_id, caller)))
    return Response(write_table(cells), media_type=MEDIA_TYPES["csv"])


@router.get(
    "/measurements/{measurement_id}/cells.geojson",
    response_model=CellsAnswer,
    response_class=GeoJson,
    responses=problems(404),
)
def get_measurement_cells_geojson(
    measurement_id: Id,
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
        row = owned(session, Measurement, measurement_id, caller)
    if not row.parameters.get("grid") or not row.result.get("surface"):
        raise Problem(interface.NOT_FOUND, "This measurement has no cells: measure the frame with a `grid`.")
    return row


def _of_campaign(
    context: Context, campaign_id: str, caller: Caller, calibration_id: str | None
) -> Iterator[Page]:
    with context.database.reading() as session:
        owned(session, Campaign, campaign_id, caller)
    asked = Asked(
        organisation_id=caller.organisation_id, campaign_id=campaign_id, calibration_id=calibration_id
    )
    return MeasurementSeries(context.database, asked).read(after=None, until=None)


def _make_feature(cells: list[str]) -> dict[str, Any]:
    """Make a feature of RFC 7946: longitude first, and no geometry where the file names no place."""
    row = read_row(dict(zip(COLUMNS, cells, strict=True)))
    place = [row[name] for name in ("longitude_deg", "latitude_deg", "altitude_m") if name in row]
    geometry = (
        {"type": "Point", "coordinates": place} if {"longitude_deg", "latitude_deg"} <= row.keys() else None
    )
    return {"type": "Feature", "id": row["id"], "geometry": geometry, "properties": row}
