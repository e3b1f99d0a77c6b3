"""A table of frame statistics, under our names or those of ImageJ's Results window."""

import re
from typing import Final

from service.problems import invalid
from service.schemas.points import MOST_POINTS, NewPoint, PointsTable
from service.sheets import UNREAD, Kind, read_sheet, refuse_columns

_FIELDS: Final = frozenset(NewPoint.model_fields)
_ALSO: Final = {
    "label": "filename",
    "file": "filename",
    "exposure_time": "exposure_time_s",
    "exposure_s": "exposure_time_s",
    "shutter_speed_s": "exposure_time_s",
    "aperture": "f_number",
    "fnumber": "f_number",
    "iso_value": "iso",
    "mean": "mean_dn",
    "min": "min_dn",
    "max": "max_dn",
    "stddev": "std_dn",
    "std": "std_dn",
    "area": "pixels",
    "n": "pixels",
}
_NUMBERS: Final = _FIELDS - {"filename", "scene", "dark"}
_USUAL: Final = ("exposure_time_s", "f_number", "iso")
_NEEDED: Final = ("filename", *_USUAL, "mean_dn", "min_dn", "max_dn", "pixels")


def read_points(data: bytes, told: PointsTable) -> tuple[list[NewPoint], list[str]]:
    """Return the rows of a table, and its columns that were not read."""
    usual = told.model_dump(include=set(_USUAL), exclude_none=True)
    ignored: list[str] = []

    def name_fields(columns: list[str]) -> list[str]:
        plain = [re.sub(r"[^a-z0-9]+", "_", name).strip("_") for name in columns]
        fields = [_ALSO.get(name, name) for name in plain]
        for name in _NEEDED:
            if name not in fields and name not in usual:
                raise refuse_columns(f"lacks a column {name}", columns)
        if "scene" not in fields and "dark" not in fields:
            raise refuse_columns("lacks a column scene", columns)
        read = [name for name in fields if name in _FIELDS]
        if len(set(read)) < len(read):
            raise refuse_columns("names a column twice", columns)
        ignored.extend(name for name, field in zip(columns, fields, strict=True) if field not in _FIELDS)
        return [name if name in _FIELDS else UNREAD for name in fields]

    kind = Kind(numbers=_NUMBERS, most=MOST_POINTS, rows_are="points", usual=usual)
    points = read_sheet(data, NewPoint, kind, name_fields)
    _refuse_rows(points, told)
    return points, [name for name in ignored if name]


def _refuse_rows(points: list[NewPoint], told: PointsTable) -> None:
    """Refuse what only the whole table shows: names given twice, and levels above the white level."""
    seen: dict[str, int] = {}
    errors = []
    for line, point in enumerate(points, start=2):
        first = seen.setdefault(point.filename, line)
        if first != line:
            message = f"names {point.filename!r} as line {first} does; each frame is one row"
            errors.append({"type": "csv", "loc": (f"line {line}", "filename"), "msg": message})
        if point.max_dn > told.white_level_dn:
            message = f"is above white_level_dn {told.white_level_dn:g}"
            errors.append({"type": "csv", "loc": (f"line {line}", "max_dn"), "msg": message})
    if errors:
        raise invalid(errors)
    if told.black_level_dn is not None and told.black_level_dn >= told.white_level_dn:
        message = "is not below white_level_dn"
        raise invalid([{"type": "value", "loc": ("query", "black_level_dn"), "msg": message}])
