"""Blur of a frame from the attitudes that its file records."""

from typing import Annotated, Any

from pydantic import ConfigDict, Field

from radiometry.tools.attitude import Basis, FrameBlur, Turn
from radiometry.tools.motion import USUAL_LIMIT_PX, MotionCase, tolerable_rate_deg_s
from service.schemas.base import Answer, Form


class FrameOptics(Form):
    """What turns an angle into pixels; files do not say it reliably."""

    pixel_pitch_um: Annotated[float, Field(ge=0.01, le=1e4)]
    focal_length_mm: Annotated[float, Field(ge=0.01, le=1e5)]
    limit_px: Annotated[float, Field(ge=1e-3, le=1e5, description="Of the theoretical motion.")] = (
        USUAL_LIMIT_PX
    )


class TurnAnswer(Answer):
    """From one record to the next, about the body's own axes."""

    start_s: float = Field(description="On the camera's clock.")
    end_s: float
    roll_rate_deg_s: float
    pitch_rate_deg_s: float
    yaw_rate_deg_s: float
    tilt_rate_deg_s: float = Field(description="Of roll and pitch together.")

    @classmethod
    def of(cls, turn: Turn) -> "TurnAnswer":
        return cls.model_validate(turn, from_attributes=True)


_TURN: dict[str, Any] = {
    "start_s": 149.791,
    "end_s": 149.991,
    "roll_rate_deg_s": -0.15,
    "pitch_rate_deg_s": 0.23,
    "yaw_rate_deg_s": -0.34,
    "tilt_rate_deg_s": 0.27,
}


class FrameMotionAnswer(Answer):
    """Blur of one frame from the attitudes that it records; rotation alone."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "frame_id": "frm_1",
                    "exposure_time_s": 0.003,
                    "basis": "nearest",
                    "rotation_rate_deg_s": 0.27,
                    "rotation_blur_px": 0.015,
                    "practical_blur_px": 0.0075,
                    "corner_blur_px": 0.029,
                    "tolerable_rate_deg_s": 9.0,
                    "limit_px": 0.5,
                    "turn": _TURN,
                    "turns": [_TURN],
                }
            ]
        }
    )

    frame_id: str
    exposure_time_s: float
    basis: Basis = Field(
        description="during: the records enclose the exposure. nearest: the two nearest to it. largest: its "
        "time is not known, the fastest two."
    )
    rotation_rate_deg_s: float = Field(description="Of the line of sight: roll and pitch together.")
    rotation_blur_px: float = Field(description="Theoretical, in the centre of the picture.")
    practical_blur_px: float = Field(description="Half of the theoretical blur.")
    corner_blur_px: float = Field(description="Theoretical, with the yaw, in the worst corner.")
    tolerable_rate_deg_s: float = Field(description="At which the theoretical blur reaches limit_px.")
    limit_px: float
    turn: TurnAnswer
    turns: list[TurnAnswer] = Field(description="From every record of the file to the next.")

    @classmethod
    def of(
        cls, frame_id: str, case: MotionCase, blur: FrameBlur, turns: tuple[Turn, ...]
    ) -> "FrameMotionAnswer":
        return cls(
            frame_id=frame_id,
            exposure_time_s=case.exposure_time_s,
            basis=blur.basis,
            rotation_rate_deg_s=blur.turn.tilt_rate_deg_s,
            rotation_blur_px=blur.centre_blur_px,
            practical_blur_px=blur.centre_blur_px / 2,
            corner_blur_px=blur.corner_blur_px,
            tolerable_rate_deg_s=tolerable_rate_deg_s(case, case.exposure_time_s),
            limit_px=case.limit_px,
            turn=TurnAnswer.of(blur.turn),
            turns=[TurnAnswer.of(turn) for turn in turns],
        )
