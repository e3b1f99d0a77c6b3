"""Linearity error: deviation of the signal from a straight line of the exposure time."""

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
    """Deviation of one level from the line, relative to the line."""

    level: Level
    deviation_rel: float


@dataclass(frozen=True, kw_only=True)
class Linearity:
    """Line of one scene and f-number, and the deviations from it.

    Attributes
    ----------
    error : Quantity
        Mean of the absolute deviations LE, release 3.1.
    lowest_rel, highest_rel : float
        Extreme deviations, which release 3.0 calls LE_min and LE_max.
    slope_dn_per_s, offset_dn : float
        Slope [DN/s] and intercept [DN] of the line.
    deviations : tuple of Deviation
        Deviation of each level on which the line rests.
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
    """Fit y = a0 + a1 t to the scene that has most exposure times, and compute the deviations from it.

    Parameters
    ----------
    levels : sequence of Level
        Levels of one channel at one ISO value.
    saturation_signal_dn : float
        Signal at saturation [DN above dark].
    range_share : tuple of float
        Range of the fit, as fractions of saturation.
    gain_dn_per_e : float
        System gain K [DN/e-].

    Returns
    -------
    Linearity or None
        None if no scene has four levels of different times.

    Notes
    -----
    Over 5 to 95 % of saturation [1]_ (section 6.7)::

        minimise sum (y_i - (a0 + a1 t_i))^2 / y_i^2,     delta_i = y_i / (a0 + a1 t_i) - 1,
        LE = mean |delta_i|

    The light must be the same at all times, so levels of another scene or f-number do not enter. u(LE) is
    that of the noise of the means; without any nonlinearity LE is that noise.

    References
    ----------
    .. [1] EMVA Standard 1288, release 3.1
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
    """Return the noise of a level's mean; for a single frame by the photon transfer."""
    if level.lit.temporal is not None:
        return level.light_u_dn
    dark = level.dark.temporal.value_dn2 if level.dark.temporal else 0.0
    variance = (dark + gain_dn_per_e * level.signal_dn) / level.lit.samples
    return math.sqrt(variance + level.light_u_dn**2)
