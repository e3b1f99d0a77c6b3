"""Drift of one camera's coefficients between campaigns, and the date until which they may be used."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

import scipy

from radiometry.fitting.evidence import Quantity
from radiometry.fleet.determinations import Determination, Key, LeftOut, Source, keep_repeats
from radiometry.fleet.line import (
    CONFIDENCE,
    DAYS_PER_YEAR,
    Line,
    Stability,
    find_date,
    fit_line,
    judge_stability,
    say_stability,
)
from radiometry.fleet.results import Tolerance
from radiometry.fleet.sensitivity import NOT_SHARED, find_sensitivity, is_clear_of_zero, main_unit


@dataclass(frozen=True, kw_only=True)
class Drift:
    """The trend of one coefficient. What a field lacks is None.

    Attributes
    ----------
    determinations : tuple of Determination
        Those used, in time.
    slope : Quantity or None
        In the unit of the coefficient per year.
    slope_interval : tuple or None
        For 95 %, in the slope's unit.
    slope_p_value : float or None
        Small: it drifts.
    cost_per_year : Quantity or None
        The slope as its effect on the result.
    scatter : Quantity or None
        Of one determination about the line.
    recalibrate_by : datetime or None
        Before this time the camera is within the tolerance with 95 % on either side.
    why : str or None
        Why there is no date.
    change : Quantity or None
        Of the line from the first determination to the last, in the unit of the coefficient.
    verdict : {"stable", "drifts", "cannot_tell"}
        By `judge_stability`.
    said : str
        The verdict in words.
    """

    key: Key
    determinations: tuple[Determination, ...]
    slope: Quantity | None
    slope_interval: tuple[float, float] | None
    slope_p_value: float | None
    cost_per_year: Quantity | None
    scatter: Quantity | None
    tolerance: Tolerance | None
    recalibrate_by: datetime | None
    why: str | None
    change: Quantity | None
    verdict: Stability
    said: str


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
        slope = Quantity(value=value, standard_uncertainty=error, unit=f"{key.unit}/a")
        interval = (value - half, value + half)
        p_value = 2.0 * float(scipy.special.stdtr(line.dof, -abs(value) / error)) if error > 0.0 else None
        if factor is not None:
            cost = Quantity(value=factor * value, standard_uncertainty=factor * error, unit=f"{unit}/a")
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
        change=None
        if change is None or change_error is None
        else Quantity(value=change, standard_uncertainty=change_error, unit=key.unit),
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
    return Quantity(
        value=scatter, standard_uncertainty=scatter / math.sqrt(2.0 * line.dof), unit=rows[0].key.unit
    )
