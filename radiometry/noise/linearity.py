"""Linearity error: how far the signal lies from a straight line of the exposure."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from radiometry.fitting.evidence import Quantity
from radiometry.noise.levels import Level

FEWEST_LEVELS = 4
"""Two parameters, and two degrees of freedom to see a bend with. EMVA 1288 asks for nine."""


@dataclass(frozen=True, kw_only=True)
class Deviation:
    """One level's deviation from the line, relative to the line."""

    level: Level
    deviation_rel: float


@dataclass(frozen=True, kw_only=True)
class Linearity:
    """The line of one scene and f-number, and what is not on it.

    ``error`` : mean of the absolute deviations, release 3.1; ``lowest_rel``, ``highest_rel`` : the extremes
        that release 3.0 calls LE_min and LE_max
    """

    error: Quantity
    lowest_rel: float
    highest_rel: float
    slope_dn_per_s: float
    offset_dn: float
    deviations: tuple[Deviation, ...]


def find_linearity(
    levels: Sequence[Level],
    *,
    saturation_signal_dn: float,
    range_share: tuple[float, float],
    gain_dn_per_e: float,
) -> Linearity | None:
    """Fit y = a0 + a1 t to the scene that has most exposure times, and give the deviations from it.

        minimise sum (y_i - (a0 + a1 t_i))^2 / y_i^2,     delta_i = y_i / (a0 + a1 t_i) - 1,
        LE = mean |delta_i|                          over 5 to 95 % of saturation      [1, section 6.7]
    The light must be the same at all times, so levels of another scene or f-number do not enter. u(LE) is
    that of the noise of the means; without any nonlinearity LE is that noise.

    Returns None where no scene has four levels of different times
    References [1] EMVA Standard 1288, release 3.1
    """
    low, high = (share * saturation_signal_dn for share in range_share)
    usable = [level for level in levels if not level.lit.clipped and low <= level.light_dn <= high]
    series = [
        members
        for members in _group(usable)
        if len({member.lit.setting.exposure_time_s for member in members}) >= FEWEST_LEVELS
    ]
    if not series:
        return None
    longest = max(series, key=len)  # of equally long ones the first by role and scene
    t = np.array([level.lit.setting.exposure_time_s for level in longest])
    y = np.array([level.light_dn for level in longest])
    design = np.column_stack([np.ones_like(t), t]) / y[:, None]
    hat = design @ np.linalg.pinv(design)
    a0, a1 = np.linalg.pinv(design) @ np.ones_like(y)
    line = a0 + a1 * t
    deviations = y / line - 1.0
    relative_u = np.array([_mean_u_dn(level, gain_dn_per_e) for level in longest]) / y
    effect = np.sign(deviations) @ (np.eye(len(y)) - hat) / len(y)
    return Linearity(
        error=Quantity(
            value=float(np.mean(np.abs(deviations))),
            standard_uncertainty=float(np.linalg.norm(effect * relative_u)),
            unit="1",
        ),
        lowest_rel=float(deviations.min()),
        highest_rel=float(deviations.max()),
        slope_dn_per_s=float(a1),
        offset_dn=float(a0),
        deviations=tuple(
            Deviation(level=level, deviation_rel=float(deviation))
            for level, deviation in zip(longest, deviations, strict=True)
        ),
    )


def _group(levels: Sequence[Level]) -> list[list[Level]]:
    def key(level: Level) -> tuple[str, str, float]:
        setting = level.lit.setting
        return setting.role, setting.scene, setting.f_number

    return [list(group) for _, group in itertools.groupby(sorted(levels, key=key), key=key)]


def _mean_u_dn(level: Level, gain_dn_per_e: float) -> float:
    """Give the noise of a level's mean; of a single frame by the photon transfer."""
    if level.lit.temporal is not None:
        return level.light_u_dn
    dark = level.dark.temporal.value_dn2 if level.dark.temporal else 0.0
    variance = (dark + gain_dn_per_e * level.signal_dn) / level.lit.samples
    return math.sqrt(variance + level.light_u_dn**2)
