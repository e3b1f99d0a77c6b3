"""Decision rules of the verdict: how the uncertainty of K enters it."""

import math

from radiometry.luminance.rows import Acceptance


def decide(
    rule: Acceptance | None, *, error_rel: float, expanded_u_rel: float | None, tolerance_rel: float
) -> bool:
    """Return True if the error of a point passes by a decision rule.

    Parameters
    ----------
    rule : {"simple", "guarded", "shared_risk"} or None
        Decision rule; None is "simple".
    error_rel : float
        Relative error of the point, without sign.
    expanded_u_rel : float or None
        Relative expanded uncertainty U of K at its f-number; None where K is relative only.
    tolerance_rel : float
        Tolerance.

    Returns
    -------
    bool
        True if it passes.

    Notes
    -----
    With the error e and the tolerance T [1]_: simple e <= T; guard band w = U, e + U <= T; shared risk e <= T
    and U <= T, so that a passed item is not accepted by a measurement that cannot tell. An unknown U is
    accepted by neither of them.

    References
    ----------
    .. [1] ILAC-G8:09/2019, Guidelines on decision rules and statements of conformity, section 4;
           JCGM 106:2012, section 8, doi:10.59161/JCGM106-2012
    """
    if rule in {None, "simple"}:
        return error_rel <= tolerance_rel
    if expanded_u_rel is None:
        return False
    if rule == "guarded":
        return error_rel + expanded_u_rel <= tolerance_rel
    return max(error_rel, expanded_u_rel) <= tolerance_rel


def compute_risk(*, error_rel: float, u_rel: float, tolerance_rel: float) -> float:
    """Compute the probability that an error is really beyond the tolerance.

    Parameters
    ----------
    error_rel, u_rel : float
        Relative error and its relative standard uncertainty.
    tolerance_rel : float
        Tolerance.

    Returns
    -------
    float
        Probability of a true error beyond either limit, of a normal distribution.

    Notes
    -----
    The specific risk of a decision [1]_::

        p = 1 - Phi((T - e) / u) + Phi((-T - e) / u)

    References
    ----------
    .. [1] JCGM 106:2012, section 9.3, doi:10.59161/JCGM106-2012
    """
    if u_rel == 0.0:
        return float(abs(error_rel) > tolerance_rel)
    above, below = ((tolerance_rel + sign * error_rel) / (u_rel * math.sqrt(2.0)) for sign in (-1.0, 1.0))
    return 0.5 * (math.erfc(above) + math.erfc(below))
