"""The row of a measurement in a series, and its columns."""

from collections.abc import Iterator, Mapping
from typing import Any

from radiometry.methods import get_method
from radiometry.specification.application import PictureApplication, SurfaceApplication
from store.frame_times import Zones, read_frame_time
from store.ready.publications import write_instant
from store.ready.records import Value, write_record
from store.tables import Calibration, Camera, FrameRow, Measurement

_FIGURES = {
    "mean": "cd_m2",
    "min": "cd_m2",
    "max": "cd_m2",
    "median": "cd_m2",
    "illuminance": "lx",
    "l_av_cd_m2": "",
    "l_min_cd_m2": "",
    "l_max_cd_m2": "",
    "u_o": "",
    "average_to_min": "",
    "max_to_min": "",
    "grid_illuminance": "lx",
}
_STORED = {"min": "smallest", "max": "largest", "illuminance": "illuminance_lx"}
"""Names in a result that differ from those of the answer."""
_PLACE = ("taken_at", "latitude_deg", "longitude_deg", "altitude_m")
_PIXELS = ("mean", "min", "max", "median")
_SHARES = ("below_zero_share", "above_one_share")
_LIGHT = ("i_ss", "i_ss_oriented", "i_ss_basis")
_PERCENTS = (5, 10, 90, 95)
_BODY = ("make", "model_name", "serial")


def _with_u(*names: str) -> Iterator[str]:
    return (f"{name}{suffix}" for name in names for suffix in ("", "_standard_uncertainty"))


_NAMES = {figure: f"{figure}_{unit}" if unit else figure for figure, unit in _FIGURES.items()}
COLUMNS = (
    *("id", "frame_id", "filename", *_PLACE),
    *("calibration_id", "calibration_version", "calibration_state", "region_origin", "pixels", "frames"),
    *_with_u(*_NAMES.values()),
    *(f"p{percent}_cd_m2" for percent in _PERCENTS),
    *_with_u(*(f"{figure}_reflectance" for figure in _PIXELS)),
    *(f"p{percent}_reflectance" for percent in _PERCENTS),
    *("index", *_with_u("index_value"), *_SHARES, "saturated_share", "vignetting", "signal"),
    *("flags", "created_at", "camera_id", *_BODY, "campaign_id", "method"),
    *_LIGHT,
)
KINDS: dict[str, type] = dict.fromkeys(
    (
        *("id", "frame_id", "filename", "taken_at", "calibration_id", "calibration_state", "region_origin"),
        *("index", "i_ss_basis", "vignetting", "signal", "flags", "created_at"),
        *("camera_id", *_BODY, "campaign_id", "method"),
    ),
    str,
) | dict.fromkeys(("calibration_version", "pixels", "frames"), int)
"""Types of the columns that are not numbers with a fraction."""
STATE, FLAGS = COLUMNS.index("calibration_state"), COLUMNS.index("flags")
"""Columns that decisions change: the state is empty in a stored row, and the flags lack those of it."""
BODY = slice(COLUMNS.index(_BODY[0]), COLUMNS.index(_BODY[-1]) + 1)
"""Columns of the camera's names, which may be corrected: a stored row has them as they were."""


def make_measured(
    row: Measurement, frame: FrameRow, calibration: Calibration, camera: Camera
) -> dict[str, Any]:
    """Return the columns of a measurement's row."""
    spec = get_method(row.method)
    taken = read_frame_time(frame, Zones(campaign=row.parameters.get("time_zone")))
    named = row.parameters.get(spec.corrected_by) if spec.corrected_by else None
    cells = _describe(row, frame, calibration, camera)
    return {
        "measurement_id": row.id,
        "organisation_id": row.organisation_id,
        "camera_id": camera.id,
        "campaign_id": row.campaign_id,
        "calibration_id": row.calibration_id,
        "corrector_id": named["calibration_id"] if named else None,
        "taken_from": taken.earliest if taken else row.created_at,
        "taken_to": taken.latest if taken else None,
        "created_at": row.created_at,
        "cells": write_record(_take(name, cells.get(name)) for name in COLUMNS),
    }


def _describe(row: Measurement, frame: FrameRow, calibration: Calibration, camera: Camera) -> dict[str, Any]:
    result, header = row.result, frame.header or {}
    cells: dict[str, Any] = {
        "id": row.id,
        "frame_id": row.frame_id,
        "filename": frame.filename,
        **{name: header.get(name) for name in _PLACE},
        "calibration_id": calibration.id,
        "calibration_version": calibration.version,
        "region_origin": row.parameters["region_origin"],
        "pixels": result.get("pixels"),
        "frames": 1 + len(row.parameters.get("repeats", ())),
        "saturated_share": result.get("saturated_share"),
        "flags": " ".join(
            dict.fromkeys((*_flags_of(result["flags"]), *_flags_of(list_passed(calibration, frame))))
        ),
        "created_at": write_instant(row.created_at),
        "camera_id": camera.id,
        "make": camera.make,
        "model_name": camera.model,
        "serial": camera.serial,
        "campaign_id": row.campaign_id,
        "method": row.method,
        "vignetting": result.get("vignetting", "file"),
    }
    application = get_method(row.method).application
    if isinstance(application, PictureApplication):
        return cells | {"vignetting": "none", "signal": "".join(result["undistorted"]["planes"])}
    if isinstance(application, SurfaceApplication):
        surface = result["surface"] or {}
        found = {name: result.get(_STORED.get(name, name), surface.get(name)) for name in _FIGURES}
        found["grid_illuminance"] = surface.get("illuminance_lx")
        names, unit = _NAMES, "luminance"
        cells |= {"signal": result["channel"]}
    elif "index" in result:
        found, names, unit = {"mean": result["value"]}, {"mean": "index_value"}, ""
        cells |= {"signal": result["index"], "index": result["index"]}
    elif "radiance" in result:
        # stored rows have no column for it
        return cells | {"signal": f"radiance {result['radiance']}"}
    else:
        found = {name: result[_STORED.get(name, name)] for name in _PIXELS}
        names, unit = {name: f"{name}_reflectance" for name in _PIXELS}, "reflectance"
        cells |= {"signal": result["band"], **{name: result.get(name) for name in (*_SHARES, *_LIGHT)}}
    for figure, quantity in found.items():
        if quantity is not None:
            cells[names[figure]] = quantity["value"]
            cells[f"{names[figure]}_standard_uncertainty"] = quantity["standard_uncertainty"]
    suffix = "cd_m2" if unit == "luminance" else unit
    for entry in result.get("percentiles", ()):
        if entry.get(unit):
            cells[f"p{entry['percent']}_{suffix}"] = entry[unit]["value"]
    return cells


def _flags_of(raised: list[dict[str, Any]]) -> list[str]:
    return [each["flag"] for each in raised]


def list_passed(calibration: Calibration, frame: FrameRow) -> list[dict[str, Any]]:
    """Return those flags with their place and detail."""
    iso = (frame.exposure or {}).get("iso")
    places = {"", *([f"iso {iso:g}"] if iso else [])}
    passed_on = get_method(calibration.method).passed_on
    return [
        raised
        for raised in calibration.result["flags"]
        if raised["where"] in places and raised["flag"] in passed_on
    ]


def _take(name: str, value: Any) -> Value:  # noqa: ANN401  of the column's kind
    kind: type[str | int | float] = KINDS.get(name, float)
    return None if value is None else kind(value)


def read_row(cells: Mapping[str, str]) -> dict[str, Any]:
    """Return the cells of a row with their types; empty ones are left out."""
    return {name: KINDS.get(name, float)(text) for name, text in cells.items() if text or name == "flags"}
