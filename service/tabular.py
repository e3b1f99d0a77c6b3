"""CSV that a spreadsheet opens without running it."""

import csv
import io
from collections.abc import Iterable, Mapping
from typing import Any

FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")


def write_csv(
    rows: Iterable[Mapping[str, Any]], columns: list[str] | None = None, *, head: bool = True
) -> str:
    """Rows under their names; numbers as they are, text that a spreadsheet would run made text.

    A cell holds one thing: of a list stands its number of entries, in a column `<name>_count`, of what has
    members each member in a column of its own, `<name>_<member>`.
    """
    rows = [_flatten(row) for row in rows]
    names = columns or (list(rows[0]) if rows else [])
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\r\n")
    if head:
        writer.writerow(names)
    for row in rows:
        writer.writerow([_cell(row.get(name)) for name in names])
    return out.getvalue()


def _flatten(row: Mapping[str, Any]) -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in row.items():
        if isinstance(value, Mapping):
            flat |= {f"{name}_{member}": each for member, each in _flatten(value).items()}
        elif isinstance(value, list | tuple):
            flat[f"{name}_count"] = len(value)
        else:
            flat[name] = value
    return flat


def _cell(value: Any) -> Any:  # noqa: ANN401
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str) and value.startswith(FORMULA_STARTS):
        return f"'{value}"
    # repr gives a float its shortest exact form
    return repr(value) if isinstance(value, float) else value
