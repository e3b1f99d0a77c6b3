"""Verdict on a fleet: whether one set of coefficients serves several cameras."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from radiometry.fitting.evidence import Quantity
from radiometry.fleet import results
from radiometry.fleet.determinations import (
    Determination,
    Effects,
    Grouping,
    Key,
    Matrix,
    Vector,
    fit_effects,
    group_cameras,
    keep_repeats,
)
from radiometry.records import Record


class _Analysis(Record):
    """A solved model with its effect on the result, None where a fraction of the mean is meaningless."""

    key: Key
    grouping: Grouping
    effects: Effects
    sensitivity: results.Sensitivity | None
    tolerance: results.Tolerance | None

    @property
    def testable(self) -> bool:
        return self.effects.dof >= results.LEAST_DOF and self.effects.within_variance > 0.0

    @property
    def contrasts(self) -> Matrix:
        """Contrasts of each camera's deviation: of its body and its lens together."""
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

    def judge(self, deviations: Vector, contrasts: Matrix) -> results.Judgement | None:
        """Make both tests, where they are possible."""
        if not self.testable or self.sensitivity is None or self.tolerance is None:
            return None
        return results.judge_deviations(
            deviations * self.sensitivity.factor,
            self.effects.standard_errors(contrasts) * self.sensitivity.factor,
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
) -> results.ParameterVerdict:
    values = np.array([row.value for row in rows])
    grouping = group_cameras(rows)
    effects = fit_effects(values, grouping.labels) if len(grouping.unit_names) > 1 else None
    # the mean of all values would count a camera as often as it was calibrated
    mean = float(values.mean()) if effects is None else effects.mean
    sensitivity = results.find_sensitivity(method, key, means, mean=mean)
    limit = _find_tolerance(sensitivity, method, key, tolerance)
    without = tuple(sorted(set(cameras) - {row.source.camera for row in rows}))
    if effects is None:
        return _judge_one_camera(key, rows, limit, without)
    analysis = _Analysis(
        key=key,
        grouping=grouping,
        effects=effects,
        sensitivity=sensitivity
        if results.is_clear_of_zero(sensitivity, effects.mean, effects.mean_u)
        else None,
        tolerance=limit,
    )
    judgement = analysis.judge(analysis.deviations, analysis.contrasts)
    return _conclude(analysis, rows, without, judgement)


def _find_tolerance(
    sensitivity: results.Sensitivity, method: str, key: Key, tolerance: float | Mapping[str, float]
) -> results.Tolerance | None:
    if isinstance(tolerance, Mapping):
        entered = tolerance.get(key.name)
    else:
        entered = tolerance if sensitivity.unit == results.main_unit(method) else None
    if entered is None:
        return None
    return sensitivity.accept(entered)


def _judge_one_camera(
    key: Key, rows: Sequence[Determination], limit: results.Tolerance | None, without: tuple[str, ...]
) -> results.ParameterVerdict:
    """Describe one camera alone: there is nothing to compare it with."""
    mean = Quantity(float(np.mean([row.value for row in rows])), rows[-1].standard_uncertainty, key.unit)
    return results.ParameterVerdict(
        key=key,
        outcome="cannot_tell",
        judged=limit is not None,
        said=results.ONE_CAMERA.format(key=key),
        cameras=1,
        repeats=len(rows),
        mean=mean,
        dof=len(rows) - 1,
        tolerance=limit,
        cameras_without=without,
    )


def _conclude(
    analysis: _Analysis,
    rows: Sequence[Determination],
    without: tuple[str, ...],
    judgement: results.Judgement | None,
) -> results.ParameterVerdict:
    key, effects, sensitivity = analysis.key, analysis.effects, analysis.sensitivity
    listed = _list_effects(analysis)
    cost, costliest = _find_cost(analysis)
    needed = None
    if judgement is not None and judgement.outcome == "cannot_tell":
        needed = _count_needed(analysis, listed)
    outcome, said = _decide(analysis, rows, listed, judgement, cost, costliest, needed)
    known = effects.dof > 0
    scatter = math.sqrt(effects.within_variance)
    within = None
    if known:
        within = _variance(
            key, effects.within_variance, effects.within_variance * math.sqrt(2.0 / effects.dof)
        )
    between = sum(effect.between_variance.value for effect in listed)
    between_u = math.hypot(*(effect.between_variance.standard_uncertainty for effect in listed))
    return results.ParameterVerdict(
        key=key,
        outcome=outcome,
        judged=analysis.tolerance is not None,
        said=said,
        cameras=len(analysis.grouping.unit_names),
        repeats=len(rows),
        mean=Quantity(effects.mean, effects.mean_u, key.unit),
        within_variance=within,
        between_variance=_variance(key, between, between_u) if known else None,
        dof=effects.dof,
        f_statistic=effects.f_statistic,
        f_p_value=effects.f_p_value,
        effects=listed if known else (),
        judgement=judgement,
        tolerance=analysis.tolerance,
        # u(s) = s / sqrt(2 v)
        repeatability=_convert(sensitivity, scatter, scatter / math.sqrt(2.0 * effects.dof))
        if known
        else None,
        cost=cost,
        costliest=costliest,
        repeats_needed=needed,
        cameras_without=without,
        flags=results.find_flags(rows, analysis.grouping, effects),
    )


def _decide(
    analysis: _Analysis,
    rows: Sequence[Determination],
    listed: tuple[results.Effect, ...],
    judgement: results.Judgement | None,
    cost: Quantity | None,
    costliest: str | None,
    needed: int | None,
) -> tuple[results.Outcome, str]:
    key, tolerance, count = analysis.key, analysis.tolerance, len(analysis.grouping.unit_names)
    if tolerance is None:
        return "cannot_tell", results.NO_TOLERANCE.format(key=key)
    if (dof := analysis.effects.dof) < results.LEAST_DOF:
        return "cannot_tell", results.TOO_FEW.format(key=key, count=count, repeats=len(rows), dof=dof)
    if len({row.value for row in rows}) == 1:
        return "shared", results.EQUAL.format(key=key, count=count)
    if analysis.effects.within_variance == 0.0:
        return "cannot_tell", results.IDENTICAL.format(key=key)
    if judgement is None or cost is None or costliest is None:
        text = results.NEAR_ZERO if tolerance.kind == "relative" else results.WITHOUT_SCALE
        return "cannot_tell", text.format(key=key)
    return judgement.outcome, results.format_decision(
        judgement.outcome,
        key,
        listed,
        tolerance,
        cost,
        cameras=count,
        costliest=costliest,
        repeats_needed=needed,
    )


def _list_effects(analysis: _Analysis) -> tuple[results.Effect, ...]:
    found = []
    grouping, effects = analysis.grouping, analysis.effects
    for name, labels, levels, factor in zip(
        grouping.names, grouping.labels, grouping.levels, effects.factors, strict=True
    ):
        errors = effects.standard_errors(factor.contrasts)
        repeats = np.bincount(labels, minlength=len(levels))
        found.append(
            results.Effect(
                factor=name,
                deviations=tuple(
                    results.Deviation(
                        label=level,
                        repeats=int(count),
                        deviation=Quantity(value, error, analysis.key.unit),
                        cost=_convert(analysis.sensitivity, value, error),
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
    """Return the largest cost of sharing, without its sign, and the camera."""
    if analysis.sensitivity is None:
        return None, None
    deviations = analysis.deviations
    largest = int(np.argmax(np.abs(deviations)))
    errors = analysis.effects.standard_errors(analysis.contrasts)
    cost = _convert(analysis.sensitivity, abs(float(deviations[largest])), float(errors[largest]))
    return cost, analysis.grouping.unit_names[largest]


def _count_needed(analysis: _Analysis, listed: tuple[results.Effect, ...]) -> int | None:
    """Return the repeats of each camera that would decide, more than there are; None where cameras differ."""
    if analysis.sensitivity is None or analysis.tolerance is None or any(map(results.does_differ, listed)):
        return None
    repeatability = math.sqrt(analysis.effects.within_variance) * analysis.sensitivity.factor
    found = results.count_repeats(
        cameras=len(analysis.grouping.unit_names),
        tolerance_in_repeatabilities=analysis.tolerance.limit / repeatability,
    )
    most = max(each.repeats for effect in listed for each in effect.deviations)
    return None if found is None else max(found, most + 1)


def _convert(sensitivity: results.Sensitivity | None, value: float, error: float) -> Quantity | None:
    if sensitivity is None:
        return None
    factor = sensitivity.factor
    return Quantity(value * factor, error * factor, sensitivity.unit)


def _variance(key: Key, value: float, error: float) -> Quantity:
    return Quantity(value, error, f"({key.unit})^2" if key.unit else "")


def judge_fleet(
    determinations: Sequence[Determination],
    *,
    method: str,
    cameras: Sequence[str],
    tolerance: float | Mapping[str, float],
) -> results.FleetVerdict:
    """Judge every parameter of the determinations, each on its own.

    The model is fitted by `effects.fit_effects` and tested by `verdicts.judge_deviations`::

        y_ij = mu + b_i + w_ij      camera i, repeat j, var(w) = within variance, numbers may be unbalanced

    Assumptions: each repeat of a camera is a campaign of its own. Repeatability is the scatter between
    campaigns, not the stated uncertainties, which include errors that all campaigns share, such as a meter's
    calibration. An error that all cameras share moves their mean and no verdict. An error that one camera's
    campaigns share with each other and not with those of the other cameras (a meter or a target of its own,
    one day for all) counts as a property of that camera. Repeatability is the same for all cameras, and
    nearly normal.

    Parameters
    ----------
    determinations : sequence of Determination
        Values of all cameras, from published versions.
    method : str
        Name of the method, which defines what a difference costs (`sensitivity.find_sensitivity`).
    cameras : sequence of str
        Serial numbers of all cameras in question, also of those without a determination.
    tolerance : float or mapping
        One number for all parameters whose effect is in the method's main unit, or one by name. A fraction
        (0.04) where the cost is in %, else in the unit of the cost.

    Returns
    -------
    FleetVerdict
        Verdicts by key. Overall per_camera if any parameter is; shared if all that were judged are. Flags:
        repeats_exceed_uncertainty, repeats_of_one_day, body_and_lens_confounded.
    """
    kept, left_out = keep_repeats(list(dict.fromkeys(row.source for row in determinations)))
    order = {source: position for position, source in enumerate(kept)}
    by_key: dict[Key, list[Determination]] = {}
    for row in sorted(
        (row for row in determinations if row.source in order), key=lambda row: order[row.source]
    ):
        if row.key.name not in results.NOT_SHARED:
            by_key.setdefault(row.key, []).append(row)
    means = _average(by_key)
    parameters = tuple(
        judge_parameter(key, rows, method=method, cameras=cameras, tolerance=tolerance, means=means)
        for key, rows in by_key.items()
    )
    determined = {source.camera for source in kept}
    outcome = _sum_up(parameters, cameras, determined)
    return results.FleetVerdict(
        outcome=outcome,
        said=_format_verdict(outcome, parameters, cameras, determined),
        parameters=parameters,
        left_out=left_out,
    )


def _average(by_key: Mapping[Key, Sequence[Determination]]) -> dict[str, float]:
    """Return each parameter's mean by name: the effect of one may depend on others."""
    values: dict[str, list[float]] = {}
    for key, rows in by_key.items():
        values.setdefault(key.name, []).extend(row.value for row in rows)
    return {name: sum(found) / len(found) for name, found in values.items()}


def _sum_up(
    parameters: Sequence[results.ParameterVerdict], cameras: Sequence[str], determined: set[str]
) -> results.Outcome:
    outcomes = {parameter.outcome for parameter in parameters if parameter.judged}
    if "per_camera" in outcomes:
        return "per_camera"
    return "shared" if outcomes == {"shared"} and determined.issuperset(cameras) else "cannot_tell"


def _format_verdict(
    outcome: results.Outcome,
    parameters: Sequence[results.ParameterVerdict],
    cameras: Sequence[str],
    determined: set[str],
) -> str:
    judged = [parameter for parameter in parameters if parameter.judged]
    open_questions = [str(each.key) for each in judged if each.outcome == "cannot_tell"]
    lacking = sorted(set(cameras) - determined)
    if lacking:
        open_questions.append(f"{', '.join(lacking)} without a published version")
    elif not judged:
        open_questions.append("no coefficient has a tolerance")
    different = [str(each.key) for each in judged if each.outcome == "per_camera"]
    match outcome:
        case "shared":
            return f"One set of coefficients serves all {len(cameras)} cameras."
        case "per_camera":
            return f"Each camera needs its own set: {'; '.join(different)}."
        case "cannot_tell":
            questions = "; ".join(open_questions)
            return f"Cannot tell whether one set serves all {len(cameras)} cameras: {questions}."
