"""One parameter of a fleet: variance components, tests, and what sharing it costs."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from radiometry.fitting.evidence import Quantity
from radiometry.fleet import messages
from radiometry.fleet.determinations import Determination, Key
from radiometry.fleet.effects import Effects, Matrix, Vector, fit_effects
from radiometry.fleet.findings import find_flags
from radiometry.fleet.grouping import Grouping, group_cameras
from radiometry.fleet.meaning import Meaning, give_meaning, is_clear_of_zero, main_unit
from radiometry.fleet.planning import count_repeats
from radiometry.fleet.results import Deviation, Effect, ParameterVerdict, Tolerance
from radiometry.fleet.verdicts import LEAST_DOF, Judgement, Outcome, judge_deviations


@dataclass(frozen=True, kw_only=True)
class _Analysis:
    """A solved model with what it is felt as; ``meaning`` : None where a share of the mean means nothing."""

    key: Key
    grouping: Grouping
    effects: Effects
    meaning: Meaning | None
    tolerance: Tolerance | None

    @property
    def testable(self) -> bool:
        return self.effects.dof >= LEAST_DOF and self.effects.within_variance > 0.0

    @property
    def contrasts(self) -> Matrix:
        """Of each camera's deviation: its body's and its lens's together."""
        parts = zip(*self.grouping.units, strict=True)
        factors = self.effects.factors
        rows = [factor.contrasts[list(at)] for factor, at in zip(factors, parts, strict=True)]
        total: Matrix = np.sum(rows, axis=0)
        return total

    @property
    def deviations(self) -> Vector:
        parts = zip(*self.grouping.units, strict=True)
        rows = [factor.deviations[list(at)] for factor, at in zip(self.effects.factors, parts, strict=True)]
        total: Vector = np.sum(rows, axis=0)
        return total

    def judge(self, deviations: Vector, contrasts: Matrix) -> Judgement | None:
        """Make both tests, where there is what they need."""
        if not self.testable or self.meaning is None or self.tolerance is None:
            return None
        return judge_deviations(
            deviations * self.meaning.factor,
            self.effects.standard_errors(contrasts) * self.meaning.factor,
            dof=self.effects.dof,
            limit=self.tolerance.limit,
        )


def judge_parameter(
    key: Key,
    rows: Sequence[Determination],
    *,
    method: str,
    cameras: Sequence[str],
    tolerance: float | Mapping[str, float],
    means: Mapping[str, float],
) -> ParameterVerdict:
    """Judge one parameter from its determinations, of which there is at least one.

    Takes
      means : of every parameter by name, for what needs another's; the others as `verdict.judge_fleet`
    Flags  repeats_exceed_uncertainty, repeats_of_one_day, body_and_lens_confounded
    """
    values = np.array([row.value for row in rows])
    grouping = group_cameras(rows)
    effects = fit_effects(values, grouping.labels) if len(grouping.unit_names) > 1 else None
    # of the shared value, not of all values: these count a camera as often as it was calibrated
    mean = float(values.mean()) if effects is None else effects.mean
    meaning = give_meaning(method, key, means, mean=mean)
    limit = _find_tolerance(meaning, method, key, tolerance)
    without = tuple(sorted(set(cameras) - {row.source.camera for row in rows}))
    if effects is None:
        return _judge_one_camera(key, rows, limit, without)
    analysis = _Analysis(
        key=key,
        grouping=grouping,
        effects=effects,
        meaning=meaning if is_clear_of_zero(meaning, effects.mean, effects.mean_u) else None,
        tolerance=limit,
    )
    judgement = analysis.judge(analysis.deviations, analysis.contrasts)
    return _conclude(analysis, rows, without, judgement)


def _find_tolerance(
    meaning: Meaning, method: str, key: Key, tolerance: float | Mapping[str, float]
) -> Tolerance | None:
    if isinstance(tolerance, Mapping):
        entered = tolerance.get(key.name)
    else:
        entered = tolerance if meaning.unit == main_unit(method) else None
    if entered is None:
        return None
    return Tolerance(limit=meaning.limit(entered), unit=meaning.unit, kind=meaning.kind, of=meaning.of)


def _judge_one_camera(
    key: Key, rows: Sequence[Determination], limit: Tolerance | None, without: tuple[str, ...]
) -> ParameterVerdict:
    """Say of one camera alone what there is to say: there is nothing to compare it with."""
    mean = Quantity(
        value=float(np.mean([row.value for row in rows])),
        standard_uncertainty=rows[-1].standard_uncertainty,
        unit=key.unit,
    )
    return ParameterVerdict(
        key=key,
        outcome="cannot_tell",
        judged=limit is not None,
        said=messages.format_one_camera(key),
        cameras=1,
        repeats=len(rows),
        mean=mean,
        within_variance=None,
        between_variance=None,
        dof=len(rows) - 1,
        f_statistic=None,
        f_p_value=None,
        effects=(),
        judgement=None,
        tolerance=limit,
        repeatability=None,
        cost=None,
        costliest=None,
        repeats_needed=None,
        cameras_without=without,
        flags=(),
    )


def _conclude(
    analysis: _Analysis,
    rows: Sequence[Determination],
    without: tuple[str, ...],
    judgement: Judgement | None,
) -> ParameterVerdict:
    effects, meaning = analysis.effects, analysis.meaning
    listed = _list_effects(analysis)
    cost, costliest = _find_cost(analysis)
    needed = None
    if judgement is not None and judgement.outcome == "cannot_tell":
        needed = _count_needed(analysis, listed)
    outcome, said = _decide(analysis, rows, listed, judgement, cost, costliest, needed)
    known = effects.dof > 0
    within = _variance(analysis.key, effects.within_variance, _variance_u(effects)) if known else None
    between = sum(effect.between_variance.value for effect in listed)
    between_u = math.hypot(*(effect.between_variance.standard_uncertainty for effect in listed))
    return ParameterVerdict(
        key=analysis.key,
        outcome=outcome,
        judged=analysis.tolerance is not None,
        said=said,
        cameras=len(analysis.grouping.unit_names),
        repeats=len(rows),
        mean=Quantity(value=effects.mean, standard_uncertainty=effects.mean_u, unit=analysis.key.unit),
        within_variance=within,
        between_variance=_variance(analysis.key, between, between_u) if known else None,
        dof=effects.dof,
        f_statistic=effects.f_statistic,
        f_p_value=effects.f_p_value,
        effects=listed if known else (),
        judgement=judgement,
        tolerance=analysis.tolerance,
        repeatability=_felt_scatter(effects, meaning) if known and meaning else None,
        cost=cost,
        costliest=costliest,
        repeats_needed=needed,
        cameras_without=without,
        flags=find_flags(rows, analysis.grouping, effects),
    )


def _decide(
    analysis: _Analysis,
    rows: Sequence[Determination],
    listed: tuple[Effect, ...],
    judgement: Judgement | None,
    cost: Quantity | None,
    costliest: str | None,
    needed: int | None,
) -> tuple[Outcome, str]:
    key, tolerance, count = analysis.key, analysis.tolerance, len(analysis.grouping.unit_names)
    if tolerance is None:
        return "cannot_tell", messages.format_no_tolerance(key)
    if analysis.effects.dof < LEAST_DOF:
        return "cannot_tell", messages.format_too_few(key, count, len(rows), analysis.effects.dof)
    if len({row.value for row in rows}) == 1:
        return "shared", messages.format_equal(key, count)
    if analysis.effects.within_variance == 0.0:
        return "cannot_tell", messages.format_identical(key)
    if judgement is None or cost is None or costliest is None:
        say = messages.format_near_zero if tolerance.kind == "relative" else messages.format_without_scale
        return "cannot_tell", say(key)
    match judgement.outcome:
        case "shared":
            said = messages.format_shared(key, count, tolerance, cost, costliest)
        case "per_camera":
            said = messages.format_per_camera(key, count, tolerance, cost, costliest)
        case "cannot_tell":
            said = messages.format_neither(key, listed, tolerance, cost, costliest, needed)
    return judgement.outcome, said + messages.format_parts(listed)


def _list_effects(analysis: _Analysis) -> tuple[Effect, ...]:
    found = []
    grouping, effects = analysis.grouping, analysis.effects
    for name, labels, levels, factor in zip(
        grouping.names, grouping.labels, grouping.levels, effects.factors, strict=True
    ):
        errors = effects.standard_errors(factor.contrasts)
        repeats = np.bincount(labels, minlength=len(levels))
        found.append(
            Effect(
                factor=name,
                deviations=tuple(
                    Deviation(
                        label=level,
                        repeats=int(count),
                        deviation=Quantity(value=value, standard_uncertainty=error, unit=analysis.key.unit),
                        cost=_feel(analysis.meaning, value, error),
                    )
                    for level, count, value, error in zip(
                        levels, repeats, factor.deviations.tolist(), errors.tolist(), strict=True
                    )
                ),
                between_variance=_variance(analysis.key, factor.variance, factor.variance_u),
                dof=factor.dof,
                f_statistic=factor.f_statistic,
                f_p_value=factor.f_p_value,
                judgement=analysis.judge(factor.deviations, factor.contrasts),
            )
        )
    return tuple(found)


def _find_cost(analysis: _Analysis) -> tuple[Quantity | None, str | None]:
    """Give the largest cost of sharing, without its sign, and whose it is."""
    if analysis.meaning is None:
        return None, None
    deviations = analysis.deviations
    largest = int(np.argmax(np.abs(deviations)))
    errors = analysis.effects.standard_errors(analysis.contrasts)
    cost = _feel(analysis.meaning, abs(float(deviations[largest])), float(errors[largest]))
    return cost, analysis.grouping.unit_names[largest]


def _count_needed(analysis: _Analysis, listed: tuple[Effect, ...]) -> int | None:
    """Give the repeats of each camera that would tell, more than there are; unknown where they differ."""
    if analysis.meaning is None or analysis.tolerance is None or any(map(messages.does_differ, listed)):
        return None
    repeatability = math.sqrt(analysis.effects.within_variance) * analysis.meaning.factor
    found = count_repeats(
        cameras=len(analysis.grouping.unit_names),
        tolerance_in_repeatabilities=analysis.tolerance.limit / repeatability,
    )
    most = max(each.repeats for effect in listed for each in effect.deviations)
    return None if found is None else max(found, most + 1)


def _feel(meaning: Meaning | None, value: float, error: float) -> Quantity | None:
    if meaning is None:
        return None
    factor = meaning.factor
    return Quantity(value=value * factor, standard_uncertainty=error * factor, unit=meaning.unit)


def _felt_scatter(effects: Effects, meaning: Meaning) -> Quantity | None:
    """Give the repeatability s as it is felt; u(s) = s / sqrt(2 v)."""
    scatter = math.sqrt(effects.within_variance)
    return _feel(meaning, scatter, scatter / math.sqrt(2.0 * effects.dof))


def _variance_u(effects: Effects) -> float:
    return effects.within_variance * math.sqrt(2.0 / effects.dof)


def _variance(key: Key, value: float, error: float) -> Quantity:
    return Quantity(value=value, standard_uncertainty=error, unit=f"({key.unit})^2" if key.unit else "")
