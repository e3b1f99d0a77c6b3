"""Generalised least squares with blocks of shared errors, one of which may have to be estimated."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import brentq

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Component:
    """One source of error with its share of the covariance, V_j = variance * structure.

    ``structure`` : (n, n), in the unit of the response squared per unit of ``variance``
    ``variance`` : None: to be estimated from the scatter; at most one component of a fit
    ``dof`` : degrees of freedom behind a given variance
    ``common`` : one and the same error in all points; their scatter says nothing about it
    """

    source: str
    kind: str
    structure: Matrix
    variance: float | None
    dof: float = math.inf
    common: bool = False


@dataclass(frozen=True, kw_only=True)
class Solution:
    """A linear model solved by generalised least squares.

    ``weights`` : (p, n): parameters = weights @ response
    ``contributions`` : (p, p) covariance of the parameters from each component
    ``variances`` : per component, given or estimated
    ``variance_of_estimate`` : of the estimated variance, 0 where none was estimated
    """

    parameters: Vector
    weights: Matrix
    contributions: tuple[Matrix, ...]
    variances: tuple[float, ...]
    variance_of_estimate: float
    chi_squared: float
    log_likelihood: float

    @property
    def covariance(self) -> Matrix:
        """The covariance of the parameters from all components, (p, p)."""
        total: Matrix = np.sum(self.contributions, axis=0)
        return total


def solve(design: Matrix, response: Vector, components: Sequence[Component]) -> Solution:
    """Solve y = A theta + e, cov(e) = V = sum_j v_j Q_j, for theta and for the one v_j that is not given.

    theta = (A' V^-1 A)^-1 A' V^-1 y = W y,   cov(theta) = W V W' = sum_j v_j W Q_j W'
    so that every component's share of every parameter's variance is known [1].

    Takes
      design : (n, p); response : (n,), in one unit; components : together positive definite
    References [1] JCGM 102:2011
    """
    variances, variance_of_estimate = _settle_variances(design, response, components)
    covariance = _add_up(components, variances)
    factor = cho_factor(covariance, lower=True)
    whitened = cho_solve(factor, design)
    weights = np.linalg.solve(design.T @ whitened, whitened.T)
    parameters = weights @ response
    residual = response - design @ parameters
    chi_squared = float(residual @ cho_solve(factor, residual))
    log_determinant = 2 * float(np.sum(np.log(np.diag(factor[0]))))
    return Solution(
        parameters=parameters,
        weights=weights,
        contributions=tuple(
            variance * (weights @ component.structure @ weights.T)
            for component, variance in zip(components, variances, strict=True)
        ),
        variances=variances,
        variance_of_estimate=variance_of_estimate,
        chi_squared=chi_squared,
        log_likelihood=-0.5 * (chi_squared + log_determinant + response.size * math.log(2 * math.pi)),
    )


def shared_structure(labels: Sequence[object], sensitivity: Vector) -> Matrix:
    """Give Q of an error that points with one label share: Q_ik = s_i s_k where the labels are equal, else 0.

    Takes
      sensitivity : (n,) change of the response per unit of the error
    """
    names = {label: index for index, label in enumerate(dict.fromkeys(labels))}
    index = np.array([names[label] for label in labels])
    return np.where(index[:, None] == index[None, :], np.outer(sensitivity, sensitivity), 0.0)


def _settle_variances(
    design: Matrix, response: Vector, components: Sequence[Component]
) -> tuple[tuple[float, ...], float]:
    """Give every component's variance, and the variance of the estimated one."""
    unknown = [index for index, component in enumerate(components) if component.variance is None]
    variances = [component.variance or 0.0 for component in components]
    if not unknown:
        return tuple(variances), 0.0
    (index,) = unknown
    known = _add_up(components, variances)
    variances[index], uncertainty = estimate_variance(
        design, response, known=known, structure=components[index].structure
    )
    return tuple(variances), uncertainty


def _add_up(components: Sequence[Component], variances: Sequence[float]) -> Matrix:
    parts = [variance * part.structure for part, variance in zip(components, variances, strict=True)]
    total: Matrix = np.sum(parts, axis=0)
    return total


def estimate_variance(
    design: Matrix, response: Vector, *, known: Matrix, structure: Matrix
) -> tuple[float, float]:
    """Estimate v in V = known + v Q by restricted maximum likelihood.

    The score 2 dl/dv = y' P Q P y - tr(P Q), P = V^-1 - V^-1 A (A' V^-1 A)^-1 A' V^-1, is zero at the
    estimate; where it is negative at v = 0 already, the known errors explain all the scatter and v = 0. The
    variance of v is the inverse of the expected information, 2 / tr(P Q P Q).

    Returns v and its variance
    References S. R. Searle, G. Casella, C. E. McCulloch, Variance Components, Wiley 1992, chapter 6
    """

    def project(variance: float) -> Matrix:
        return _residual_maker(design, known + variance * structure)

    def score(variance: float) -> float:
        projector = project(variance)
        filtered = projector @ response
        return float(filtered @ structure @ filtered - np.sum(projector * structure))

    estimate = 0.0
    if score(0.0) > 0.0:
        upper = float(np.trace(known) / np.trace(structure))
        while score(upper) > 0.0:
            upper *= 4.0
        estimate = float(brentq(score, 0.0, upper, xtol=1e-14 * upper, rtol=1e-13))
    spread = project(estimate) @ structure
    return estimate, 2.0 / float(np.sum(spread * spread.T))


def _residual_maker(design: Matrix, covariance: Matrix) -> Matrix:
    """Give P, which filters what the design explains out of the response and weighs the rest by V^-1."""
    factor = cho_factor(covariance, lower=True)
    inverse = cho_solve(factor, np.eye(len(covariance)))
    explained = inverse @ design
    projector: Matrix = inverse - explained @ np.linalg.solve(design.T @ explained, explained.T)
    return projector
