"""Generalised least squares with shared errors, some of whose variances may have to be estimated."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy
from numpy.linalg import LinAlgError

from radiometry.fitting.components import Component, Labels, Matrix, Vector
from radiometry.fitting.factoring import Factored, Problem
from radiometry.fitting.variances import estimate_variances


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
    factored : Factored
        The covariance at these variances.
    """

    parameters: Vector
    weights: Matrix
    contributions: tuple[Matrix, ...]
    variances: tuple[float, ...]
    covariance_of_estimates: Matrix
    chi_squared: float
    log_likelihood: float
    projected: Vector
    factored: "Factored" = field(repr=False)

    @property
    def covariance(self) -> Matrix:
        """Covariance of the parameters from all components, (p, p)."""
        total: Matrix = np.sum(self.contributions, axis=0)
        return total

    def predict(self, component: Component) -> Matrix:
        """Return the weights of the best linear prediction of a component's errors.

        Parameters
        ----------
        component : Component
            One of the components of the problem, shared.

        Returns
        -------
        ndarray of float64
            Matrix with errors = it @ response, (levels, n): v Z'P [1]_.

        References
        ----------
        .. [1] G. K. Robinson, Statistical Science 6, 15 (1991),
               doi:10.1214/ss/1177011926
        """
        index = next(i for i, each in enumerate(self.factored.problem.components) if each is component)
        return self.variances[index] * self.factored.project(component.columns()).T


def solve(
    design: Matrix,
    response: Vector,
    components: Sequence[Component],
    *,
    start: Sequence[float] | None = None,
) -> Solution:
    """Solve y = A theta + e for theta and for each variance that is not given.

    Parameters
    ----------
    design : ndarray of float64
        Matrix A, (n, p).
    response : ndarray of float64
        Vector y, in one unit, (n,).
    components : sequence of Component
        Sources of error; at least one has no groups, and is above 0 everywhere.
    start : sequence of float or None, default: None
        Variance of each component at which the search of the unknown ones starts.

    Returns
    -------
    Solution
        Parameters, their covariance by component, and the variances.

    Raises
    ------
    LinAlgError
        If the problem has no solution in finite numbers.

    Notes
    -----
    With cov(e) = V = sum_j v_j Z_j Z_j' [1]_::

        theta = (A' V^-1 A)^-1 A' V^-1 y = W y
        cov(theta) = W V W' = sum_j v_j (W Z_j) (W Z_j)'

    so that the share of every component in every parameter's variance is known.

    References
    ----------
    .. [1] JCGM 102:2011, doi:10.59161/JCGM102-2011
    """
    problem = Problem(design, response, tuple(components))
    variances, covariance = estimate_variances(problem, start)
    factored = Factored(problem, variances)
    weights = factored.weights
    chi_squared = factored.square(problem.centred)
    return Solution(
        parameters=problem.ordinary + weights @ problem.centred,
        weights=weights,
        contributions=tuple(
            variance * effects @ effects.T
            for index, variance in enumerate(variances)
            for effects in [factored.find_effects(index)]
        ),
        variances=tuple(variances.tolist()),
        covariance_of_estimates=covariance,
        chi_squared=chi_squared,
        log_likelihood=-0.5
        * (chi_squared + factored.log_determinant + response.size * math.log(2 * math.pi)),
        projected=factored.project(problem.centred),
        factored=factored,
    )


def leave_groups_out(
    design: Matrix, response: Vector, components: Sequence[Component], labels: Labels
) -> list[tuple[Vector, dict[str, Vector]]]:
    """Solve without each group of points in turn, all variances being known.

    Parameters
    ----------
    design : ndarray of float64
        Matrix A, (n, p).
    response : ndarray of float64
        Vector y, (n,).
    components : sequence of Component
        Sources of error with their variances.
    labels : ndarray of intp
        Index of each point's group, (n,). A shared component may have these labels.

    Returns
    -------
    list of tuple[Vector, dict of str to Vector]
        Without each group: the parameters, and by source the predicted errors of
        the components with other labels.

    Raises
    ------
    LinAlgError
        If the rest does not determine the parameters.

    Notes
    -----
    The points of different groups are independent given the other components'
    errors: each group is reduced to a triangle once, and the triangles before and
    after a group are those of the points without it.
    """
    known = list(components)
    absorbed = next(
        (i for i, e in enumerate(known) if e.labels is not None and np.array_equal(e.labels, labels)),
        len(known),
    )
    if absorbed == len(known):
        apart = Component(source="", kind="B", sensitivity=np.zeros(len(labels)), variance=0.0, labels=labels)
        known.append(apart)
    problem = Problem(design, response, tuple(known), absorbed)
    variances = np.array([each.variance or 0.0 for each in known])
    factored = Factored(problem, variances)
    rows = np.column_stack([factored.block, factored.whiten(response)])[np.argsort(labels, kind="stable")]
    parts = np.split(rows, np.cumsum(np.bincount(labels))[:-1])
    size = rows.shape[1]
    ridge = np.eye(problem.levels, size, problem.parameters)

    def accumulate(some: Sequence[Matrix]) -> list[Matrix]:
        triangles = [np.zeros((0, size))]
        for part in some:
            triangles.append(_triangulate(triangles[-1], part))
        return triangles

    before, after = accumulate(parts), accumulate(parts[::-1])[::-1]
    found = []
    for index in range(len(parts)):
        triangle = _triangulate(before[index], after[index + 1], ridge)
        scaled = scipy.linalg.solve_triangular(triangle[: size - 1, : size - 1], triangle[: size - 1, -1])
        if not np.all(np.isfinite(scaled)):
            raise LinAlgError("the points without a group do not determine the parameters")
        errors = factored.scale * scaled
        found.append(
            (
                errors[: problem.parameters],
                {known[i].source: errors[part] for i, part in problem.parts.items()},
            )
        )
    return found


def _triangulate(*rows: Matrix) -> Matrix:
    """Return the triangle whose square is the sum of the rows' squares."""
    return np.asarray(np.linalg.qr(np.vstack(rows), mode="r"), np.float64)
