"""Measurements with a calibrated camera: one frame, or every field frame of a campaign."""

from pathlib import PurePath
from typing import Annotated, Literal
from urllib.parse import quote

from fastapi import Depends, Query, Request, Response
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.drawing.text import in_step
from radiometry.findings import InputRejected, interface
from radiometry.fitting.comparison import Comparison
from radiometry.methods import get_method
from radiometry.specification.application import PictureApplication
from service.http import answers, auth, changes, lookup, models, operations
from service.http.context import Context, UsesContext
from service.http.lookup import Own
from service.http.paging import Page, UsesPaging
from service.http.problems import Problem, wrong
from service.jobs.routes import JobAnswer, enqueue, reply_queued
from service.measurements import maps, requests, schemas
from store import database
from store.measuring import comparison, plan
from store.queries import by_id, calibrations
from store.tables import Calibration, Campaign, FrameRow, Job, Measurement

OfCalibration = Annotated[models.Text | None, Query(description="Only those made with this version.")]


def answer_measurements(session: Session, rows: list[Measurement]) -> list[schemas.MeasurementAnswer]:
    """Measurements with their frames and versions, in a handful of queries however many they are."""
    frame_ids, version_ids = {row.frame_id for row in rows}, {row.calibration_id for row in rows}
    falloff_ids = {}
    for row in rows:
        if (corrector := get_method(row.method).corrected_by) and corrector in row.parameters:
            falloff_ids[row.id] = row.parameters[corrector]["calibration_id"]
    frames, versions = by_id(session, FrameRow, frame_ids), by_id(session, Calibration, version_ids)
    status = calibrations.read_version_statuses(session, sorted({*versions, *falloff_ids.values()}))
    return [
        schemas.MeasurementAnswer.of(
            row,
            frames[row.frame_id],
            versions[row.calibration_id],
            status[row.calibration_id],
            status[falloff_ids[row.id]] if row.id in falloff_ids else None,
        )
        for row in rows
    ]


RECORD_SCHEMA = 1


class MeasuredFrame(models.Answer, restates=(FrameRow,), fields="id filename sha256 role supplied exposure"):
    """A frame of the measurement: its file by hash, and its exposure as it was used."""


class MeasuredWith(
    models.Answer, restates=(Calibration,), fields="id method version content_sha256 parameters inputs result"
):
    """The calibration version, as stored."""


class MeasurementRecord(
    models.Answer, restates=(Measurement,), fields="id method parameters result software content_sha256"
):
    """A measurement as stored, with its frames and calibration version: `make verify` recomputes it."""

    schema_version: int
    frames: list[MeasuredFrame] = models.told("The measured frame first.")
    calibration: MeasuredWith
    map_sha256: str | None = models.maybe("SHA-256 of map.tif, where there is one.")


def _read_asked(body: requests.MeasurementOptions) -> plan.Asked:
    grid, lanes = requests.read_grid(body.grid) if body.grid is not None else (None, None)
    return plan.Asked(
        polygon=requests.read_roi(body.roi).polygon if body.roi is not None else None,
        grid=grid,
        lanes=lanes,
        frame_ids=tuple(body.list_frames()) if getattr(body, "frame_ids", None) else None,
        conditions=body.model_dump(include=set(requests.CONDITIONS), exclude_unset=True),
        products=tuple(body.products or ()),
        allow=tuple(dict.fromkeys(body.allow or ())),
        **body.model_dump(include={"reflectance", "incidence_angle_deg", "index", "quantity"}),
    )


def _read_asked_of_one(body: requests.NewMeasurement) -> plan.Asked:
    return _read_asked(body)


Asked = Annotated[plan.Asked, Depends(_read_asked)]
"""What a body asks, its regions read before the database is locked."""
AskedOfOne = Annotated[plan.Asked, Depends(_read_asked_of_one)]

router = operations.Router(prefix="/v1", tags=["measurements"])


@router.post("/measurements", status_code=202, response_model=JobAnswer, responses=answers.problems(404, 409))
def start_measurement(
    body: requests.NewMeasurement, asked: AskedOfOne, caller: auth.Uploader, session: Session
) -> changes.Reply:
    """Measure a frame with a calibrated camera. The job's result names the measurement.

    Without `calibration_id` the version is taken that was in force when the frame was taken. `frame_ids` in
    place of `frame_id` averages repeats of one scene.
    """
    frame, *_ = (lookup.owned(session, FrameRow, each, caller) for each in body.list_frames())
    named = _named(session, body, caller)
    job = _enqueue(session, frame, asked, named, caller, plan.Captures(session), lane="measure")
    return reply_queued(session, job)


@router.post(
    "/campaigns/{campaign_id}/measurements",
    status_code=202,
    response_model=requests.CampaignMeasurementsAnswer,
    responses=answers.problems(409),
)
def start_campaign_measurements(
    campaign: Own[Campaign],
    body: requests.MeasurementOptions,
    asked: Asked,
    caller: auth.Uploader,
    session: Session,
) -> changes.Reply:
    """Measure every field frame of a campaign. One that cannot be measured is named with the reason.

    Frames that a person left out are not measured. An index is measured once a capture. The calibration may
    come from another campaign of the same camera.
    """
    named, captures = _named(session, body, caller), plan.Captures(session)
    started: dict[Job, None] = {}
    refused: list[requests.NotMeasured] = []
    for frame in _field_frames(session, campaign):
        try:
            job = _enqueue(session, frame, asked, named, caller, captures, lane="flight")
            started[job] = None
        except (InputRejected, database.Conflict) as refusal:
            why = {"code": str(refusal.code), "detail": refusal.message}
            refused.append(requests.NotMeasured(frame_id=frame.id, filename=frame.filename, **why))
    session.flush()
    jobs_answer = [JobAnswer.of(job, session.get_one(FrameRow, job.subject_id)) for job in started]
    answer = requests.CampaignMeasurementsAnswer(jobs=jobs_answer, not_measured=refused)
    return changes.Reply(status=202, body=answer, jobs=list(started))


@router.get("/measurements", response_model=Page[schemas.MeasurementAnswer])
def list_measurements(
    paging: UsesPaging,
    caller: auth.Reader,
    session: Session,
    camera_id: models.Text | None = None,
    campaign_id: models.Text | None = None,
    calibration_id: OfCalibration = None,
) -> Response:
    """The measurements of your organisation, newest first."""
    named = {"campaign_id": campaign_id, "calibration_id": calibration_id}
    rows = paging.choose(caller, select(Measurement), **named)
    if camera_id is not None:
        of_camera = select(Calibration.id).where(Calibration.camera_id == camera_id)
        rows = rows.where(Measurement.calibration_id.in_(of_camera))
    return paging.send(session, rows, lambda found: answer_measurements(session, found), newest_first=True)


@router.get("/measurements/{measurement_id}", **answers.sends(schemas.MeasurementAnswer))
def get_measurement(measurement: Own[Measurement], request: Request, session: Session) -> Response:
    """One measurement, with the calibration that it was made with and what has become of that since."""
    answer = answer_measurements(session, [measurement])[0]
    # the figures never change; how their calibration stands may, and that of its vignetting, which is a flag
    state = f"{answer.calibration.state}-{answer.calibration.superseded_by or ''}-{len(answer.flags)}"
    return answer.respond(answers.standing(request, f"{measurement.content_sha256}-{state}"))


@router.get("/measurements/{measurement_id}/record.json", **answers.sends(MeasurementRecord))
def get_measurement_record(measurement: Own[Measurement], request: Request, session: Session) -> Response:
    """A measurement as stored, with all that `make verify` needs to recompute it but the frames' files.

    It never changes. `stilb export --measurement` downloads it with the frames and the map.
    """
    headers = answers.immutable(request, f"{measurement.content_sha256}-record")
    calibration = session.get_one(Calibration, measurement.calibration_id)
    more = [*measurement.parameters.get("repeats", []), *plan.list_others(measurement.parameters)]
    ids = [measurement.frame_id, *(named["frame_id"] for named in more)]
    return MeasurementRecord.restate(
        measurement,
        schema_version=RECORD_SCHEMA,
        frames=[MeasuredFrame.restate(session.get_one(FrameRow, frame_id)) for frame_id in ids],
        calibration=MeasuredWith.restate(calibration),
        map_sha256=measurement.map_tif_sha256,
    ).respond(headers)


@router.get("/measurements/{measurement_id}/map.tif", **answers.sends_stored_file("image/tiff"))
def get_measurement_map(measurement: Own[Measurement], request: Request, context: UsesContext) -> Response:
    """Return the map of all pixels, float32, with the frame's metadata; NaN where the value is not known.

    A luminance in cd/m2; a band's reflectance or an index without unit, or its radiance in W/(m2 sr nm). With
    the product `bands`: several planes on the same pixels, named in GDAL's metadata. Of a geometry campaign's
    frame: its undistorted picture, uint16.
    """
    return _send_map(request, context, measurement, "tif")


@router.get("/measurements/{measurement_id}/map.png", **answers.sends_stored_file("image/png"))
def get_measurement_picture(
    measurement: Own[Measurement], request: Request, context: UsesContext
) -> Response:
    """The map in false colours with its bar: of luminance on a logarithmic scale, else on an even one.

    Of a geometry campaign's frame: its undistorted picture, to look at.
    """
    return _send_map(request, context, measurement, "png")


def _named(session: Session, body: requests.MeasurementOptions, caller: auth.Caller) -> Calibration | None:
    return lookup.owned(session, Calibration, body.calibration_id, caller) if body.calibration_id else None


def _enqueue(
    session: Session,
    frame: FrameRow,
    asked: plan.Asked,
    named: Calibration | None,
    caller: auth.Caller,
    captures: plan.Captures,
    *,
    lane: str,
) -> Job:
    subject = plan.find_subject(session, frame, asked, captures)
    planned = plan.plan_measurement(session, subject, asked, named, captures)
    return enqueue(session, caller, "measure", subject.id, planned, lane)


def _field_frames(session: Session, campaign: Campaign) -> list[FrameRow]:
    rows = select(FrameRow).where(FrameRow.standing(campaign.id), FrameRow.role == "field")
    if not (found := [each for each in session.scalars(rows.order_by(FrameRow.id)) if not each.left_out]):
        detail = "This campaign has no field frame: upload frames with role=field first."
        raise Problem(interface.CAMPAIGN_INCOMPLETE, detail)
    return found


def _send_map(request: Request, context: Context, row: Measurement, kind: Literal["tif", "png"]) -> Response:
    sha256 = maps.require_map(row.map_tif_sha256 if kind == "tif" else row.map_png_sha256)
    with context.database.reading() as session:
        frame = session.get_one(FrameRow, row.frame_id)
    name = quote(f"{PurePath(frame.filename).stem}-{row.id}.{kind}", safe="")
    headers = {"Content-Disposition": f"inline; filename*=UTF-8''{name}"}
    return answers.send_blob(request, context.files, sha256, f"image/{kind.replace('tif', 'tiff')}", headers)


_OTHER_REGION = " The two regions differ: the change may be one of the place and not of the light."


class Compared(models.Answer, restates=Comparison):
    """new - old, and new / old - 1."""


class Measured(models.Answer):
    measurement_id: str
    filename: str
    taken_at: str | None = None
    mean: models.Quantity
    region: list[list[float]] = models.told("Outline [x, y] in px of what the mean is of.")
    region_origin: str = models.told("Source of the region, as in the measurement.")

    @classmethod
    def of(cls, side: comparison.Side) -> "Measured":
        return cls.restate(side, side.frame.header or {}, side.frame, measurement_id=side.measurement.id)


class ContrastAnswer(Compared):
    old: Measured
    new: Measured
    significant: bool = models.told(
        "At least two standard uncertainties of the difference, and more than `confusion_rel`."
    )
    confusion_rel: float | None = models.maybe(
        "What two types of lamp could show as a change without any, where the light is neither "
        "known nor the same in both."
    )
    said: str
    common: list[str] = models.told("Sources whose error is the same in both, so that it cancels.")
    same_region: bool = models.told(
        "The same outlines in images of the same size. Whether they show the same ground is not known."
    )
    cells: list[list[Compared]] | None = models.maybe(
        "Of two grids with as many rows and columns: cell by cell."
    )


def _format_verdict(found: comparison.MeasurementComparison) -> str:
    mean = found.mean
    if mean.difference.value == 0.0:
        return "Both are exactly equal."
    if mean.in_standard_uncertainties is None:
        return "Neither has an uncertainty."
    shown, unit = (mean.difference, "") if mean.change is None else (mean.change, " %")
    by = in_step(abs(shown.value), shown.standard_uncertainty)[0] + unit
    moved = "rose" if mean.difference.value > 0.0 else "fell"
    times = f"{mean.in_standard_uncertainties:.2g} times the uncertainty of the difference"
    verdict = "a significant change" if found.is_significant else "not a significant change"
    if found.confusion_rel is not None and mean.in_standard_uncertainties >= comparison.SURE:
        verdict += (
            f". Lamps of another type can show up to {found.confusion_rel:.0%} without any: state the "
            "light of both, or that it is the same"
        )
    return f"The mean {moved} by {by}, {times}: {verdict}."


comparisons_router = operations.Router(prefix="/v1", tags=["measurements"])


@comparisons_router.get(
    "/measurements/{measurement_id}/comparison",
    response_model=ContrastAnswer,
    responses=answers.problems(409),
)
def contrast_measurements(
    measurement_id: lookup.Id,
    caller: auth.Reader,
    session: Session,
    old: Annotated[models.Text, Query(description="The measurement that it is compared with.")],
    *,
    other_region: Annotated[bool, Query(description="Compare them even if their outlines differ.")] = False,
    same_light: Annotated[bool, Query(description="You know that the same lamps lit both.")] = False,
) -> Response:
    """Compute the difference of two measurements and its significance. Errors that both share cancel.

    Measurements with different outlines are refused unless `other_region` is true.
    """
    before, after = _side(session, old, caller), _side(session, measurement_id, caller)
    was, is_now = before.summary.measured, after.summary.measured
    if was != is_now:
        raise wrong("query.old", f"is of {was}, the other of {is_now}: compare like with like")
    found = comparison.compare_measurements(before, after, other_region=other_region, same_light=same_light)
    return ContrastAnswer.restate(
        found.mean,
        found,
        old=Measured.of(before),
        new=Measured.of(after),
        significant=found.is_significant,
        said=_format_verdict(found) + ("" if found.same_region else _OTHER_REGION),
        cells=found.cells or None,
    ).respond()


def _side(session: Session, measurement_id: str, caller: auth.Caller) -> comparison.Side:
    row = lookup.owned(session, Measurement, measurement_id, caller)
    application = get_method(row.method).application
    if isinstance(application, PictureApplication):
        raise wrong("query.old", f"is an {application.quantity} and has no value to compare")
    return comparison.Side(
        measurement=row,
        frame=session.get_one(FrameRow, row.frame_id),
        calibration=session.get_one(Calibration, row.calibration_id),
    )
