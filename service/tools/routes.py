"""The calculators: nothing is stored, the same question always has the same answer."""

from collections.abc import Callable, Collection, Coroutine
from functools import partial
from typing import Annotated, Any, TypeVar

from fastapi import Depends, Query, Request, Response
from pydantic import Field, TypeAdapter

from radiometry.tools import coverage, exponents, motion
from service.http import answers, auth, changes, models, operations
from service.http.problems import Problem, invalid
from service.http.tables import UNREAD, Kind, is_table, read_sheet, read_sheet_or_document, refuse_columns
from service.tools.schemas import (
    MOST_CASES,
    MOST_ROWS,
    CoverageAnswer,
    CoveragesAnswer,
    ExposureAnswer,
    ExposureRow,
    ExposureTable,
    MotionAnswer,
    MotionsAnswer,
    NewCoverage,
    NewExposureSeries,
    NewMotion,
)

_SIGNAL = "signal_dn"
_SETTINGS = ("exposure_time_s", "f_number", "iso")
_ALSO = {"exposure_s": "exposure_time_s"}
# of a colour each, as tables of raw means have them: any of them may be the signal, but only one
_CHANNELS = ("r", "g", "g1", "g2", "gr", "gb", "b", "grey")
_FIELDS = frozenset(ExposureRow.model_fields)


def read_series(data: bytes, told: ExposureTable) -> NewExposureSeries:
    """The rows of a table; ``told`` : what the request says of all of them."""
    if told.white_level_dn is None:
        raise _wrong("white_level_dn", "is missing: a table does not say it, so say it in the query")
    usual = told.model_dump(include=set(_SETTINGS), exclude_none=True)

    def name_fields(columns: list[str]) -> list[str]:
        return _name_fields(columns, told.signal, usual)

    kind = Kind(numbers=_FIELDS, most=MOST_ROWS, rows_are="rows", usual=usual)
    dark = {} if told.dark_dn is None else {"dark_dn": told.dark_dn}
    rows = read_sheet(data, ExposureRow, kind, name_fields)
    return NewExposureSeries(rows=rows, white_level_dn=told.white_level_dn, **dark)


def refuse_query(told: ExposureTable) -> None:
    """Beside JSON, which says all of it in its body: two values of one thing are one too many."""
    if told.model_fields_set:
        name = next(each for each in ExposureTable.model_fields if each in told.model_fields_set)
        raise _wrong(name, "goes with a table (Content-Type: text/csv); in JSON it stands in the body")


def _name_fields(columns: list[str], wanted: str | None, usual: Collection[str]) -> list[str]:
    signal = _find_signal(columns, wanted)
    others = {*_CHANNELS, _SIGNAL} - {signal}
    fields = [
        _SIGNAL if name == signal else UNREAD if name in others else _ALSO.get(name, name) for name in columns
    ]
    read = [name for name in fields if name != UNREAD]
    if not set(read) <= _FIELDS or len(set(read)) < len(read) or "" in columns:
        message = f"must name columns of {', '.join(ExposureRow.model_fields)}, each at most once"
        raise refuse_columns(message, columns)
    for name in _SETTINGS:
        if name not in fields and name not in usual:
            message = f"lacks {name}; add its column, or say in the query what it was in all rows"
            raise refuse_columns(message, columns)
    return fields


def _find_signal(columns: list[str], wanted: str | None) -> str:
    """The column that holds the signal: the one that is named, else the only one that can."""
    if wanted is not None:
        if wanted.strip().lower() not in columns:
            raise _wrong("signal", f"there is no such column; there are {', '.join(columns)[:200]}")
        return wanted.strip().lower()
    if _SIGNAL in columns:
        return _SIGNAL
    found = [name for name in columns if name in _CHANNELS]
    if not found:
        raise refuse_columns(f"lacks {_SIGNAL}", columns)
    if len(found) > 1:
        message = f"holds the signals of {', '.join(found)}; name one in the query, as signal={found[0]}"
        raise refuse_columns(message, columns)
    return found[0]


def _wrong(name: str, message: str) -> Problem:
    return invalid([{"type": "table", "loc": ("query", name), "msg": message}])


F = TypeVar("F", bound=models.Form)


def _take_key(_idempotency_key: changes.IdempotencyKey = None) -> None:
    """Every POST takes a key; here nothing is done that could be done twice."""


router = operations.Router(prefix="/v1", tags=["tools"])
stateless = [Depends(_take_key)]


def _read_one_or_many(form: type[F]) -> Callable[[Request], Coroutine[Any, Any, list[F] | F]]:
    """A body that is one object, a list of them or a table; each bad field is named with its place."""
    one: TypeAdapter[F] = TypeAdapter(form)
    many: TypeAdapter[list[F]] = TypeAdapter(
        Annotated[list[form], Field(min_length=1, max_length=MOST_CASES)]  # type: ignore[arg-type, valid-type]
    )

    async def read(request: Request) -> list[F] | F:
        return await read_sheet_or_document(
            request,
            partial(_read_table, form=form),
            lambda data: (many if isinstance(data, list) else one).validate_python(data),
        )

    return read


def _read_table(data: bytes, form: type[F]) -> list[F]:
    """Under the names of the fields; a column for what no row says may be left out."""

    def name_fields(columns: list[str]) -> list[str]:
        if not set(columns) <= form.model_fields.keys() or len(set(columns)) < len(columns):
            message = f"must name columns of {', '.join(form.model_fields)}, each at most once"
            raise refuse_columns(message, columns)
        return columns

    numbers = frozenset(form.model_fields) - {"name"}
    return read_sheet(data, form, Kind(numbers=numbers, most=MOST_CASES, rows_are="cases"), name_fields)


def _body_of(form: type[models.Form]) -> dict[str, Any]:
    schema = form.model_json_schema()
    several = {"type": "array", "items": schema, "minItems": 1, "maxItems": MOST_CASES}
    content = {
        "application/json": {"schema": {"oneOf": [schema, several]}},
        "text/csv": {"schema": {"type": "string"}},
    }
    return {"requestBody": {"required": True, "content": content}}


async def _read_exposures(request: Request, table: Annotated[ExposureTable, Query()]) -> NewExposureSeries:
    """JSON that says all, or a table and in the query what the table does not say."""
    if not is_table(request):
        refuse_query(table)
    return await read_sheet_or_document(
        request, partial(read_series, told=table), NewExposureSeries.model_validate
    )


def _body_of_series() -> dict[str, Any]:
    schema = NewExposureSeries.model_json_schema()
    # written out where it is used: nothing registers it among the document's components
    schema["properties"]["rows"]["items"] = schema.pop("$defs")["ExposureRow"]
    content = {"application/json": {"schema": schema}, "text/csv": {"schema": {"type": "string"}}}
    return {"requestBody": {"required": True, "content": content}}


Motions = Annotated[list[NewMotion] | NewMotion, Depends(_read_one_or_many(NewMotion))]
Exposures = Annotated[NewExposureSeries, Depends(_read_exposures)]
Coverages = Annotated[list[NewCoverage] | NewCoverage, Depends(_read_one_or_many(NewCoverage))]


@router.post(
    "/tools/motion",
    response_model=MotionAnswer | MotionsAnswer,
    responses=answers.problems(),
    dependencies=stateless,
    openapi_extra=_body_of(NewMotion),
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
    responses=answers.problems(),
    dependencies=stateless,
    openapi_extra=_body_of(NewCoverage),
)
def compute_ground_coverage(body: Coverages, _caller: auth.Reader) -> Response:
    """Compute what a tilted or nadir camera sees of level ground, and how finely.

    One object gives one answer, a list or a table (the cameras of a rig) gives `items` in its order.
    """
    if isinstance(body, list):
        return CoveragesAnswer(items=[_cover(form) for form in body]).respond()
    return _cover(body).respond()


@router.post(
    "/tools/exposure",
    response_model=ExposureAnswer,
    responses=answers.problems(),
    dependencies=stateless,
    openapi_extra=_body_of_series(),
)
def fit_exposure_exponents(body: Exposures, _caller: auth.Reader) -> Response:
    """Exponents of exposure time, f-number and ISO from a table of mean signals.

    The query belongs to a table that is sent as CSV. Rows below 1/256 or above 95 % of the way from dark to
    white are left out, each with its reason.
    """
    fit = exponents.fit_exponents(body.series(), dark_dn=body.dark_dn, white_level_dn=body.white_level_dn)
    return ExposureAnswer.restate(fit).respond()


def _move(form: NewMotion) -> MotionAnswer:
    return MotionAnswer.of(form, motion.compute_motion(form.case()))


def _cover(form: NewCoverage) -> CoverageAnswer:
    return CoverageAnswer.of(form, coverage.compute_coverage(form.view()))
