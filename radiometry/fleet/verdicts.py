"""Whether deviations stay within a tolerance, or leave it, or neither can be said."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

Vector = NDArray[np.float64]
Outcome = Literal["shared", "per_camera", "cannot_tell"]

ALPHA = 0.05
"""Most often that shared is said of what leaves the tolerance, and per_camera of what stays within."""

LEAST_DOF = 3
"""Of the repeatability. With fewer it is known to worse than 1 / sqrt(2 * 3) = 41 %, and on faith in a normal
distribution that nobody could check: nothing is said then."""


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """An outcome and both tests behind it.

    ``equivalence_p_value`` : small: all deviations lie within the tolerance
    ``exceedance_p_value`` : small: at least one lies outside
    """

    outcome: Outcome
    equivalence_p_value: float
    exceedance_p_value: float


def judge_deviations(deviations: Vector, standard_errors: Vector, *, dof: int, limit: float) -> Judgement:
    """Test each level's deviation d_i from the mean of all against +-limit, with both error rates held.

    The question is of these cameras, not of the population that they are drawn from: the cameras are counted
    and known, and of a standard deviation between cameras five of them would say next to nothing (its upper
    limit is 2.4 times its estimate). So the test is on each camera's deviation from the set they would share:

        shared      max_i P(t_v < (|d_i| - limit) / u_i) < alpha        every |delta_i| < limit
        per_camera  2 k min_i P(t_v > (|d_i| - limit) / u_i) < alpha    some |delta_i| > limit

    The first is two one-sided tests of each camera; all must pass, so that no correction for their number is
    needed (intersection-union [1]): whatever the truth, shared is said of a fleet in which a camera leaves
    the tolerance with at most alpha. The second is Bonferroni's over k cameras and two sides: per_camera is
    said of a fleet within the tolerance with at most alpha. Neither passes: cannot_tell.
    A difference that is certain and small does not make a fleet per_camera, as an F test alone would.

    Takes
      deviations, standard_errors : (k,) in the unit of limit; standard_errors > 0; dof : v of their variance
    References [1] R. L. Berger, Multiparameter hypothesis testing and acceptance sampling,
      Technometrics 24 (1982) 295-300, doi:10.2307/1267823; D. J. Schuirmann, J. Pharmacokin. Biopharm. 15
      (1987) 657-680, doi:10.1007/BF01068419
    """
    distances = (np.abs(deviations) - limit) / standard_errors
    equivalence = float(np.max(stdtr(dof, distances)))
    exceedance = min(1.0, 2.0 * deviations.size * float(np.min(stdtr(dof, -distances))))
    outcome: Outcome = "cannot_tell"
    if dof >= LEAST_DOF and equivalence < ALPHA:
        outcome = "shared"
    elif dof >= LEAST_DOF and exceedance < ALPHA:
        outcome = "per_camera"
    return Judgement(outcome=outcome, equivalence_p_value=equivalence, exceedance_p_value=exceedance)
