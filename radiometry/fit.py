"""One calibration curve: points with shared errors, a model, its parameters and what is known of them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from radiometry import models
from radiometry.gls import Component, Matrix, Solution, Vector, shared_structure, solve

_MOST_ROUNDS = 200
_SETTLED_REL = 1e-11
_COVERAGE = 0.95


@dataclass(frozen=True, kw_only=True)
class Curve:
    """The points of one curve, (n,) each, and the uncertainties that the caller knows.

    ``rhs`` : X = t S L / f^2; ``signal_dn`` : N above dark, > 0; ``signal_u_dn`` : of each point alone, > 0
    ``scenes``, ``f_numbers``, ``times_s`` : labels; points with one label share one error
    ``readings`` : how many meter readings were averaged for the point's scene
    ``dark_u_dn``, ``dark_dof`` : of the dark signal, which all points share
    ``repeatability_u_rel`` : of one meter reading; None: estimated from the scatter between scenes
    ``lens_shares`` : V, by which the signals were divided, 1 where vignetting is not corrected; so was their
        noise, and so is the dark signal's error; ``lens_u_rel`` : u(V) / V, shared within an f-number
    """

    rhs: Vector
    signal_dn: Vector
    signal_u_dn: Vector
    scenes: tuple[str, ...]
    f_numbers: tuple[float, ...]
    times_s: tuple[float, ...]
    readings: NDArray[np.int64]
    dark_u_dn: float
    dark_dof: float
    f_number_u_rel: float
    time_u_rel: float
    repeatability_u_rel: float | None
    lens_shares: Vector
    lens_u_rel: Vector

    def take(self, keep: NDArray[np.bool_], *, repeatability_u_rel: float | None) -> "Curve":
        """Give some of the points, with the meter's repeatability now known."""
        chosen = np.flatnonzero(keep)
        return Curve(
            rhs=self.rhs[keep],
            signal_dn=self.signal_dn[keep],
            signal_u_dn=self.signal_u_dn[keep],
            scenes=tuple(self.scenes[i] for i in chosen),
            f_numbers=tuple(self.f_numbers[i] for i in chosen),
            times_s=tuple(self.times_s[i] for i in chosen),
            readings=self.readings[keep],
            dark_u_dn=self.dark_u_dn,
            dark_dof=self.dark_dof,
            f_number_u_rel=self.f_number_u_rel,
            time_u_rel=self.time_u_rel,
            repeatability_u_rel=repeatability_u_rel,
            lens_shares=self.lens_shares[keep],
            lens_u_rel=self.lens_u_rel[keep],
        )


@dataclass(frozen=True, kw_only=True)
class CurveFit:
    """A model fitted to a curve.

    ``covariance`` : of ``parameters``, with the Birge ratio
    ``k_weights`` : (n,) weight of each point's response in the model's first parameter
    ``k_shares`` : source -> (kind, relative variance of the first parameter from it), Birge's excess too
    ``k_uncertainty_of_variance`` : half the variance of the relative variance of K, for the effective dof
    ``repeatability_u_rel`` : given or estimated; None where the model does not use one
    """

    model: str
    parameters: Vector
    covariance: Matrix
    k_weights: Vector
    k_shares: dict[str, tuple[str, float]]
    k_uncertainty_of_variance: float
    repeatability_u_rel: float | None
    chi_squared: float | None
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


def fit_curve(curve: Curve, *, model: str) -> CurveFit | None:
    """Fit one model to a curve by iterated generalised least squares.

    The covariance of ln N, here for N = K X, holds what points share [1]:
        V_ik = (u(N_i)^2 [i=k] + u(D)^2) / (K^2 X_i X_k)
             + u_r^2 / m_s [same scene] + 4 u_f^2 [same f-number] + u_t^2 [same time]
             + u(V_i) u(V_k) / (V_i V_k) [same f-number], where N was divided by V, and u(N), u(D) with it
    X carries errors too (effective variance), so V depends on K and is renewed until K settles. u_r is
    estimated by restricted maximum likelihood where it is not given. When chi^2 / dof > 1 the variances that
    the scatter can test are multiplied by it (Birge); an error common to all points is not among them.

    `semilog` is ordinary least squares, as the procedure does it.

    Returns None when there are too few points for the model or the iteration does not settle
    References [1] JCGM 102:2011; R. T. Birge, Phys. Rev. 40, 207, 1932
    """
    if len(curve.rhs) <= len(models.PARAMETER_NAMES[model]):
        return None
    theta = models.start(model, curve.rhs, curve.signal_dn)
    for _ in range(_MOST_ROUNDS):
        axes = models.lay_out(model, curve.rhs, curve.signal_dn, theta)
        if axes is None:
            return None
        components = _components(curve, axes, model)
        solution = solve(axes.design, axes.response, components)
        step = np.abs(axes.design @ (solution.parameters - theta))
        theta = solution.parameters
        if model == "semilog" or np.max(step) < _SETTLED_REL:
            return _judge(curve, model, axes, components, solution)
    return None


def _components(curve: Curve, axes: models.Axes, model: str) -> list[Component]:
    """List the sources of error with their structure in the units of the response."""
    n = len(curve.rhs)
    if model == "semilog":
        spread = _ordinary_variance(axes)
        return [Component(source="scatter", kind="A", structure=np.eye(n), variance=spread, dof=n - 2)]
    reading = axes.per_relative_x / np.sqrt(curve.readings)
    given = curve.repeatability_u_rel
    by_dark = axes.per_dn / curve.lens_shares
    return [
        Component(
            source="signal noise",
            kind="A",
            structure=np.diag((axes.per_dn * curve.signal_u_dn) ** 2),
            variance=1.0,
        ),
        Component(
            source="dark signal",
            kind="A" if math.isfinite(curve.dark_dof) else "B",
            structure=np.outer(by_dark, by_dark),
            variance=curve.dark_u_dn**2,
            dof=curve.dark_dof,
        ),
        Component(
            source="meter repeatability",
            kind="A" if given is None else "B",
            structure=shared_structure(curve.scenes, reading),
            variance=None if given is None else given**2,
        ),
        _relative("f-number", curve.f_numbers, 2 * axes.per_relative_x, curve.f_number_u_rel),
        _relative("exposure time", curve.times_s, axes.per_relative_x, curve.time_u_rel),
        *_of_lens(curve),
    ]


def _of_lens(curve: Curve) -> list[Component]:
    """Give the error of V; the response is ln N, so that V's relative error is its change."""
    if not np.any(curve.lens_u_rel):
        return []
    return [
        Component(
            source="vignetting",
            kind="B",
            structure=shared_structure(curve.f_numbers, curve.lens_u_rel),
            variance=1.0,
            common=len(set(curve.f_numbers)) == 1,
        )
    ]


def _relative(source: str, labels: Sequence[float], sensitivity: Vector, u_rel: float) -> Component:
    return Component(
        source=source,
        kind="B",
        structure=shared_structure(labels, sensitivity),
        variance=u_rel**2,
        common=len(set(labels)) == 1,
    )


def _ordinary_variance(axes: models.Axes) -> float:
    """Give the residual variance of ordinary least squares, > 0 also for points on a line."""
    _, p = axes.design.shape
    theta = np.linalg.lstsq(axes.design, axes.response, rcond=None)[0]
    residual = axes.response - axes.design @ theta
    smallest = (math.ulp(1.0) * float(np.max(np.abs(axes.response)))) ** 2
    return max(float(residual @ residual) / float(len(residual) - p), smallest)


def _judge(
    curve: Curve, model: str, axes: models.Axes, components: list[Component], solution: Solution
) -> CurveFit:
    """Compare the scatter with the uncertainties, and say what K's variance is made of."""
    n, p = axes.design.shape
    dof = n - p
    excess = max(1.0, solution.chi_squared / dof) if model != "semilog" else 1.0
    theta = solution.parameters
    factors = [1.0 if component.common else excess for component in components]
    covariance: Matrix = np.sum([f * c for f, c in zip(factors, solution.contributions, strict=True)], axis=0)
    shares, doubt = _k_variance(components, solution, excess=excess, dof=dof, model=model)
    estimated = [i for i, component in enumerate(components) if component.variance is None]
    repeatability = math.sqrt(solution.variances[estimated[0]]) if estimated else curve.repeatability_u_rel
    return CurveFit(
        model=model,
        parameters=models.from_theta(model, theta),
        covariance=models.covariance_from_theta(model, theta, covariance),
        k_weights=solution.weights[0],
        k_shares=shares,
        k_uncertainty_of_variance=doubt,
        repeatability_u_rel=None if model == "semilog" else repeatability,
        chi_squared=None if model == "semilog" else solution.chi_squared,
        dof=dof,
        birge_ratio=math.sqrt(excess),
        log_likelihood=solution.log_likelihood + axes.log_jacobian,
        free_parameters=p + len(estimated) + (model == "semilog"),
    )


def _k_variance(
    components: list[Component], solution: Solution, *, excess: float, dof: int, model: str
) -> tuple[dict[str, tuple[str, float]], float]:
    """Give the sources' shares of K's relative variance, and half the variance of their sum.

    A share v_j with nu_j degrees of freedom has variance 2 v_j^2 / nu_j. The estimated component's share is
    v w'Qw with var(v) from the information; Birge's ratio multiplies by chi^2 / dof, itself known to 2 / dof.
    """
    scale = models.relative_scale(model, solution.parameters)
    shares: dict[str, tuple[str, float]] = {}
    doubt = testable = 0.0
    for component, contribution in zip(components, solution.contributions, strict=True):
        share = max(0.0, scale * float(contribution[0, 0]))  # rounding can leave less than nothing
        shares[component.source] = (component.kind, share)
        if component.common:
            continue
        testable += share
        if component.variance is None:
            weight = solution.weights[0]
            slope = scale * float(weight @ component.structure @ weight)
            doubt += excess**2 * slope**2 * solution.variance_of_estimate / 2
        else:
            doubt += (excess * share) ** 2 / component.dof
    if excess > 1.0:
        shares["scatter beyond these"] = ("A", (excess - 1.0) * testable)
        doubt += (excess * testable) ** 2 / dof
    return shares, doubt
