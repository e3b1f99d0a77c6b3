"""The cells of a lit surface, measured and judged together."""

import math
from collections.abc import Sequence

import numpy as np

from radiometry.findings import Raised
from radiometry.fitting.evidence import Quantity
from radiometry.luminance.averaging import find_drift
from radiometry.luminance.camera import CalibratedCamera, Read, add_up
from radiometry.luminance.findings import summarise_cells
from radiometry.luminance.measured import AppliedLuminance, Surface
from radiometry.luminance.surface import Cells, Estimate, judge_uniformity


def measure_surface(
    frames: Sequence[Sequence[Sequence[Read]]], camera: CalibratedCamera, *, reflectance: float | None
) -> tuple[Surface, tuple[Raised, ...]]:
    """Apply the calibration to every cell as it was read in each frame, and judge them together."""
    cells = [list(zip(*lines, strict=True)) for lines in zip(*frames, strict=True)]
    drift = None
    if len(frames) > 1:
        signals = [[signal for signal, _ in cell] for line in cells for cell in line]
        drift = find_drift(signals, dark_signal_dn=camera.coefficient.dark_signal_dn)
    applied = [[camera.apply_to_region(cell, drift=drift) for cell in line] for line in cells]
    uniformity = judge_uniformity(_gather(applied))
    average = _quantity(uniformity.average_cd_m2, "cd/m2")
    surface = Surface(
        cell_model="projective",
        cells=tuple(tuple(one.luminance_cd_m2 for one in line) for line in applied),
        l_av_cd_m2=average,
        l_min_cd_m2=_quantity(uniformity.smallest_cd_m2, "cd/m2"),
        l_max_cd_m2=_quantity(uniformity.largest_cd_m2, "cd/m2"),
        u_o=_ratio(uniformity.u_o),
        u_l=tuple(_ratio(line) for line in uniformity.u_l),
        average_to_min=_ratio(uniformity.average_to_min),
        max_to_min=_ratio(uniformity.max_to_min),
        illuminance_lx=illuminate(average, reflectance),
    )
    return surface, summarise_cells(applied)


def _gather(applied: Sequence[Sequence[AppliedLuminance]]) -> Cells:
    """Separate the cells' effects into those that they share and each one's own."""
    values = np.array([[one.luminance_cd_m2.value for one in line] for line in applied])
    noise = np.array([[add_up(one.effects, shared=False) for one in line] for line in applied])
    shared = np.array(
        [[[e.effect_cd_m2 for e in one.effects if e.shared] for one in line] for line in applied]
    )
    return Cells(values_cd_m2=values, noise_cd_m2=noise, shared_cd_m2=np.moveaxis(shared, -1, 0))


def illuminate(luminance: Quantity, reflectance: float | None) -> Quantity | None:
    """Compute E = pi L / rho [lx]."""
    if reflectance is None:
        return None
    factor = math.pi / reflectance
    return Quantity(
        value=luminance.value * factor,
        standard_uncertainty=luminance.standard_uncertainty * factor,
        unit="lx",
    )


def _quantity(figure: Estimate, unit: str) -> Quantity:
    return Quantity(value=figure.value, standard_uncertainty=figure.standard_uncertainty, unit=unit)


def _ratio(figure: Estimate | None) -> Quantity | None:
    return _quantity(figure, "1") if figure is not None else None
