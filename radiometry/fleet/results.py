"""Results of a comparison of cameras, its flags and sentences, and what a difference costs."""

import math
from collections.abc import Mapping, Sequence
from datetime import timedelta
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from radiometry.drawing.text import in_step
from radiometry.findings import Raised, declare, flag
from radiometry.fitting.evidence import Quantity
from radiometry.fleet.determinations import Determination, Effects, Grouping, Key, LeftOut
from radiometry.methods import get_method
from radiometry.records import Record, about

Vector = NDArray[np.float64]
Outcome = Literal["shared", "per_camera", "cannot_tell"]

# Largest error rate: "shared" of a fleet that exceeds the tolerance, "per_camera" of one within it
ALPHA = 0.05

# Fewest degrees of freedom of the repeatability. With fewer its relative uncertainty is above 1 / sqrt(2 * 3)
# = 41 %, for a normal distribution that cannot be checked: there is no verdict then.
LEAST_DOF = 3


class Judgement(Record):
    """An outcome and both tests behind it."""

    outcome: Outcome
    equivalence_p_value: float  # Small: all deviations lie within the tolerance
    exceedance_p_value: float  # Small: at least one lies outside


def judge_deviations(deviations: Vector, standard_errors: Vector, *, dof: int, limit: float) -> Judgement:
    """Test each level's deviation d_i from the mean of all against +-limit, with both error rates limited.

    The question is about these cameras, not the population that they are drawn from: the cameras are counted
    and known, and five of them hardly determine a standard deviation between cameras (its upper limit is 2.4
    times its estimate). So the test is on each camera's deviation from the set they would share::

        shared      max_i P(t_v < (|d_i| - limit) / u_i) < alpha        every |delta_i| < limit
        per_camera  2 k min_i P(t_v > (|d_i| - limit) / u_i) < alpha    some |delta_i| > limit

    The first is two one-sided tests of each camera [2]; all must pass, so that no correction for their number
    is needed (intersection-union [1]): for any fleet in which a camera exceeds the tolerance, the probability
    of "shared" is at most alpha. The second is Bonferroni's over k cameras and two sides: for a fleet within
    the tolerance, the probability of "per_camera" is at most alpha. If neither passes: cannot_tell. A
    difference that is certain and small does not make a fleet per_camera, as an F test alone would.

    [1] R. L. Berger, Technometrics 24, 295 (1982), doi:10.2307/1267823
    [2] D. J. Schuirmann, J. Pharmacokin. Biopharm. 15, 657 (1987), doi:10.1007/BF01068419
    """
    distances = (np.abs(deviations) - limit) / standard_errors
    equivalence = float(np.max(scipy.special.stdtr(dof, distances)))
    exceedance = min(1.0, 2.0 * deviations.size * float(np.min(scipy.special.stdtr(dof, -distances))))
    outcome: Outcome = "cannot_tell"
    if dof >= LEAST_DOF and equivalence < ALPHA:
        outcome = "shared"
    elif dof >= LEAST_DOF and exceedance < ALPHA:
        outcome = "per_camera"
    return Judgement(outcome=outcome, equivalence_p_value=equivalence, exceedance_p_value=exceedance)


class Tolerance(Record):
    """The largest deviation from the shared value that is accepted."""

    limit: float = about("In the unit of the cost.")
    unit: str
    kind: str
    of: str = about("Of what it is a limit.")


class Deviation(Record):
    """The distance of one level from the mean of all."""

    label: str = about('A serial number, or "body with lens" where a body had several lenses.')
    repeats: int
    deviation: Quantity
    cost: Quantity | None = about("The same as its effect on the result; None where unknown.")


class Effect(Record):
    """Effect of the levels of one factor."""

    factor: Literal["camera", "body", "lens"] = about("Body and lens where swaps separate the two.")
    deviations: tuple[Deviation, ...]
    between_variance: Quantity = about("Variance component, not below 0.")
    dof: int
    f_statistic: float | None
    f_p_value: float | None
    judgement: Judgement | None = about("None where the tests could not be made.")


class ParameterVerdict(Record):
    """Verdict on one parameter: does one value serve all cameras that have it."""

    key: Key
    outcome: Outcome
    judged: bool = about("False: no tolerance was given for it, and the fleet's verdict ignores it.")
    said: str
    cameras: int
    repeats: int
    mean: Quantity = about(
        "The shared value, the unweighted mean; its uncertainty is from repeatability alone."
    )
    within_variance: Quantity | None = about("Of one determination repeated on one camera.", default=None)
    between_variance: Quantity | None = None
    dof: int = about("Degrees of freedom of the repeatability.")
    f_statistic: float | None = about(
        "Of all that makes cameras differ, bodies and lenses together.", default=None
    )
    f_p_value: float | None = None
    effects: tuple[Effect, ...] = ()
    judgement: Judgement | None = None
    tolerance: Tolerance | None
    repeatability: Quantity | None = about("Of one determination, as its effect on the result.", default=None)
    cost: Quantity | None = about("The largest cost of sharing for a camera.", default=None)
    costliest: str | None = about("The camera that this cost is of.", default=None)
    repeats_needed: int | None = about(
        "Of each camera, to show that they are alike, where that is open and nothing was found.", default=None
    )
    cameras_without: tuple[str, ...] = about("Those that have no such coefficient.")
    flags: tuple[Raised, ...] = ()


class FleetVerdict(Record):
    """The verdict on a fleet: per_camera when any parameter is; shared when all that were judged are."""

    outcome: Outcome
    said: str
    parameters: tuple[ParameterVerdict, ...]
    left_out: tuple[LeftOut, ...]


Kind = Literal["relative", "absolute"]

PERCENT = "%"

# Measures of a fit's quality, which are listed with the coefficients and applied to no image
NOT_SHARED = frozenset({"rms_px"})

# A fraction of a mean is meaningful if the mean is more than this many of its standard errors from 0
CLEAR_OF_ZERO = 3.0


class Sensitivity(Record):
    """Sensitivity coefficient of a parameter: cost = factor * difference."""

    kind: Kind  # relative: tolerances are fractions (0.04), costs in %; absolute: both in `unit`
    unit: str  # Of the cost
    of: str  # The affected quantity, for sentences
    factor: float

    def accept(self, tolerance: float) -> Tolerance:
        """Return a tolerance in the unit of the cost."""
        limit = 100.0 * tolerance if self.kind == "relative" else tolerance
        return Tolerance(limit=limit, unit=self.unit, kind=self.kind, of=self.of)


def main_unit(method: str) -> str:
    """Return the unit of a tolerance that applies to all coefficients of a method.

    Parameters
    ----------
    method : str
        Name of the method.
    """
    return get_method(method).tolerance_unit


def find_sensitivity(method: str, key: Key, means: Mapping[str, float], *, mean: float) -> Sensitivity:
    """Find the effect of a difference of a parameter on the result.

    To first order in the difference, from the models' own equations:

    - luminance_k, reflectance_k: L and R are inverse to K; for a camera whose K is d above the shared one,
      L_shared / L - 1 = d / K, in %.
    - corner_falloff, k1..k3 of vignetting: the change of V in the corner, where r = 1, in % of the signal.
    - k1..k3, p1, p2 of geometry: displacement of the image point in the frame's corner, in px,
      k_m: f r^(2m+1);  p1: f |(2xy, r^2 + 2y^2)|;  p2: f |(r^2 + 2x^2, 2xy)|,  x = cx / fx, y = cy / fy.
    - names that end in _px or _dn: the difference itself.
    - all others: the difference in % of their mean.

    Each is taken alone. k1..k3 of one fit compensate each other, so that their costs are upper limits; for
    vignetting, corner_falloff is decisive.

    Parameters
    ----------
    method : str
        Name of the method.
    key : Key
        The parameter.
    means : mapping of str to float
        The fleet's mean of each parameter by name.
    mean : float
        The mean of this one.
    """
    kinds = {each.name: each for each in get_method(method).coefficients}
    effect = kinds[key.name].effect if key.name in kinds else None
    if effect is not None and effect.factor is not None:
        # a fraction that is stated in % is not multiplied again
        factor = 1.0 if key.unit == effect.unit else effect.factor(means)
        relative = effect.unit == PERCENT
        return Sensitivity(
            kind="relative" if relative else "absolute", unit=effect.unit, of=effect.of, factor=factor
        )
    for ending, unit in (("_px", "px"), ("_dn", "DN")):
        if key.name.endswith(ending):
            return Sensitivity(kind="absolute", unit=unit, of=f"of {key.name}", factor=1.0)
    factor = 100.0 / abs(mean) if mean else math.nan
    return Sensitivity(
        kind="relative", unit=PERCENT, of=effect.of if effect else f"of {key.name}", factor=factor
    )


def is_clear_of_zero(sensitivity: Sensitivity, mean: float, standard_error: float) -> bool:
    """Return True if the factor is meaningful: a fraction of a mean that may be 0 is not."""
    if sensitivity.kind == "absolute":
        return math.isfinite(sensitivity.factor)
    return math.isfinite(sensitivity.factor) and abs(mean) > CLEAR_OF_ZERO * standard_error


REPEATS_EXCEED_UNCERTAINTY = flag(
    "Repeated calibrations of a camera scatter by more than their stated uncertainties explain, with 99 %.",
    "Check for drift, an error that was not stated, or one wrong campaign. The verdict uses the larger "
    "scatter.",
    "fleet",
)
REPEATS_OF_ONE_DAY = flag(
    "All repeats of each camera are from one day: changes between days are not in the repeatability.",
    "Repeat on another day.",
    "fleet",
)
BODY_AND_LENS_CONFOUNDED = flag(
    "No swaps link all bodies and lenses: a difference cannot be assigned to the body or to the lens.",
    "Calibrate bodies with swapped lenses. The verdict on the pairs as they are holds.",
    "fleet",
)

FINDINGS = declare(globals())


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
