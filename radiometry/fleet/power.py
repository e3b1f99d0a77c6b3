"""Number of repeats of each camera that show that a fleet is alike."""

import math

import numpy as np
import scipy

from radiometry.fleet.verdicts import ALPHA, LEAST_DOF

POWER = 0.9
"""Required probability that equal cameras are found equal."""

MOST_REPEATS = 100

_STEPS = 400


def compute_power(*, cameras: int, repeats: int, tolerance_in_repeatabilities: float) -> float:
    """Compute a lower limit of the probability that equal cameras are found to be shared.

    Parameters
    ----------
    cameras : int
        Number k of cameras.
    repeats : int
        Number n of repeats of each camera.
    tolerance_in_repeatabilities : float
        T, tolerance / repeatability.

    Notes
    -----
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
    """Find the repeats of each camera with which equal cameras are found shared in `POWER` of the cases.

    Parameters
    ----------
    cameras : int
        Number of cameras.
    tolerance_in_repeatabilities : float
        Tolerance / repeatability.

    Returns
    -------
    int or None
        None where `MOST_REPEATS` do not suffice.
    """
    for repeats in range(2, MOST_REPEATS + 1):
        power = compute_power(
            cameras=cameras, repeats=repeats, tolerance_in_repeatabilities=tolerance_in_repeatabilities
        )
        if power >= POWER:
            return repeats
    return None
