"""Effect of a change of a reflectance version on the measurements that were made with it."""

from typing import Any, Literal

from radiometry.findings import InputRejected
from radiometry.fitting.comparison import MeasuredChange
from radiometry.specification.application import BandApplication
from store.applied import read_applied
from store.frame_times import read_header
from store.tables import Calibration, FrameRow, Measurement

PanelCalibration = Literal["common", "separate", "unknown"]

_PANEL = "panel reflectance"


def compare_panels(old: Calibration, new: Calibration) -> tuple[PanelCalibration, dict[str, float]]:
    """Compare the panels of two versions; return the error that they share, relative to K, by band."""
    before, after = _panels(old), _panels(new)
    if not before or not after:
        return "unknown", {}
    if before != after:
        return "separate", {}
    of_old, of_new = _panel_u_rel(old), _panel_u_rel(new)
    return "common", {band: min(of_old[band], of_new[band]) for band in of_old.keys() & of_new.keys()}


def touch_band(
    application: BandApplication,
    measurement: Measurement,
    frame: FrameRow,
    old: Calibration,
    new: Calibration,
) -> MeasuredChange:
    """The change of what was measured, or why there is no figure."""
    if "index" in measurement.parameters:
        return MeasuredChange.untold("An index changes with both of its bands: measure it again.")
    band = str(measurement.result.get("band", ""))
    try:
        change = application.change(
            read_applied(old),
            read_applied(new),
            header=read_header(frame, measurement.parameters.get("time_zone")),
            incidence_angle_deg=measurement.parameters.get("incidence_angle_deg"),
            common_u_rel=compare_panels(old, new)[1].get(band, 0.0),
        )
    except InputRejected as refusal:
        return MeasuredChange.untold(refusal.message)
    return MeasuredChange(change=change, basis="signal", why=None)


def _panels(version: Calibration) -> set[tuple[str, str]]:
    fits = [each["coefficient"] for each in version.result["band_fits"]]
    used = {(each["panel"], day) for each in fits for day in each.get("panel_measured_on", ())}
    # versions from before the days were stored had one measurement
    return used or {(panel["serial"], panel["measured_on"]) for panel in version.inputs.get("panels", [])}


def _panel_u_rel(version: Calibration) -> dict[str, float]:
    return {fit["coefficient"]["band"]: _share_of_panel(fit["budget"]) for fit in version.result["band_fits"]}


def _share_of_panel(budget: list[dict[str, Any]]) -> float:
    return next((float(entry["u_rel"]) for entry in budget if entry["source"] == _PANEL), 0.0)
