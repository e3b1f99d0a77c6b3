"""A series of exposures: what is typed in, and the exponents that follow from it."""

from typing import Annotated

from pydantic import ConfigDict, Field

from radiometry.tools.exponents import ExponentFit, SeriesRow
from service.schemas.base import Answer, Form, Number, Quantity
from service.schemas.tools.settings import ExposureTime

FNumber = Annotated[Number, Field(ge=0.1, le=1000)]
Iso = Annotated[Number, Field(ge=0.1, le=1e9)]
Signal = Annotated[Number, Field(ge=-1e9, le=1e9)]


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
