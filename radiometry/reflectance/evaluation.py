"""K of a calibration at the time of a frame."""

import bisect
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from radiometry.reflectance.results import Coefficient, Knot

# The time over which `drift_half_hour_rel` is stated.
HALF_HOUR_S = 1800.0
# Versions before the drift was estimated.
USUAL_DRIFT_REL = 0.02
_FAST_S = 300.0
# A clock that was set in between leaves years: the rule ends with the day.
_LONGEST_S = 86_400.0


@dataclass(frozen=True, kw_only=True)
class KAtTime:
    """K at the time of a frame.

    Attributes
    ----------
    value : float
        K.
    u_rel : float
        Relative standard uncertainty from all sources but the sunshine gain and drift.
    drift_u_rel : float
        Relative standard uncertainty from K's change between the panel visits and the
        frame.
    outside_s : float or None
        Time to the nearest panel visit [s], negative before the first; 0 between or
        during visits, None if a time is not known.
    """

    value: float
    u_rel: float
    drift_u_rel: float
    outside_s: float | None


def change_variance(after_s: float) -> float:
    """Compute the variance of K's change in a time, relative to that in half an hour.

    Parameters
    ----------
    after_s : float
        Time [s]; more than a day counts as a day.

    Notes
    -----
    Half of it is a random walk (a sensor that drifts), half settles within minutes (light
    that is not modelled)::

        v(t) = (t / 30 min + 1 - exp(-t / 5 min)) / 2
    """
    time_s = min(abs(after_s), _LONGEST_S)
    return 0.5 * (time_s / HALF_HOUR_S - math.expm1(-time_s / _FAST_S))


def interpolate(knots: Sequence[Knot], *, at_s: float | None, follow: bool, drift_rel: float) -> KAtTime:
    """Compute K(t) from the panel visits, with the uncertainty that they do not share.

    Parameters
    ----------
    knots : sequence of Knot
        K of the panel visits in the order of time.
    at_s : float or None
        Time on the camera's clock [s]; None if it is not known.
    follow : bool
        True for lines between the visits, False for their mean.
    drift_rel : float
        Relative standard deviation d of K's change in half an hour.

    Notes
    -----
    K(t) is the sum of w_i K_i over the visits: lines weigh the two around t by time, and
    before the first and after the last visit take the nearest. With the growth v(t) of
    `change_variance` [1]_::

        u^2 = sum (w_i u_i)^2
        drift^2 = d^2 (sum w_i v(t - t_i) - sum w_i w_j v(t_i - t_j) / 2)

    Without the time of the frame or of the visits K is the mean, and the drift d and the
    whole difference between visits.

    References
    ----------
    .. [1] N. Cressie, Statistics for Spatial Data (1993), section 3.2 (v/2 is a variogram),
           doi:10.1002/9781119115151
    """
    ks = [knot.reflectance_k for knot in knots]
    times = [knot.at_s for knot in knots if knot.at_s is not None]
    known_s = at_s if len(times) == len(knots) else None
    weights = [1.0 / len(knots)] * len(knots)
    if known_s is not None and follow:
        weights = _weigh(times, known_s)
    value = math.fsum(w * k for w, k in zip(weights, ks, strict=True))
    u_rel = math.hypot(*(w * k * knot.u_rel for w, k, knot in zip(weights, ks, knots, strict=True))) / value
    if known_s is None:
        drift_u_rel = math.hypot(drift_rel, (max(ks) - min(ks)) / value)
        return KAtTime(value=value, u_rel=u_rel, drift_u_rel=drift_u_rel, outside_s=None)
    weighed = list(zip(weights, times, strict=True))
    variance = math.fsum(w * change_variance(known_s - t) for w, t in weighed) - 0.5 * math.fsum(
        w * v * change_variance(t - s) for w, t in weighed for v, s in weighed
    )
    first, last = (knots[end].half_span_s or 0.0 for end in (0, -1))
    return KAtTime(
        value=value,
        u_rel=u_rel,
        drift_u_rel=drift_rel * math.sqrt(max(0.0, variance)),
        outside_s=min(0.0, known_s - times[0] + first) + max(0.0, known_s - times[-1] - last),
    )


def evaluate_k(coefficient: Coefficient, *, at_s: float | None) -> KAtTime:
    """Compute K(t) with its uncertainty by `interpolate`, and what all visits share.

    Parameters
    ----------
    coefficient : Coefficient
        Coefficient of the band.
    at_s : float or None
        Time on the camera's clock [s]; None if it is not known.
    """
    drift_rel = coefficient.drift_half_hour_rel
    found = interpolate(
        coefficient.knots,
        at_s=at_s,
        follow=coefficient.interpolation == "linear",
        drift_rel=USUAL_DRIFT_REL if drift_rel is None else drift_rel,
    )
    return replace(
        found,
        u_rel=math.hypot(found.u_rel, coefficient.shared_u_rel),
        drift_u_rel=math.hypot(found.drift_u_rel, coefficient.drift_u_rel),
    )


def _weigh(times: Sequence[float], at_s: float) -> list[float]:
    weights = [0.0] * len(times)
    at_s = min(max(at_s, times[0]), times[-1])
    right = bisect.bisect_left(times, at_s)
    weights[right] = 1.0
    if times[right] > at_s:
        weights[right] = (at_s - times[right - 1]) / (times[right] - times[right - 1])
        weights[right - 1] = 1.0 - weights[right]
    return weights
