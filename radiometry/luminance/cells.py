"""The cells of a lit surface, measured and judged together."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from radiometry.findings import Raised
from radiometry.fitting.evidence import Quantity
from radiometry.fitting.sources import FLICKER
from radiometry.frame.grid import Grid
from radiometry.luminance.averaging import find_drift
from radiometry.luminance.camera import CalibratedCamera, Read, add_up
from radiometry.luminance.corners import Array, displace_cells
from radiometry.luminance.findings import summarise_cells
from radiometry.luminance.measured import AppliedLuminance, Surface
from radiometry.luminance.surface import Cells, Estimate, judge_uniformity

_LOCAL: Final = frozenset({FLICKER})
"""Sources that may err in each cell on its own (see `surface.judge_uniformity`)."""


def measure_surface(
    frames: Sequence[Sequence[Sequence[Read]]],
    camera: CalibratedCamera,
    grid: Grid,
    *,
    reflectance: float | None,
) -> tuple[Surface, tuple[Raised, ...]]:
    """Apply the calibration to every cell as it was read in each frame, and judge them together."""
    cells = [list(zip(*lines, strict=True)) for lines in zip(*frames, strict=True)]
    drift = None
    if len(frames) > 1:
        signals = [[signal for signal, _ in cell] for line in cells for cell in line]
        drift = find_drift(signals, dark_signal_dn=camera.coefficient.dark_signal_dn)
    applied = [[camera.apply_to_region(cell, drift=drift) for cell in line] for line in cells]
    values = np.array([[one.luminance_cd_m2.value for one in line] for line in applied])
    displaced = displace_cells(grid, values)
    uniformity = judge_uniformity(_gather(applied, values, displaced))
    average = _quantity(uniformity.average_cd_m2, "cd/m2")
    surface = Surface(
        cell_model="projective",
        cells=tuple(
            tuple(_widen(one.luminance_cd_m2, by) for one, by in zip(line, more, strict=True))
            for line, more in zip(applied, np.linalg.norm(displaced, axis=0), strict=True)
        ),
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


def _gather(applied: Sequence[Sequence[AppliedLuminance]], values: Array, displaced: Array) -> Cells:
    """Separate the cells' effects into those that they share and each one's own."""
    noise = np.array([[add_up(one.effects, shared=False) for one in line] for line in applied])
    shared, local = (
        np.moveaxis(np.array([[_list_shared(one, is_local=each) for one in line] for line in applied]), -1, 0)
        for each in (False, True)
    )
    return Cells(
        values_cd_m2=values,
        noise_cd_m2=noise,
        shared_cd_m2=np.concatenate([shared, displaced]),
        local_cd_m2=local,
    )


def _list_shared(applied: AppliedLuminance, *, is_local: bool) -> list[float]:
    return [
        each.effect_cd_m2 for each in applied.effects if each.shared and (each.source in _LOCAL) is is_local
    ]


def _widen(luminance: Quantity, by_cd_m2: float) -> Quantity:
    return replace(luminance, standard_uncertainty=math.hypot(luminance.standard_uncertainty, by_cd_m2))


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
