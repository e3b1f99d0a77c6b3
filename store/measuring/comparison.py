"""Two measurements, or the references of two versions, and which errors are the same in both."""

import math
from functools import cached_property
from itertools import chain
from typing import Any, Final, Literal

from radiometry.findings import InputRejected, interface
from radiometry.fitting import comparison
from radiometry.methods import get_method
from radiometry.records import Record
from radiometry.specification.application import BandApplication, Summary, SurfaceApplication
from radiometry.spectral import mismatch
from store import codec, database
from store.queries.frame_times import read_header
from store.tables import Calibration, FrameRow, Measurement

Reference = Literal["common", "separate", "unknown"]
"""Whether the error of what two versions depend on, meters or panel, is the same in both."""


def compare_meters(old: Calibration, new: Calibration) -> tuple[Reference, float]:
    """Compare the certificates of two versions; return the error that they share, relative to K."""
    if {get_method(each.method).reference for each in (old, new)} != {"meter"}:
        return "separate", 0.0
    before, after = _certificates(old), _certificates(new)
    if before is None or after is None:
        return "unknown", 0.0
    coefficients = (*codec.read_applied(old), *codec.read_applied(new))
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


def compare_panels(old: Calibration, new: Calibration) -> tuple[Reference, dict[str, float]]:
    """Compare the panels of two versions; return the error that they share, relative to K, by band."""
    before, after = _panels(old), _panels(new)
    if not before or not after:
        return "unknown", {}
    if before != after:
        return "separate", {}
    of_old, of_new = _panel_u_rel(old), _panel_u_rel(new)
    return "common", {band: min(of_old[band], of_new[band]) for band in of_old.keys() & of_new.keys()}


def touch_band(
    application: BandApplication, measured: Measurement, frame: FrameRow, old: Calibration, new: Calibration
) -> comparison.MeasuredChange:
    if "index" in measured.parameters:
        return comparison.MeasuredChange.untold("An index changes with both of its bands: measure it again.")
    band = str(measured.result.get("band", ""))
    try:
        change = application.change(
            codec.read_applied(old),
            codec.read_applied(new),
            header=read_header(frame, measured.parameters.get("time_zone")),
            incidence_angle_deg=measured.parameters.get("incidence_angle_deg"),
            common_u_rel=compare_panels(old, new)[1].get(band, 0.0),
        )
    except InputRejected as refusal:
        return comparison.MeasuredChange.untold(refusal.message)
    return comparison.MeasuredChange(change=change, basis="signal", why=None)


def _panels(version: Calibration) -> set[tuple[str, str]]:
    fits = [each["coefficient"] for each in version.result["band_fits"]]
    used = {(each["panel"], day) for each in fits for day in each.get("panel_measured_on", ())}
    # versions from before the days were stored had one measurement
    return used or {(panel["serial"], panel["measured_on"]) for panel in version.inputs.get("panels", [])}


def _panel_u_rel(version: Calibration) -> dict[str, float]:
    found = dict.fromkeys((fit["coefficient"]["band"] for fit in version.result["band_fits"]), 0.0)
    lines = (
        (fit["coefficient"]["band"], line) for fit in version.result["band_fits"] for line in fit["budget"]
    )
    return found | {band: line["u_rel"] for band, line in lines if line["source"] == "panel reflectance"}


SURE: Final = 2.0  # standard uncertainties of a difference from which on it is significant


class Side(Record):
    measurement: Measurement
    frame: FrameRow
    calibration: Calibration

    @property
    def result(self) -> dict[str, Any]:
        return self.measurement.result

    @cached_property
    def summary(self) -> Summary:
        return get_method(self.measurement.method).summarise(self.result)

    @property
    def mean(self) -> dict[str, Any]:
        return dict(self.summary.figures["mean"])

    @property
    def region(self) -> list[list[float]]:
        return list(self.measurement.parameters["polygon"])

    @property
    def region_origin(self) -> str:
        return str(self.measurement.parameters["region_origin"])

    @property
    def cells(self) -> list[list[dict[str, Any]]] | None:
        surface = self.result.get("surface")
        return surface["cells"] if surface else None


class MeasurementComparison(Record):
    mean: comparison.Comparison
    common: tuple[str, ...]
    same_region: bool
    cells: tuple[tuple[comparison.Comparison, ...], ...] | None
    confusion_rel: float | None = None

    @property
    def is_significant(self) -> bool:
        """True for two standard uncertainties of the difference, and more than the lamps can confuse."""
        sigmas, change = self.mean.in_standard_uncertainties, self.mean.change
        if sigmas is None or sigmas < SURE:
            return False
        return self.confusion_rel is None or change is None or abs(change.value) > 100.0 * self.confusion_rel


def compare_measurements(
    old: Side, new: Side, *, other_region: bool = False, same_light: bool = False
) -> MeasurementComparison:
    same_region = _outline(old) == _outline(new)
    if not (same_region or other_region):
        raise database.Conflict(
            interface.REGIONS_DIFFER,
            f"{_format_region(old)}; {_format_region(new)}: the two outlines differ, so that a change may be "
            "one of the place and not of the light. Measure both with one roi or one grid. To compare them "
            "nevertheless, ask with other_region=true.",
        )
    common = find_common(old, new) | _find_common_conditions(old, new, same_light=same_light)
    before, after = _budget(old), _budget(new)
    fell = after.value < before.value
    return MeasurementComparison(
        mean=comparison.compare_measured(before, after, common=common),
        common=tuple(sorted(common)),
        same_region=same_region,
        cells=_compare_cells(old, new, before, after, common),
        confusion_rel=_find_confusion(old, new, fell=fell) if mismatch.SOURCE not in common else None,
    )


def _outline(side: Side) -> tuple[Any, ...]:
    """Return what was measured in the image: its size, the region, and the cells if there are any."""
    header = side.frame.header or {}
    grid = side.measurement.parameters.get("grid")
    return header.get("width_px"), header.get("height_px"), side.region, grid and grid["corners"]


def _format_region(side: Side) -> str:
    xs, ys = zip(*side.region, strict=True)
    box = f"x {min(xs):g} to {max(xs):g}, y {min(ys):g} to {max(ys):g} px"
    return f"{side.frame.filename}: {box}, from the {side.region_origin.replace('_', ' ')}"


def _is_lit(side: Side) -> bool:
    return isinstance(get_method(side.measurement.method).application, SurfaceApplication)


def _find_common_conditions(old: Side, new: Side, *, same_light: bool) -> set[str]:
    """Errors of spectrum, glare and distance that are the same in both, as far as K is."""
    if not _is_lit(old) or old.calibration.id != new.calibration.id:
        return set()
    before, after = (side.measurement.parameters.get("conditions", {}) for side in (old, new))
    light = before.get("light_source")
    same = same_light or (light is not None and light == after.get("light_source"))
    common = {mismatch.SOURCE} if same else set()
    # of one scene under the same lamps a lens scatters the same share of the frame's mean
    common |= {comparison.STRAY} if same_light and _outline(old) == _outline(new) else set()
    # an unknown distance of the calibration is the larger part, and the same in both
    return common | ({comparison.FOCUS} if before.get("distance_m") == after.get("distance_m") else set())


def _find_confusion(old: Side, new: Side, *, fell: bool) -> float | None:
    """Return what two types of lamp could show, unless the spectrum of both is known."""
    if not _is_lit(old):
        return None
    assumed = [
        "conditions" not in side.measurement.parameters
        or any(raised["flag"] == mismatch.SPECTRAL_MISMATCH_UNKNOWN for raised in side.result["flags"])
        for side in (old, new)
    ]
    confusion = mismatch.find_confusion(old.result["channel"])
    return abs(math.expm1(-confusion if fell else confusion)) if any(assumed) else None


def find_common(old: Side, new: Side) -> set[str]:
    """Sources whose error is the same in both: of one version, of one meter, of one setting of a camera."""
    same_version = old.calibration.id == new.calibration.id
    if isinstance(get_method(old.measurement.method).application, BandApplication):
        k = [side.result.get("reflectance_k") for side in (old, new)]
        return {"K"} if same_version and k[0] is not None and k[0] == k[1] else set()
    if old.frame.exposure is None or new.frame.exposure is None:
        return set()
    before, after = codec.decode_exposure(old.frame.exposure), codec.decode_exposure(new.frame.exposure)
    settings = {"exposure time": "exposure_time_s", "f-number": "f_number", "ISO setting": "iso"}
    common = {name for name, field in settings.items() if getattr(before, field) == getattr(after, field)}
    if old.calibration.camera_id != new.calibration.camera_id:
        common = set()
    if same_version and before.iso == after.iso:
        common |= {"meter calibration", "dark signal"}
        # more parameters than one have a correlation that the budget does not keep
        models = {each.model for each in codec.read_applied(old.calibration) if each.iso == before.iso}
        common |= {"fit of K"} if models == {"proportional"} else set()
    elif same_version or compare_meters(old.calibration, new.calibration)[0] == "common":
        common |= {"meter calibration"}
    return common


def _budget(side: Side) -> comparison.Budgeted:
    mean = side.mean
    uncertainties: dict[str, float] = {}
    for share in side.result.get("budget", []):
        u = share.get("standard_uncertainty_cd_m2", share.get("standard_uncertainty"))
        uncertainties[share["source"]] = u
    if _is_lit(side) and "conditions" not in side.measurement.parameters:
        # made before spectra could be stated: its budget has no line of it
        uncertainties[mismatch.SOURCE] = mismatch.DEFAULT_U_REL * abs(mean["value"])
    if not uncertainties:
        uncertainties["all"] = mean["standard_uncertainty"]
    return comparison.Budgeted(
        value=mean["value"], unit=mean["unit"], effects=comparison.sign_effects(mean["value"], uncertainties)
    )


def _compare_cells(
    old: Side, new: Side, before: comparison.Budgeted, after: comparison.Budgeted, common: set[str]
) -> tuple[tuple[comparison.Comparison, ...], ...] | None:
    if old.cells is None or new.cells is None:
        return None
    shapes = [(len(cells), len(cells[0])) for cells in (old.cells, new.cells)]
    if shapes[0] != shapes[1]:
        return None
    columns = shapes[0][1]
    pairs = zip(chain.from_iterable(old.cells), chain.from_iterable(new.cells), strict=True)
    flat = [
        comparison.compare_measured(_cell(before, was), _cell(after, becomes), common=common)
        for was, becomes in pairs
    ]
    return tuple(tuple(flat[at : at + columns]) for at in range(0, len(flat), columns))


def _cell(mean: comparison.Budgeted, cell: dict[str, Any]) -> comparison.Budgeted:
    return comparison.scale_effects(mean, cell["value"], cell["standard_uncertainty"])
