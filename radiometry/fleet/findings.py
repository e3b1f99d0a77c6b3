"""Findings of a fleet, what its comparison could have seen, and the sentences about it."""

import math
from collections.abc import Sequence
from datetime import timedelta

import numpy as np
import scipy

from radiometry.drawing.text import in_step
from radiometry.findings import Raised, declared, flag
from radiometry.fitting.evidence import Quantity
from radiometry.fleet.determinations import Determination, Effects, Grouping, Key
from radiometry.fleet.results import ALPHA, LEAST_DOF, Effect, Outcome, Tolerance

REPEATS_EXCEED_UNCERTAINTY = flag(
    "repeats_exceed_uncertainty",
    "Repeated calibrations of a camera scatter by more than their stated uncertainties explain, with 99 %.",
    "Check for drift, an error that was not stated, or one wrong campaign. The verdict uses the larger "
    "scatter.",
    "fleet",
)
REPEATS_OF_ONE_DAY = flag(
    "repeats_of_one_day",
    "All repeats of each camera are from one day: changes between days are not in the repeatability.",
    "Repeat on another day.",
    "fleet",
)
BODY_AND_LENS_CONFOUNDED = flag(
    "body_and_lens_confounded",
    "No swaps link all bodies and lenses: a difference cannot be assigned to the body or to the lens.",
    "Calibrate bodies with swapped lenses. The verdict on the pairs as they are holds.",
    "fleet",
)

FINDINGS = declared(globals())


_CHANCE = 0.01
_ONE_DAY = timedelta(days=1)


def find_flags(rows: Sequence[Determination], grouping: Grouping, effects: Effects) -> tuple[Raised, ...]:
    where = str(rows[0].key)
    found = []
    stated = float(np.mean([row.standard_uncertainty**2 for row in rows]))
    if effects.dof > 0 and stated > 0.0:
        ratio = effects.within_variance / stated
        if ratio > float(scipy.special.chdtri(effects.dof, _CHANCE)) / effects.dof:
            found.append(
                REPEATS_EXCEED_UNCERTAINTY.at(
                    where, f"Repeats scatter {ratio**0.5:.2g} times as much as their standard uncertainties."
                )
            )
    if effects.dof > 0 and _are_of_one_day(rows):
        found.append(REPEATS_OF_ONE_DAY.at(where, "All repeats of each camera lie within 24 hours."))
    if grouping.confounded:
        found.append(
            BODY_AND_LENS_CONFOUNDED.at(
                where, f"{len(grouping.unit_names)} pairs of body and lens, and no swaps that link them all."
            )
        )
    return tuple(found)


def _are_of_one_day(rows: Sequence[Determination]) -> bool:
    times: dict[str, list[float]] = {}
    for row in rows:
        times.setdefault(row.source.camera, []).append(row.source.at.timestamp())
    return all(max(found) - min(found) <= _ONE_DAY.total_seconds() for found in times.values())


POWER = 0.9  # Required probability that equal cameras are found equal

MOST_REPEATS = 100

_STEPS = 400


def compute_power(*, cameras: int, repeats: int, tolerance_in_repeatabilities: float) -> float:
    """Compute a lower limit of the probability that equal cameras are found to be shared.

    A camera's deviation has the standard deviation c = sqrt((1 - 1 / k) / n) repeatabilities, v = k (n - 1),
    and passes `verdicts.judge_deviations` when |d| + t_{1-alpha,v} s c < T. With s^2 v ~ chi^2_v, per
    camera::

        p = E_s[2 Phi((T - t s c) / c) - 1]+,     power >= 1 - k (1 - p)         (Bonferroni)
    """
    dof = cameras * (repeats - 1)
    if dof < LEAST_DOF:
        return 0.0
    spread = math.sqrt((1.0 - 1.0 / cameras) / repeats)
    quantile = float(scipy.special.stdtrit(dof, 1.0 - ALPHA))
    # the mean over s, at the middles of slices of equal probability
    scatter = np.sqrt(scipy.special.chdtri(dof, (np.arange(_STEPS) + 0.5) / _STEPS) / dof)
    room = tolerance_in_repeatabilities / spread - quantile * scatter
    passing = float(np.mean(np.where(room > 0.0, 2.0 * scipy.special.ndtr(room) - 1.0, 0.0)))
    return max(0.0, 1.0 - cameras * (1.0 - passing))


def count_repeats(*, cameras: int, tolerance_in_repeatabilities: float) -> int | None:
    """Find the repeats of each camera with which equal cameras are found shared in `POWER` of the cases."""
    for repeats in range(2, MOST_REPEATS + 1):
        power = compute_power(
            cameras=cameras, repeats=repeats, tolerance_in_repeatabilities=tolerance_in_repeatabilities
        )
        if power >= POWER:
            return repeats
    return None


# Of the F test, which only words the verdict: whether a difference is certain, however small
_SIGNIFICANT = 0.05
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
    """Return the sentences of a verdict that was tested."""
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
