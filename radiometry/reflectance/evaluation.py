"""K of a calibration at the time of a frame."""

import bisect
import math
from dataclasses import dataclass

from radiometry.reflectance.results import Coefficient, Knot


@dataclass(frozen=True, kw_only=True)
class KAtTime:
    """K at the time of a frame.

    Attributes
    ----------
    value : float
        K.
    u_rel : float
        Relative standard uncertainty from all sources but the sunshine gain.
    outside : bool
        True if the time is not between two knots.
    """

    value: float
    u_rel: float
    outside: bool


def evaluate_k(coefficient: Coefficient, *, at_s: float | None) -> KAtTime:
    """Compute K(t) with its uncertainty.

    Parameters
    ----------
    coefficient : Coefficient
        Coefficient of the band.
    at_s : float or None
        Time on the camera's clock [s]; None if it is not known.

    Returns
    -------
    KAtTime
        K at that time.

    Notes
    -----
    "constant" uses the mean of the panel captures, with their drift in its
    uncertainty. "linear" uses, with w = (t - t_0)/(t_1 - t_0) between the two
    captures around t::

        K(t) = (1 - w) K_0 + w K_1        u^2 = shared^2 + (1 - w)^2 u_0^2 + w^2 u_1^2

    Outside the captures K is that of the nearest one, and the whole change between
    the first and the last is added to the uncertainty: there is no evidence that it
    stopped there. Without the time of the frame or of the captures it is the mean,
    with the same addition.
    """
    knots = coefficient.knots
    mean = math.fsum(knot.reflectance_k for knot in knots) / len(knots)
    mean_u_rel = math.hypot(*(knot.u_rel for knot in knots)) / len(knots)
    times = [knot.at_s for knot in knots if knot.at_s is not None]
    timed = at_s is not None and len(times) == len(knots)
    outside = timed and len(knots) > 1 and not times[0] <= (at_s or 0.0) <= times[-1]
    if coefficient.interpolation == "constant" or len(knots) == 1:
        u_rel = math.hypot(coefficient.shared_u_rel, coefficient.drift_u_rel, mean_u_rel)
        return KAtTime(value=mean, u_rel=u_rel, outside=outside)
    change_rel = abs(knots[-1].reflectance_k - knots[0].reflectance_k) / mean
    if at_s is None or not timed:
        return KAtTime(
            value=mean, u_rel=math.hypot(coefficient.shared_u_rel, mean_u_rel, change_rel), outside=True
        )
    if outside:
        knot = knots[0] if at_s < times[0] else knots[-1]
        u_rel = math.hypot(coefficient.shared_u_rel, knot.u_rel, change_rel)
        return KAtTime(value=knot.reflectance_k, u_rel=u_rel, outside=True)
    right = min(max(1, bisect.bisect_left(times, at_s)), len(knots) - 1)
    return _between(
        knots[right - 1], knots[right], times[right - 1], times[right], at_s, coefficient.shared_u_rel
    )


def _between(
    before: Knot, after: Knot, start_s: float, end_s: float, at_s: float, shared_u_rel: float
) -> KAtTime:
    weight = (at_s - start_s) / (end_s - start_s)
    value = (1.0 - weight) * before.reflectance_k + weight * after.reflectance_k
    own = math.hypot(
        (1.0 - weight) * before.u_rel * before.reflectance_k, weight * after.u_rel * after.reflectance_k
    )
    return KAtTime(value=value, u_rel=math.hypot(shared_u_rel, own / value), outside=False)
