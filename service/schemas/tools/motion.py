"""Image motion: what is typed in, and what follows from it."""

from dataclasses import asdict
from typing import Annotated, Any

from pydantic import ConfigDict, Field, model_validator

from radiometry.tools.motion import USUAL_LIMIT_PX, Motion, MotionCase
from service.schemas.base import Answer, Form, Number, Text
from service.schemas.tools.settings import ExposureTime, FocalLength, Metres, PixelPitch

KM_H_PER_M_S = 3.6

Rate = Annotated[Number, Field(ge=0, le=1e5)]
Limit = Annotated[
    Number, Field(ge=1e-3, le=1e5, description="Of the theoretical motion; twice it for a practical one.")
]


class NewMotion(Form):
    """One lens, one exposure, one way of moving. Rates are magnitudes: 0 or more."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "pixel_pitch_um": 4.65,
                    "focal_length_mm": 9,
                    "exposure_time_s": 0.00125,
                    "distance_m": 25,
                    "rotation_rate_deg_s": 165.6,
                    "limit_px": 0.5,
                }
            ]
        }
    )

    name: Annotated[Text | None, Field(description="Given back, to find it in a table.")] = None
    pixel_pitch_um: PixelPitch
    focal_length_mm: FocalLength
    exposure_time_s: ExposureTime
    distance_m: Annotated[Metres, Field(description="Along the line of sight; the height of a nadir camera.")]
    rotation_rate_deg_s: Annotated[
        Rate | None, Field(description="About an axis across the line of sight.")
    ] = None
    ground_speed_m_s: Annotated[Rate | None, Field(description="Across the line of sight.")] = None
    ground_speed_km_h: Annotated[
        Rate | None, Field(description="In place of ground_speed_m_s, never with it.")
    ] = None
    limit_px: Limit = USUAL_LIMIT_PX

    @model_validator(mode="after")
    def _one_speed(self) -> "NewMotion":
        if self.ground_speed_m_s is not None and self.ground_speed_km_h is not None:
            raise ValueError("give ground_speed_m_s or ground_speed_km_h, not both")
        return self

    def case(self) -> MotionCase:
        said = self.model_dump(exclude={"name", "ground_speed_km_h"})
        if self.ground_speed_km_h is not None:
            said["ground_speed_m_s"] = self.ground_speed_km_h / KM_H_PER_M_S
        return MotionCase(**said)


_MOTION: dict[str, Any] = {
    "gsd_m": 0.012917,
    "rotation_angle_deg": 0.207,
    "rotation_ground_m": 0.090321,
    "rotation_blur_px": 6.9926,
    "theoretical_blur_px": 6.9926,
    "practical_blur_px": 3.4963,
    "tolerable_rate_deg_s": 11.841,
    "longest_exposure_s": 8.9380e-05,
    "limit_px": 0.5,
}


class MotionAnswer(Answer):
    """Blur in pixels; what was not asked for is left out. Limits are of the theoretical motion."""

    model_config = ConfigDict(json_schema_extra={"examples": [_MOTION]})

    name: str | None = None
    gsd_m: float
    rotation_angle_deg: float | None = None
    rotation_ground_m: float | None = None
    rotation_blur_px: float | None = Field(default=None, description="Theoretical, from rotation alone.")
    forward_blur_px: float | None = Field(default=None, description="Theoretical, from speed alone.")
    theoretical_blur_px: float | None = Field(
        default=None, description="Rotation and speed together, in the worst direction."
    )
    practical_blur_px: float | None = Field(default=None, description="Half of the theoretical blur.")
    tolerable_rate_deg_s: float = Field(
        description="Of rotation alone, at which the THEORETICAL blur reaches limit_px."
    )
    longest_exposure_s: float | None = Field(
        default=None, description="At which the theoretical blur reaches limit_px; absent if nothing moves."
    )
    limit_px: float
    ground_speed_m_s: float | None = Field(default=None, description="As it was understood.")

    @classmethod
    def of(cls, form: NewMotion, motion: Motion) -> "MotionAnswer":
        case = form.case()
        return cls(
            name=form.name,
            limit_px=case.limit_px,
            ground_speed_m_s=case.ground_speed_m_s,
            **asdict(motion),
        )


class MotionsAnswer(Answer):
    """A table's results, in its order."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"items": [_MOTION]}]})

    items: list[MotionAnswer]
