"""Meter readings of the scenes: averaged, with their spread, and with checks of the lamp."""

import math
from collections import defaultdict
from collections.abc import Sequence

from radiometry.findings import Raised
from radiometry.luminance import codes
from radiometry.luminance.results import SceneSummary
from radiometry.luminance.rows import Reading

_LAMP_DRIFT_REL = 0.02
_RHO_TOLERANCE_REL = 0.10
_USUAL_COVERAGE_FACTOR = 2.0


def summarise_scenes(readings: Sequence[Reading], *, panel_rho: float | None) -> tuple[SceneSummary, ...]:
    """Average the luminance readings per scene.

    Parameters
    ----------
    readings : sequence of Reading
        Meter readings.
    panel_rho : float or None
        Luminance factor of the target, if given.

    Returns
    -------
    tuple of SceneSummary
        One summary per scene; a scene without a luminance reading has none.
    """
    by_scene: dict[str, list[Reading]] = defaultdict(list)
    for reading in readings:
        by_scene[reading.scene].append(reading)
    scenes = sorted({reading.scene for reading in readings if reading.quantity == "luminance"})
    return tuple(_summarise(scene, by_scene[scene], panel_rho) for scene in scenes)


def _summarise(scene: str, readings: Sequence[Reading], panel_rho: float | None) -> SceneSummary:
    luminances = _values(readings, "luminance")
    illuminances = _values(readings, "illuminance")
    mean_lx = math.fsum(illuminances) / len(illuminances) if illuminances else None
    return SceneSummary(
        scene=scene,
        readings=len(luminances),
        luminance_cd_m2=math.fsum(luminances) / len(luminances),
        spread_rel=_spread(luminances),
        illuminance_lx=mean_lx,
        illuminance_spread_rel=_spread(illuminances) if illuminances else None,
        rho_e_pi_cd_m2=panel_rho * mean_lx / math.pi
        if panel_rho is not None and mean_lx is not None
        else None,
    )


def _values(readings: Sequence[Reading], quantity: str) -> list[float]:
    return sorted(r.value for r in readings if r.quantity == quantity)


def _spread(ordered: Sequence[float]) -> float:
    """Compute (largest - smallest) / mean."""
    return (ordered[-1] - ordered[0]) / (math.fsum(ordered) / len(ordered))


def check_scenes(scenes: Sequence[SceneSummary]) -> list[Raised]:
    """Check the lamp for drift, and compare luminance with illuminance.

    Returns
    -------
    list of Raised
        `lamp_drift` if the illuminance readings of a scene spread over more than 2
        %; `rho_cross_check` if L and rho E / pi of a scene differ by more than 10
        %.
    """
    raised: list[Raised] = []
    for scene in scenes:
        where = f"scene {scene.scene}"
        drift = scene.illuminance_spread_rel
        if drift is not None and drift > _LAMP_DRIFT_REL:
            detail = f"The illuminance readings spread over {drift:.1%} of their mean."
            raised.append(codes.LAMP_DRIFT.at(where, detail))
        expected = scene.rho_e_pi_cd_m2
        if (
            expected is not None
            and not abs(scene.luminance_cd_m2 - expected) <= _RHO_TOLERANCE_REL * expected
        ):
            detail = f"L is {scene.luminance_cd_m2:.4g} cd/m2, rho E / pi is {expected:.4g} cd/m2."
            raised.append(codes.RHO_CROSS_CHECK.at(where, detail))
    return raised


def meter_calibration_u_rel(readings: Sequence[Reading]) -> tuple[float, bool]:
    """Return the meters' relative calibration uncertainty.

    Parameters
    ----------
    readings : sequence of Reading
        Meter readings.

    Returns
    -------
    tuple[float, bool]
        Largest relative standard uncertainty, and whether that of every meter is
        known.

    Notes
    -----
    Of several meters the largest is used, as one error common to all points: that
    is the cautious choice if it is not known how their standards are related. A
    certificate without a coverage factor is read with k = 2.
    """
    luminance = [reading for reading in readings if reading.quantity == "luminance"]
    known = [
        reading.expanded_uncertainty_rel / (reading.coverage_factor or _USUAL_COVERAGE_FACTOR)
        for reading in luminance
        if reading.expanded_uncertainty_rel is not None
    ]
    return max(known, default=0.0), len(known) == len(luminance)
