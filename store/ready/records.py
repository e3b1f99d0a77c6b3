"""Rows of a series as they are kept: CSV records, in which what one reader may take otherwise is quoted."""

import csv
import re
from collections.abc import Iterable, Sequence
from typing import Final

Value = str | float | int | None

_PLAIN: Final = re.compile(r"(?:[\w%°(][\w%°(). :/*+-]*)?")
"""Texts that every reader takes as they are: CSV and JSON, and a spreadsheet for no formula."""


def write_record(values: Iterable[Value]) -> str:
    """Write a CSV record without its line end; an absent value is an empty cell."""
    return ",".join(map(_write, values))


def is_plain(records: str) -> bool:
    """Return True if no cell is quoted: each comma ends one, and each text is one that all readers take."""
    return '"' not in records


def split_records(records: Sequence[str]) -> list[Sequence[str]]:
    """Split records into columns of cells."""
    joined = ",".join(records)
    if not is_plain(joined):
        return list(zip(*csv.reader(records), strict=True))
    # one list of all cells: a list for each record would be collected as garbage time and again
    cells, width = joined.split(","), records[0].count(",") + 1
    return [cells[place::width] for place in range(width)]


def read_records(lines: str) -> list[str]:
    """Return the records of a text that has one a line; a quoted cell may have lines of its own."""
    if is_plain(lines):
        return lines.split("\n") if lines else []
    records: list[str] = []
    for line in lines.split("\n"):
        if records and records[-1].count('"') % 2:
            records[-1] += f"\n{line}"
        else:
            records.append(line)
    return records


def _write(value: Value) -> str:
    if value is None:
        return ""
    if not isinstance(value, str):
        # repr gives a float its shortest exact form
        return repr(value)
    return value if _PLAIN.fullmatch(value) else '"' + value.replace('"', '""') + '"'
