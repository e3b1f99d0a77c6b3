"""Variances of a linear problem that are not given, by restricted maximum likelihood."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.linalg import LinAlgError
from numpy.typing import NDArray

from radiometry.fitting.components import Component, Matrix, Vector
from radiometry.fitting.factoring import Factored, Problem
from radiometry.fitting.traces import Traces

_INDISTINCT = 1e-12
_MAX_STEPS = 200
_MAX_HALVINGS = 40
_NEAR_REL = 0.1
_LAST_STEP_REL = 1e-8
_UNHEARD = 1e-10


def estimate_variances(problem: Problem, start: Sequence[float] | None = None) -> tuple[Vector, Matrix]:
    """Estimate the variances v_j >= 0 that are not given by restricted maximum likelihood.

    Parameters
    ----------
    problem : Problem
        Linear problem; its components without a variance `are_separable`.
    start : sequence of float or None, default: None
        Variance of each component at which the search of the unknown ones starts.

    Returns
    -------
    tuple[Vector, Matrix]
        Variance of each component, and the covariance of the m estimated ones, (m,
        m).

    Notes
    -----
    The likelihood is that of the residuals of the design alone [1]_, [2]_. With P =
    V^-1 - V^-1 A (A' V^-1 A)^-1 A' V^-1 and Q_j = Z_j Z_j', the scores are zero at
    the estimate::

        2 dl/dv_j = y'P Q_j P y - tr(P Q_j)

    If a score is negative at v_j = 0, the other errors explain all the scatter and
    v_j = 0. The steps are Newton's, or Fisher's where the likelihood is not concave,
    and never lower it. The covariance of the estimates is the inverse of the
    expected information, tr(P Q_i P Q_j) / 2.

    References
    ----------
    .. [1] S. R. Searle, G. Casella, C. E. McCulloch, Variance Components, Wiley
           1992, chapter 6, doi:10.1002/9780470316856
    .. [2] H. D. Patterson, R. Thompson, Biometrika 58, 545 (1971),
           doi:10.1093/biomet/58.3.545
    """
    unknown = list(problem.unknown)
    variances = np.array([each.variance or 0.0 for each in problem.components])
    if not unknown:
        return variances, np.zeros((0, 0))

    def at(estimates: Vector) -> Factored:
        full = variances.copy()
        full[unknown] = estimates
        return Factored(problem, full)

    if start is None:
        # one after the other: a variance that the ones before it make needless stays 0
        estimates = np.zeros(len(unknown))
        for count in range(1, len(unknown) + 1):
            estimates, factored = _climb(at, estimates, np.arange(len(unknown)) < count)
    else:
        estimates, factored = _climb(at, np.array(start)[unknown], np.ones(len(unknown), np.bool_))
    variances[unknown] = estimates
    return variances, np.asarray(np.linalg.inv(_find_slope(factored)[1]), np.float64)


def are_separable(design: Matrix, components: Sequence[Component]) -> bool:
    """Return True if the scatter about the design determines the variances of these components separately.

    Parameters
    ----------
    design : ndarray of float64
        Matrix A, (n, p).
    components : sequence of Component
        Sources of error; their variances are not used.

    Returns
    -------
    bool
        False if the M Q_j M are linearly dependent, with M the projection on the
        residuals of the design: then only a sum of the variances appears in them.
    """
    n = len(design)
    unit = Component(source="", kind="B", sensitivity=np.ones(n), variance=1.0)
    unknown = [replace(each, variance=None) for each in components]
    problem = Problem(design, np.zeros(n), (unit, *unknown))
    variances = np.zeros(1 + len(unknown))
    variances[0] = 1.0
    products = Traces(Factored(problem, variances)).products
    sizes = [float(np.linalg.norm(each.gather(each.sensitivity))) for each in unknown]
    return bool(np.linalg.eigvalsh(products / np.outer(sizes, sizes))[0] > _INDISTINCT)


def _find_slope(factored: Factored) -> tuple[Vector, Matrix, Matrix]:
    """Return dl/dv, the expected and the observed information of the unknown variances."""
    unknown = [factored.problem.components[i] for i in factored.problem.unknown]
    found = Traces(factored)
    left = factored.reduce(factored.whiten(factored.problem.centred))[0]
    sums = [found.gather(i, left) for i in factored.problem.unknown]
    moments = np.array([float(np.sum(each**2)) for each in sums])
    spread = np.column_stack([each.spread(of) for each, of in zip(unknown, sums, strict=True)])
    upper, lower = factored.reduce(factored.whiten(spread))
    expected = found.products / 2.0
    return (moments - found.traces) / 2.0, expected, upper.T @ upper + lower.T @ lower - expected


def _climb(
    at: Callable[[Vector], Factored], estimates: Vector, sought: NDArray[np.bool_]
) -> tuple[Vector, Factored]:
    """Climb to the maximum of the restricted likelihood, at which no variance is below 0."""
    factored = at(estimates)
    for _ in range(_MAX_STEPS):
        slope, expected, observed = _find_slope(factored)
        free = sought & ((estimates > 0.0) | (slope > 0.0))
        step = _find_step(estimates, slope, expected, free)
        if _compare(step, estimates) < _NEAR_REL and np.linalg.eigvalsh(observed)[0] > 0.0:
            step = _find_step(estimates, slope, observed, free)
        last = _compare(step, estimates) < _LAST_STEP_REL
        reached, factored = _advance(at, estimates, step, factored, certain=last)
        if last or np.array_equal(reached, estimates):
            return reached, factored
        estimates = reached
    raise LinAlgError("the variances do not converge")


def _compare(step: Vector, estimates: Vector) -> float:
    """Return the largest step relative to its variance; 1 for a variance that leaves 0."""
    sizes = np.where(estimates > 0.0, estimates, np.where(step > 0.0, step, 1.0))
    return float(np.max(np.abs(step) / sizes))


def _find_step(estimates: Vector, slope: Vector, information: Matrix, free: NDArray[np.bool_]) -> Vector:
    """Return the step of the variances that do not rest at 0: Fisher's or Newton's by the information."""
    while True:
        step = np.zeros_like(estimates)
        if not free.any():
            return step
        step[free] = np.linalg.solve(information[np.ix_(free, free)], slope[free])
        stuck = free & (estimates == 0.0) & (step <= 0.0)
        if not stuck.any():
            return step
        free = free & ~stuck


def _advance(
    at: Callable[[Vector], Factored], estimates: Vector, step: Vector, factored: Factored, *, certain: bool
) -> tuple[Vector, Factored]:
    """Take the step, or as much of it as does not lower the likelihood."""
    height = factored.restricted_likelihood()
    for halving in range(_MAX_HALVINGS):
        reached = np.maximum(estimates + 0.5**halving * step, 0.0)
        found = at(reached)
        if certain or found.restricted_likelihood() >= height - _UNHEARD * (1.0 + abs(height)):
            return reached, found
    return estimates, factored
