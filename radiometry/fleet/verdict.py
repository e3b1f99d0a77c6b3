"""Verdict on a fleet: whether one value of each parameter serves all cameras, and what sharing costs."""

from collections.abc import Mapping, Sequence

from radiometry.fleet.determinations import Determination, Key, keep_repeats
from radiometry.fleet.parameter import judge_parameter
from radiometry.fleet.results import FleetVerdict, ParameterVerdict
from radiometry.fleet.sensitivity import NOT_SHARED
from radiometry.fleet.verdicts import Outcome


def judge_fleet(
    determinations: Sequence[Determination],
    *,
    method: str,
    cameras: Sequence[str],
    tolerance: float | Mapping[str, float],
) -> FleetVerdict:
    """Judge every parameter of the determinations, each on its own.

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

    Notes
    -----
    The model is fitted by `effects.fit_effects` and tested by `verdicts.judge_deviations`::

        y_ij = mu + b_i + w_ij      camera i, repeat j, var(w) = within variance, numbers may be unbalanced

    Assumptions: each repeat of a camera is a campaign of its own. Repeatability is the scatter between
    campaigns, not the stated uncertainties, which include errors that all campaigns share, such as a meter's
    calibration. An error that all cameras share moves their mean and no verdict. An error that one camera's
    campaigns share with each other and not with those of the other cameras (a meter or a target of its own,
    one day for all) counts as a property of that camera. Repeatability is the same for all cameras, and
    nearly normal.
    """
    kept, left_out = keep_repeats(list(dict.fromkeys(row.source for row in determinations)))
    order = {source: position for position, source in enumerate(kept)}
    by_key: dict[Key, list[Determination]] = {}
    for row in sorted(
        (row for row in determinations if row.source in order), key=lambda row: order[row.source]
    ):
        if row.key.name not in NOT_SHARED:
            by_key.setdefault(row.key, []).append(row)
    means = _average(by_key)
    parameters = tuple(
        judge_parameter(key, rows, method=method, cameras=cameras, tolerance=tolerance, means=means)
        for key, rows in by_key.items()
    )
    determined = {source.camera for source in kept}
    outcome = _sum_up(parameters, cameras, determined)
    return FleetVerdict(
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


def _sum_up(parameters: Sequence[ParameterVerdict], cameras: Sequence[str], determined: set[str]) -> Outcome:
    outcomes = {parameter.outcome for parameter in parameters if parameter.judged}
    if "per_camera" in outcomes:
        return "per_camera"
    return "shared" if outcomes == {"shared"} and determined.issuperset(cameras) else "cannot_tell"


def _format_verdict(
    outcome: Outcome, parameters: Sequence[ParameterVerdict], cameras: Sequence[str], determined: set[str]
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
