"""Image motion: what is typed in, and what follows from it."""

from typing import Annotated

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
        json_schema_extra={"not": {"required": ["ground_speed_m_s", "ground_speed_km_h"]}}
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


class MotionAnswer(Answer, restates=Motion):
    """Blur in pixels; what was not asked for is left out. Limits are of the theoretical motion."""

    name: str | None = None
    limit_px: float
    ground_speed_m_s: float | None = Field(default=None, description="As it was understood.")

    @classmethod
    def of(cls, form: NewMotion, motion: Motion) -> "MotionAnswer":
        return cls.restate(motion, form.case(), name=form.name)


class MotionsAnswer(Answer):
    """A table's results, in its order."""

    items: list[MotionAnswer]
