"""The calculators: what is typed in, and what follows from it. Nothing is stored."""

from dataclasses import asdict
from typing import Annotated, Any

from pydantic import ConfigDict, Field, model_validator

from radiometry.tools.coverage import Coverage, View
from radiometry.tools.exponents import ExponentFit, SeriesRow
from radiometry.tools.motion import USUAL_LIMIT_PX, Motion, MotionCase
from service.schemas.base import Answer, Form, Number, Quantity, Text

MOST_CASES = 1000
_KM_H_PER_M_S = 3.6

# wider than any camera and any aircraft, narrower than what overflows
PixelPitch = Annotated[Number, Field(ge=0.01, le=1e4, description="Distance of neighbouring pixels.")]
FocalLength = Annotated[Number, Field(ge=0.01, le=1e5)]
ExposureTime = Annotated[Number, Field(ge=1e-9, le=86_400)]
FNumber = Annotated[Number, Field(ge=0.1, le=1000)]
Iso = Annotated[Number, Field(ge=0.1, le=1e9)]
Metres = Annotated[Number, Field(ge=1e-3, le=1e7)]
SensorSide = Annotated[Number, Field(ge=1e-3, le=1e4)]
Rate = Annotated[Number, Field(ge=0, le=1e5)]
Limit = Annotated[
    Number, Field(ge=1e-3, le=1e5, description="Of the theoretical motion; twice it for a practical one.")
]
Signal = Annotated[Number, Field(ge=-1e9, le=1e9)]


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
            said["ground_speed_m_s"] = self.ground_speed_km_h / _KM_H_PER_M_S
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
    tilt_deg: Annotated[Number, Field(ge=0, lt=90, description="0 looks straight down.")]
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


class ExposureRow(Form):
    exposure_time_s: ExposureTime
    f_number: FNumber
    iso: Iso
    signal_dn: Annotated[Signal, Field(description="Mean raw number, dark included.")]
    dark_dn: Annotated[Signal | None, Field(description="Where dark differs by row.")] = None


class NewExposureSeries(Form):
    """Mean signals of one surface in one light, at several settings."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "rows": [
                        {"exposure_time_s": time, "f_number": 11, "iso": 200, "signal_dn": signal}
                        for time, signal in ((0.01, 373), (0.02, 752), (0.04, 1472), (0.1, 3780))
                    ],
                    "dark_dn": 8,
                    "white_level_dn": 16384,
                }
            ]
        }
    )

    rows: Annotated[list[ExposureRow], Field(min_length=1, max_length=10_000)]
    dark_dn: Annotated[
        Signal, Field(description="Of rows that state none; 0 where black is off already.")
    ] = 0.0
    white_level_dn: Annotated[Number, Field(gt=0, le=1e9)]

    def series(self) -> list[SeriesRow]:
        return [SeriesRow(**row.model_dump()) for row in self.rows]


class Exponents(Answer):
    """Of the settings that vary."""

    exposure_time_s: Quantity | None = None
    f_number: Quantity | None = None
    iso: Quantity | None = None


class LeftOutRow(Answer):
    row: int = Field(description="Its number, from 0.")
    reason: str


class ExposureAnswer(Answer):
    """signal - dark = A t^a N^b S^s: 1, -2 and 1 for a linear sensor behind an ideal lens."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "exponents": {
                        "exposure_time_s": {"value": 1.0048, "standard_uncertainty": 0.0079, "unit": "1"}
                    },
                    "used": 4,
                    "left_out": [],
                    "scatter_rel": 0.0134,
                }
            ]
        }
    )

    exponents: Exponents
    used: int = Field(description="How many rows entered.")
    left_out: list[LeftOutRow]
    scatter_rel: float = Field(description="Of the signal about the fit.")

    @classmethod
    def of(cls, fit: ExponentFit) -> "ExposureAnswer":
        return cls.model_validate(fit, from_attributes=True)
