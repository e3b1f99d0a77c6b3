"""The fleet's verdict: of each parameter, does one value serve all cameras, and what does sharing cost."""

from collections.abc import Mapping, Sequence

from radiometry.fleet import messages
from radiometry.fleet.determinations import Determination, Key, Source, keep_repeats
from radiometry.fleet.meaning import NOT_SHARED
from radiometry.fleet.parameter import judge_parameter
from radiometry.fleet.results import FleetVerdict, ParameterVerdict
from radiometry.fleet.verdicts import Outcome


def judge_fleet(
    determinations: Sequence[Determination],
    *,
    method: str,
    cameras: Sequence[str],
    tolerance: float | Mapping[str, float],
) -> FleetVerdict:
    """Judge every parameter that the determinations hold; each verdict stands by itself.

        y_ij = mu + b_i + w_ij      camera i, repeat j, var(w) = within variance, numbers may be unbalanced

    What is assumed: repeats of a camera are campaigns of its own. Only what differs between them is
    repeatability, and it is taken from the scatter between them, not from the stated uncertainties: these
    hold errors that all campaigns share, a meter's calibration for one. Shared by all cameras, such an error
    moves their mean and no verdict. An error that one camera's campaigns share with each other and not with
    those of the other cameras (a meter or a target of its own, one day for all) is taken for a property of
    that camera. Repeatability is the same for all cameras, and nearly normal.

    Takes
      method : says what a difference is felt as (`meaning.give_meaning`)
      cameras : serial numbers of all that were asked about, also of those without a determination
      tolerance : one number for all parameters that are felt in the method's main unit, or one by name;
        a share (0.04) where the cost is in %, else in the unit of the cost
    Returns verdicts by key; overall per_camera when any parameter is, shared when all that were judged are
    Flags  repeats_exceed_uncertainty, repeats_of_one_day, body_and_lens_confounded
    Source: `judging.judge_deviations`, `effects.fit_effects`
    """
    kept, left_out = keep_repeats(_list_sources(determinations))
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
    outcome = _sum_up(parameters, cameras, {source.camera for source in kept})
    return FleetVerdict(
        outcome=outcome,
        said=_say(outcome, parameters, cameras, {source.camera for source in kept}),
        parameters=parameters,
        left_out=left_out,
    )


def _list_sources(determinations: Sequence[Determination]) -> list[Source]:
    return list(dict.fromkeys(row.source for row in determinations))


def _average(by_key: Mapping[Key, Sequence[Determination]]) -> dict[str, float]:
    """Give each parameter's mean by name, for what one needs to know of the others."""
    values: dict[str, list[float]] = {}
    for key, rows in by_key.items():
        values.setdefault(key.name, []).extend(row.value for row in rows)
    return {name: sum(found) / len(found) for name, found in values.items()}


def _sum_up(parameters: Sequence[ParameterVerdict], cameras: Sequence[str], determined: set[str]) -> Outcome:
    outcomes = {parameter.outcome for parameter in parameters if parameter.judged}
    if "per_camera" in outcomes:
        return "per_camera"
    return "shared" if outcomes == {"shared"} and determined.issuperset(cameras) else "cannot_tell"


def _say(
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
    return messages.format_fleet(outcome, len(cameras), different, open_questions)
