"""A series of exposures from a spreadsheet, under our names or those that people give such tables."""

from collections.abc import Collection

from service.problems import Problem, invalid
from service.schemas.tools.exposure import MOST_ROWS, ExposureRow, ExposureTable, NewExposureSeries
from service.sheets import UNREAD, Kind, read_sheet, refuse_columns

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
