"""Drift of one camera and of a rig: a line through determinations, and its verdict."""

import math
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime, timedelta
from typing import Literal

import numpy as np
import scipy

from radiometry.fitting.evidence import Quantity
from radiometry.fleet.determinations import Determination, Key, LeftOut, Source, keep_repeats
from radiometry.fleet.results import NOT_SHARED, Tolerance, find_sensitivity, is_clear_of_zero, main_unit
from radiometry.records import Record, about
from radiometry.specification.exports import RigMember

Stability = Literal["stable", "drifts", "cannot_tell"]

CONFIDENCE = 0.95

DAYS_PER_YEAR = 365.25

_FEWEST = 3

HORIZON_DAYS = 10 * DAYS_PER_YEAR  # Longest extrapolation of a straight line


class Line(Record):
    """Straight line, y = value + slope (t - origin), t in days, with the covariance of (value, slope)."""

    origin: datetime
    value: float
    slope_per_day: float
    covariance: tuple[tuple[float, float], tuple[float, float]]
    dof: int

    def at(self, days: float) -> tuple[float, float]:
        (a, b), (_, c) = self.covariance
        return self.value + self.slope_per_day * days, math.sqrt(a + 2 * b * days + c * days * days)


def fit_line(rows: Sequence[Determination]) -> Line | None:
    """Fit a straight line by weighted least squares, with its uncertainty from the scatter about it.

    As [1], with weights::

        w_i = 1 / u_i^2,   cov = s^2 (A' W A)^-1,   s^2 = sum w_i (y_i - line_i)^2 / (n - 2)

    The stated uncertainties decide the weights; the scatter alone decides the uncertainty of the line. An
    error that all campaigns share (the meter's) is part of every u_i, moves no slope, and would hide a drift.
    If one u_i is 0, all weights are equal.

    [1] JCGM 100:2008, H.3, doi:10.59161/JCGM100-2008E
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


class Drift(Record):
    """The trend of one coefficient. What a field lacks is None."""

    key: Key
    determinations: tuple[Determination, ...] = about("Those used, in time.")
    slope: Quantity | None = about("In the unit of the coefficient per year.")
    slope_interval: tuple[float, float] | None = about("For 95 %, in the slope's unit.")
    slope_p_value: float | None = about("Small: it drifts.")
    cost_per_year: Quantity | None = about("The slope as its effect on the result.")
    scatter: Quantity | None = about("Of one determination about the line.")
    tolerance: Tolerance | None
    recalibrate_by: datetime | None = about(
        "Before this time the camera is within the tolerance with 95 % on either side."
    )
    why: str | None = about("Why there is no date.")
    change: Quantity | None = about(
        "Of the line from the first determination to the last, in the unit of the coefficient."
    )
    verdict: Stability = about("By `judge_stability`.")
    said: str = about("The verdict in words.")


def judge_drift(
    determinations: Sequence[Determination], *, method: str, tolerance: float | None
) -> tuple[tuple[Drift, ...], tuple[LeftOut, ...]]:
    """Fit each coefficient of one camera against time, over its campaigns with its present lens.

    Parameters
    ----------
    determinations : sequence of Determination
        Of one camera.
    method : str
        Name of the method.
    tolerance : float or None
        For parameters whose effect is in the method's main unit, as in `verdict.judge_fleet`; None: no date.

    Returns
    -------
    drifts : tuple of Drift
        One for each coefficient, by `fit_line` and `find_date`.
    left_out : tuple of LeftOut
        Versions that were not used.
    """
    sources, left_out = keep_repeats(list(dict.fromkeys(row.source for row in determinations)))
    sources, others = _keep_lens(sources)
    order = {source: number for number, source in enumerate(sources)}
    by_key: dict[Key, list[Determination]] = {}
    for row in sorted(
        (row for row in determinations if row.source in order), key=lambda row: order[row.source]
    ):
        if row.key.name not in NOT_SHARED:
            by_key.setdefault(row.key, []).append(row)
    latest = {key.name: rows[-1].value for key, rows in by_key.items()}
    drifts = tuple(
        _judge(key, rows, method=method, tolerance=tolerance, latest=latest) for key, rows in by_key.items()
    )
    return drifts, (*left_out, *others)


def _keep_lens(sources: Sequence[Source]) -> tuple[tuple[Source, ...], tuple[LeftOut, ...]]:
    """Return the versions with the lens of the last one: another lens is another camera, not a drift."""
    if not sources:
        return (), ()
    lens = sources[-1].lens
    kept = tuple(source for source in sources if source.lens in {lens, None} or lens is None)
    others = tuple(
        LeftOut(version=source.version, why=f"It was made with lens {source.lens}; the last one with {lens}.")
        for source in sources
        if source not in kept
    )
    return kept, others


def _judge(
    key: Key,
    rows: Sequence[Determination],
    *,
    method: str,
    tolerance: float | None,
    latest: Mapping[str, float],
) -> Drift:
    reference = rows[-1]
    sensitivity = find_sensitivity(method, key, latest, mean=reference.value)
    known = is_clear_of_zero(sensitivity, reference.value, reference.standard_uncertainty)
    limit = None
    if tolerance is not None and sensitivity.unit == main_unit(method):
        limit = sensitivity.accept(tolerance)
    line = fit_line(rows)
    date, why = None, None
    if line is None:
        there = "is 1" if len(rows) == 1 else f"are {len(rows)}"
        why = f"A trend needs three campaigns at different times; there {there}."
    elif limit is None:
        why = "No tolerance was given that holds for it."
    elif not known:
        why = "Its value is not clear of 0, so that a share of it means nothing."
    else:
        date, why = find_date(line, reference=reference.value, limit=limit.limit / sensitivity.factor)
    return _describe(
        key, rows, line, limit, sensitivity.factor if known else None, sensitivity.unit, date, why
    )


def _describe(
    key: Key,
    rows: Sequence[Determination],
    line: Line | None,
    limit: Tolerance | None,
    factor: float | None,
    unit: str,
    date: datetime | None,
    why: str | None,
) -> Drift:
    slope = interval = p_value = cost = None
    span_days = (rows[-1].source.at - rows[0].source.at) / timedelta(days=1)
    accepted = limit.limit / factor if limit is not None and factor else None
    verdict, change, change_error = judge_stability(line, span_days, limit=accepted)
    if line is not None:
        error = DAYS_PER_YEAR * math.sqrt(line.covariance[1][1])
        value = DAYS_PER_YEAR * line.slope_per_day
        half = float(scipy.special.stdtrit(line.dof, 0.5 + CONFIDENCE / 2.0)) * error
        slope = Quantity(value, error, f"{key.unit}/a")
        interval = (value - half, value + half)
        p_value = 2.0 * float(scipy.special.stdtr(line.dof, -abs(value) / error)) if error > 0.0 else None
        if factor is not None:
            cost = Quantity(factor * value, factor * error, f"{unit}/a")
    return Drift(
        key=key,
        determinations=tuple(rows),
        slope=slope,
        slope_interval=interval,
        slope_p_value=p_value,
        cost_per_year=cost,
        scatter=_scatter(rows, line),
        tolerance=limit,
        recalibrate_by=date,
        why=why,
        change=None if change is None or change_error is None else Quantity(change, change_error, key.unit),
        verdict=verdict,
        said=say_stability(
            verdict, with_limit=accepted is not None, repeats=len({row.source.at for row in rows})
        ),
    )


def _scatter(rows: Sequence[Determination], line: Line | None) -> Quantity | None:
    """Return the root mean square about the line over n - 2, not weighted; u(s) = s / sqrt(2 v)."""
    if line is None:
        return None
    squares = [
        (row.value - line.at((row.source.at - line.origin) / timedelta(days=1))[0]) ** 2 for row in rows
    ]
    scatter = math.sqrt(sum(squares) / line.dof)
    return Quantity(scatter, scatter / math.sqrt(2.0 * line.dof), rows[0].key.unit)


_NAMED = "Serial number of the camera, and the number: yaw, pitch, roll, x, y or z."


class RigStability(Record):
    """One number of the orientation of one camera over several sets. What does not exist is None."""

    camera: str = about(_NAMED)
    name: str = about(_NAMED)
    sets: int = about("Number of sets.")
    mean: Quantity = about("Mean of the sets, with its standard uncertainty.")
    repeatability: Quantity | None = about("Standard deviation of one set; None for one.")
    slope: Quantity | None = about("Trend per year; None for fewer than three sets at different times.")
    change: Quantity | None = about("Of the trend from the first set to the last.")
    verdict: Stability = about("Verdict on the change, as on the coefficients of one camera.")
    said: str = about("The verdict in words.")


class RigVersion(Record):
    """Version of one camera of a rig, with its time."""

    version: str
    at: datetime
    member: RigMember


def group_sets(
    cameras: Sequence[Sequence[RigVersion]], count_shared: Callable[[RigMember, RigMember], int]
) -> tuple[tuple[tuple[RigVersion, ...], ...], tuple[LeftOut, ...]]:
    """Group versions by the triggers that their pictures share.

    Each version of the reference takes, of every other camera, the version that shares most triggers with
    it, of equally many the nearest in time: triggers of two days may have the same names.

    Parameters
    ----------
    cameras : sequence of sequence of RigVersion
        Versions of each camera, one per campaign, the reference first.
    count_shared : callable
        ``(member, member) -> int``, how many triggers have a picture of both.

    Returns
    -------
    tuple of (tuple of tuple of RigVersion, tuple of LeftOut)
        Sets in time, one version of each camera in each, and versions that are in none.
    """
    free = [list(each) for each in cameras[1:]]
    sets, why = [], []
    for first in sorted(cameras[0], key=lambda each: (each.at, each.version)):
        members = [first]
        for versions in free:
            shared = {each.version: count_shared(first.member, each.member) for each in versions}
            best = min(
                versions,
                key=lambda each: (-shared[each.version], abs(each.at - first.at), each.version),
                default=None,
            )
            if best is not None and shared[best.version]:
                members.append(best)
        if len(members) < len(cameras):
            why.append(
                LeftOut(version=first.version, why="No version of every other camera shares its triggers.")
            )
            continue
        for versions, member in zip(free, members[1:], strict=True):
            versions.remove(member)
        sets.append(tuple(members))
    why += [
        LeftOut(
            version=each.version,
            why="No version of the reference shares its triggers, or another shares more.",
        )
        for versions in free
        for each in versions
    ]
    return tuple(sets), tuple(why)


def compare_sets(
    sets: Sequence[tuple[datetime, Mapping[tuple[str, str], Quantity]]], *, limits: Mapping[str, float]
) -> tuple[RigStability, ...]:
    """Compare the orientations of several sets, number by number.

    Parameters
    ----------
    sets : sequence of tuple of (datetime, mapping)
        Time and numbers of each set, by camera and name.
    limits : mapping
        Largest accepted change from the first set to the last, by unit.

    Returns
    -------
    tuple of RigStability
        Results by camera and name.
    """
    found: dict[tuple[str, str], list[tuple[datetime, Quantity]]] = {}
    for at, numbers in sorted(sets, key=lambda each: each[0]):
        for key, quantity in numbers.items():
            found.setdefault(key, []).append((at, quantity))
    return tuple(_compare(camera, name, rows, limits) for (camera, name), rows in found.items())


def _compare(
    camera: str, name: str, found: Sequence[tuple[datetime, Quantity]], limits: Mapping[str, float]
) -> RigStability:
    unit = found[0][1].unit
    limit = limits.get(unit)
    rows = [
        Determination(
            key=Key(name=name, unit=unit, model="rig"),
            value=quantity.value,
            standard_uncertainty=quantity.standard_uncertainty,
            source=Source(version=str(number), camera=camera, lens=None, campaign=str(number), at=at),
        )
        for number, (at, quantity) in enumerate(found)
    ]
    count, values = len(rows), np.array([row.value for row in rows])
    spread = float(values.std(ddof=1)) if count > 1 else None
    stated = math.sqrt(sum(row.standard_uncertainty**2 for row in rows)) / count
    line = fit_line(rows)
    span_days = (rows[-1].source.at - rows[0].source.at) / timedelta(days=1)
    verdict, change, error = judge_stability(line, span_days, limit=limit)

    def state(value: float | None, u: float | None, per: str = "") -> Quantity | None:
        known = value is not None and u is not None
        return Quantity(value, u, f"{unit}{per}") if known else None  # type: ignore[arg-type]

    return RigStability(
        camera=camera,
        name=name,
        sets=count,
        mean=Quantity(float(values.mean()), max(stated, (spread or 0.0) / math.sqrt(count)), unit),
        repeatability=state(spread, None if spread is None else spread / math.sqrt(2.0 * (count - 1))),
        slope=state(
            DAYS_PER_YEAR * line.slope_per_day if line else None,
            DAYS_PER_YEAR * math.sqrt(line.covariance[1][1]) if line else None,
            "/a",
        ),
        change=state(change, error),
        verdict=verdict,
        said=say_stability(
            verdict, with_limit=limit is not None, repeats=len({row.source.at for row in rows})
        ),
    )
