"""Ground coverage of a camera: what is entered, and what follows from it."""

from typing import Annotated

from pydantic import Field

from radiometry.tools.coverage import MOST_TILT_DEG, Coverage, View
from service.schemas.base import Answer, Form, Number, Text
from service.schemas.tools.settings import FocalLength, Metres, PixelPitch

SensorSide = Annotated[Number, Field(ge=1e-3, le=1e4)]


class NewCoverage(Form):
    """One camera above level ground."""

    name: Annotated[Text | None, Field(description="Given back, to find it in a rig.")] = None
    height_m: Metres
    tilt_deg: Annotated[Number, Field(ge=0, le=MOST_TILT_DEG, description="0 looks straight down.")]
    azimuth_deg: Annotated[
        Number,
        Field(ge=-360, le=360, description="Where the tilt points, clockwise from y of the footprint."),
    ] = 0.0
    focal_length_mm: FocalLength
    sensor_width_mm: Annotated[SensorSide, Field(description="Along the rows, which are level.")]
    sensor_height_mm: Annotated[SensorSide, Field(description="Along the tilt.")]
    pixel_pitch_um: PixelPitch

    def view(self) -> View:
        return View(**self.model_dump(exclude={"name"}))


class FieldOfView(Answer):
    horizontal: float = Field(description="Degrees.")
    vertical: float = Field(description="Degrees.")


class CoverageAnswer(Answer, restates=Coverage, without="horizontal_fov_deg vertical_fov_deg"):
    """Ground coverage; what lies above the horizon is left out and named."""

    name: str | None = None
    fov_deg: FieldOfView
    missing: str | None = Field(default=None, description="What is left out, and why.")

    @classmethod
    def of(cls, form: NewCoverage, coverage: Coverage) -> "CoverageAnswer":
        why = None
        if coverage.horizon_in_view:
            why = (
                f"far_m, gsd_far_m, gsd_far_along_m and footprint: the upper edge looks "
                f"{form.tilt_deg + coverage.vertical_fov_deg / 2:.1f} degrees up from straight down, at the "
                "horizon or above it."
            )
        fov = {"horizontal": coverage.horizontal_fov_deg, "vertical": coverage.vertical_fov_deg}
        return cls.restate(coverage, name=form.name, fov_deg=fov, missing=why)


class CoveragesAnswer(Answer):
    """A rig's cameras, in its order."""

    items: list[CoverageAnswer]
