"""Measurements by the list: of a campaign as CSV or GeoJSON, of a time as a series."""

from typing import Annotated, Literal

from fastapi import APIRouter, Query, Response
from fastapi.responses import JSONResponse
from sqlalchemy import select

from service.auth import Caller, Reader
from service.context import Context, UsesContext
from service.lookup import Id, owned
from service.measurement_rows import COLUMNS, flatten, make_feature
from service.measurements import OfCalibration, answer_measurements
from service.routes import problems
from service.schemas.base import Instant, Text
from service.schemas.measured import MeasurementAnswer
from service.schemas.series import FeaturesAnswer, MeasurementSeriesAnswer
from service.tabular import write_csv
from store.tables import Calibration, Camera, Campaign, Measurement

router = APIRouter(prefix="/v1", tags=["measurements"])


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
    """Every measurement of a campaign, a line each, oldest first."""
    found = _of_campaign(context, campaign_id, caller, calibration_id)
    return Response(write_csv([flatten(answer) for answer in found], COLUMNS), media_type="text/csv")


@router.get(
    "/campaigns/{campaign_id}/measurements.geojson",
    response_model=FeaturesAnswer,
    response_class=GeoJson,
    responses=problems(404),
)
def get_campaign_measurements_geojson(
    campaign_id: Id, caller: Reader, context: UsesContext, calibration_id: OfCalibration = None
) -> Response:
    """Every measurement of a campaign as a feature where its frame was taken, oldest first."""
    found = _of_campaign(context, campaign_id, caller, calibration_id)
    collection = {"type": "FeatureCollection", "features": [make_feature(answer) for answer in found]}
    return GeoJson(collection)


@router.get(
    "/series/measurements",
    response_model=MeasurementSeriesAnswer,
    responses={200: {"content": {"text/csv": {"schema": {"type": "string"}}}}, **problems(404)},
)
def get_measurement_series(
    caller: Reader,
    context: UsesContext,
    camera_id: Annotated[Text | None, Query()] = None,
    start: Annotated[Instant | None, Query(alias="from")] = None,
    end: Annotated[Instant | None, Query(alias="to")] = None,
    format: Annotated[Literal["json", "csv"], Query()] = "json",  # noqa: A002  the contract's name
) -> Response:
    """Every measurement made in a time: flat, in one answer, for a panel or a spreadsheet, oldest first."""
    rows = select(Measurement).where(Measurement.organisation_id == caller.organisation_id)
    if start is not None:
        rows = rows.where(Measurement.created_at >= start)
    if end is not None:
        rows = rows.where(Measurement.created_at < end)
    with context.database.reading() as session:
        if camera_id is not None:
            owned(session, Camera, camera_id, caller)
            of_camera = select(Calibration.id).where(Calibration.camera_id == camera_id)
            rows = rows.where(Measurement.calibration_id.in_(of_camera))
        found = answer_measurements(session, list(session.scalars(rows.order_by(Measurement.id))))
    flat = [flatten(answer) for answer in found]
    if format == "csv":
        return Response(write_csv(flat, COLUMNS), media_type="text/csv")
    return JSONResponse({"rows": flat})


def _of_campaign(
    context: Context, campaign_id: str, caller: Caller, calibration_id: str | None
) -> list[MeasurementAnswer]:
    rows = select(Measurement).where(Measurement.campaign_id == campaign_id)
    if calibration_id is not None:
        rows = rows.where(Measurement.calibration_id == calibration_id)
    with context.database.reading() as session:
        owned(session, Campaign, campaign_id, caller)
        return answer_measurements(session, list(session.scalars(rows.order_by(Measurement.id))))
