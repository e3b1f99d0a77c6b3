"""Meter readings from a spreadsheet."""

from service.schemas.campaigns import MOST_READINGS, NewReading
from service.sheets import Kind, read_sheet, refuse_columns

_COLUMNS = ("scene", "quantity", "value", "unit", "meter_id", "taken_at")
_NEEDED = frozenset(_COLUMNS[:4])
_KIND = Kind(numbers=frozenset({"value"}), most=MOST_READINGS, rows_are="readings")


def read_readings(data: bytes) -> list[NewReading]:
    """Readings, one a line, under the names of their columns."""
    return read_sheet(data, NewReading, _KIND, _name_fields)


def _name_fields(columns: list[str]) -> list[str]:
    if not set(columns) >= _NEEDED or not set(columns) <= set(_COLUMNS) or len(set(columns)) < len(columns):
        message = f"must name each of the columns {', '.join(_COLUMNS)} once (the last two may be absent)"
        raise refuse_columns(message, columns)
    return columns
