"""Errors of a fitted curve by what causes them, at any f-number and at each one of its points."""

import math
from dataclasses import dataclass

import numpy as np

from radiometry.fitting import models
from radiometry.fitting.components import Component, Matrix, Vector, contribute
from radiometry.fitting.gls import Solution
from radiometry.fitting.sources import DARK_CURRENT, F_NUMBER, LAMP, SCATTER, TIME, Curve

_NEGLIGIBLE_REL = 1e-4

Rows = tuple[tuple[float, ...], ...]


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """Errors of the model's parameters, and of X at one f-number, by what causes them.

    Attributes
    ----------
    f_number : float or None
        Nominal f-number; None for X with the errors that f-numbers have on average.
    x_error : float
        Predicted ln(X / nominal X) of all frames at the f-number; 0 for None.
    fit, f_numbers : tuple of tuple of float
        Covariance of the parameters, and of `x_error` as a last row, by the errors of
        all f-numbers and by all other sources but the exposure times.
    times : tuple of tuple of float
        Effect on each of them of one standard uncertainty of each exposure time, by
        rising time.
    k_variance_rel : float
        Relative variance of K at the f-number.
    k_uncertainty_of_variance : float
        Half the variance of `k_variance_rel`, for the effective degrees of freedom.
    """

    f_number: float | None
    x_error: float
    fit: Rows
    f_numbers: Rows
    times: Rows
    k_variance_rel: float
    k_uncertainty_of_variance: float

    def effective_dof(self, common_variance_rel: float = 0.0) -> float:
        """Return the degrees of freedom of K's variance after Welch and Satterthwaite [1]_.

        Parameters
        ----------
        common_variance_rel : float, default: 0.0
            Further relative variance of K that is known exactly.

        Returns
        -------
        float
            At least 1; infinite if the variance of K is known exactly.

        References
        ----------
        .. [1] JCGM 100:2008, G.4.1, doi:10.59161/JCGM100-2008E
        """
        if self.k_uncertainty_of_variance == 0.0:
            return math.inf
        variance = self.k_variance_rel + common_variance_rel
        return max(1.0, variance**2 / self.k_uncertainty_of_variance)


@dataclass(frozen=True, kw_only=True)
class Converged:
    """Last iteration of a fit that converged.

    Attributes
    ----------
    linear : LinearModel
        The model as a linear problem.
    components : list of Component
        Sources of error.
    solution : Solution
        Its solution.
    """

    linear: models.LinearModel
    components: list[Component]
    solution: Solution

    @property
    def dof(self) -> int:
        """Points minus parameters."""
        return self.linear.response.size - self.solution.parameters.size

    def find_u(self, source: str) -> float:
        """Return a source's standard uncertainty, 0 if it is not among the components."""
        variances = zip(self.components, self.solution.variances, strict=True)
        return math.sqrt(sum(variance for component, variance in variances if component.source == source))

    def predict_scatter(self, weights: Vector) -> Vector:
        """Return the best linear prediction of each point's own scatter, relative, (n,).

        Parameters
        ----------
        weights : ndarray of float64
            Weight of each point's scatter, (n,).

        Returns
        -------
        ndarray of float64
            Zeros if the points do not scatter beyond the stated sources.
        """
        variance: Vector = self.find_u(SCATTER) ** 2 / weights
        return variance * self.linear.per_relative_x * self.solution.projected

    def predict_dark_rate(self, curve: Curve) -> tuple[float, float]:
        """Return the best linear prediction of the dark current's rate, and its standard uncertainty [DN/s].

        Returns
        -------
        tuple[float, float]
            0 and the given uncertainty if the rate is not among the components.
        """
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

    Parameters
    ----------
    converged : Converged
        Fit of the curve.
    model : str
        Name of the model.
    factors : tuple[float, float]
        Square of the Birge ratio, and the factor of the scatter's variance.
    at : tuple[int, float] or None, default: None
        Index of an f-number among those of the curve, rising, and its value; None for
        any f-number.

    Returns
    -------
    tuple[dict of str to tuple[str, float], Prediction]
        Kind of each source with its share, and the errors.

    Notes
    -----
    What a source contributes to the error of a prediction w'y of theta + 2 b is v (w'Z
    - z), with z = 2 at the f-number whose b it is and 0 elsewhere. A share v_j with
    nu_j degrees of freedom has variance 2 v_j^2 / nu_j. The share of an estimated
    component is v_j w'Q_j w, with cov(v) from the information matrix; w minimises the
    total, so that it does not matter that w depends on v. Birge's ratio multiplies by
    chi^2 / dof, which has itself a relative variance of 2 / dof.
    """
    (excess, tails), solution, components = factors, converged.solution, converged.components
    jacobian = models.find_jacobian(model, solution.parameters)
    rows = jacobian[:, None] * solution.weights
    k = models.from_theta(model, solution.parameters)[0]
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
