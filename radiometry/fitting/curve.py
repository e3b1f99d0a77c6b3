"""One calibration curve: points with shared errors, a model, its parameters and what is known of them."""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit

from radiometry.fitting import models
from radiometry.fitting.gls import Component, Matrix, Solution, Vector, are_separable, solve
from radiometry.fitting.sources import READING, SCATTER, Curve, list_sources

_MAX_ITERATIONS = 200
_RELATIVE_TOLERANCE = 1e-11
_COVERAGE = 0.95


@dataclass(frozen=True, kw_only=True)
class CurveFit:
    """A model fitted to a curve.

    ``covariance`` : of ``parameters``, with the Birge ratio
    ``k_weights`` : (n,) weight of each point's response in the model's first parameter
    ``k_shares`` : source -> (kind, relative variance of the first parameter from it), Birge's excess too
    ``k_uncertainty_of_variance`` : half the variance of the relative variance of K, for the effective dof
    ``repeatability_u_rel`` : given or estimated; None where the model does not use one
    ``scatter_u_rel`` : between frames, 0 where the other sources explain how the points scatter
    ``chi_squared`` : with all sources; ``stated_chi_squared`` : without the scatter between frames
    """

    model: str
    parameters: Vector
    covariance: Matrix
    k_weights: Vector
    k_shares: dict[str, tuple[str, float]]
    k_uncertainty_of_variance: float
    repeatability_u_rel: float | None
    scatter_u_rel: float
    chi_squared: float | None
    stated_chi_squared: float | None
    dof: int
    birge_ratio: float
    log_likelihood: float
    free_parameters: int

    def effective_dof(self, common_variance_rel: float = 0.0) -> float:
        """Degrees of freedom of K's variance (Welch, Satterthwaite), a further exact variance included."""
        variance = sum(share for _, share in self.k_shares.values()) + common_variance_rel
        if self.k_uncertainty_of_variance == 0.0:
            return math.inf
        return max(1.0, variance**2 / self.k_uncertainty_of_variance)


def coverage_factor(dof: float) -> float:
    """Give k for a level of confidence of 95 %: Student's t, 1.96 for infinite degrees of freedom."""
    return float(stdtrit(dof, (1 + _COVERAGE) / 2))


@dataclass(frozen=True, kw_only=True)
class _Converged:
    """The iteration's last round."""

    linear: models.LinearModel
    components: list[Component]
    solution: Solution

    @property
    def dof(self) -> int:
        """Points without parameters."""
        return self.linear.response.size - self.solution.parameters.size

    def find_u(self, source: str) -> float:
        """Give a source's standard uncertainty, 0 where it is not among them."""
        variances = zip(self.components, self.solution.variances, strict=True)
        return math.sqrt(sum(variance for component, variance in variances if component.source == source))


def fit_curve(curve: Curve, *, model: str) -> CurveFit | None:
    """Fit one model to a curve by iterated generalised least squares.

    The covariance of ln N, here for N = K X, holds what points share [1]:
        V_ik = (u(N_i)^2 [i=k] + u(D)^2) / (K^2 X_i X_k)
             + u_r^2 / m_s [same scene] + 4 u_f^2 [same f-number] + u_t^2 [same time]
             + u(V_i) u(V_k) / (V_i V_k) [same f-number], where N was divided by V, and u(N), u(D) with it
             + u_s^2 [i=k], only where the other sources leave chi^2 / dof > 1
    X carries errors too (effective variance), so V depends on K and is renewed until K settles. u_r, where it
    is not given, and u_s, of each frame's own light (shutter, aperture, lamp), are estimated together by
    restricted maximum likelihood [2]. u_s stays out where it is 0, and where the points cannot tell it from
    u_r, as with one frame per scene. What chi^2 / dof is then still above 1 multiplies the variances that the
    scatter can test (Birge [3]); an error common to all points is not among them.

    `semilog` is ordinary least squares, as the procedure does it.

    Returns None when there are too few points for the model or the iteration does not settle
    References [1] JCGM 102:2011; [2] `gls.estimate_variances`; [3] Phys. Rev. 40, 207, 1932
    """
    if len(curve.rhs) <= len(models.PARAMETER_NAMES[model]):
        return None
    start = models.start(model, curve.rhs, curve.signal_dn)
    stated = _converge(curve, model, start, scattered=False)
    if stated is not None and (model == "semilog" or stated.solution.chi_squared <= stated.dof):
        return _judge(curve, model, stated, stated.solution.chi_squared)
    # noise alone can weigh points that disagree so unlike that nothing settles: with their scatter it does
    scattered = _add_scatter(curve, model, start if stated is None else stated.solution.parameters)
    if scattered is not None:
        return _judge(curve, model, scattered, _by_stated(scattered))
    return None if stated is None else _judge(curve, model, stated, stated.solution.chi_squared)


def _converge(curve: Curve, model: str, theta: Vector, *, scattered: bool) -> _Converged | None:
    """Renew the weights until the parameters settle; None where they do not, or no weights are left."""
    for _ in range(_MAX_ITERATIONS):
        linear = models.linearise(model, curve.rhs, curve.signal_dn, theta)
        if linear is None:
            return None
        components = list_sources(curve, linear, model=model, scattered=scattered)
        try:
            solution = solve(linear.design, linear.response, components)
        except np.linalg.LinAlgError:
            return None
        step = np.abs(linear.design @ (solution.parameters - theta))
        theta = solution.parameters
        if model == "semilog" or np.max(step) < _RELATIVE_TOLERANCE:
            return _Converged(linear=linear, components=components, solution=solution)
    return None


def _add_scatter(curve: Curve, model: str, theta: Vector) -> _Converged | None:
    """Fit with the scatter between frames estimated too; None where the points say nothing about it."""
    linear = models.linearise(model, curve.rhs, curve.signal_dn, theta)
    if linear is None or curve.scatter_u_rel is not None:
        return None
    components = list_sources(curve, linear, model=model, scattered=True)
    unknown = [component.structure for component in components if component.variance is None]
    if not are_separable(linear.design, unknown):
        return None
    found = _converge(curve, model, theta, scattered=True)
    return found if found is not None and found.find_u(SCATTER) > 0.0 else None


def _by_stated(converged: _Converged) -> float:
    """Give chi^2 as the other sources alone would have it, each with the variance that was found."""
    variances = zip(converged.components, converged.solution.variances, strict=True)
    known = [replace(part, variance=variance) for part, variance in variances if part.source != SCATTER]
    return solve(converged.linear.design, converged.linear.response, known).chi_squared


def _judge(curve: Curve, model: str, converged: _Converged, stated_chi_squared: float) -> CurveFit:
    """Compare the scatter with the uncertainties, and say what K's variance is made of."""
    solution, dof, theta = converged.solution, converged.dof, converged.solution.parameters
    weighed = model != "semilog"
    excess = max(1.0, solution.chi_squared / dof) if weighed else 1.0
    factors = [1.0 if component.common else excess for component in converged.components]
    covariance: Matrix = np.sum([f * c for f, c in zip(factors, solution.contributions, strict=True)], axis=0)
    shares, doubt = _k_variance(converged, excess=excess, model=model)
    estimated = sum(component.variance is None for component in converged.components)
    return CurveFit(
        model=model,
        parameters=models.from_theta(model, theta),
        covariance=models.covariance_from_theta(model, theta, covariance),
        k_weights=solution.weights[0],
        k_shares=shares,
        k_uncertainty_of_variance=doubt,
        repeatability_u_rel=_repeatability(curve, converged) if weighed else None,
        scatter_u_rel=converged.find_u(SCATTER),
        chi_squared=solution.chi_squared if weighed else None,
        stated_chi_squared=stated_chi_squared if weighed else None,
        dof=dof,
        birge_ratio=math.sqrt(excess),
        log_likelihood=solution.log_likelihood + converged.linear.log_jacobian,
        free_parameters=theta.size + estimated + (not weighed),
    )


def _repeatability(curve: Curve, converged: _Converged) -> float:
    given = curve.repeatability_u_rel
    return converged.find_u(READING) if given is None else given


def _k_variance(
    converged: _Converged, *, excess: float, model: str
) -> tuple[dict[str, tuple[str, float]], float]:
    """Give the sources' shares of K's relative variance, and half the variance of their sum.

    A share v_j with nu_j degrees of freedom has variance 2 v_j^2 / nu_j. An estimated component's share is
    v_j w'Q_j w, with cov(v) from the information; Birge's ratio multiplies by chi^2 / dof, itself known to
    2 / dof.
    """
    solution = converged.solution
    scale = models.relative_scale(model, solution.parameters)
    weight = solution.weights[0]
    shares: dict[str, tuple[str, float]] = {}
    slopes: list[float] = []
    doubt = testable = given = 0.0
    for component, contribution in zip(converged.components, solution.contributions, strict=True):
        share = max(0.0, scale * float(contribution[0, 0]))  # rounding can leave less than nothing
        shares[component.source] = (component.kind, share)
        if component.common:
            continue
        testable += share
        if component.variance is None:
            slopes.append(scale * float(weight @ component.structure @ weight))
        else:
            given += share
            doubt += (excess * share) ** 2 / component.dof
    slope = np.array(slopes)
    doubt += excess**2 * float(slope @ solution.covariance_of_estimates @ slope) / 2
    if excess > 1.0:
        shares["scatter beyond these"] = ("A", (excess - 1.0) * testable)
        doubt += (excess * given) ** 2 / converged.dof
    return shares, doubt
