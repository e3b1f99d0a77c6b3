"""The calculators: nothing is stored, the same question always has the same answer."""

from collections.abc import Collection
from functools import partial
from typing import Annotated, Any, TypeVar

from fastapi import Depends, Query, Request, Response
from pydantic import ConfigDict, Field

from radiometry.tools import coverage, exponents, motion
from radiometry.tools.exponents import ExponentFit, LeftOut, SeriesRow
from service.calibrations.schemas import FlagRaised
from service.http import auth, changes, models, operations, tables
from service.http.models import Answer, Form, Number, Quantity, Text
from service.http.problems import wrong

MOST_CASES = 1000

# wider than any camera and any aircraft, narrower than what overflows
PixelPitch = Annotated[Number, models.told("Distance of neighbouring pixels.", ge=0.01, le=1e4)]
FocalLength = Annotated[Number, Field(ge=0.01, le=1e5)]
ExposureTime = Annotated[Number, Field(ge=1e-9, le=86_400)]
Metres = Annotated[Number, Field(ge=1e-3, le=1e7)]


SensorSide = Annotated[Number, Field(ge=1e-3, le=1e4)]


class NewCoverage(Form):
    """One camera above level ground."""

    name: Text | None = models.maybe("Given back, to find it in a rig.")
    height_m: Metres
    tilt_deg: Number = models.told("0 looks straight down.", ge=0, le=coverage.MOST_TILT_DEG)
    azimuth_deg: Number = models.told(
        "Where the tilt points, clockwise from y of the footprint.", default=0.0, ge=-360, le=360
    )
    focal_length_mm: FocalLength
    sensor_width_mm: SensorSide = models.told("Along the rows, which are level.")
    sensor_height_mm: SensorSide = models.told("Along the tilt.")
    pixel_pitch_um: PixelPitch


class FieldOfView(Answer):
    horizontal: float = models.told("Degrees.")
    vertical: float = models.told("Degrees.")


class CoverageAnswer(Answer, restates=coverage.Coverage, without="horizontal_fov_deg vertical_fov_deg"):
    """Ground coverage; what lies above the horizon is left out and named."""

    name: str | None = None
    fov_deg: FieldOfView
    missing: str | None = models.maybe("What is left out, and why.")


class CoveragesAnswer(Answer):
    """A rig's cameras, in its order."""

    items: list[CoverageAnswer]


MOST_ROWS = 10_000

_USUAL = "Of a table's rows that state none."

FNumber = Annotated[Number, Field(ge=0.1, le=1000)]
Iso = Annotated[Number, Field(ge=0.1, le=1e9)]
Signal = Annotated[Number, Field(ge=-1e9, le=1e9)]


class ExposureRow(Form):
    exposure_time_s: ExposureTime
    f_number: FNumber
    iso: Iso
    signal_dn: Signal = models.told("Mean raw number, dark included.")
    dark_dn: Signal | None = models.maybe("Where dark differs by row.")


class NewExposureSeries(Form):
    """Mean signals of one surface in one light, at several settings."""

    rows: Annotated[list[ExposureRow], Field(min_length=1, max_length=MOST_ROWS)]
    dark_dn: Signal = models.told("Of rows that state none; 0 where black is off already.", default=0.0)
    white_level_dn: Annotated[Number, Field(gt=0, le=1e9)]


class ExposureTable(Form):
    """Statements that a table does not contain; with JSON none of them, since they are in the body."""

    white_level_dn: float | None = models.maybe("Needed with a table; of JSON in the body.", gt=0, le=1e9)
    dark_dn: float | None = models.maybe("Of a table's rows without one; else 0.", ge=-1e9, le=1e9)
    exposure_time_s: float | None = models.maybe(_USUAL, ge=1e-9, le=86_400)
    f_number: float | None = models.maybe(_USUAL, ge=0.1, le=1000)
    iso: float | None = models.maybe(_USUAL, ge=0.1, le=1e9)
    signal: Text | None = models.maybe("The column of the signal, where there is one a channel.")


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
    Number, models.told("Of the theoretical motion; twice it for a practical one.", ge=1e-3, le=1e5)
]


def refuse_two_speeds(said: Any) -> None:  # noqa: ANN401  a form with both
    if said.ground_speed_m_s is not None and said.ground_speed_km_h is not None:
        raise ValueError("give ground_speed_m_s or ground_speed_km_h, not both")


class NewMotion(Form):
    """One lens, one exposure, one way of moving. Rates are magnitudes: 0 or more."""

    model_config = ConfigDict(
        json_schema_extra={"not": {"required": ["ground_speed_m_s", "ground_speed_km_h"]}}
    )

    name: Text | None = models.maybe("Given back, to find it in a table.")
    pixel_pitch_um: PixelPitch
    focal_length_mm: FocalLength
    exposure_time_s: ExposureTime
    distance_m: Metres = models.told("Along the line of sight; the height of a nadir camera.")
    rotation_rate_deg_s: Rate | None = models.maybe("About an axis across the line of sight.")
    ground_speed_m_s: Rate | None = models.maybe("Across the line of sight.")
    ground_speed_km_h: Rate | None = models.maybe("In place of ground_speed_m_s, never with it.")
    limit_px: Limit = motion.USUAL_LIMIT_PX

    def check(self) -> None:
        refuse_two_speeds(self)

    def case(self) -> motion.MotionCase:
        said = self.model_dump(exclude={"name", "ground_speed_km_h"})
        if self.ground_speed_km_h is not None:
            said["ground_speed_m_s"] = self.ground_speed_km_h / KM_H_PER_M_S
        return motion.MotionCase(**said)


class MotionAnswer(Answer, restates=motion.Motion):
    """Blur in pixels; what was not asked for is left out. Limits are of the theoretical motion."""

    name: str | None = None
    limit_px: float
    ground_speed_m_s: float | None = models.maybe("As it was understood.")


class MotionsAnswer(Answer):
    """A table's results, in its order."""

    items: list[MotionAnswer]


def describe_tools() -> dict[str, dict[str, Any]]:
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


_SIGNAL = "signal_dn"
_SETTINGS = ("exposure_time_s", "f_number", "iso")
_ALSO = {"exposure_s": "exposure_time_s"}
# of a colour each, as tables of raw means have them: any of them may be the signal, but only one
_CHANNELS = ("r", "g", "g1", "g2", "gr", "gb", "b", "grey")
_FIELDS = frozenset(ExposureRow.model_fields)


def read_series(data: bytes, told: ExposureTable) -> NewExposureSeries:
    if told.white_level_dn is None:
        raise wrong("query.white_level_dn", "is missing: a table does not say it, so say it in the query")
    usual = told.model_dump(include=set(_SETTINGS), exclude_none=True)
    name_fields = partial(_name_fields, wanted=told.signal, usual=usual)
    kind = tables.Kind(numbers=_FIELDS, most=MOST_ROWS, rows_are="rows", usual=usual)
    dark = {} if told.dark_dn is None else {"dark_dn": told.dark_dn}
    rows = tables.read_sheet(data, ExposureRow, kind, name_fields)
    return NewExposureSeries(rows=rows, white_level_dn=told.white_level_dn, **dark)


def refuse_query(told: ExposureTable) -> None:
    """Beside JSON, which says all of it in its body: two values of one thing are one too many."""
    if told.model_fields_set:
        name = next(each for each in ExposureTable.model_fields if each in told.model_fields_set)
        raise wrong(
            f"query.{name}", "goes with a table (Content-Type: text/csv); in JSON it stands in the body"
        )


def _name_fields(columns: list[str], wanted: str | None, usual: Collection[str]) -> list[str]:
    signal = _find_signal(columns, wanted)
    others = {*_CHANNELS, _SIGNAL} - {signal}
    fields = [
        _SIGNAL if name == signal else tables.UNREAD if name in others else _ALSO.get(name, name)
        for name in columns
    ]
    read = [name for name in fields if name != tables.UNREAD]
    if not set(read) <= _FIELDS or len(set(read)) < len(read) or "" in columns:
        message = f"must name columns of {', '.join(ExposureRow.model_fields)}, each at most once"
        raise tables.refuse_columns(message, columns)
    for name in _SETTINGS:
        if name not in fields and name not in usual:
            message = f"lacks {name}; add its column, or say in the query what it was in all rows"
            raise tables.refuse_columns(message, columns)
    return fields


def _find_signal(columns: list[str], wanted: str | None) -> str:
    """The column that holds the signal: the one that is named, else the only one that can."""
    if wanted is not None:
        if wanted.strip().lower() not in columns:
            raise wrong("query.signal", f"there is no such column; there are {', '.join(columns)[:200]}")
        return wanted.strip().lower()
    if _SIGNAL in columns:
        return _SIGNAL
    if not (found := [name for name in columns if name in _CHANNELS]):
        raise tables.refuse_columns(f"lacks {_SIGNAL}", columns)
    if len(found) > 1:
        message = f"holds the signals of {', '.join(found)}; name one in the query, as signal={found[0]}"
        raise tables.refuse_columns(message, columns)
    return found[0]


F = TypeVar("F", bound=models.Form)


def _take_key(_idempotency_key: changes.IdempotencyKey = None) -> None:
    """Every POST takes a key; here nothing is done that could be done twice."""


router = operations.Router(prefix="/v1", tags=["tools"])
stateless = [Depends(_take_key)]


def _take_one_or_many(form: type[F]) -> tables.OneOrMany[F]:
    """Take a table under the names of the fields; a column for what no row says may be left out."""
    known = tuple(form.model_fields)
    numbers = frozenset(known) - {"name"}
    return tables.OneOrMany(
        form, tables.Kind(numbers=numbers, most=MOST_CASES, rows_are="cases", known=known)
    )


async def _read_exposures(request: Request, table: Annotated[ExposureTable, Query()]) -> NewExposureSeries:
    """JSON that says all, or a table and in the query what the table does not say."""
    if not tables.is_table(request):
        refuse_query(table)
    return await tables.read_sheet_or_document(
        request, partial(read_series, told=table), NewExposureSeries.model_validate
    )


def _body_of_series() -> dict[str, Any]:
    schema = NewExposureSeries.model_json_schema()
    # written out where it is used: nothing registers it among the document's components
    schema["properties"]["rows"]["items"] = schema.pop("$defs")["ExposureRow"]
    return tables.state_body(schema)


_MOTIONS, _COVERAGES = _take_one_or_many(NewMotion), _take_one_or_many(NewCoverage)
Motions = Annotated[list[NewMotion] | NewMotion, Depends(_MOTIONS)]
Exposures = Annotated[NewExposureSeries, Depends(_read_exposures)]
Coverages = Annotated[list[NewCoverage] | NewCoverage, Depends(_COVERAGES)]


@router.post(
    "/tools/motion",
    response_model=MotionAnswer | MotionsAnswer,
    dependencies=stateless,
    openapi_extra=_MOTIONS.stated,
)
def compute_image_motion(body: Motions, _caller: auth.Reader) -> Response:
    """Image motion from speed and rotation, theoretical and practical; what is tolerable.

    One object gives one answer, a list or a table gives `items` in its order. Limits are of the theoretical
    motion.
    """
    if isinstance(body, list):
        return MotionsAnswer(items=[_move(form) for form in body]).respond()
    return _move(body).respond()


@router.post(
    "/tools/coverage",
    response_model=CoverageAnswer | CoveragesAnswer,
    dependencies=stateless,
    openapi_extra=_COVERAGES.stated,
)
def compute_ground_coverage(body: Coverages, _caller: auth.Reader) -> Response:
    """Compute what a tilted or nadir camera sees of level ground, and how finely.

    One object gives one answer, a list or a table (the cameras of a rig) gives `items` in its order.
    """
    if isinstance(body, list):
        return CoveragesAnswer(items=[_cover(form) for form in body]).respond()
    return _cover(body).respond()


@router.post(
    "/tools/exposure", response_model=ExposureAnswer, dependencies=stateless, openapi_extra=_body_of_series()
)
def fit_exposure_exponents(body: Exposures, _caller: auth.Reader) -> Response:
    """Exponents of exposure time, f-number and ISO from a table of mean signals.

    The query belongs to a table that is sent as CSV. Rows below 1/256 or above 95 % of the way from dark to
    white are left out, each with its reason.
    """
    rows = [SeriesRow(**row.model_dump()) for row in body.rows]
    fit = exponents.fit_exponents(rows, dark_dn=body.dark_dn, white_level_dn=body.white_level_dn)
    return ExposureAnswer.restate(fit).respond()


def _move(form: NewMotion) -> MotionAnswer:
    return MotionAnswer.restate(motion.compute_motion(form.case()), form.case(), name=form.name)


def _cover(form: NewCoverage) -> CoverageAnswer:
    found, why = coverage.compute_coverage(coverage.View(**form.model_dump(exclude={"name"}))), None
    if found.horizon_in_view:
        why = (
            f"far_m, gsd_far_m, gsd_far_along_m and footprint: the upper edge looks "
            f"{form.tilt_deg + found.vertical_fov_deg / 2:.1f} degrees up from straight down, at the "
            "horizon or above it."
        )
    fov = {"horizontal": found.horizontal_fov_deg, "vertical": found.vertical_fov_deg}
    return CoverageAnswer.restate(found, name=form.name, fov_deg=fov, missing=why)
