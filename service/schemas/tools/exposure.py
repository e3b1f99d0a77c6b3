"""A series of exposures: what is typed in, and the exponents that follow from it."""

from typing import Annotated

from pydantic import Field

from radiometry.tools.exponents import ExponentFit, LeftOut, SeriesRow
from service.schemas.base import Answer, Form, Number, Quantity, Text
from service.schemas.fleet import FlagRaised
from service.schemas.tools.settings import EXPOSURE_TIMES_S, ExposureTime

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
