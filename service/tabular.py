"""CSV that a spreadsheet opens without running it."""

import csv
import io
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

_STARTS: Final = "=+-@\t\r\n\uff1d\uff0b\uff0d\uff20"
"""What a formula begins with; the last four in East Asian spreadsheets."""
_RUNS: Final = re.compile(rf"(?:^|(?<=[;\t]))(?=[{re.escape(_STARTS)}])")
"""Where a spreadsheet would begin a formula, also one whose separator is another than ours."""
_MONTHS: Final = "jan|feb|mar|mrz|mär|apr|may|mai|jun|jul|aug|sept?|oct|okt|nov|dec|dez"
_NUMBERLIKE: Final = re.compile(
    rf"(?=.*\d)(?:[\d.,:/ eE+%$€£-]|(?<![a-z])(?:{_MONTHS})(?![a-z]))+|true|false", re.IGNORECASE
)
_LOCAL: Final = re.compile(r"(\d{4}-\d\d-\d\d)T(\d\d:\d\d:\d\d)(?:(\.\d{1,3})\d*)?")


def keep_texts(texts: Sequence[str]) -> Sequence[str]:
    """Return texts of which a spreadsheet runs none as a formula."""
    joined = "".join(texts)
    runs = not {text[:1] for text in texts}.isdisjoint(_STARTS) or ";" in joined or "\t" in joined
    return [_RUNS.sub("'", text) for text in texts] if runs else texts


def spell_instant(text: str, decimal: str) -> str:
    """Return a time as spreadsheets read it, to the millisecond; one that names another zone than Z stays."""
    found = _LOCAL.fullmatch(text.removesuffix("Z"))
    return f"{found[1]} {found[2]}{(found[3] or '').replace('.', decimal)}" if found else text


def spell_text(text: str, decimal: str) -> str:
    """Return a text that a spreadsheet leaves one: 0012, which it would count for 12, and MAR1 as ="0012"."""
    if _NUMBERLIKE.fullmatch(text):
        return f'="{text}"'
    return _RUNS.sub("'", text if text.endswith("Z") else spell_instant(text, decimal))


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
    if isinstance(value, str):
        return _RUNS.sub("'", value)
    # repr gives a float its shortest exact form
    return repr(value) if isinstance(value, float) else value
