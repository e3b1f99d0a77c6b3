"""Meter readings from a spreadsheet: the three ways in which spreadsheets write CSV."""

import csv
import io
import re
from contextlib import suppress
from typing import Any

from pydantic import ValidationError

from service.problems import HttpCode, Problem, invalid, located
from service.schemas.campaigns import MOST_READINGS, NewReading

_COLUMNS = ("scene", "quantity", "value", "unit", "meter_id", "taken_at")
_NEEDED = frozenset(_COLUMNS[:4])
_GROUPED = re.compile(r"\d{1,3}(,\d{3})+")


def read_readings(data: bytes) -> list[NewReading]:
    """Comma, or semicolon or tab with a decimal comma; each bad row is named with its line."""
    try:
        text = data.decode("utf-8-sig")
        # the separator is the one of the first line; a lone CR ends a line too
        separator = max(",;\t", key=text.splitlines()[0].count) if text.strip() else ","
        reader = csv.DictReader(io.StringIO(text, newline=None), delimiter=separator)
        columns = _read_columns(reader)
        reader.fieldnames = columns
        return _read_rows(reader, separator)
    except UnicodeDecodeError as error:
        raise Problem(400, HttpCode.BAD_REQUEST, "The CSV is not UTF-8. Save it as CSV UTF-8.") from error
    except csv.Error as error:
        raise Problem(400, HttpCode.BAD_REQUEST, f"The CSV cannot be read: {error}.") from error


def _read_columns(reader: "csv.DictReader[str]") -> list[str]:
    columns = [name.strip().lower() for name in reader.fieldnames or []]
    if not set(columns) >= _NEEDED or not set(columns) <= set(_COLUMNS) or len(set(columns)) < len(columns):
        message = (
            f"must name each of the columns {', '.join(_COLUMNS)} once (the last two may be absent); "
            f"it names {', '.join(map(repr, columns))[:200] or 'nothing'}"
        )
        raise invalid([{"type": "csv", "loc": ("line 1",), "msg": message}])
    return columns


def _read_rows(reader: "csv.DictReader[str]", separator: str) -> list[NewReading]:
    forms: list[NewReading] = []
    errors: list[dict[str, Any]] = []
    for row in reader:
        line = f"line {reader.line_num}"
        if None in row:
            message = "has more cells than line 1 names; a decimal comma needs semicolons between the cells"
            errors.append({"type": "csv", "loc": (line,), "msg": message})
            continue
        cells: dict[str, Any] = {name: cell.strip() for name, cell in row.items() if cell and cell.strip()}
        if "value" in cells:
            cells["value"] = _read_number(cells["value"], separator)
        try:
            forms.append(NewReading.model_validate(cells))
        except ValidationError as error:
            errors += located(error, line)
    if not 0 < len(forms) + len(errors) <= MOST_READINGS:
        message = f"must hold 1 to {MOST_READINGS} readings below its first line"
        errors = [{"type": "csv", "loc": ("csv",), "msg": message}]
    if errors:
        raise invalid(errors)
    return forms


def _read_number(text: str, separator: str) -> float | str:
    """The number, or the text as it is for the form to refuse."""
    # after tabs 1,234 may be a thousand and more, or one and a bit: nobody can tell
    if separator == ";" or (separator == "\t" and not _GROUPED.fullmatch(text)):
        text = text.replace(",", ".")
    with suppress(ValueError):
        return float(text)
    return text
