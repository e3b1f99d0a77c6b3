"""Fit of one calibration curve: points with shared errors, a model, and its parameters."""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit

from radiometry.fitting import models
from radiometry.fitting.gls import Component, Matrix, Solution, Vector, are_separable, solve
from radiometry.fitting.sources import DARK_CURRENT, READING, SCATTER, TAIL_FACTOR, Curve, list_sources

_MAX_ITERATIONS = 200
_RELATIVE_TOLERANCE = 1e-11
_COVERAGE = 0.95


@dataclass(frozen=True, kw_only=True)
class CurveFit:
    """A model fitted to a calibration curve.

    Attributes
    ----------
    model : str
        Name of the model.
    parameters : ndarray of float64
        Fitted parameters, named by `models.PARAMETER_NAMES`.
    covariance : ndarray of float64
        Covariance of `parameters`, Birge ratio included, (p, p).
    k_weights : ndarray of float64
        Weight of each point's response in the model's first parameter, (n,).
    k_shares : dict of str to tuple[str, float]
        For each source, its kind (A or B) and the relative variance that it
        contributes to the first parameter. The excess from the Birge ratio is one
        of them.
    k_uncertainty_of_variance : float
        Half the variance of the relative variance of K, for the effective degrees
        of freedom.
    repeatability_u_rel : float or None
        Relative standard uncertainty of one meter reading, given or estimated; None
        if the model does not use one.
    scatter_u_rel : float
        Relative scatter between frames; 0 if the other sources explain the scatter
        of the points.
    scatter_errors_rel : ndarray of float64
        Predicted error of each point from that scatter, relative, (n,).
    dark_rate_dn_per_s, dark_rate_u_dn_per_s : float
        Prediction of the rate of the dark current relative to its expectation, from
        dark and light frames together, and its standard uncertainty [DN/s].
    chi_squared, stated_chi_squared : float or None
        With all sources, and without the scatter between frames; None for
        "semilog".
    dof : int
        Points minus parameters.
    birge_ratio : float
        sqrt(chi^2 / dof) where that exceeds 1, else 1.
    log_likelihood : float
        Log likelihood of the signals in DN, comparable between models.
    free_parameters : int
        Number of fitted parameters, estimated variances included.
    """

    model: str
    parameters: Vector
    covariance: Matrix
    k_weights: Vector
    k_shares: dict[str, tuple[str, float]]
    k_uncertainty_of_variance: float
    repeatability_u_rel: float | None
    scatter_u_rel: float
    scatter_errors_rel: Vector
    dark_rate_dn_per_s: float
    dark_rate_u_dn_per_s: float
    chi_squared: float | None
    stated_chi_squared: float | None
    dof: int
    birge_ratio: float
    log_likelihood: float
    free_parameters: int

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
        variance = sum(share for _, share in self.k_shares.values()) + common_variance_rel
        if self.k_uncertainty_of_variance == 0.0:
            return math.inf
        return max(1.0, variance**2 / self.k_uncertainty_of_variance)


def coverage_factor(dof: float) -> float:
    """Return the coverage factor k for a coverage probability of 95 %.

    Parameters
    ----------
    dof : float
        Effective degrees of freedom; may be infinite.

    Returns
    -------
    float
        Quantile of Student's t; 1.96 for infinite degrees of freedom.
    """
    return float(stdtrit(dof, (1 + _COVERAGE) / 2))


@dataclass(frozen=True, kw_only=True)
class _Converged:
    """Last iteration of a fit that converged."""

    linear: models.LinearModel
    components: list[Component]
    solution: Solution

    @property
    def dof(self) -> int:
        """Points minus parameters."""
        return self.linear.response.size - self.solution.parameters.size

    def find_u(self, source: str) -> float:
        """Return a source's standard uncertainty, 0 if it is not among the components.

        Parameters
        ----------
        source : str
            Name of the source.

        Returns
        -------
        float
            Square root of the source's variance.
        """
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

        Parameters
        ----------
        curve : Curve
            Points of the fit.

        Returns
        -------
        tuple[float, float]
            0 and the given uncertainty if the rate is not among the components.

        Notes
        -----
        With z the sensitivity of the response to the rate, v its variance and P as in
        the fit, the prediction is v z'P y, and its variance v - v^2 z'P z.
        """
        variance = self.find_u(DARK_CURRENT) ** 2
        if not variance:
            return 0.0, curve.dark_rate_u_dn_per_s
        sensitivity = self.linear.per_dn / curve.lens_shares * curve.dark_lever_s
        variances = zip(self.components, self.solution.variances, strict=True)
        known = [replace(component, variance=each) for component, each in variances]
        projected = solve(self.linear.design, sensitivity, known).projected
        left = 1.0 - variance * float(sensitivity @ projected)
        return variance * float(sensitivity @ self.solution.projected), math.sqrt(variance * max(left, 0.0))


def fit_curve(curve: Curve, *, model: str) -> CurveFit | None:
    """Fit one model to a calibration curve by iterated generalised least squares.

    Parameters
    ----------
    curve : Curve
        Points of one curve: X, signal above dark [DN], uncertainties, and the
        labels of shared errors.
    model : {"proportional", "affine", "power", "semilog"}
        Curve to fit. "semilog" is fitted by ordinary least squares, as the
        procedure does.

    Returns
    -------
    CurveFit or None
        None if there are no more points than parameters, or if the iteration does
        not converge.

    Notes
    -----
    The first three models are fitted to ln N. For N = K X the covariance of ln N is
    [1]_::

        V_ik = (u(N_i)^2 [i=k] + u(D)^2) / (K^2 X_i X_k) + u_r^2 / m_s [same scene]
             + 4 u_f^2 [same f-number] + u_t^2 [same time] + u_s^2 [i=k]

    plus u(V_i) u(V_k) / (V_i V_k) [same f-number] where N was divided by the
    vignetting V; u(N) and u(D) are then divided by V too. X has errors as well, so
    V_ik depends on K and is updated until K converges. u_s enters only if the other
    sources leave chi^2 / dof > 1; it and an u_r that is not given are estimated
    together by REML [2]_. If chi^2 / dof is still above 1, the testable variances
    are multiplied by it (Birge [3]_).

    u_s, the scatter of each frame's own light (shutter, aperture, lamp), is left
    out if it is 0, and if the points cannot separate it from u_r, as with one frame
    per scene. An error common to all points is not testable by their scatter.

    References
    ----------
    .. [1] JCGM 102:2011, doi:10.59161/JCGM102-2011
    .. [2] H. D. Patterson, R. Thompson, Biometrika 58, 545 (1971),
           doi:10.1093/biomet/58.3.545
    .. [3] R. T. Birge, Phys. Rev. 40, 207 (1932), doi:10.1103/PhysRev.40.207
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
    """Update the weights until the parameters converge; None if they do not, or if no weights are left."""
    for _ in range(_MAX_ITERATIONS):
        linear = _linearise(curve, model, theta)
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


def _linearise(curve: Curve, model: str, theta: Vector) -> models.LinearModel | None:
    """Return the linear problem, in which the dark current's error has its expectation."""
    linear = models.linearise(model, curve.rhs, curve.signal_dn, theta)
    if linear is None or not curve.dark_rate_shift_dn_per_s:
        return linear
    back = linear.per_dn / curve.lens_shares * curve.dark_lever_s * curve.dark_rate_shift_dn_per_s
    return replace(linear, response=linear.response + back)


def _add_scatter(curve: Curve, model: str, theta: Vector) -> _Converged | None:
    """Fit with the scatter between frames estimated too; None if the points do not determine it."""
    linear = _linearise(curve, model, theta)
    if linear is None or curve.scatter_u_rel is not None:
        return None
    components = list_sources(curve, linear, model=model, scattered=True)
    unknown = [component.structure for component in components if component.variance is None]
    if not are_separable(linear.design, unknown):
        return None
    found = _converge(curve, model, theta, scattered=True)
    return found if found is not None and found.find_u(SCATTER) > 0.0 else None


def _by_stated(converged: _Converged) -> float:
    """Return chi^2 without the scatter between frames, each other source with the variance found for it."""
    variances = zip(converged.components, converged.solution.variances, strict=True)
    known = [replace(part, variance=variance) for part, variance in variances if part.source != SCATTER]
    return solve(converged.linear.design, converged.linear.response, known).chi_squared


def _judge(curve: Curve, model: str, converged: _Converged, stated_chi_squared: float) -> CurveFit:
    """Compare the scatter with the uncertainties, and list the contributions to K's variance."""
    solution, dof, theta = converged.solution, converged.dof, converged.solution.parameters
    weighed = model != "semilog"
    excess = max(1.0, solution.chi_squared / dof) if weighed else 1.0
    # weights that were chosen by the residuals claim too much of the scatter
    tails = TAIL_FACTOR if np.ptp(curve.scatter_weights) else 1.0
    factors = [
        (1.0 if part.common else excess) * (tails if part.source == SCATTER else 1.0)
        for part in converged.components
    ]
    covariance: Matrix = np.sum([f * c for f, c in zip(factors, solution.contributions, strict=True)], axis=0)
    shares, doubt = _k_variance(converged, excess=excess, tails=tails, model=model)
    estimated = sum(component.variance is None for component in converged.components)
    rate, u_rate = converged.predict_dark_rate(curve)
    return CurveFit(
        model=model,
        parameters=models.from_theta(model, theta),
        covariance=models.covariance_from_theta(model, theta, covariance),
        k_weights=solution.weights[0],
        k_shares=shares,
        k_uncertainty_of_variance=doubt,
        repeatability_u_rel=_repeatability(curve, converged) if weighed else None,
        scatter_u_rel=converged.find_u(SCATTER),
        scatter_errors_rel=converged.predict_scatter(curve.scatter_weights),
        dark_rate_dn_per_s=rate,
        dark_rate_u_dn_per_s=u_rate,
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
    converged: _Converged, *, excess: float, tails: float, model: str
) -> tuple[dict[str, tuple[str, float]], float]:
    """Return the sources' shares of K's relative variance, and half the variance of their sum.

    Notes
    -----
    A share v_j with nu_j degrees of freedom has variance 2 v_j^2 / nu_j. The share
    of an estimated component is v_j w'Q_j w, with cov(v) from the information
    matrix. Birge's ratio multiplies by chi^2 / dof, which has itself a relative
    variance of 2 / dof.
    """
    solution = converged.solution
    scale = models.relative_scale(model, solution.parameters)
    weight = solution.weights[0]
    shares: dict[str, tuple[str, float]] = {}
    slopes: list[float] = []
    doubt = testable = given = 0.0
    for component, contribution in zip(converged.components, solution.contributions, strict=True):
        tail = tails if component.source == SCATTER else 1.0
        share = max(0.0, tail * scale * float(contribution[0, 0]))  # rounding can leave less than nothing
        shares[component.source] = (component.kind, share)
        if component.common:
            continue
        testable += share
        if component.variance is None:
            slopes.append(tail * scale * float(weight @ component.structure @ weight))
        else:
            given += share
            doubt += (excess * share) ** 2 / component.dof
    slope = np.array(slopes)
    doubt += excess**2 * float(slope @ solution.covariance_of_estimates @ slope) / 2
    if excess > 1.0:
        shares["scatter beyond these"] = ("A", (excess - 1.0) * testable)
        doubt += (excess * given) ** 2 / converged.dof
    return shares, doubt
