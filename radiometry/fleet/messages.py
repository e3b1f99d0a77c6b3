"""Sentences of verdicts on a fleet, for the person who decides."""

from radiometry.drawing.text import in_step
from radiometry.fitting.evidence import Quantity
from radiometry.fleet.determinations import Key
from radiometry.fleet.power import POWER
from radiometry.fleet.results import Effect, Tolerance
from radiometry.fleet.verdicts import LEAST_DOF, Outcome

_SIGNIFICANT = 0.05
"""Of the F test, which only words the verdict: whether a difference is certain, however small."""
_PLURAL = {"camera": "cameras", "body": "bodies", "lens": "lenses"}

ONE_CAMERA = "{key}: cannot tell. Only one camera has it: publish a version of another."
TOO_FEW = (
    "{key}: cannot tell. {repeats} determinations of {count} cameras leave {dof} degrees of freedom for the "
    f"repeatability, fewer than {LEAST_DOF}: calibrate cameras again, in campaigns of their own."
)
IDENTICAL = (
    "{key}: cannot tell. The repeats of each camera agree to the last digit: they were copied, or held "
    "fixed, and say nothing about repeatability."
)
EQUAL = "{key}: one set serves all {count} cameras. All its values are equal."
NO_TOLERANCE = "{key}: not judged. No tolerance was given for it: name it in `tolerance`."
NEAR_ZERO = "{key}: cannot tell. Its mean is not clear of 0, so that a share of it means nothing."
WITHOUT_SCALE = (
    "{key}: cannot tell. What it moves in the corner follows from fx_px, fy_px, cx_px and cy_px, and not all "
    "of them are there."
)


def does_differ(effect: Effect) -> bool:
    """Return True if the F test finds the levels different.

    Parameters
    ----------
    effect : Effect
        Effect of one factor.
    """
    return effect.f_p_value is not None and effect.f_p_value < _SIGNIFICANT


def format_decision(
    outcome: Outcome,
    key: Key,
    effects: tuple[Effect, ...],
    tolerance: Tolerance,
    cost: Quantity,
    *,
    cameras: int,
    costliest: str,
    repeats_needed: int | None,
) -> str:
    """Return the sentences of a verdict that was tested.

    Parameters
    ----------
    outcome : {"shared", "per_camera", "cannot_tell"}
        The verdict.
    key, effects, tolerance, cost, cameras, costliest, repeats_needed
        As in `results.ParameterVerdict`.
    """
    limit = f"{tolerance.limit:.3g} {tolerance.unit} {tolerance.of}"
    value, u = in_step(cost.value, cost.standard_uncertainty)
    shown = f"{value} {cost.unit} (u = {u} {cost.unit})"
    match outcome:
        case "shared":
            said = (
                f"one set serves all {cameras} cameras. Each lies within {limit} of their mean; sharing "
                f"costs {costliest} the most, {shown}."
            )
        case "per_camera":
            said = (
                f"one set does not serve all {cameras} cameras. {costliest} lies {shown} off their mean, "
                f"more than the {limit} that are accepted: each camera needs its own."
            )
        case "cannot_tell":
            found, more = _explain_open(effects, limit, repeats_needed)
            said = f"cannot tell. {found}: {costliest} lies the furthest off the mean, {shown}. {more}"
    return f"{key}: {said}{_format_parts(effects)}"


def _explain_open(effects: tuple[Effect, ...], limit: str, repeats_needed: int | None) -> tuple[str, str]:
    differ = [_PLURAL[effect.factor] for effect in effects if does_differ(effect)]
    if differ:
        return (
            f"The {' and the '.join(differ)} do differ; that it is by more than {limit} is not shown, nor "
            "that it is by less"
        ), "More repeats of each camera decide it."
    found = f"No difference is certain, and neither is that none exceeds {limit}"
    if repeats_needed is None:
        return (
            found,
            "The repeatability is too poor: no number of repeats that can be asked for would show it.",
        )
    return found, (
        f"If they are alike, {repeats_needed} repeats of each camera show it with a probability of "
        f"{100.0 * POWER:.0f} %."
    )


def _format_parts(effects: tuple[Effect, ...]) -> str:
    """Return which of body and lens makes the difference, where that is known."""
    words = {
        "shared": "agree within the tolerance",
        "per_camera": "differ by more than the tolerance",
        "cannot_tell": "may or may not differ by more than the tolerance",
    }
    parts = [
        f"the {_PLURAL[effect.factor]} {words[effect.judgement.outcome]}"
        for effect in effects
        if len(effects) > 1 and effect.judgement is not None
    ]
    return f" By themselves {' and '.join(parts)}." if parts else ""
