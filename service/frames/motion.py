"""The image motion of a campaign's frames from the attitudes that their files record."""

from typing import Annotated, Any, Literal

from fastapi import Query, Response
from pydantic import Field, model_validator
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.findings import InputRejected, shared
from radiometry.frame import FrameHeader
from radiometry.tools.motion import USUAL_LIMIT_PX, Basis, MotionCase, blur_of_file, compute_motion
from service.campaigns.schemas import Role
from service.http import auth, lookup, operations, tables
from service.http.models import Answer, Form, maybe, told
from service.http.problems import wrong
from service.tools.routes import KM_H_PER_M_S, refuse_two_speeds
from store.codec import decode_exposure, decode_header
from store.tables import Camera, Campaign, FrameRow


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

    @model_validator(mode="after")
    def _speed_and_height(self) -> "CampaignOptics":
        refuse_two_speeds(self)
        if (self.speed_m_s is None) != (self.distance_m is None):
            raise ValueError("a ground speed and distance_m are given together or not at all")
        return self

    @property
    def speed_m_s(self) -> float | None:
        if self.ground_speed_km_h is not None:
            return self.ground_speed_km_h / KM_H_PER_M_S
        return self.ground_speed_m_s

    def case(self, pixel_pitch_um: float, exposure_time_s: float) -> MotionCase:
        return MotionCase(
            pixel_pitch_um=pixel_pitch_um,
            focal_length_mm=self.focal_length_mm,
            exposure_time_s=exposure_time_s,
            distance_m=self.distance_m or 1.0,  # of no effect on rotation
            ground_speed_m_s=self.speed_m_s,
            limit_px=self.limit_px,
        )


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


router = operations.Router(prefix="/v1", tags=["tools"])


@router.get(
    "/campaigns/{campaign_id}/motion",
    response_model=CampaignMotionAnswer,
    responses={200: {"content": {"text/csv": {"schema": {"type": "string"}}}}},
)
def get_campaign_motion(
    campaign_id: lookup.Id, optics: Annotated[CampaignOptics, Query()], caller: auth.Reader, session: Session
) -> Response:
    """The blur of every frame of a campaign, a row each, from its own attitudes and a speed that is stated.

    A frame without attitudes stands there with the reason. The camera is taken as fixed to the aircraft,
    looking down. Without vibration.
    """
    campaign = lookup.owned(session, Campaign, campaign_id, caller)
    pitch_um = _find_pitch(session, campaign, optics)
    frames = select(FrameRow).where(FrameRow.campaign_id == campaign.id, FrameRow.withdrawn_at.is_(None))
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
        raise wrong("query.pixel_pitch_um", "is missing, and the camera's record does not say it either")
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
        case = optics.case(pixel_pitch_um, exposure_time_s)
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
        blur = blur_of_file(
            header,
            exposure_time_s=exposure_time_s,
            pixel_pitch_um=pixel_pitch_um,
            focal_length_mm=optics.focal_length_mm,
        )
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
