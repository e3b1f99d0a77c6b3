"""What a camera sees of the ground: what is typed in, and what follows from it."""

from dataclasses import asdict
from typing import Annotated, Any

from pydantic import ConfigDict, Field

from radiometry.tools.coverage import MOST_TILT_DEG, Coverage, View
from service.schemas.base import Answer, Form, Number, Text
from service.schemas.tools.settings import FocalLength, Metres, PixelPitch

SensorSide = Annotated[Number, Field(ge=1e-3, le=1e4)]


class NewCoverage(Form):
    """One camera above level ground."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "height_m": 50,
                    "tilt_deg": 45,
                    "focal_length_mm": 9,
                    "sensor_width_mm": 6.4,
                    "sensor_height_mm": 4.8,
                    "pixel_pitch_um": 4.65,
                }
            ]
        }
    )

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


_COVERAGE: dict[str, Any] = {
    "fov_deg": {"horizontal": 39.15, "vertical": 29.86},
    "near_m": 28.94,
    "far_m": 86.36,
    "gsd_near_m": 0.028842,
    "gsd_centre_m": 0.036534,
    "gsd_far_m": 0.049824,
    "gsd_near_along_m": 0.0322,
    "gsd_centre_along_m": 0.0517,
    "gsd_far_along_m": 0.0961,
    "footprint": [[-19.8, 28.9], [19.8, 28.9], [34.3, 86.4], [-34.3, 86.4]],
    "horizon_in_view": False,
}


class CoverageAnswer(Answer):
    """What lies above the horizon is left out and named."""

    model_config = ConfigDict(json_schema_extra={"examples": [_COVERAGE]})

    name: str | None = None
    fov_deg: FieldOfView
    near_m: float = Field(description="From the point below the camera along the tilt; negative behind it.")
    far_m: float | None = None
    gsd_near_m: float = Field(description="Of a pixel across the line of sight, in that whole row.")
    gsd_centre_m: float
    gsd_far_m: float | None = None
    gsd_near_along_m: float = Field(description="Of a pixel along the tilt, on the ground.")
    gsd_centre_along_m: float
    gsd_far_along_m: float | None = None
    footprint: list[list[float]] | None = Field(
        default=None,
        description="[x, y] in metres of near left, near right, far right, far left; y is azimuth 0.",
    )
    horizon_in_view: bool
    missing: str | None = Field(default=None, description="What is left out, and why.")

    @classmethod
    def of(cls, form: NewCoverage, coverage: Coverage) -> "CoverageAnswer":
        said = asdict(coverage)
        fov = {name: said.pop(f"{name}_fov_deg") for name in ("horizontal", "vertical")}
        why = None
        if coverage.horizon_in_view:
            why = (
                f"far_m, gsd_far_m, gsd_far_along_m and footprint: the upper edge looks "
                f"{form.tilt_deg + fov['vertical'] / 2:.1f} degrees up from straight down, at the horizon or "
                "above it."
            )
        return cls(name=form.name, fov_deg=FieldOfView.model_validate(fov), missing=why, **said)


class CoveragesAnswer(Answer):
    """A rig's cameras, in its order."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"items": [_COVERAGE]}]})

    items: list[CoverageAnswer]
