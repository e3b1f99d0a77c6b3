"""Nonuniformity: differences between pixels that every frame repeats, dark (DSNU) and lit (PRNU)."""

import math
from collections.abc import Sequence

from radiometry.fitting.evidence import Quantity
from radiometry.noise.levels import Level, list_darks
from radiometry.noise.stacks import Stack, Variance

PRNU_RANGE_SHARE = (0.3, 0.7)
"""EMVA 1288 takes a level at 50 % of saturation; in the field it is the one of most frames within these, of
equals the nearest to 50 %."""

_RESOLVED_IN_ERRORS = 2.0


def find_dsnu(stacks: Sequence[Stack]) -> tuple[Quantity, bool] | None:
    """Compute DSNU = sqrt(s^2_dark) [DN] of the dark stack with most frames.

    Parameters
    ----------
    stacks : sequence of Stack
        Stacks of one channel at one ISO value.

    Returns
    -------
    tuple of (Quantity, bool) or None
        DSNU [DN], and a bool for whether it is resolved, that is not hidden by noise;
        None if it cannot be computed.

    Notes
    -----
    [1]_ (section 8.2) divides by K for electrons. Nothing slow is removed: glow and banding are part of it.

    References
    ----------
    .. [1] EMVA Standard 1288, release 3.1
    """
    darks = list_darks(stacks)
    if not darks:
        return None
    stack = max(darks, key=lambda each: len(each.frames))  # of equals the shortest time
    if stack.pattern is None:
        raise AssertionError("a stack with a temporal variance has a spatial one")
    return _root(stack.pattern, unit="DN"), _is_resolved(stack.pattern)


def find_prnu(levels: Sequence[Level], *, saturation_signal_dn: float) -> tuple[Quantity, bool] | None:
    """Compute PRNU = sqrt(s^2_50 - s^2_dark) / (mu_50 - mu_dark) about half of saturation.

    Parameters
    ----------
    levels : sequence of Level
        Levels of one channel at one ISO value.
    saturation_signal_dn : float
        Signal at saturation [DN above dark].

    Returns
    -------
    tuple of (Quantity, bool) or None
        PRNU, and a bool for whether it is resolved, that is not hidden by noise; None
        if it cannot be computed.

    Notes
    -----
    [1]_ (section 8.2) defines it for equally lit pixels. Behind a lens the light is not even, so a
    quadratic surface is removed from both mean images. It holds for a block of at most 96 samples, not for
    the whole frame.

    References
    ----------
    .. [1] EMVA Standard 1288, release 3.1
    """
    low, high = (share * saturation_signal_dn for share in PRNU_RANGE_SHARE)
    usable = [level for level in levels if not level.left_out and low <= level.light_dn <= high]
    if not usable:
        return None
    level = min(
        usable,
        key=lambda each: (
            -len(each.lit.frames),
            abs(each.light_dn - saturation_signal_dn / 2),
        ),
    )
    lit, dark = level.lit.detrended, level.dark.detrended
    if lit is None or dark is None:
        raise AssertionError("a stack with a temporal variance has a spatial one")
    pattern = Variance(value_dn2=lit.value_dn2 - dark.value_dn2, u_dn2=math.hypot(lit.u_dn2, dark.u_dn2))
    root = _root(pattern, unit="1")
    return (
        Quantity(
            value=root.value / level.light_dn,
            standard_uncertainty=root.standard_uncertainty / level.light_dn,
            unit="1",
        ),
        _is_resolved(pattern),
    )


def _root(variance: Variance, *, unit: str) -> Quantity:
    """Return the root with its uncertainty: u / (2 s), and near zero how far one error more would reach."""
    root = math.sqrt(max(0.0, variance.value_dn2))
    if _is_resolved(variance):
        u = variance.u_dn2 / (2.0 * root)
    else:
        u = math.sqrt(max(0.0, variance.value_dn2) + variance.u_dn2) - root
    return Quantity(value=root, standard_uncertainty=u, unit=unit)


def _is_resolved(variance: Variance) -> bool:
    return variance.value_dn2 > _RESOLVED_IN_ERRORS * variance.u_dn2
