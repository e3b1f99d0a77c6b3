"""The calculators: what they take and what they answer."""

from typing import Annotated, Any

from pydantic import ConfigDict, Field, model_validator

from radiometry.tools.coverage import MOST_TILT_DEG, Coverage, View
from radiometry.tools.exponents import ExponentFit, LeftOut, SeriesRow
from radiometry.tools.motion import USUAL_LIMIT_PX, Motion, MotionCase
from service.calibrations.schemas import FlagRaised
from service.http.models import Answer, Form, Number, Quantity, Text

MOST_CASES = 1000

# wider than any camera and any aircraft, narrower than what overflows
PixelPitch = Annotated[Number, Field(ge=0.01, le=1e4, description="Distance of neighbouring pixels.")]
FocalLength = Annotated[Number, Field(ge=0.01, le=1e5)]
EXPOSURE_TIMES_S = Field(ge=1e-9, le=86_400)
ExposureTime = Annotated[Number, EXPOSURE_TIMES_S]
Metres = Annotated[Number, Field(ge=1e-3, le=1e7)]


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


MOST_ROWS = 10_000

_F_NUMBERS, _ISOS = Field(ge=0.1, le=1000), Field(ge=0.1, le=1e9)
_SIGNALS_DN, _WHITE_LEVELS_DN = Field(ge=-1e9, le=1e9), Field(gt=0, le=1e9)

FNumber = Annotated[Number, _F_NUMBERS]
Iso = Annotated[Number, _ISOS]
Signal = Annotated[Number, _SIGNALS_DN]


class ExposureRow(Form):
    exposure_time_s: ExposureTime
    f_number: FNumber
    iso: Iso
    signal_dn: Annotated[Signal, Field(description="Mean raw number, dark included.")]
    dark_dn: Annotated[Signal | None, Field(description="Where dark differs by row.")] = None


class NewExposureSeries(Form):
    """Mean signals of one surface in one light, at several settings."""

    rows: Annotated[list[ExposureRow], Field(min_length=1, max_length=MOST_ROWS)]
    dark_dn: Annotated[
        Signal, Field(description="Of rows that state none; 0 where black is off already.")
    ] = 0.0
    white_level_dn: Annotated[Number, _WHITE_LEVELS_DN]

    def series(self) -> list[SeriesRow]:
        return [SeriesRow(**row.model_dump()) for row in self.rows]


class ExposureTable(Form):
    """Statements that a table does not contain; with JSON none of them, since they are in the body."""

    white_level_dn: Annotated[
        float | None, _WHITE_LEVELS_DN, Field(description="Needed with a table; of JSON in the body.")
    ] = None
    dark_dn: Annotated[
        float | None, _SIGNALS_DN, Field(description="Of a table's rows without one; else 0.")
    ] = None
    exposure_time_s: Annotated[
        float | None, EXPOSURE_TIMES_S, Field(description="Of a table's rows that state none.")
    ] = None
    f_number: Annotated[float | None, _F_NUMBERS, Field(description="Of a table's rows that state none.")] = (
        None
    )
    iso: Annotated[float | None, _ISOS, Field(description="Of a table's rows that state none.")] = None
    signal: Annotated[
        Text | None, Field(description="The column of the signal, where there is one a channel.")
    ] = None


class Exponents(Answer):
    """Exponents of the settings that vary."""

    exposure_time_s: Quantity | None = None
    f_number: Quantity | None = None
    iso: Quantity | None = None


class LeftOutRow(Answer, restates=LeftOut):
    pass


class ExposureAnswer(Answer, restates=ExponentFit):
    """signal - dark = A t^a N^b S^s: 1, -2 and 1 for a linear sensor behind an ideal lens."""

    exponents: Exponents
    flags: list[FlagRaised]


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


def describe_tools() -> dict[str, dict[str, Any]]:
    """Return the schemas of each calculator, as its page asks and shows."""
    return {
        name: {
            "form": form.model_json_schema(),
            "answer": answer.model_json_schema(),
            "takes_table": form is ExposureTable,
        }
        for name, form, answer in (
            ("motion", NewMotion, MotionAnswer),
            ("coverage", NewCoverage, CoverageAnswer),
            ("exposure", ExposureTable, ExposureAnswer),
        )
    }
