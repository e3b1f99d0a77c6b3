"""Dark current: how the dark signal, and its noise, grow with time; and dark frames that saw light."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import Reason, shared
from radiometry.fitting.evidence import MOST_DOF, Quantity
from radiometry.frame.darkness import TAKE_AGAIN, inspect_black
from radiometry.noise.rows import DARK
from radiometry.noise.stacks import Stack

Vector = NDArray[np.float64]

ABOVE_OTHERS_SHARE = 0.001
"""Of the span from black to white, above the darkest frame of the same ISO and time: black levels wander by a
tenth of this."""


@dataclass(frozen=True, kw_only=True)
class DarkCurrent:
    """Dark current from the dark signal and from the dark noise.

    Attributes
    ----------
    from_mean : Quantity
        Slope of the dark signal's mean [DN/s].
    from_variance : Quantity or None
        Slope of the dark noise's variance [DN^2/s]; None if it is not known.
    dof : float
        Degrees of freedom of the uncertainty of the first.
    """

    from_mean: Quantity
    from_variance: Quantity | None
    dof: float


def find_dark_current(stacks: Sequence[Stack]) -> DarkCurrent | None:
    """Fit mu_dark = mu_0 + mu_I t to the means of all dark frames, and a line to their stacks' variances.

    Parameters
    ----------
    stacks : sequence of Stack
        Stacks of one channel at one ISO value.

    Returns
    -------
    DarkCurrent or None
        None if there are fewer than three dark frames, or if all have one exposure
        time.

    Notes
    -----
    The dark current in DN and in electrons is [1]_ (section 7.1)::

        mu_I [DN/s] = slope of the mean,     mu_I [e-/s] = slope of the variance / K^2

    A frame's mean is weighted by the noise of its samples. Electronics move whole frames by more than that
    noise; where frames scatter more, the error grows with their scatter (Birge).

    References
    ----------
    .. [1] EMVA Standard 1288, release 3.1
    """
    darks = [stack for stack in stacks if stack.setting.role == DARK]
    noise = max((stack.temporal.value_dn2 for stack in darks if stack.temporal), default=0.0)
    points = [
        (
            stack.setting.exposure_time_s,
            mean,
            math.sqrt(_noise_dn2(stack, noise) / stack.samples),
        )
        for stack in darks
        for mean in stack.frame_means_dn
    ]
    line = _fit_slope(points)
    if line is None or noise <= 0.0:
        return None
    variances = [
        (stack.setting.exposure_time_s, stack.temporal.value_dn2, stack.temporal.u_dn2)
        for stack in darks
        if stack.temporal
    ]
    growing = _fit_slope(variances, fewest=2)
    return DarkCurrent(
        from_mean=Quantity(value=line[0], standard_uncertainty=line[1], unit="DN/s"),
        from_variance=Quantity(value=growing[0], standard_uncertainty=growing[1], unit="DN2/s")
        if growing
        else None,
        dof=line[2],
    )


def _noise_dn2(stack: Stack, otherwise: float) -> float:
    return stack.temporal.value_dn2 if stack.temporal else otherwise


def _fit_slope(
    points: Sequence[tuple[float, float, float]], *, fewest: int = 3
) -> tuple[float, float, float] | None:
    """Return slope, its standard uncertainty and degrees of freedom of a weighted line through (t, y, u)."""
    if len(points) < fewest or len({time for time, _, _ in points}) < 2:
        return None
    t, y, u = (np.array(column) for column in zip(*points, strict=True))
    if not np.all(u > 0.0):
        return None
    weights = 1.0 / u**2
    middle = float(weights @ t / weights.sum())
    spread = float(weights @ (t - middle) ** 2)
    slope = float(weights @ ((t - middle) * y)) / spread
    level = float(weights @ y / weights.sum())
    residual = y - level - slope * (t - middle)
    dof = len(points) - 2
    excess = max(1.0, float(weights @ residual**2) / dof) if dof else 1.0
    return slope, math.sqrt(excess / spread), float(dof) if excess > 1.0 else MOST_DOF


def find_not_dark(stack: Stack) -> dict[str, Reason]:
    """Return the reason for each frame of a dark stack that saw light.

    Parameters
    ----------
    stack : Stack
        Stack of dark frames.

    Returns
    -------
    dict of str to Reason
        Reason by name of the frame.

    Notes
    -----
    A warm sensor's signal grows with time, in all frames of one time alike. A noise campaign measures just
    this, so only a signal that no sensor reaches without light counts against the stated black level.
    """
    span = max(stack.white_level_dn - stack.black_level_dn, 1.0)
    darkest = min(stack.frame_means_dn)
    found = {}
    for frame, mean in zip(stack.frames, stack.frame_means_dn, strict=True):
        reason = inspect_black(mean, black_level_dn=stack.black_level_dn, white_level_dn=stack.white_level_dn)
        if mean - darkest > ABOVE_OTHERS_SHARE * span:
            detail = (
                f"Its mean is {mean - darkest:.3g} DN above that of a dark frame of the same ISO and time: "
                f"this one saw light. {TAKE_AGAIN}"
            )
            reason = shared.DARK_NOT_DARK.reason(detail)
        if reason is not None and reason.outcome == "fail":
            found[frame] = reason
    return found
