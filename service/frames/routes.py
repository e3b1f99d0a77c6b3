"""Frames: uploaded as a stream, read by a worker, given back byte for byte; and their image motion."""

from collections.abc import Mapping
from functools import partial
from typing import Annotated, Any, Literal
from urllib.parse import quote

from fastapi import Query, Request, Response
from pydantic import Field
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.findings import InputRejected, interface, shared
from radiometry.frame import FrameHeader
from radiometry.frame.roi import bounding_window
from radiometry.frame.verdicts import Verdict
from radiometry.tools.motion import USUAL_LIMIT_PX, Basis, MotionCase, blur_of_file, compute_motion
from service.campaigns.schemas import RoiAnswer, Role
from service.frames.schemas import FrameAnswer, FrameChange, Upload
from service.http import answers, auth, changes, operations, problems, tables
from service.http.context import Context, UsesContext
from service.http.lookup import Id, Locked, Own
from service.http.models import Answer, Form, maybe, told
from service.http.paging import Page, UsesPaging
from service.measurements.requests import NewDrawing, read_region
from service.tools.routes import KM_H_PER_M_S, refuse_two_speeds
from service.uploads.frames import admit, answer_frames, answer_write, keep_frame, receive
from store.codec import decode_exposure, decode_header
from store.queries.campaigns import find_or_add_roi, renew_extraction
from store.queries.frames import current_roi, describe_anew, require_role
from store.reviews import judge_alone
from store.tables import Camera, Campaign, FrameRow, Job, utc_now

router = operations.Router(prefix="/v1", tags=["frames"])

_BINARY = {"schema": {"type": "string", "format": "binary"}}
_UPLOAD = {
    "requestBody": {
        "required": True,
        "description": "The file as it is, or a form with one part named `file`.",
        "content": {
            "application/octet-stream": _BINARY,
            "multipart/form-data": {
                "schema": {
                    "type": "object",
                    "required": ["file"],
                    "properties": {"file": {"type": "string", "format": "binary"}},
                }
            },
        },
    }
}


@router.post(
    "/campaigns/{campaign_id}/frames",
    **answers.makes(FrameAnswer, "The campaign has these bytes already.", 400, 409, 413, 507),
    openapi_extra=_UPLOAD,
)
async def upload_frame(
    campaign_id: Id,
    request: Request,
    upload: Annotated[Upload, Query()],
    caller: auth.Uploader,
    context: UsesContext,
    writing: changes.StreamWrites,
) -> Response:
    """Upload one file. It is durable when this answers; a worker then reads it.

    The hash is compared when X-Content-SHA256 or Repr-Digest announces it.
    """
    region = read_region(upload.roi) if upload.roi is not None else None
    admitting = partial(admit, context, campaign_id, caller, role=upload.role)
    blob, name = await receive(request, context.blobs, admit=admitting)
    named = upload.model_copy(update={"filename": upload.filename or name})
    return await keep_frame(context, writing, caller, campaign_id, upload=named, region=region, blob=blob)


@router.get("/campaigns/{campaign_id}/frames", response_model=Page[FrameAnswer])
def list_frames(
    campaign: Own[Campaign],
    paging: UsesPaging,
    context: UsesContext,
    session: Session,
    *,
    brief: Annotated[bool, Query(description="Without `metadata` and `verdict`: shorter.")] = False,
    withdrawn: Annotated[bool, Query(description="The withdrawn frames instead.")] = False,
) -> Response:
    """A campaign's frames, oldest first, without those that were withdrawn."""
    rows = select(FrameRow).where(FrameRow.campaign_id == campaign.id)
    rows = rows.where(FrameRow.withdrawn_at.is_not(None) if withdrawn else FrameRow.withdrawn_at.is_(None))

    def shape(found: list[FrameRow]) -> list[FrameAnswer]:
        if brief:
            return [each.model_copy(update={"metadata": None}) for each in answer_frames(session, found, {})]
        return answer_frames(session, found, _find_verdicts(context, session, found))

    return paging.send(session, rows, shape)


@router.get("/frames/{frame_id}", response_model=FrameAnswer)
def get_frame(frame: Own[FrameRow], context: UsesContext, session: Session) -> Response:
    """One frame: what it says of itself, its refusal or warnings, its statistics, and the verdict on it."""
    return answer_frames(session, [frame], _find_verdicts(context, session, [frame]))[0].respond()


@router.patch("/frames/{frame_id}", response_model=FrameAnswer, responses=answers.problems(409))
def change_frame(
    frame: Locked[FrameRow], body: FrameChange, caller: auth.Calibrator, session: Session
) -> changes.Reply:
    """Correct what was said of a frame; it is then read again."""
    # locked: what two who come at once supply is kept together
    return _reply(session, frame, apply_change(session, frame, body, caller))


def apply_change(session: Session, frame: FrameRow, body: FrameChange, caller: auth.Caller) -> list[Job]:
    """Correct what was said of a frame; return the job that reads it again, if its statistics need it."""
    said = body.model_dump(exclude_none=True, exclude={"frame_ids", "expected", "reason"})
    if body.role is not None:
        require_role(session.get_one(Campaign, frame.campaign_id), body.role)
    if "scene" in said:
        frame.scene = said.pop("scene") or None
    if (left_out := said.pop("left_out", None)) is not None:
        reason = {"reason": body.reason or "Left out in the grid.", "by": caller.named}
        frame.left_out = reason if left_out else None
    was_withdrawn = frame.withdrawn_at is not None
    if (withdrawn := said.pop("withdrawn", was_withdrawn)) != was_withdrawn:
        frame.withdrawn_at = utc_now() if withdrawn else None
    supplied = {name: said.pop(name) for name in ("exposure_time_s", "f_number", "iso") if name in said}
    said["supplied"] = {**frame.supplied, **supplied}
    # one that is restored anyway: the campaign's region may have changed meanwhile
    return _read_again(session, frame, caller, said, anyway=was_withdrawn and not withdrawn)


@router.put("/frames/{frame_id}/roi", response_model=FrameAnswer)
def set_frame_roi(
    frame: Own[FrameRow], drawing: NewDrawing, caller: auth.Calibrator, session: Session
) -> changes.Reply:
    """Set a region for one frame, where the camera has moved."""
    if header := frame.header:
        bounding_window(drawing.polygon, height_px=header["height_px"], width_px=header["width_px"])
    roi = find_or_add_roi(session, caller.organisation_id, drawing)
    return _reply(session, frame, _read_again(session, frame, caller, {"roi_id": roi.id}))


@router.get("/frames/{frame_id}/roi", response_model=RoiAnswer)
def get_frame_roi(frame: Own[FrameRow], session: Session) -> Response:
    """The region that holds for a frame: its own, drawn or found, else its campaign's."""
    if (roi := current_roi(session, frame, session.get_one(Campaign, frame.campaign_id))) is None:
        raise problems.Problem(interface.NOT_FOUND, "This frame has no region yet: PUT one here.")
    return RoiAnswer.of(roi).respond()


@router.get("/frames/{frame_id}/content", **answers.sends_stored_file("application/octet-stream"))
def get_frame_content(frame: Own[FrameRow], request: Request, context: UsesContext) -> Response:
    """The very bytes that were uploaded."""
    headers = {
        "Content-Disposition": f"attachment; filename*=UTF-8''{quote(frame.filename, safe='')}",
        "X-Content-Type-Options": "nosniff",
    }
    return answers.send_blob(request, context.files, frame.sha256, "application/octet-stream", headers)


@router.get("/frames/{frame_id}/preview.png", **answers.sends_stored_file("image/png"))
def get_frame_preview(frame: Own[FrameRow], request: Request, context: UsesContext) -> Response:
    """A picture to draw the region on; its width against `width_px` is the scale."""
    return answers.send_blob(request, context.files, require_preview(frame), "image/png", {})


def require_preview(frame: FrameRow) -> str:
    if frame.preview_sha256 is None:
        detail = "This frame has no preview: it has not been read yet, or it was refused."
        raise problems.Problem(interface.PREVIEW_NOT_READY, detail, retryable=frame.state == "received")
    return frame.preview_sha256


def require_header(frame: FrameRow) -> dict[str, Any]:
    if frame.header is None:
        detail = f"{frame.filename} has not been read, or cannot be. Look at another frame, or wait for it."
        raise problems.Problem(shared.FRAME_NOT_READ, detail, status=409, retryable=frame.state == "received")
    return frame.header


def _read_again(
    session: Session, frame: FrameRow, caller: auth.Caller, said: dict[str, Any], *, anyway: bool = False
) -> list[Job]:
    """Describe a frame anew; return the job that reads it again, if that has changed anything."""
    changed = describe_anew(frame, said) or anyway
    return [renew_extraction(session, frame, caller.organisation_id, by=caller.key_id)] if changed else []


def _reply(session: Session, frame: FrameRow, jobs: list[Job]) -> changes.Reply:
    session.flush()
    campaign = session.get_one(Campaign, frame.campaign_id)
    return changes.Reply(status=200, body=answer_write(session, frame, campaign, jobs), jobs=jobs)


def _find_verdicts(context: Context, session: Session, frames: list[FrameRow]) -> Mapping[str, Verdict]:
    if all(frame.state == "received" and frame.header is None for frame in frames):
        # nothing else is said of a frame that waits: who has just sent it waits for no review
        campaigns = {each: session.get_one(Campaign, each) for each in {one.campaign_id for one in frames}}
        return {each.id: judge_alone(session, each, campaigns[each.campaign_id]) for each in frames}
    ids = [frame.id for frame in frames]
    return context.reviews.find(session, frames[0].campaign_id, verdicts_of=ids).verdicts


class CampaignOptics(Form):
    """Optics that convert an angle to pixels, and how the aircraft flew: files say neither reliably."""

    pixel_pitch_um: float | None = maybe("Else that of the camera's record.", ge=0.01, le=1e4)
    focal_length_mm: Annotated[float, Field(ge=0.01, le=1e5)]
    limit_px: float = told("Of the theoretical motion.", default=USUAL_LIMIT_PX, ge=1e-3, le=1e5)
    ground_speed_m_s: float | None = maybe("With distance_m, and only then.", ge=0, le=1e5)
    ground_speed_km_h: float | None = maybe("In place of ground_speed_m_s, never with it.", ge=0, le=1e5)
    distance_m: float | None = maybe("Height above ground; with a speed, and only then.", ge=1e-3, le=1e7)
    role: Role | None = maybe("Only frames of this role.")
    format: Literal["json", "csv"] = "json"

    def check(self) -> None:
        refuse_two_speeds(self)
        if (self.speed_m_s is None) != (self.distance_m is None):
            raise ValueError("a ground speed and distance_m are given together or not at all")

    @property
    def speed_m_s(self) -> float | None:
        if self.ground_speed_km_h is not None:
            return self.ground_speed_km_h / KM_H_PER_M_S
        return self.ground_speed_m_s


class FrameMotionRow(Answer):
    """One frame's motion, flat; what is not known is absent, and `missing` says why."""

    frame_id: str
    filename: str
    role: Role
    scene: str | None = None
    taken_at: str | None = None
    exposure_time_s: float | None = None
    basis: Basis | None = maybe("Which records the rate is from.")
    rotation_rate_deg_s: float | None = maybe("Of roll and pitch together.")
    yaw_rate_deg_s: float | None = None
    rotation_blur_px: float | None = maybe("Theoretical, in the centre.")
    corner_blur_px: float | None = maybe("Theoretical, of rotation alone, in the worst corner.")
    forward_blur_px: float | None = maybe("Theoretical, of the stated speed.")
    theoretical_blur_px: float | None = maybe(
        "Rotation and speed together, in the centre, in the worst direction."
    )
    practical_blur_px: float | None = maybe("Half of the theoretical blur.")
    tolerable_rate_deg_s: float | None = maybe(
        "Of rotation alone, at which the theoretical blur reaches limit_px."
    )
    within_limit: bool | None = maybe("Whether the theoretical blur is at most limit_px; absent: unknown.")
    missing_code: str | None = None
    missing: str | None = maybe("Why there is no rate, and what to do.")


class CampaignMotionAnswer(Answer):
    """A campaign's frames, oldest first, in one answer; the columns of the CSV are those of a row."""

    pixel_pitch_um: float
    focal_length_mm: float
    limit_px: float
    ground_speed_m_s: float | None = None
    distance_m: float | None = None
    frames: int
    with_rates: int = told("Frames whose rotation is known.")
    within_limit: int
    beyond_limit: int
    rows: list[FrameMotionRow]


motion_router = operations.Router(prefix="/v1", tags=["tools"])


@motion_router.get(
    "/campaigns/{campaign_id}/motion", response_model=CampaignMotionAnswer, responses=answers.text()
)
def get_campaign_motion(
    campaign: Own[Campaign], optics: Annotated[CampaignOptics, Query()], session: Session
) -> Response:
    """The blur of every frame of a campaign, a row each, from its own attitudes and a speed that is stated.

    A frame without attitudes stands there with the reason. The camera is taken as fixed to the aircraft,
    looking down. Without vibration.
    """
    pitch_um = _find_pitch(session, campaign, optics)
    frames = select(FrameRow).where(FrameRow.standing(campaign.id))
    if optics.role is not None:
        frames = frames.where(FrameRow.role == optics.role)
    found = session.scalars(frames.order_by(FrameRow.id))
    rows = [_describe(frame, optics, pitch_um) for frame in found]
    if optics.format == "csv":
        return Response(
            tables.write_csv([row.dump() for row in rows], list(FrameMotionRow.model_fields)),
            media_type="text/csv",
        )
    return CampaignMotionAnswer.restate(
        optics,
        pixel_pitch_um=pitch_um,
        ground_speed_m_s=optics.speed_m_s,
        frames=len(rows),
        with_rates=sum(row.basis is not None for row in rows),
        within_limit=sum(row.within_limit is True for row in rows),
        beyond_limit=sum(row.within_limit is False for row in rows),
        rows=rows,
    ).respond()


def _find_pitch(session: Session, campaign: Campaign, optics: CampaignOptics) -> float:
    pitch_um = optics.pixel_pitch_um or session.get_one(Camera, campaign.camera_id).pixel_pitch_um
    if pitch_um is None:
        raise problems.wrong(
            "query.pixel_pitch_um", "is missing, and the camera's record does not say it either"
        )
    return pitch_um


def _read(frame: FrameRow) -> tuple[FrameHeader, float]:
    if frame.refusal_code is not None:
        raise InputRejected(
            shared.FRAME_NOT_READ, f"This frame was refused ({frame.refusal_code}): {frame.refusal_detail}"
        )
    if frame.header is None:
        raise InputRejected(shared.FRAME_NOT_READ, "This frame has not been read yet.")
    if frame.exposure is None:
        raise InputRejected(shared.EXPOSURE_MISSING, "This frame states no exposure time.")
    return decode_header(frame.header), decode_exposure(frame.exposure).exposure_time_s


def _describe(frame: FrameRow, optics: CampaignOptics, pixel_pitch_um: float) -> FrameMotionRow:
    row: dict[str, Any] = {name: getattr(frame, name) for name in ("filename", "role", "scene")}
    row["frame_id"] = frame.id
    try:
        header, exposure_time_s = _read(frame)
        taken: dict[str, float] = {
            "exposure_time_s": exposure_time_s,
            "pixel_pitch_um": pixel_pitch_um,
            "focal_length_mm": optics.focal_length_mm,
        }
        case = MotionCase(
            **taken,
            distance_m=optics.distance_m or 1.0,  # of no effect on rotation
            ground_speed_m_s=optics.speed_m_s,
            limit_px=optics.limit_px,
        )
        motion = compute_motion(case)
        forward_px = motion.forward_blur_px or 0.0
        row |= {
            "taken_at": header.taken_at,
            "exposure_time_s": exposure_time_s,
            "forward_blur_px": motion.forward_blur_px,
            "tolerable_rate_deg_s": motion.tolerable_rate_deg_s,
            # too long for the speed, whatever the rotation was
            "within_limit": False if forward_px > case.limit_px else None,
        }
        blur = blur_of_file(header, **taken)
        theoretical = blur.centre_blur_px + forward_px
        row |= {
            "basis": blur.basis,
            "rotation_rate_deg_s": blur.turn.tilt_rate_deg_s,
            "yaw_rate_deg_s": blur.turn.yaw_rate_deg_s,
            "rotation_blur_px": blur.centre_blur_px,
            "corner_blur_px": blur.corner_blur_px,
            "theoretical_blur_px": theoretical,
            "practical_blur_px": theoretical / 2,
            "within_limit": theoretical <= case.limit_px,
        }
    except InputRejected as error:
        row |= {"missing_code": error.code, "missing": error.message}
    return FrameMotionRow(**row)
