"""Measurements as flat rows for a spreadsheet, and as features for a map."""

from typing import Any

from radiometry.methods import get_method
from radiometry.specification.application import SurfaceApplication
from service.schemas.base import Quantity
from service.schemas.measured import MeasurementAnswer

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
_PLAIN = ("id", "frame_id", "filename", "taken_at", "latitude_deg", "longitude_deg", "altitude_m")
_PIXELS = ("mean", "min", "max", "median")
PERCENTS = (5, 10, 90, 95)


def _name(figure: str) -> str:
    return f"{figure}_{_FIGURES[figure]}" if _FIGURES[figure] else figure


def _name_of_band(answer: MeasurementAnswer, figure: str) -> str:
    return "index_value" if answer.index is not None else f"{figure}_reflectance"


COLUMNS = [
    *_PLAIN,
    *("calibration_id", "calibration_version", "calibration_state", "region_origin", "pixels", "frames"),
    *(f"{_name(figure)}{suffix}" for figure in _FIGURES for suffix in ("", "_standard_uncertainty")),
    *(f"p{percent}_cd_m2" for percent in PERCENTS),
    *(f"{figure}_reflectance{suffix}" for figure in _PIXELS for suffix in ("", "_standard_uncertainty")),
    *(f"p{percent}_reflectance" for percent in PERCENTS),
    *("index", "index_value", "index_value_standard_uncertainty"),
    *(
        "below_zero_share",
        "above_one_share",
        "saturated_share",
        "vignetting",
        "signal",
        "flags",
        "created_at",
    ),
]

_TEXTS = (
    *("id", "frame_id", "filename", "taken_at", "calibration_id", "calibration_state", "region_origin"),
    *("index", "vignetting", "signal", "flags", "created_at"),
)
KINDS: dict[str, type] = dict.fromkeys(_TEXTS, str) | {
    "calibration_version": int,
    "pixels": int,
    "frames": int,
}
"""Types of the columns that are not numbers with a fraction."""


def flatten(answer: MeasurementAnswer) -> dict[str, Any]:
    """One row; what the measurement does not have is left out."""
    row: dict[str, Any] = {name: getattr(answer, name) for name in _PLAIN}
    row |= {
        "calibration_id": answer.calibration.id,
        "calibration_version": answer.calibration.version,
        "calibration_state": answer.calibration.state,
        "region_origin": answer.region_origin,
        "pixels": answer.pixels,
        "frames": len(answer.frame_ids or [answer.frame_id]),
    }
    surface = isinstance(get_method(answer.method).application, SurfaceApplication)
    for figure in _FIGURES:
        quantity: Quantity | None = getattr(answer, figure)
        if quantity is not None:
            name = _name(figure) if surface else _name_of_band(answer, figure)
            row[name] = quantity.value
            row[f"{name}_standard_uncertainty"] = quantity.standard_uncertainty
    for entry in answer.percentiles:
        if entry.luminance is not None:
            row[f"p{entry.percent}_cd_m2"] = entry.luminance.value
        if entry.reflectance is not None:
            row[f"p{entry.percent}_reflectance"] = entry.reflectance.value
    if answer.index is not None:
        row["index"] = answer.index.name
    if answer.reflected is not None:
        row["below_zero_share"] = answer.reflected.below_zero_share
        row["above_one_share"] = answer.reflected.above_one_share
    row |= {
        "saturated_share": answer.saturated_share,
        "vignetting": answer.vignetting,
        "signal": answer.signal,
        "flags": " ".join(dict.fromkeys(raised.flag for raised in answer.flags)),
        "created_at": answer.dump()["created_at"],
    }
    return {name: value for name, value in row.items() if value is not None}


def make_feature(answer: MeasurementAnswer) -> dict[str, Any]:
    """A feature of RFC 7946: longitude first, and no geometry where the file names no place."""
    geometry = None
    if answer.latitude_deg is not None and answer.longitude_deg is not None:
        place = [answer.longitude_deg, answer.latitude_deg]
        if answer.altitude_m is not None:
            place.append(answer.altitude_m)
        geometry = {"type": "Point", "coordinates": place}
    return {"type": "Feature", "id": answer.id, "geometry": geometry, "properties": flatten(answer)}
