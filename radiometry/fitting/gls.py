"""Generalised least squares with error components, their variances by REML, and prediction."""

import math
from collections.abc import Callable, Sequence
from dataclasses import field, replace

import numpy as np
import scipy
from numpy.linalg import LinAlgError
from numpy.typing import NDArray

from radiometry.fitting import sources
from radiometry.fitting.components import (
    Component,
    Factored,
    Labels,
    Matrix,
    Problem,
    Traces,
    Vector,
    contribute,
)
from radiometry.fitting.sources import DARK_CURRENT, F_NUMBER, LAMP, SCATTER, TIME, Curve
from radiometry.records import Record

_INDISTINCT = 1e-12
_MAX_STEPS = 200
_MAX_HALVINGS = 40
_NEAR_REL = 0.1
_LAST_STEP_REL = 1e-8
_UNHEARD = 1e-10


def estimate_variances(problem: Problem, start: Sequence[float] | None = None) -> tuple[Vector, Matrix]:
    """Estimate the variances v_j >= 0 that are not given by restricted maximum likelihood.

    The likelihood is that of the residuals of the design alone [1], [2]. With P = V^-1 - V^-1 A (A' V^-1
    A)^-1 A' V^-1 and Q_j = Z_j Z_j', the scores are zero at the estimate::

        2 dl/dv_j = y'P Q_j P y - tr(P Q_j)

    If a score is negative at v_j = 0, the other errors explain all the scatter and v_j = 0. The steps are
    Newton's, or Fisher's where the likelihood is not concave, and never lower it. The covariance of the
    estimates is the inverse of the expected information, tr(P Q_i P Q_j) / 2.

    [1] S. R. Searle, G. Casella, C. E. McCulloch, Variance Components, Wiley 1992, chapter 6,
        doi:10.1002/9780470316856
    [2] H. D. Patterson, R. Thompson, Biometrika 58, 545 (1971), doi:10.1093/biomet/58.3.545
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
    """Return True if the scatter about the design determines the variances of these components separately."""
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


def expect_variance(problem: Problem, variances: Vector) -> tuple[float, float]:
    """Return the mean of the one unknown variance over all from 0 on, and its degrees of freedom.

    Its likelihood is taken as normal: score and information at ``variances`` give its mean m and standard
    deviation s. With h = phi(m / s) / Phi(m / s), the part from 0 on has the mean m + s h and the variance
    s^2 (1 - h (h + m / s)), and degrees of freedom are 2 mean^2 / variance.
    """
    slope, information, _ = _find_slope(Factored(problem, variances))
    found = float(variances[problem.unknown[0]])
    if information[0, 0] <= 0.0:  # lost in rounding, where shared errors are a million times the points' own
        return found, math.inf
    s = 1.0 / math.sqrt(float(information[0, 0]))
    m = found + float(slope[0]) * s**2
    log_share = -((m / s) ** 2 + math.log(2.0 * math.pi)) / 2.0 - float(scipy.special.log_ndtr(m / s))
    h = math.exp(log_share)
    mean = max(0.0, m + s * h)
    if m < -100.0 * s:  # their limit, beyond which the variance is rounding
        return mean, 2.0
    return mean, 2.0 * mean**2 / (s**2 * (1.0 - h * (h + m / s)))


def _climb(
    at: Callable[[Vector], Factored], estimates: Vector, sought: NDArray[np.bool_]
) -> tuple[Vector, Factored]:
    """Climb to the maximum of the restricted likelihood, at which no variance is below 0."""
    factored = at(estimates)
    for _ in range(_MAX_STEPS):
        slope, expected, observed = _find_slope(factored)
        free = sought & ((estimates > 0.0) | (slope > 0.0))
        step = _find_step(estimates, slope, expected, free)
        near = free.any() and _compare(step, estimates) < _NEAR_REL
        if near and np.linalg.eigvalsh(observed[np.ix_(free, free)])[0] > 0.0:
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


class Solution(Record):
    """Solution of a linear model by generalised least squares."""

    parameters: Vector  # Estimates theta, (p,)
    weights: Matrix  # Matrix W with parameters = W @ response, (p, n)
    contributions: tuple[Matrix, ...]  # Covariance of the parameters from each component, (p, p) each
    variances: tuple[float, ...]  # Variance of each component, given or estimated
    # Covariance of the m estimated variances, in the order of their components, (m, m)
    covariance_of_estimates: Matrix
    chi_squared: float  # Weighted sum of squared residuals
    log_likelihood: float  # Log likelihood of the response
    projected: Vector  # V^-1 (response - design @ parameters), (n,)
    factored: "Factored" = field(repr=False)  # The covariance at these variances

    @property
    def covariance(self) -> Matrix:
        """Covariance of the parameters from all components, (p, p)."""
        total: Matrix = np.sum(self.contributions, axis=0)
        return total

    def predict(self, component: Component) -> Matrix:
        """Return the weights of the best linear prediction of a component's errors.

        [1] G. K. Robinson, Statistical Science 6, 15 (1991), doi:10.1214/ss/1177011926
        """
        index = next(i for i, each in enumerate(self.factored.problem.components) if each is component)
        return self.variances[index] * self.factored.project(component.columns()).T


def solve(
    design: Matrix, response: Vector, components: Sequence[Component], *, start: Sequence[float] | None = None
) -> Solution:
    """Solve y = A theta + e for theta and for each variance that is not given.

    With cov(e) = V = sum_j v_j Z_j Z_j' [1]::

        theta = (A' V^-1 A)^-1 A' V^-1 y = W y
        cov(theta) = W V W' = sum_j v_j (W Z_j) (W Z_j)'

    so that the share of every component in every parameter's variance is known.

    [1] JCGM 102:2011, doi:10.59161/JCGM102-2011
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

    The points of different groups are independent given the other components' errors: each group is reduced
    to a triangle once, and the triangles before and after a group are those of the points without it.
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


_NEGLIGIBLE_REL = 1e-4

Rows = tuple[tuple[float, ...], ...]


class Prediction(Record):
    """Errors of the model's parameters, and of X at one f-number, by what causes them."""

    f_number: float | None  # Nominal f-number; None for X with the errors that f-numbers have on average
    x_error: float  # Predicted ln(X / nominal X) of all frames at the f-number; 0 for None
    # Covariance of the parameters, and of `x_error` as a last row, by the errors of all f-numbers and by all
    # other sources but the exposure times
    fit: Rows
    f_numbers: Rows
    times: Rows  # Effect on each of them of one standard uncertainty of each exposure time, by rising time
    k_variance_rel: float  # Relative variance of K at the f-number
    # Half the variance of `k_variance_rel`, for the effective degrees of freedom
    k_uncertainty_of_variance: float

    def effective_dof(self, common_variance_rel: float = 0.0) -> float:
        """Return the degrees of freedom of K's variance after Welch and Satterthwaite [1].

        [1] JCGM 100:2008, G.4.1, doi:10.59161/JCGM100-2008E
        """
        if self.k_uncertainty_of_variance == 0.0:
            return math.inf
        variance = self.k_variance_rel + common_variance_rel
        return max(1.0, variance**2 / self.k_uncertainty_of_variance)


class Converged(Record):
    """Last iteration of a fit that converged."""

    linear: sources.LinearModel  # The model as a linear problem
    components: list[Component]  # Sources of error
    solution: Solution

    @property
    def dof(self) -> int:
        return self.linear.response.size - self.solution.parameters.size

    def find_u(self, source: str) -> float:
        """Return a source's standard uncertainty, 0 if it is not among the components."""
        variances = zip(self.components, self.solution.variances, strict=True)
        return math.sqrt(sum(variance for component, variance in variances if component.source == source))

    def predict_scatter(self, weights: Vector) -> Vector:
        """Return the best linear prediction of each point's own scatter, relative, (n,)."""
        variance: Vector = self.find_u(SCATTER) ** 2 / weights
        return variance * self.linear.per_relative_x * self.solution.projected

    def predict_dark_rate(self, curve: Curve) -> tuple[float, float]:
        """Return the best linear prediction of the dark current's rate, and its standard error [DN/s]."""
        return self._predict_first(DARK_CURRENT) or (0.0, curve.dark_rate_u_dn_per_s)

    def predict_lamp(self, curve: Curve) -> float:
        """Return sqrt(z^2 + u(z)^2) of the lamp's drift z in units of its prior uncertainty; 1 if unseen."""
        if "" not in curve.lamp_labels or not np.any(curve.lamp_u_rel):
            return 1.0
        # "" is the first of the sorted labels
        return math.hypot(*(self._predict_first(LAMP) or (1.0, 0.0)))

    def _predict_first(self, source: str) -> tuple[float, float] | None:
        """Return the predicted error of a source's first group, and its standard uncertainty."""
        found = next((i for i, each in enumerate(self.components) if each.source == source), None)
        if found is None:
            return None
        errors, u = self.solution.factored.predict(found)
        return float(errors[0]), float(u[0])


def predict_errors(
    converged: Converged, model: str, factors: tuple[float, float], at: tuple[int, float] | None = None
) -> tuple[dict[str, tuple[str, float]], Prediction]:
    """Return the sources' shares of K's relative variance, and the errors at any or at one f-number.

    What a source contributes to the error of a prediction w'y of theta + 2 b is v (w'Z
    - z), with z = 2 at the f-number whose b it is and 0 elsewhere. A share v_j with
    nu_j degrees of freedom has variance 2 v_j^2 / nu_j. The share of an estimated
    component is v_j w'Q_j w, with cov(v) from the information matrix; w minimises the
    total, so that it does not matter that w depends on v. Birge's ratio multiplies by
    chi^2 / dof, which has itself a relative variance of 2 / dof.
    """
    (excess, tails), solution, components = factors, converged.solution, converged.components
    jacobian = sources.find_jacobian(model, solution.parameters)
    rows = jacobian[:, None] * solution.weights
    k = sources.from_theta(model, solution.parameters)[0]
    gradient, x_error, target = np.eye(len(rows))[0] / k, 0.0, 0.0
    if at is not None:
        shared = next(each for each in components if each.source == F_NUMBER)
        rows = np.vstack([rows, 2.0 * solution.predict(shared)[at[0]]])
        x_error = float(rows[-1] @ solution.factored.problem.centred)
        gradient = np.append(gradient, converged.linear.per_relative_x[0] if model == "power" else 1.0)
        target = 2.0
    size = len(rows)
    shares: dict[str, tuple[str, float]] = {}
    slopes: list[float] = []
    fit, f_numbers, times = np.zeros((size, size)), np.zeros((size, size)), np.zeros((size, 0))
    doubt = testable = given = total = 0.0
    for index, (component, estimate) in enumerate(zip(components, solution.variances, strict=True)):
        tail = tails if component.source == SCATTER else 1.0
        variance = tail * estimate
        effects = np.vstack(
            [
                jacobian[:, None] * solution.factored.find_effects(index),
                contribute(component, rows[len(jacobian) :]),
            ]
        )
        if component.source == F_NUMBER and at is not None:
            effects[-1, at[0]] -= target
        scaled = math.sqrt(variance * (1.0 if component.common else excess)) * effects
        if component.source == F_NUMBER:
            f_numbers = scaled @ scaled.T
        elif component.source == TIME:
            # rounding alone is left of what cancels, and another processor rounds differently
            sizes = np.max(np.abs(scaled), axis=1, keepdims=True)
            sizes[len(jacobian) :] = math.sqrt(variance)
            times = np.where(np.abs(scaled) < _NEGLIGIBLE_REL * sizes, 0.0, scaled)
        else:
            fit = fit + scaled @ scaled.T
        slope = float(np.sum((gradient @ effects) ** 2))
        share = variance * slope
        shares[component.source] = (component.kind, shares.get(component.source, ("", 0.0))[1] + share)
        total += share
        if component.common:
            continue
        testable += share
        if component.variance is None:
            slopes.append(tail * slope)
        else:
            given += share
            doubt += (excess * share) ** 2 / component.dof
    slope_of = np.array(slopes)
    doubt += excess**2 * float(slope_of @ solution.covariance_of_estimates @ slope_of) / 2
    if excess > 1.0:
        shares["scatter beyond these"] = ("A", (excess - 1.0) * testable)
        doubt += (excess * given) ** 2 / converged.dof
    return shares, Prediction(
        f_number=at[1] if at else None,
        x_error=x_error,
        fit=_plain(fit),
        f_numbers=_plain(f_numbers),
        times=_plain(times),
        k_variance_rel=total + (excess - 1.0) * testable,
        k_uncertainty_of_variance=doubt,
    )


def _plain(matrix: Matrix) -> Rows:
    return tuple(tuple(row) for row in matrix.tolist())
