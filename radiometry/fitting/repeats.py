"""Repeated values: whether they scatter beyond their own noise, and how well their mean is then known."""

import math

import scipy

_LEVEL, _LEVEL_OF_TWO = 0.60, 0.35
_COVERAGE = 0.975
_KNOWN_DOF = 1e9


def shows_scatter(observed: float, expected: float, count: int, *, dof: float = math.inf) -> bool:
    """Return True if the variance of repeated values is not taken for that of their noise.

    Parameters
    ----------
    observed : float
        Variance of the values.
    expected : float
        Variance that their noise predicts.
    count : int
        Number of values, 2 or more.
    dof : float, default: inf
        Degrees of freedom of the prediction.

    Returns
    -------
    bool
        True beyond the 60 % quantile of F, or of two values beyond that of 35 %. The levels are low because
        few values seldom show a scatter that is as large as their noise: with Student's interval beyond
        them, a mean is covered by 93 % or more whatever the ratio of scatter and noise.
    """
    level = _LEVEL_OF_TWO if count == 2 else _LEVEL
    return observed > expected * float(scipy.special.fdtri(count - 1, min(dof, _KNOWN_DOF), level))


def merge_variances(observed: float, predicted: float, count: int, *, dof: float) -> tuple[float, float]:
    """Compute the standard uncertainty of a mean, and degrees of freedom that give it its expanded one.

    Parameters
    ----------
    observed, predicted, count, dof
        As in `shows_scatter`.

    Returns
    -------
    tuple of float
        u = sqrt(max(observed, predicted) / count), and degrees of freedom whose Student's factor times u is
        the larger of both intervals for 95 %: by noise with `dof`, and, where there is scatter, by
        `observed` with count - 1.
    """
    u = math.sqrt(max(observed, predicted) / count)
    if u == 0.0 or not shows_scatter(observed, predicted, count, dof=dof):
        return u, dof
    by_noise, by_scatter = (
        float(scipy.special.stdtrit(min(freedom, _KNOWN_DOF), _COVERAGE)) * math.sqrt(variance / count)
        for freedom, variance in ((dof, predicted), (count - 1.0, observed))
    )
    if by_noise >= by_scatter:
        return u, dof
    return u, float(scipy.special.stdtridf(_COVERAGE, by_scatter / u))
