"""Generalised least squares with blocks of shared errors, some of which may have to be estimated."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.optimize import brentq

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

_INDISTINCT = 1e-6


@dataclass(frozen=True, kw_only=True)
class Component:
    """One source of error and its part of the covariance, V_j = variance * structure.

    Attributes
    ----------
    source : str
        Name of the source.
    kind : str
        "A" (evaluated from scatter) or "B" (evaluated by other means).
    structure : ndarray of float64
        Matrix Q_j, in units of the response squared per unit of `variance`, (n, n).
    variance : float or None
        Variance v_j; None if it is to be estimated from the scatter.
    dof : float, default: math.inf
        Degrees of freedom of a given variance.
    common : bool, default: False
        True if all points have the same error, so that their scatter does not test
        it.
    """

    source: str
    kind: str
    structure: Matrix
    variance: float | None
    dof: float = math.inf
    common: bool = False


@dataclass(frozen=True, kw_only=True)
class Solution:
    """Solution of a linear model by generalised least squares.

    Attributes
    ----------
    parameters : ndarray of float64
        Estimates theta, (p,).
    weights : ndarray of float64
        Matrix W with parameters = W @ response, (p, n).
    contributions : tuple of ndarray of float64
        Covariance of the parameters from each component, (p, p) each.
    variances : tuple of float
        Variance of each component, given or estimated.
    covariance_of_estimates : ndarray of float64
        Covariance of the m estimated variances, in the order of their components,
        (m, m).
    chi_squared : float
        Weighted sum of squared residuals.
    log_likelihood : float
        Log likelihood of the response.
    projected : ndarray of float64
        V^-1 (response - design @ parameters), (n,).
    """

    parameters: Vector
    weights: Matrix
    contributions: tuple[Matrix, ...]
    variances: tuple[float, ...]
    covariance_of_estimates: Matrix
    chi_squared: float
    log_likelihood: float
    projected: Vector

    @property
    def covariance(self) -> Matrix:
        """Covariance of the parameters from all components, (p, p)."""
        total: Matrix = np.sum(self.contributions, axis=0)
        return total


def solve(design: Matrix, response: Vector, components: Sequence[Component]) -> Solution:
    """Solve y = A theta + e for theta and for each variance that is not given.

    Parameters
    ----------
    design : ndarray of float64
        Matrix A, (n, p).
    response : ndarray of float64
        Vector y, in one unit, (n,).
    components : sequence of Component
        Sources of error, whose sum is positive definite.

    Returns
    -------
    Solution
        Parameters, their covariance by component, and the variances.

    Notes
    -----
    With cov(e) = V = sum_j v_j Q_j [1]_::

        theta = (A' V^-1 A)^-1 A' V^-1 y = W y
        cov(theta) = W V W' = sum_j v_j W Q_j W'

    so that the share of every component in every parameter's variance is known.

    References
    ----------
    .. [1] JCGM 102:2011, doi:10.59161/JCGM102-2011
    """
    variances, covariance_of_estimates = _complete_variances(design, response, components)
    covariance = _add_up(components, variances)
    factor = cho_factor(covariance, lower=True)
    whitened = cho_solve(factor, design)
    weights = np.linalg.solve(design.T @ whitened, whitened.T)
    parameters = weights @ response
    residual = response - design @ parameters
    projected = cho_solve(factor, residual)
    chi_squared = float(residual @ projected)
    log_determinant = 2 * float(np.sum(np.log(np.diag(factor[0]))))
    return Solution(
        parameters=parameters,
        weights=weights,
        contributions=tuple(
            variance * (weights @ component.structure @ weights.T)
            for component, variance in zip(components, variances, strict=True)
        ),
        variances=variances,
        covariance_of_estimates=covariance_of_estimates,
        chi_squared=chi_squared,
        log_likelihood=-0.5 * (chi_squared + log_determinant + response.size * math.log(2 * math.pi)),
        projected=projected,
    )


def shared_structure(labels: Sequence[object], sensitivity: Vector) -> Matrix:
    """Return the matrix Q of an error that points with the same label share.

    Parameters
    ----------
    labels : sequence of object
        Label of each point, n in all.
    sensitivity : ndarray of float64
        Change s of the response per unit of the error, (n,).

    Returns
    -------
    ndarray of float64
        Q_ik = s_i s_k where the labels are equal, else 0, (n, n).
    """
    names = {label: index for index, label in enumerate(dict.fromkeys(labels))}
    index = np.array([names[label] for label in labels])
    return np.where(index[:, None] == index[None, :], np.outer(sensitivity, sensitivity), 0.0)


def are_separable(design: Matrix, structures: Sequence[Matrix]) -> bool:
    """Return True if the scatter about the design determines the variances of these structures separately.

    Parameters
    ----------
    design : ndarray of float64
        Matrix A, (n, p).
    structures : sequence of ndarray of float64
        Matrices Q_j, (n, n) each.

    Returns
    -------
    bool
        False if the Z'QZ are linearly dependent.

    Notes
    -----
    Z is a basis of the residual space of the design. If the Z'QZ depend on each
    other linearly, only a sum of the variances appears in the residuals.
    """
    rest = _leave_over(design)
    flat = [(rest.T @ structure @ rest).ravel() for structure in structures]
    sizes = [float(np.linalg.norm(structure)) for structure in structures]
    scaled = np.array([part / size for part, size in zip(flat, sizes, strict=True)])
    return bool(np.linalg.matrix_rank(scaled, tol=_INDISTINCT) == len(structures))


def _complete_variances(
    design: Matrix, response: Vector, components: Sequence[Component]
) -> tuple[tuple[float, ...], Matrix]:
    """Return every component's variance, and the covariance of the estimated ones."""
    unknown = [index for index, component in enumerate(components) if component.variance is None]
    variances = [component.variance or 0.0 for component in components]
    if not unknown:
        return tuple(variances), np.zeros((0, 0))
    estimates, covariance = estimate_variances(
        design,
        response,
        known=_add_up(components, variances),
        structures=[components[index].structure for index in unknown],
    )
    for index, estimate in zip(unknown, estimates, strict=True):
        variances[index] = estimate
    return tuple(variances), covariance


def _add_up(components: Sequence[Component], variances: Sequence[float]) -> Matrix:
    parts = [variance * part.structure for part, variance in zip(components, variances, strict=True)]
    total: Matrix = np.sum(parts, axis=0)
    return total


def estimate_variances(
    design: Matrix, response: Vector, *, known: Matrix, structures: Sequence[Matrix]
) -> tuple[tuple[float, ...], Matrix]:
    """Estimate the v_j >= 0 in V = known + sum_j v_j Q_j by restricted maximum likelihood.

    Parameters
    ----------
    design : ndarray of float64
        Matrix A, (n, p).
    response : ndarray of float64
        Vector y, (n,).
    known : ndarray of float64
        Covariance that is given, (n, n).
    structures : sequence of ndarray of float64
        Matrices Q_j of the variances to estimate, which `are_separable`.

    Returns
    -------
    tuple[tuple[float, ...], Matrix]
        The v_j, and their covariance, (m, m).

    Notes
    -----
    The likelihood is that of Z'y alone, with Z a basis of the residual space of the
    design [1]_, [2]_. With Z'VZ = L L', w = L^-1 Z'y and S_j = L^-1 Z'Q_j Z L^-T,
    the scores are zero at the estimate::

        2 dl/dv_j = w'S_j w - tr S_j

    If a score is negative at v_j = 0, the other errors explain all the scatter and
    v_j = 0. The covariance of the estimates is the inverse of the expected
    information, tr(S_i S_j) / 2.

    References
    ----------
    .. [1] S. R. Searle, G. Casella, C. E. McCulloch, Variance Components, Wiley
           1992, chapter 6, doi:10.1002/9780470316856
    .. [2] H. D. Patterson, R. Thompson, Biometrika 58, 545 (1971),
           doi:10.1093/biomet/58.3.545
    """
    rest = _leave_over(design)
    seen = [rest.T @ structure @ rest for structure in structures]
    left, own = rest.T @ response, rest.T @ known @ rest
    estimates = _find_variances(left, own, seen)
    _, whitened = _whiten(left, _spread(own, estimates, seen), seen)
    information = np.array([[float(np.sum(one * other)) / 2.0 for other in whitened] for one in whitened])
    return estimates, np.linalg.inv(information)


def _leave_over(design: Matrix) -> Matrix:
    """Return an orthonormal basis of the residual space of the design, (n, n - p)."""
    basis: Matrix = np.linalg.qr(design, mode="complete")[0]
    return basis[:, design.shape[1] :]


def _find_variances(left: Vector, known: Matrix, structures: Sequence[Matrix]) -> tuple[float, ...]:
    """Return the variances at which the scores are zero.

    Notes
    -----
    The last variance is searched along the best values of the others for each of
    its own. Along these the slope of the likelihood is its slope in v alone, so one
    bracketed root after another is enough, and no step can leave v_j >= 0.
    """
    *others, structure = structures
    if not others:
        return (_find_variance(left, known, structure),)

    def find_others(variance: float) -> tuple[float, ...]:
        return _find_variances(left, known + variance * structure, others)

    def score(variance: float) -> float:
        total = _spread(known + variance * structure, find_others(variance), others)
        response, (whitened,) = _whiten(left, total, [structure])
        return float(response @ whitened @ response - np.trace(whitened))

    if score(0.0) <= 0.0:
        return (*find_others(0.0), 0.0)
    upper = _find_variance(left, known, structure)
    while score(upper) > 0.0:
        upper *= 2.0
    estimate = _root(score, upper)
    return (*find_others(estimate), estimate)


def _find_variance(left: Vector, known: Matrix, structure: Matrix) -> float:
    """Return the zero of the only score, from the eigenvalues of S and w along its axes.

    Notes
    -----
    The score is negative beyond the largest (w_i^2 - 1) / s_i::

        2 dl/dv = sum_i s_i (w_i^2 - 1 - v s_i) / (1 + v s_i)^2
    """
    response, (whitened,) = _whiten(left, known, [structure])
    sizes, axes = np.linalg.eigh(whitened)
    heard = sizes > math.ulp(1.0) * sizes.size * sizes[-1]
    sizes, squares = sizes[heard], (axes.T @ response)[heard] ** 2

    def score(variance: float) -> float:
        return float(np.sum(sizes * (squares - 1.0 - variance * sizes) / (1.0 + variance * sizes) ** 2))

    if score(0.0) <= 0.0:
        return 0.0
    return _root(score, 2.0 * float(np.max((squares - 1.0) / sizes)))


def _root(score: Callable[[float], float], upper: float) -> float:
    return float(brentq(score, 0.0, upper, xtol=1e-14 * upper, rtol=1e-13))


def _whiten(
    response: Vector, covariance: Matrix, structures: Sequence[Matrix]
) -> tuple[Vector, list[Matrix]]:
    """Return L^-1 y and L^-1 Q L^-T of a covariance L L'."""
    root = np.linalg.cholesky(covariance)

    def divide(right: Matrix) -> Matrix:
        return np.asarray(solve_triangular(root, right, lower=True), np.float64)

    return divide(response), [divide(divide(structure).T) for structure in structures]


def _spread(known: Matrix, variances: Sequence[float], structures: Sequence[Matrix]) -> Matrix:
    total = known
    for variance, structure in zip(variances, structures, strict=True):
        total = total + variance * structure
    return total
