"""Fits, versions, what is decided of them, and their forms for other programs."""

import hashlib
import io
import json
from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Annotated, Any, Final

from anyio import to_thread
from fastapi import Query, Request, Response
from pydantic import ConfigDict, RootModel, ValidationError, create_model
from sqlalchemy import Select, select
from sqlalchemy.orm import Session, load_only
from starlette.concurrency import run_in_threadpool

from radiometry import methods
from radiometry.findings import interface
from radiometry.fitting.evidence import Exclusion
from radiometry.specification.exports import Export, ExportOption, ExportSubject, Picture
from service.calibrations import history, schemas
from service.calibrations.methods import FitRequest, NewCalibration, read_request
from service.calibrations.schemas import CalibrationAnswer
from service.documents import issuing, rendered
from service.http import answers, operations, tables
from service.http.answers import problems, sends_file
from service.http.auth import Calibrator, Caller, Publisher, Reader
from service.http.changes import Reply, Writes
from service.http.context import Context, UsesContext
from service.http.lookup import Id, Own, owned
from service.http.models import Answer, Form, PositiveText, Quantity, Text, told
from service.http.paging import Page, Paging, UsesPaging
from service.http.problems import Problem, invalid, located
from service.jobs.routes import QUEUES, enqueue, reply_queued
from store import codec, fits, publications
from store.measuring.version import choose_falloff
from store.queries import calibrations, campaigns, usage
from store.queries.evidence import Evidence, gather
from store.tables import Calibration, Camera, Campaign, Panel, Publication

router = operations.Router(prefix="/v1", tags=["calibrations"])

_NARROW: Final = load_only(Calibration.organisation_id, Calibration.campaign_id, Calibration.method)


@router.post("/campaigns/{campaign_id}/calibrations", **QUEUES, responses=problems(409))
def start_calibration(campaign_id: Id, body: NewCalibration, caller: Calibrator, writing: Writes) -> Response:
    """Fit the campaign. What is missing is said before it starts; the job's result names the version."""
    outdated: list[str] = []

    def change(session: Session) -> Reply:
        campaign = owned(session, Campaign, campaign_id, caller)
        if campaign.measures:
            raise Problem(
                interface.MEASUREMENTS_ONLY,
                "Nothing is fitted from a night of measurements. Fit the campaign of the calibration frames, "
                "publish it, and measure this one.",
            )
        spec = methods.get_method(campaign.method)
        request = read_request(body, spec)
        if (panel_id := getattr(request, "panel_id", None)) is not None:
            campaign.panel_id = owned(session, Panel, panel_id, caller).id
        evidence = gather(session, campaign)
        params = _read_params(session, request, campaign, evidence, caller)
        params = fits.leave_out_doubtful(params, evidence)
        missing = fits.list_missing(campaign, evidence, params)
        outdated[:] = evidence.outdated
        if missing:
            detail = "; ".join(missing[:5]) + (f"; and {len(missing) - 5} more" if len(missing) > 5 else "")
            passing = bool(outdated or campaigns.count_being_read(session, campaign))
            raise Problem(interface.CAMPAIGN_INCOMPLETE, detail, retryable=passing, missing=missing)
        return reply_queued(session, enqueue(session, caller, "fit", campaign.id, codec.encode(params)))

    try:
        return writing.run(caller, change)
    except Problem:
        if outdated:
            _hasten(writing.context, caller, campaign_id, outdated)
        raise


def _hasten(context: Context, caller: Caller, campaign_id: str, outdated: Sequence[str]) -> None:
    with context.database.writing(caller.key_id, caller.organisation_id) as session:
        campaign = session.get_one(Campaign, campaign_id)
        queued = campaigns.hasten_renewal(session, campaign, outdated, by=caller.key_id)
        usage.add_jobs(session, len(queued), organisation_id=caller.organisation_id)


@router.get("/campaigns/{campaign_id}/calibrations", response_model=Page[CalibrationAnswer])
def list_campaign_calibrations(campaign: Own[Campaign], paging: UsesPaging, session: Session) -> Response:
    """The versions that were fitted from a campaign, newest first."""
    rows = select(Calibration).where(Calibration.campaign_id == campaign.id)
    return _page(session, paging, rows)


@router.get("/cameras/{camera_id}/calibrations", response_model=Page[CalibrationAnswer])
def list_camera_calibrations(
    camera: Own[Camera],
    paging: UsesPaging,
    session: Session,
    method: str | None = None,
    state: calibrations.VersionState | None = None,
) -> Response:
    """A camera's history, newest first."""
    rows = calibrations.history(camera.id, method=method, state=state)
    return _page(session, paging, rows)


@router.get("/calibrations/{calibration_id}", response_model=CalibrationAnswer)
def get_calibration(calibration: Own[Calibration], session: Session) -> Response:
    """One version, whole: coefficients, points, diagnostics, inputs."""
    return _answer(session, calibration).respond()


@router.get("/calibrations/{calibration_id}/points.csv", **sends_file("text/csv"))
def get_points_csv(calibration: Own[Calibration], request: Request) -> Response:
    """Every point of the fit, used or left out, a line each.

    Of what is a list, such as the spots of a flat frame, stands its length, in a column `<name>_count`.
    """
    headers = answers.immutable(request, f"{calibration.content_sha256}-points")
    return Response(tables.write_csv(calibration.result["points"]), headers=headers, media_type="text/csv")


@router.get("/calibrations/{calibration_id}/plot.svg", **sends_file("image/svg+xml"))
async def get_plot_svg(
    calibration_id: Id, request: Request, caller: Reader, context: UsesContext
) -> Response:
    """The result drawn, each method its own way.

    Luminance: signal against X and residuals, a row per ISO value. Reflectance: K per band, and each band's K
    in time with the frames that were measured, which the ETag follows.
    Vignetting: falloff by f-number, and what is left over. Sharpness: the response by position. Geometry:
    distortion, where corners were seen, each view's error. Noise: photon transfer, signal to noise,
    linearity.
    """

    def find() -> tuple[str, str, list[str], bytes | None]:
        with context.database.reading() as session:
            version = owned(session, Calibration, calibration_id, caller, options=[_NARROW])
            flight = [at.isoformat() for at in calibrations.list_flight(session, version)]
        source = rendered.name_source(json.dumps(["plot", version.id, flight]).encode())
        return version.method, source, flight, rendered.find_rendered(context, source)

    def draw() -> bytes:
        with context.database.reading() as session:
            result = session.scalars(select(Calibration.result).where(Calibration.id == calibration_id)).one()
        order = rendered.write_order("plot", method=method, result=result | {"flight": flight})
        return rendered.render_and_keep(context, source, order)

    method, source, flight, kept = await run_in_threadpool(find)
    svg = await to_thread.run_sync(draw, limiter=context.presses) if kept is None else kept
    tag = hashlib.sha256(svg).hexdigest()
    is_standing = methods.get_method(method).of_one_flight
    headers = answers.standing(request, tag) if is_standing else answers.immutable(request, tag)
    return Response(svg, headers=headers, media_type="image/svg+xml")


@router.post(
    "/calibrations/{calibration_id}/publish", response_model=CalibrationAnswer, responses=problems(409)
)
async def publish_calibration(
    calibration_id: Id, body: schemas.NewPublication, caller: Publisher, context: UsesContext, writing: Writes
) -> Response:
    """Put a version in force in [valid_from, valid_to). It replaces what was in force there.

    Its certificate is issued with it, and kept: the answer waits until its pages are set. A version that is
    published again is issued an amendment; the original stays. `warnings` name what the certificate lacks of
    what ISO/IEC 17025 asks for.
    """

    def change(session: Session) -> Reply:
        calibration = owned(session, Calibration, calibration_id, caller)
        publication = publications.publish(
            session, calibration, valid_from=body.valid_from, valid_to=body.valid_to, reason=body.reason
        )
        publications.keep_issued(session, publication, printed)
        answer = _answer(session, calibration)
        return Reply(status=200, body=answer.model_copy(update={"warnings": gaps}))

    if (earlier := await run_in_threadpool(writing.replay, caller)) is not None:
        return earlier
    printed, gaps = await to_thread.run_sync(
        issuing.prepare, context, calibration_id, caller, body, limiter=context.presses
    )
    return await run_in_threadpool(writing.run, caller, change)


@router.post("/calibrations/{calibration_id}/revoke", response_model=history.RevocationAnswer)
def revoke_calibration(
    calibration: Own[Calibration], body: schemas.NewRevocation, caller: Publisher, session: Session
) -> Reply:
    """Revoke a version permanently. It stays readable; nothing takes its place automatically.

    `measurements` are those made with it: they stay, flagged, with what another version would make of each.
    `roads` are evaluations with frames that rest on it.
    """
    publications.revoke(session, calibration, reason=body.reason, by=caller.key_id)
    answer = _answer(session, calibration)
    return Reply(status=200, body=history.RevocationAnswer.revoked(session, calibration, answer))


def _read_params(
    session: Session, request: FitRequest, campaign: Campaign, evidence: Evidence, caller: Caller
) -> Any:  # noqa: ANN401
    said = request.read_parameters(methods.get_method(campaign.method))
    exclusions = []
    for index, exclusion in enumerate(request.exclude or []):
        if exclusion.frame_id not in evidence.names:
            detail = f"exclude.{index}.frame_id: this campaign has no such frame in use."
            raise Problem(interface.VALIDATION_FAILED, detail)
        name = evidence.names[exclusion.frame_id]
        exclusions.append(Exclusion(frame=name, reason=exclusion.reason, by=caller.named))
    said["exclude"] = tuple(sorted(exclusions, key=lambda e: e.frame))
    corrector = methods.get_method(campaign.method).corrected_by
    asked = said.pop(corrector, None) if corrector else None
    try:
        params = fits.make_params(session, campaign, **said)
    except ValidationError as error:
        raise invalid(located(error, "body")) from error
    if corrector is None or asked is None:
        return params
    named = None if asked == schemas.IN_FORCE else owned(session, Calibration, asked, caller)
    chosen = choose_falloff(session, campaign, evidence, params, named)
    return replace(params, **{corrector: chosen.content_sha256})


def _page(session: Session, paging: Paging, rows: Select[Any]) -> Response:
    def shape(found: list[Calibration]) -> list[CalibrationAnswer]:
        ids = [row.id for row in found]
        status = calibrations.read_version_statuses(session, ids)
        coefficients = calibrations.coefficients_of(session, ids)
        return [CalibrationAnswer.of(row, status[row.id], coefficients[row.id], whole=False) for row in found]

    return paging.send(session, rows, shape, newest_first=True)


def _answer(session: Session, calibration: Calibration) -> CalibrationAnswer:
    status = calibrations.read_version_statuses(session, [calibration.id])[calibration.id]
    coefficients = calibrations.coefficients_of(session, [calibration.id])[calibration.id]
    answer = CalibrationAnswer.of(calibration, status, coefficients, whole=True)
    answer.certificates = [
        schemas.IssuedAnswer.restate(each, reason=session.get_one(Publication, each.publication_id).reason)
        for each in publications.list_issued(session, calibration.id)
    ]
    if status.state == "draft":
        start, end = calibrations.suggest_validity(session, calibration)
        answer.suggested_validity = schemas.SuggestedValidity(valid_from=start, valid_to=end)
    return answer


class CameraFile(Answer):
    """A camera's geometry with its uncertainties."""

    model_config = ConfigDict(extra="allow")

    camera_name: str
    model: str
    convention: str
    image_width_px: int
    image_height_px: int
    parameters: dict[str, Quantity]


class OdmCameras(RootModel[dict[str, dict[str, float | str]]]):
    """Cameras by their name in OpenDroneMap: OpenSfM's model brown, lengths over the larger side."""


exports_router = operations.Router(prefix="/v1/calibrations/{calibration_id}/exports", tags=["calibrations"])

_ANSWERS = {"get_camera_json": CameraFile, "get_odm_cameras": OdmCameras}


def _add(method: str, export: Export) -> None:
    def send(
        calibration: Own[Calibration],
        request: Request,
        query: Any,  # noqa: ANN401  a form of the export's options
        context: UsesContext,
    ) -> Response:
        with context.database.reading() as session:
            camera = session.get_one(Camera, calibration.camera_id)
        _require(calibration, camera, method, export)
        tag = f"{calibration.content_sha256}-{export.filename}-{request.url.query}"
        headers = answers.immutable(request, tag)
        of_camera = {each.name: getattr(camera, each.name) for each in fields(ExportSubject)[1:]}
        subject = ExportSubject(calibration_id=calibration.id, **of_camera)
        written = export.write(fits.read_result(calibration), subject, query.model_dump())
        content = _write_tiff(written) if isinstance(written, Picture) else written
        return Response(content, headers=headers, media_type=export.media_type)

    answer = _ANSWERS.get(export.operation)
    form = create_model(
        export.operation, __base__=Form, **{option.name: _describe(option) for option in export.options}
    )
    send.__annotations__["query"] = Annotated[form, Query()]
    stated = answers.sends(answer, 404) if answer else answers.sends_file(export.media_type)
    stated |= {"name": export.operation, "description": export.description}
    exports_router.add_api_route(f"/{export.filename}", send, **stated)


def _describe(option: ExportOption) -> Any:  # noqa: ANN401  a type with its default
    kind: Any = PositiveText if option.kind == "number" else Text
    held: Any = kind if option.required else kind | None
    described = Annotated[held, told(option.description)] if option.description else held
    return (described, ...) if option.required else (described, None)


def _require(calibration: Calibration, camera: Camera, method: str, export: Export) -> None:
    if calibration.method != method:
        known = ", ".join(each.filename for each in methods.get_method(calibration.method).exports)
        which = f"its exports are {known}" if known else "it has none"
        raise Problem(interface.NOT_FOUND, f"A version of {calibration.method} has no such export: {which}.")
    if export.needs_pixel_pitch and camera.pixel_pitch_um is None:
        detail = (
            f"{export.label} needs the sensor's size: register the camera again, with its pixel_pitch_um."
        )
        raise Problem(interface.VALIDATION_FAILED, detail)


def _write_tiff(picture: Picture) -> bytes:
    import tifffile

    out = io.BytesIO()
    photometric = "rgb" if picture.samples.ndim == 3 else "minisblack"
    tifffile.imwrite(
        out, picture.samples, photometric=photometric, metadata=None, description=picture.description
    )
    return out.getvalue()


for _spec in methods.METHODS:
    for _export in _spec.exports:
        _add(_spec.name, _export)
