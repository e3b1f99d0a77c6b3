"""Tests whether deviations stay within a tolerance or exceed it."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Outcome = Literal["shared", "per_camera", "cannot_tell"]

ALPHA = 0.05
"""Largest error rate: "shared" of a fleet that exceeds the tolerance, "per_camera" of one within it."""

LEAST_DOF = 3
"""Fewest degrees of freedom of the repeatability. With fewer its relative uncertainty is above
1 / sqrt(2 * 3) = 41 %, for a normal distribution that cannot be checked: there is no verdict then."""


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """An outcome and both tests behind it.

    Attributes
    ----------
    equivalence_p_value : float
        Small: all deviations lie within the tolerance.
    exceedance_p_value : float
        Small: at least one lies outside.
    """

    outcome: Outcome
    equivalence_p_value: float
    exceedance_p_value: float


def judge_deviations(deviations: Vector, standard_errors: Vector, *, dof: int, limit: float) -> Judgement:
    """Test each level's deviation d_i from the mean of all against +-limit, with both error rates limited.

    Parameters
    ----------
    deviations, standard_errors : ndarray of float64, shape (k,)
        In the unit of the limit; the standard errors are above 0.
    dof : int
        Degrees of freedom v of the standard errors.
    limit : float
        Largest accepted deviation.

    Notes
    -----
    The question is about these cameras, not the population that they are drawn from: the cameras are counted
    and known, and five of them hardly determine a standard deviation between cameras (its upper limit is 2.4
    times its estimate). So the test is on each camera's deviation from the set they would share::

        shared      max_i P(t_v < (|d_i| - limit) / u_i) < alpha        every |delta_i| < limit
        per_camera  2 k min_i P(t_v > (|d_i| - limit) / u_i) < alpha    some |delta_i| > limit

    The first is two one-sided tests of each camera [2]_; all must pass, so that no correction for their
    number is needed (intersection-union [1]_): for any fleet in which a camera exceeds the tolerance, the
    probability of "shared" is at most alpha. The second is Bonferroni's over k cameras and two sides: for a
    fleet within the tolerance, the probability of "per_camera" is at most alpha. If neither passes:
    cannot_tell. A difference that is certain and small does not make a fleet per_camera, as an F test alone
    would.

    References
    ----------
    .. [1] R. L. Berger, Technometrics 24, 295 (1982), doi:10.2307/1267823
    .. [2] D. J. Schuirmann, J. Pharmacokin. Biopharm. 15, 657 (1987), doi:10.1007/BF01068419
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
