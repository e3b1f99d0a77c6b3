"""Results of a comparison of cameras, and what a difference of their coefficients costs."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from radiometry.findings import Raised
from radiometry.fitting.evidence import Quantity
from radiometry.fleet.determinations import Key, LeftOut
from radiometry.methods import get_method
from radiometry.specification.parameters import about

__all__ = [
    "PERCENT",
    "Deviation",
    "Effect",
    "FleetVerdict",
    "Outcome",
    "ParameterVerdict",
    "find_sensitivity",
    "main_unit",
]


Vector = NDArray[np.float64]
Outcome = Literal["shared", "per_camera", "cannot_tell"]

# Largest error rate: "shared" of a fleet that exceeds the tolerance, "per_camera" of one within it
ALPHA = 0.05

# Fewest degrees of freedom of the repeatability. With fewer its relative uncertainty is above 1 / sqrt(2 * 3)
# = 41 %, for a normal distribution that cannot be checked: there is no verdict then.
LEAST_DOF = 3


@dataclass(frozen=True, kw_only=True)
class Judgement:
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

    The first is two one-sided tests of each camera [2]; all must pass, so that no correction for their
    number is needed (intersection-union [1]): for any fleet in which a camera exceeds the tolerance, the
    probability of "shared" is at most alpha. The second is Bonferroni's over k cameras and two sides: for a
    fleet within the tolerance, the probability of "per_camera" is at most alpha. If neither passes:
    cannot_tell. A difference that is certain and small does not make a fleet per_camera, as an F test alone
    would.

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


@dataclass(frozen=True, kw_only=True)
class Tolerance:
    """The largest deviation from the shared value that is accepted."""

    limit: float = field(metadata=about("In the unit of the cost."))
    unit: str
    kind: str
    of: str = field(metadata=about("Of what it is a limit."))


@dataclass(frozen=True, kw_only=True)
class Deviation:
    """The distance of one level from the mean of all."""

    label: str = field(
        metadata=about('A serial number, or "body with lens" where a body had several lenses.')
    )
    repeats: int
    deviation: Quantity
    cost: Quantity | None = field(metadata=about("The same as its effect on the result; None where unknown."))


@dataclass(frozen=True, kw_only=True)
class Effect:
    """Effect of the levels of one factor."""

    factor: Literal["camera", "body", "lens"] = field(
        metadata=about("Body and lens where swaps separate the two.")
    )
    deviations: tuple[Deviation, ...]
    between_variance: Quantity = field(metadata=about("Variance component, not below 0."))
    dof: int
    f_statistic: float | None
    f_p_value: float | None
    judgement: Judgement | None = field(metadata=about("None where the tests could not be made."))


@dataclass(frozen=True, kw_only=True)
class ParameterVerdict:
    """Verdict on one parameter: does one value serve all cameras that have it."""

    key: Key
    outcome: Outcome
    judged: bool = field(
        metadata=about("False: no tolerance was given for it, and the fleet's verdict ignores it.")
    )
    said: str
    cameras: int
    repeats: int
    mean: Quantity = field(
        metadata=about("The shared value, the unweighted mean; its uncertainty is from repeatability alone.")
    )
    within_variance: Quantity | None = field(
        default=None, metadata=about("Of one determination repeated on one camera.")
    )
    between_variance: Quantity | None = None
    dof: int = field(metadata=about("Degrees of freedom of the repeatability."))
    f_statistic: float | None = field(
        default=None, metadata=about("Of all that makes cameras differ, bodies and lenses together.")
    )
    f_p_value: float | None = None
    effects: tuple[Effect, ...] = ()
    judgement: Judgement | None = None
    tolerance: Tolerance | None
    repeatability: Quantity | None = field(
        default=None, metadata=about("Of one determination, as its effect on the result.")
    )
    cost: Quantity | None = field(default=None, metadata=about("The largest cost of sharing for a camera."))
    costliest: str | None = field(default=None, metadata=about("The camera that this cost is of."))
    repeats_needed: int | None = field(
        default=None,
        metadata=about(
            "Of each camera, to show that they are alike, where that is open and nothing was found."
        ),
    )
    cameras_without: tuple[str, ...] = field(metadata=about("Those that have no such coefficient."))
    flags: tuple[Raised, ...] = ()


@dataclass(frozen=True, kw_only=True)
class FleetVerdict:
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


@dataclass(frozen=True, kw_only=True)
class Sensitivity:
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

    Notes
    -----
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
