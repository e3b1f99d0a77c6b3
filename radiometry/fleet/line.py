"""A straight line through determinations over time, and what may be said of it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Literal

import numpy as np
import scipy

from radiometry.fleet.determinations import Determination

Stability = Literal["stable", "drifts", "cannot_tell"]

CONFIDENCE = 0.95

DAYS_PER_YEAR = 365.25

_FEWEST = 3

HORIZON_DAYS = 10 * DAYS_PER_YEAR
"""Longest extrapolation of a straight line."""


@dataclass(frozen=True, kw_only=True)
class Line:
    """Straight line, y = value + slope (t - origin), t in days, with the covariance of (value, slope)."""

    origin: datetime
    value: float
    slope_per_day: float
    covariance: tuple[tuple[float, float], tuple[float, float]]
    dof: int

    def at(self, days: float) -> tuple[float, float]:
        """Return the line and its standard error.

        Parameters
        ----------
        days : float
            Time after the origin [d].
        """
        (a, b), (_, c) = self.covariance
        return self.value + self.slope_per_day * days, math.sqrt(a + 2 * b * days + c * days * days)


def fit_line(rows: Sequence[Determination]) -> Line | None:
    """Fit a straight line by weighted least squares, with its uncertainty from the scatter about it.

    Parameters
    ----------
    rows : sequence of Determination
        Values of one coefficient of one camera.

    Returns
    -------
    Line or None
        None for fewer than three rows, or if all have the same time.

    Notes
    -----
    As [1]_, with weights::

        w_i = 1 / u_i^2,   cov = s^2 (A' W A)^-1,   s^2 = sum w_i (y_i - line_i)^2 / (n - 2)

    The stated uncertainties decide the weights; the scatter alone decides the uncertainty of the line. An
    error that all campaigns share (the meter's) is part of every u_i, moves no slope, and would hide a drift.
    If one u_i is 0, all weights are equal.

    References
    ----------
    .. [1] JCGM 100:2008, H.3, doi:10.59161/JCGM100-2008E
    """
    origin = rows[-1].source.at
    days = np.array([(row.source.at - origin) / timedelta(days=1) for row in rows])
    if len(rows) < _FEWEST or np.ptp(days) == 0.0:
        return None
    values = np.array([row.value for row in rows])
    stated = np.array([row.standard_uncertainty for row in rows])
    weights = 1.0 / (stated / stated.max()) ** 2 if np.all(stated > 0.0) else np.ones(len(rows))
    # in units of the span the normal equations are well scaled
    span = float(np.ptp(days))
    design = np.column_stack([np.ones(len(rows)), days / span])
    unit = np.linalg.inv(design.T @ (weights[:, None] * design))
    offset = float(values.mean())
    value, slope = unit @ (design.T @ (weights * (values - offset)))
    residual = values - offset - design @ np.array([value, slope])
    variance = float(np.sum(weights * residual**2)) / (len(rows) - 2)
    (a, b), (_, c) = (unit * variance).tolist()
    return Line(
        origin=origin,
        value=offset + float(value),
        slope_per_day=float(slope) / span,
        covariance=((a, b / span), (b / span, c / span**2)),
        dof=len(rows) - 2,
    )


def find_date(line: Line, *, reference: float, limit: float) -> tuple[datetime | None, str | None]:
    """Find when the line may first have left reference +-limit, from its origin on.

    Parameters
    ----------
    line : Line
        Fitted line.
    reference : float
        Value in use [unit of the coefficient].
    limit : float
        Largest accepted difference [unit of the coefficient].

    Returns
    -------
    datetime or None, str or None
        The time, or the reason why there is none.

    Notes
    -----
    The time t solves::

        |line(t) - reference| + t_{0.95,v} u(line(t)) = limit

    At any time before, the true line is within the tolerance with 95 % on either side: t is the lower limit
    of the time at which it leaves. This assumes that the drift continues unchanged.
    """
    quantile = float(scipy.special.stdtrit(line.dof, CONFIDENCE))

    def excess(days: float) -> float:
        value, error = line.at(days)
        return abs(value - reference) + quantile * error - limit

    if abs(line.value - reference) > limit:
        return line.origin, None
    if excess(0.0) > 0.0:
        return None, (
            "The line is known too poorly: already at the last version its uncertainty reaches beyond the "
            "tolerance. Calibrate again, or accept more."
        )
    if excess(HORIZON_DAYS) <= 0.0:
        return None, "The tolerance is not left within ten years, and a line is not believed for longer."
    # convex, not above 0 at the one end and above it at the other: there is one crossing
    days = float(scipy.optimize.brentq(excess, 0.0, HORIZON_DAYS, xtol=1e-6))
    return line.origin + timedelta(days=days), None


def judge_stability(
    line: Line | None, span_days: float, *, limit: float | None
) -> tuple[Stability, float | None, float | None]:
    """Judge whether a coefficient stayed the same over the time in which it was determined.

    Parameters
    ----------
    line : Line or None
        Fitted line.
    span_days : float
        Time from the first determination to the last [d].
    limit : float or None
        Largest accepted change in that time [unit of the coefficient].

    Returns
    -------
    tuple of (str, float or None, float or None)
        Verdict, change and its standard error; the latter two None without a line.

    Notes
    -----
    With d the change of the line over the time and u its standard error, of v degrees of freedom::

        stable   |d| + t_{0.95,v} u < limit        two one-sided tests at 5 %
        drifts   |d| - t_{0.975,v} u > limit       without a limit: > 0

    Without a limit nothing can be shown to be stable, only not to be found drifting.
    """
    if line is None:
        return "cannot_tell", None, None
    change = line.slope_per_day * span_days
    error = math.sqrt(line.covariance[1][1]) * span_days
    if abs(change) - float(scipy.special.stdtrit(line.dof, 0.5 + CONFIDENCE / 2.0)) * error > (limit or 0.0):
        return "drifts", change, error
    if limit is not None and abs(change) + float(scipy.special.stdtrit(line.dof, CONFIDENCE)) * error < limit:
        return "stable", change, error
    return "cannot_tell", change, error


def say_stability(verdict: Stability, *, with_limit: bool, repeats: int) -> str:
    """Return a verdict of `judge_stability` in words.

    Parameters
    ----------
    verdict : {"stable", "drifts", "cannot_tell"}
        Verdict.
    with_limit : bool
        True if there was a limit.
    repeats : int
        Number of determinations at different times.
    """
    if verdict == "stable":
        return "It stayed within the tolerance, with 95 %."
    if verdict == "drifts":
        beyond = "by more than the tolerance" if with_limit else "from one determination to the next"
        return f"It drifts {beyond}, with 95 %."
    if repeats < _FEWEST:
        there = "is" if repeats == 1 else "are"
        return f"{_FEWEST} determinations at different times are needed; there {there} {repeats}."
    if not with_limit:
        return "No drift was found. Stability can be shown against a tolerance only."
    return "Neither a drift beyond the tolerance nor stability within it is shown: repeat the calibration."
