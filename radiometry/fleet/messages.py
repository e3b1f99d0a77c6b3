"""What is said of a verdict, in sentences for somebody who has to decide."""

from radiometry.fitting.evidence import Quantity
from radiometry.fleet.determinations import Key
from radiometry.fleet.planning import POWER
from radiometry.fleet.results import Effect, Tolerance
from radiometry.fleet.verdicts import LEAST_DOF, Outcome

_SURE = 0.05
"""Of the F test, which only words the verdict: whether a difference is certain, however small."""


def show(quantity: Quantity) -> str:
    """Give a value with its standard uncertainty to two digits: 83.4 px (u = 1.2 px)."""
    return f"{quantity.value:.3g} {quantity.unit} (u = {quantity.standard_uncertainty:.2g} {quantity.unit})"


def show_limit(tolerance: Tolerance) -> str:
    """Give the tolerance: 4 % of the luminance."""
    return f"{tolerance.limit:.3g} {tolerance.unit} {tolerance.of}"


def format_shared(key: Key, count: int, tolerance: Tolerance, cost: Quantity, costliest: str) -> str:
    """One set is enough."""
    return (
        f"{key}: one set serves all {count} cameras. Each lies within {show_limit(tolerance)} of their mean; "
        f"sharing costs {costliest} the most, {show(cost)}."
    )


def format_per_camera(key: Key, count: int, tolerance: Tolerance, cost: Quantity, costliest: str) -> str:
    """One set is not enough."""
    return (
        f"{key}: one set does not serve all {count} cameras. {costliest} lies {show(cost)} off their mean, "
        f"more than the {show_limit(tolerance)} that are accepted: each camera needs its own."
    )


def does_differ(effect: Effect) -> bool:
    """Tell whether the F test finds the levels different."""
    return effect.f_p_value is not None and effect.f_p_value < _SURE


def format_neither(
    key: Key,
    effects: tuple[Effect, ...],
    tolerance: Tolerance,
    cost: Quantity,
    costliest: str,
    repeats_needed: int | None,
) -> str:
    """Neither was shown."""
    differ = [effect.factor for effect in effects if does_differ(effect)]
    plural = {"camera": "cameras", "body": "bodies", "lens": "lenses"}
    limit = show_limit(tolerance)
    found = (
        f"The {' and the '.join(plural[each] for each in differ)} do differ; that it is by more than {limit} "
        "is not shown, nor that it is by less"
        if differ
        else f"No difference is certain, and neither is that none exceeds {limit}"
    )
    if differ:
        more = "More repeats of each camera decide it."
    elif repeats_needed is None:
        more = "The repeatability is too poor: no number of repeats that can be asked for would show it."
    else:
        more = (
            f"If they are alike, {repeats_needed} repeats of each camera show it with a probability of "
            f"{100.0 * POWER:.0f} %."
        )
    return f"{key}: cannot tell. {found}: {costliest} lies the furthest off the mean, {show(cost)}. {more}"


def format_parts(effects: tuple[Effect, ...]) -> str:
    """Add which of body and lens does it, where that is known."""
    words = {
        "shared": "agree within the tolerance",
        "per_camera": "differ by more than the tolerance",
        "cannot_tell": "may or may not differ by more than the tolerance",
    }
    plural = {"camera": "cameras", "body": "bodies", "lens": "lenses"}
    parts = [
        f"the {plural[effect.factor]} {words[effect.judgement.outcome]}"
        for effect in effects
        if len(effects) > 1 and effect.judgement is not None
    ]
    return f" By themselves {' and '.join(parts)}." if parts else ""


def format_one_camera(key: Key) -> str:
    """Nothing to compare with."""
    return f"{key}: cannot tell. Only one camera has it: publish a version of another."


def format_too_few(key: Key, count: int, repeats: int, dof: int) -> str:
    """Not enough to test anything."""
    return (
        f"{key}: cannot tell. {repeats} determinations of {count} cameras leave {dof} degrees of freedom for "
        f"the repeatability, fewer than {LEAST_DOF}: calibrate cameras again, in campaigns of their own."
    )


def format_identical(key: Key) -> str:
    """Repeats that are none."""
    return (
        f"{key}: cannot tell. The repeats of each camera agree to the last digit: they were copied, or held "
        "fixed, and say nothing about repeatability."
    )


def format_equal(key: Key, count: int) -> str:
    """All the same."""
    return f"{key}: one set serves all {count} cameras. All its values are equal."


def format_no_tolerance(key: Key) -> str:
    """Nobody said how much is accepted."""
    return f"{key}: not judged. No tolerance was given for it: name it in `tolerance`."


def format_near_zero(key: Key) -> str:
    """A share of nothing."""
    return f"{key}: cannot tell. Its mean is not clear of 0, so that a share of it means nothing."


def format_without_scale(key: Key) -> str:
    """The conversion is lacking."""
    return (
        f"{key}: cannot tell. What it moves in the corner follows from fx_px, fy_px, cx_px and cy_px, and "
        "not all of them are there."
    )


def format_fleet(outcome: Outcome, asked: int, per_camera: list[str], open_questions: list[str]) -> str:
    """Sum up."""
    match outcome:
        case "shared":
            return f"One set of coefficients serves all {asked} cameras."
        case "per_camera":
            return f"Each camera needs its own set: {'; '.join(per_camera)}."
        case "cannot_tell":
            return f"Cannot tell whether one set serves all {asked} cameras: {'; '.join(open_questions)}."
