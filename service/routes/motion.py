"""The image motion of frames from the attitudes that their files record."""

from typing import Annotated

from fastapi import Query, Response
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.findings import InputRejected, shared
from radiometry.frame import FrameHeader
from radiometry.tools.motion import blur_of_file, compute_turns, read_attitudes
from service.auth import Reader
from service.context import UsesContext
from service.lookup import Id, owned
from service.operations import Router
from service.problems import invalid
from service.routes import problems
from service.schemas.attitudes import (
    COLUMNS,
    CampaignMotionAnswer,
    CampaignOptics,
    FrameMotionAnswer,
    FrameMotionRow,
    FrameOptics,
    format_forward,
    format_rotation,
)
from service.tabular import write_csv
from store.codec import decode_exposure, decode_header
from store.tables import Camera, Campaign, FrameRow

router = Router(prefix="/v1", tags=["tools"])


@router.get("/frames/{frame_id}/motion", response_model=FrameMotionAnswer, responses=problems(404))
def get_frame_motion(
    frame_id: Id, optics: Annotated[FrameOptics, Query()], caller: Reader, context: UsesContext
) -> Response:
    """The blur of a frame whose file records attitudes with their times, as a Sequoia's does.

    The camera is taken as fixed to the aircraft, looking down. Rotation alone, without vibration.
    """
    with context.database.reading() as session:
        frame = owned(session, FrameRow, frame_id, caller)
        pitch_um = _find_pitch(session, session.get_one(Campaign, frame.campaign_id), optics)
    header, exposure_time_s = _read(frame)
    blur = blur_of_file(
        header,
        exposure_time_s=exposure_time_s,
        pixel_pitch_um=pitch_um,
        focal_length_mm=optics.focal_length_mm,
    )
    case = optics.case(pitch_um, exposure_time_s)
    turns = compute_turns(read_attitudes(header.multispectral))
    return FrameMotionAnswer.of(frame.id, case, blur, turns).respond()


@router.get(
    "/campaigns/{campaign_id}/motion",
    response_model=CampaignMotionAnswer,
    responses={200: {"content": {"text/csv": {"schema": {"type": "string"}}}}, **problems(404)},
)
def get_campaign_motion(
    campaign_id: Id, optics: Annotated[CampaignOptics, Query()], caller: Reader, context: UsesContext
) -> Response:
    """The blur of every frame of a campaign, a row each, from its own attitudes and a speed that is stated.

    A frame without attitudes stands there with the reason. The camera is taken as fixed to the aircraft,
    looking down. Without vibration.
    """
    with context.database.reading() as session:
        campaign = owned(session, Campaign, campaign_id, caller)
        pitch_um = _find_pitch(session, campaign, optics)
        frames = select(FrameRow).where(FrameRow.campaign_id == campaign.id, FrameRow.withdrawn_at.is_(None))
        if optics.role is not None:
            frames = frames.where(FrameRow.role == optics.role)
        found = session.scalars(frames.order_by(FrameRow.id))
        rows = [_describe(frame, optics, pitch_um) for frame in found]
    if optics.format == "csv":
        return Response(write_csv([row.dump() for row in rows], COLUMNS), media_type="text/csv")
    return CampaignMotionAnswer.of(rows, optics, pitch_um).respond()


def _find_pitch(session: Session, campaign: Campaign, optics: FrameOptics) -> float:
    """As it is asked for, else as the camera's record says it."""
    pitch_um = optics.pixel_pitch_um or session.get_one(Camera, campaign.camera_id).pixel_pitch_um
    if pitch_um is None:
        message = "is missing, and the camera's record does not say it either"
        raise invalid([{"type": "missing_pitch", "loc": ("query", "pixel_pitch_um"), "msg": message}])
    return pitch_um


def _read(frame: FrameRow) -> tuple[FrameHeader, float]:
    """Read what the file states of itself, and its exposure time [s]."""
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
    """Describe what is known of one frame's motion, and why the rest is not."""
    row = {name: getattr(frame, name) for name in ("filename", "role", "scene")} | {"frame_id": frame.id}
    try:
        header, exposure_time_s = _read(frame)
        case = optics.case(pixel_pitch_um, exposure_time_s)
        row |= {"taken_at": header.taken_at, "exposure_time_s": exposure_time_s} | format_forward(case)
        blur = blur_of_file(
            header,
            exposure_time_s=exposure_time_s,
            pixel_pitch_um=pixel_pitch_um,
            focal_length_mm=optics.focal_length_mm,
        )
        row |= format_rotation(case, blur)
    except InputRejected as error:
        row |= {"missing_code": error.code, "missing": error.message}
    return FrameMotionRow(**row)
