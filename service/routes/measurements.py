"""Measurements with a calibrated camera: one frame, or every field frame of a campaign."""

from typing import Annotated, Literal

from fastapi import APIRouter, Query, Request, Response
from fastapi.responses import JSONResponse
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.errors import InputRejected
from radiometry.surface import Grid
from service.auth import Caller, Reader, Uploader
from service.context import Context, UsesContext
from service.immutable import not_modified, send_blob
from service.lookup import Id, owned
from service.measurement_rows import COLUMNS, flatten, make_feature
from service.paging import Cursor, Limit, Page, page
from service.problems import HttpCode, Problem
from service.routes import UNCHANGED, problems, sends_file
from service.routes.campaigns import read_roi
from service.schemas.base import Instant, Text
from service.schemas.jobs import JobAnswer
from service.schemas.measured import MeasurementAnswer, MeasurementSeriesAnswer
from service.schemas.measurements import (
    CampaignMeasurementsAnswer,
    MeasurementOptions,
    NewMeasurement,
    NotMeasured,
)
from service.tabular import write_csv
from service.writing import Reply, Writes
from store import jobs
from store.errors import Conflict
from store.measuring.plan import Asked, find_subject, plan_measurement
from store.queries.calibrations import standings
from store.tables import Calibration, Camera, Campaign, FrameRow, Job, Measurement

router = APIRouter(prefix="/v1", tags=["measurements"])

_FEATURES = {
    "type": "object",
    "required": ["type", "features"],
    "properties": {"type": {"const": "FeatureCollection"}, "features": {"type": "array"}},
}
_OfCalibration = Annotated[Text | None, Query(description="Only those made with this version.")]


@router.post("/measurements", status_code=202, response_model=JobAnswer, responses=problems(404, 409))
def start_measurement(body: NewMeasurement, caller: Uploader, writing: Writes) -> Response:
    """Measure a frame with a calibrated camera. The job's result names the measurement.

    Without `calibration_id` the version is taken that was in force when the frame was taken.
    """

    def change(session: Session) -> Reply:
        frame = owned(session, FrameRow, body.frame_id, caller)
        named = _named(session, body, caller)
        job = _enqueue(session, frame, _read_asked(body), named, caller)
        session.flush()
        location = {"Location": f"/v1/jobs/{job.id}"}
        return Reply(status=202, body=JobAnswer.of(job), headers=location, jobs=[job])

    return writing.run(caller, change)


@router.post(
    "/campaigns/{campaign_id}/measurements",
    status_code=202,
    response_model=CampaignMeasurementsAnswer,
    responses=problems(404, 409),
)
def start_campaign_measurements(
    campaign_id: Id, body: MeasurementOptions, caller: Uploader, writing: Writes
) -> Response:
    """Measure every field frame of a campaign. One that cannot be measured is named with the reason.

    An index is measured once a capture. The calibration may come from another campaign of the same camera.
    """

    def change(session: Session) -> Reply:
        campaign = owned(session, Campaign, campaign_id, caller)
        named, asked = _named(session, body, caller), _read_asked(body)
        started: dict[Job, None] = {}
        refused: list[NotMeasured] = []
        for frame in _field_frames(session, campaign):
            try:
                started[_enqueue(session, frame, asked, named, caller)] = None
            except (InputRejected, Conflict) as refusal:
                refused.append(
                    NotMeasured(
                        frame_id=frame.id,
                        filename=frame.filename,
                        code=str(refusal.code),
                        detail=refusal.message,
                    )
                )
        session.flush()
        answer = CampaignMeasurementsAnswer(jobs=[JobAnswer.of(job) for job in started], not_measured=refused)
        return Reply(status=202, body=answer, jobs=list(started))

    return writing.run(caller, change)


@router.get("/measurements", response_model=Page[MeasurementAnswer], responses=problems())
def list_measurements(
    request: Request,
    caller: Reader,
    context: UsesContext,
    camera_id: Annotated[Text | None, Query()] = None,
    campaign_id: Annotated[Text | None, Query()] = None,
    calibration_id: _OfCalibration = None,
    limit: Limit = 100,
    cursor: Cursor = None,
) -> Response:
    """The measurements of your organisation, newest first."""
    rows = select(Measurement).where(Measurement.organisation_id == caller.organisation_id)
    if camera_id is not None:
        of_camera = select(Calibration.id).where(Calibration.camera_id == camera_id)
        rows = rows.where(Measurement.calibration_id.in_(of_camera))
    if campaign_id is not None:
        rows = rows.where(Measurement.campaign_id == campaign_id)
    if calibration_id is not None:
        rows = rows.where(Measurement.calibration_id == calibration_id)
    with context.database.reading() as session:
        return page(
            session,
            request,
            rows,
            by=Measurement.id,
            limit=limit,
            cursor=cursor,
            newest_first=True,
            shape=lambda found: _answers(session, found),
        )


@router.get(
    "/measurements/{measurement_id}",
    response_model=MeasurementAnswer,
    responses={**UNCHANGED, **problems(404)},
)
def get_measurement(measurement_id: Id, request: Request, caller: Reader, context: UsesContext) -> Response:
    """One measurement, with the calibration that it was made with and what has become of that since."""
    with context.database.reading() as session:
        row = owned(session, Measurement, measurement_id, caller)
        answer = _answers(session, [row])[0]
    # the figures never change; how their calibration stands may, and that of its vignetting, which is a flag
    state = f"{answer.calibration.state}-{answer.calibration.superseded_by or ''}-{len(answer.flags)}"
    tag = f"{row.content_sha256}-{state}"
    response = not_modified(request, tag) or answer.respond({"ETag": f'"{tag}"'})
    response.headers["Cache-Control"] = "private, no-cache"
    return response


@router.get(
    "/measurements/{measurement_id}/map.tif",
    response_class=Response,
    responses=sends_file("image/tiff"),
)
def get_measurement_map(
    measurement_id: Id, request: Request, caller: Reader, context: UsesContext
) -> Response:
    """The luminance of every pixel in cd/m2, float32, with the frame's metadata. Saturated pixels are NaN.

    Of a geometry campaign's frame: its undistorted picture, uint16.
    """
    row = _owned(context, measurement_id, caller)
    return _blob(request, context, row.map_tif_sha256, "image/tiff", f"{measurement_id}.tif")


@router.get(
    "/measurements/{measurement_id}/map.png",
    response_class=Response,
    responses=sends_file("image/png"),
)
def get_measurement_picture(
    measurement_id: Id, request: Request, caller: Reader, context: UsesContext
) -> Response:
    """The map in false colours on a logarithmic scale, with its bar."""
    row = _owned(context, measurement_id, caller)
    return _blob(request, context, row.map_png_sha256, "image/png", f"{measurement_id}.png")


@router.get(
    "/campaigns/{campaign_id}/measurements.csv",
    response_class=Response,
    responses={200: {"content": {"text/csv": {"schema": {"type": "string"}}}}, **problems(404)},
)
def get_campaign_measurements_csv(
    campaign_id: Id, caller: Reader, context: UsesContext, calibration_id: _OfCalibration = None
) -> Response:
    """Every measurement of a campaign, a line each, oldest first."""
    found = _of_campaign(context, campaign_id, caller, calibration_id)
    return Response(write_csv([flatten(answer) for answer in found], COLUMNS), media_type="text/csv")


@router.get(
    "/campaigns/{campaign_id}/measurements.geojson",
    response_class=Response,
    responses={200: {"content": {"application/geo+json": {"schema": _FEATURES}}}, **problems(404)},
)
def get_campaign_measurements_geojson(
    campaign_id: Id, caller: Reader, context: UsesContext, calibration_id: _OfCalibration = None
) -> Response:
    """Every measurement of a campaign as a feature where its frame was taken, oldest first."""
    found = _of_campaign(context, campaign_id, caller, calibration_id)
    collection = {"type": "FeatureCollection", "features": [make_feature(answer) for answer in found]}
    return JSONResponse(collection, media_type="application/geo+json")


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
        found = _answers(session, list(session.scalars(rows.order_by(Measurement.id))))
    flat = [flatten(answer) for answer in found]
    if format == "csv":
        return Response(write_csv(flat, COLUMNS), media_type="text/csv")
    return JSONResponse({"rows": flat})


def _read_asked(body: MeasurementOptions) -> Asked:
    grid = None
    if body.grid is not None:
        corners = tuple((corner[0], corner[1]) for corner in body.grid.corners)
        grid = Grid(corners=corners, rows=body.grid.rows, columns=body.grid.columns)
    return Asked(
        polygon=read_roi(body.roi).polygon if body.roi is not None else None,
        grid=grid,
        reflectance=body.reflectance,
        incidence_angle_deg=body.incidence_angle_deg,
        index=body.index,
        products=tuple(body.products or ()),
    )


def _named(session: Session, body: MeasurementOptions, caller: Caller) -> Calibration | None:
    return owned(session, Calibration, body.calibration_id, caller) if body.calibration_id else None


def _enqueue(
    session: Session, frame: FrameRow, asked: Asked, named: Calibration | None, caller: Caller
) -> Job:
    subject = find_subject(session, frame, asked)
    return jobs.enqueue(
        session,
        kind="measure",
        subject_id=subject.id,
        organisation_id=caller.organisation_id,
        by=caller.key_id,
        parameters=plan_measurement(session, subject, asked, named),
    )


def _field_frames(session: Session, campaign: Campaign) -> list[FrameRow]:
    rows = select(FrameRow).where(FrameRow.campaign_id == campaign.id, FrameRow.role == "field")
    found = list(session.scalars(rows.order_by(FrameRow.id)))
    if not found:
        detail = "This campaign has no field frame: upload frames with role=field first."
        raise Problem(422, HttpCode.CAMPAIGN_INCOMPLETE, detail)
    return found


def _of_campaign(
    context: Context, campaign_id: str, caller: Caller, calibration_id: str | None
) -> list[MeasurementAnswer]:
    rows = select(Measurement).where(Measurement.campaign_id == campaign_id)
    if calibration_id is not None:
        rows = rows.where(Measurement.calibration_id == calibration_id)
    with context.database.reading() as session:
        owned(session, Campaign, campaign_id, caller)
        return _answers(session, list(session.scalars(rows.order_by(Measurement.id))))


def _answers(session: Session, rows: list[Measurement]) -> list[MeasurementAnswer]:
    """Measurements with their frames and versions, in a handful of queries however many they are."""
    frame_ids, version_ids = {row.frame_id for row in rows}, {row.calibration_id for row in rows}
    corrected = {row.id: row.parameters["vignetting"] for row in rows if "vignetting" in row.parameters}
    frames = {f.id: f for f in session.scalars(select(FrameRow).where(FrameRow.id.in_(frame_ids)))}
    wanted = select(Calibration).where(Calibration.id.in_(version_ids))
    versions = {version.id: version for version in session.scalars(wanted)}
    falloff_ids = {named["calibration_id"] for named in corrected.values()}
    standing = standings(session, sorted({*versions, *falloff_ids}))
    return [
        MeasurementAnswer.of(
            row,
            frames[row.frame_id],
            versions[row.calibration_id],
            standing[row.calibration_id],
            standing[corrected[row.id]["calibration_id"]] if row.id in corrected else None,
        )
        for row in rows
    ]


def _owned(context: Context, measurement_id: str, caller: Caller) -> Measurement:
    with context.database.reading() as session:
        return owned(session, Measurement, measurement_id, caller)


def _blob(request: Request, context: Context, sha256: str | None, media_type: str, filename: str) -> Response:
    if sha256 is None:
        detail = 'This measurement was made without a map: ask for one with "products": ["map"].'
        raise Problem(404, HttpCode.NOT_FOUND, detail)
    headers = {"Content-Disposition": f'inline; filename="{filename}"'}
    return send_blob(request, context.blobs, sha256, media_type, headers)
