"""The meter certificates behind two versions."""

from typing import Literal

from radiometry.methods import get_method
from store.applied import read_applied
from store.tables import Calibration

MeterCalibration = Literal["common", "separate", "unknown"]


def compare_meters(old: Calibration, new: Calibration) -> tuple[MeterCalibration, float]:
    """Compare the certificates of two versions; return the error that they share, relative to K."""
    if {get_method(each.method).reference for each in (old, new)} != {"meter"}:
        return "separate", 0.0
    before, after = _certificates(old), _certificates(new)
    if before is None or after is None:
        return "unknown", 0.0
    coefficients = (*read_applied(old), *read_applied(new))
    if before != after or any(coefficient.model == "semilog" for coefficient in coefficients):
        return "separate", 0.0
    return "common", min(coefficient.meter_calibration_u_rel for coefficient in coefficients)


def _certificates(calibration: Calibration) -> set[tuple[str, ...]] | None:
    """The certificates behind a version's luminance readings; None where one has none."""
    readings = [r for r in calibration.inputs.get("readings", []) if r["quantity"] == "luminance"]
    meters = [m for m in calibration.inputs.get("meters", []) if m["kind"] == "luminance"]
    named = {f"{m['make']} {m['model']} {m['serial']}" for m in meters if "certificate" in m}
    if not readings or not all(reading["meter"] in named for reading in readings):
        return None
    return {(m["make"], m["model"], m["serial"], m["certificate"]["number"]) for m in meters}
