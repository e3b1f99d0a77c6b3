"""A curve through measurements that share errors: the choice of its model, and robust weights."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.linalg import LinAlgError

from radiometry.fitting import gls, sources
from radiometry.fitting.components import Matrix, Problem, Vector, index_labels
from radiometry.fitting.sources import F_NUMBER, READING, SCATTER, TAIL_DOF, TAIL_FACTOR, Curve, list_sources
from radiometry.records import Record

# Relative standard uncertainty of a nominal f-number that nothing is known of. Nominal values are rounded by
# up to 2.8 % (f/11 for 11.314), which as a rectangular distribution is 2.8 / sqrt(3) %.
F_NUMBER_U_REL = 0.015

_FEWEST_F_NUMBERS = 3
_MAX_ITERATIONS = 200
_PATIENCE = 25
_RELATIVE_TOLERANCE = 1e-11
_COVERAGE = 0.95


class CurveFit(Record):
    """A model fitted to a calibration curve."""

    model: str
    parameters: Vector  # Fitted parameters, named by `models.PARAMETER_NAMES`
    covariance: Matrix  # Covariance of `parameters`, Birge ratio included, (p, p)
    k_weights: Vector  # Weight of each point's response in the model's first parameter, (n,)
    # For each source, its kind (A or B) and the relative variance that it contributes to the first parameter.
    # The excess from the Birge ratio is one of them.
    k_shares: dict[str, tuple[str, float]]
    # Errors at any f-number, then at each f-number of the points, rising; the first alone for "semilog", and
    # for points that do not tell f-numbers apart
    predictions: tuple[gls.Prediction, ...]
    # Relative standard uncertainty of one meter reading, given or estimated; None if the model does not use
    # one
    repeatability_u_rel: float | None
    # Relative standard uncertainty of a nominal f-number, given or estimated; None for "semilog"
    f_number_u_rel: float | None
    # Relative scatter between frames; 0 if the other sources explain the scatter of the points
    scatter_u_rel: float
    # Relative scatter to expect of a later frame: also where the other sources happen to explain the points
    later_scatter_u_rel: float
    later_scatter_dof: float
    scatter_errors_rel: Vector  # Predicted error of each point from that scatter, relative, (n,)
    # Prediction of the rate of the dark current relative to its expectation, from dark and light frames
    # together, and its standard uncertainty [DN/s]
    dark_rate_dn_per_s: float
    dark_rate_u_dn_per_s: float
    # Root mean square of the lamp's change that all scenes share, as the points show it, in units of its
    # given uncertainty; 1 if they cannot
    lamp_size: float
    chi_squared: float | None  # With all sources, and without the scatter between frames; None for "semilog"
    stated_chi_squared: float | None
    dof: int  # Points minus parameters
    birge_ratio: float  # sqrt(chi^2 / dof) where that exceeds 1, else 1
    log_likelihood: float  # Log likelihood of the signals in DN, comparable between models
    free_parameters: int  # Number of fitted parameters, estimated variances included

    def effective_dof(self, common_variance_rel: float = 0.0) -> float:
        """Return the degrees of freedom of K's variance, as `Prediction.effective_dof`."""
        return self.predictions[0].effective_dof(common_variance_rel)


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
    return float(scipy.special.stdtrit(dof, (1 + _COVERAGE) / 2))


def find_dof(factor: float) -> float:
    """Return the degrees of freedom that have a coverage factor for 95 %; infinite of 1.96 and less."""
    least = coverage_factor(1e9)
    return float(scipy.special.stdtridf((1 + _COVERAGE) / 2, factor)) if factor > least else math.inf


def fit_curve(curve: Curve, *, model: str, near: CurveFit | None = None) -> CurveFit | None:
    """Fit one model to a calibration curve by iterated generalised least squares.

    With the scatter of a fit ``near`` it that needed one, another is sought at once.

    The first three models are fitted to ln N. For N = K X the covariance of ln N is
    [1]::

        V_ik = (u(N_i)^2 [i=k] + u(D)^2) / (K^2 X_i X_k) + u_r^2 / m_s [same scene]
             + 4 u_f^2 [same f-number] + u_t^2 [same time] + u_s^2 [i=k]

    u_f may be None if it is not known. It is then estimated together with u_r, from the scatter between
    f-numbers, if there are at least three and the points separate it from u_r; else it is `F_NUMBER_U_REL`.
    The error of each f-number is predicted from the points in the same pass [4].

    To V are added u(V_i) u(V_k) / (V_i V_k) [same f-number] where N was divided by the vignetting V; u(N) and
    u(D) are then divided by V too. X has errors as well, so V_ik depends on K and is updated until K
    converges. u_s enters only if the other sources leave chi^2 / dof > 1; it and an u_r that is not given are
    estimated together by REML [2]. If chi^2 / dof is still above 1, the testable variances are multiplied by
    it (Birge [3]).

    u_s, the scatter of each frame's own light (shutter, aperture, lamp), is left
    out if it is 0, and if the points cannot separate it from u_r, as with one frame
    per scene. An error common to all points is not testable by their scatter.

    [1] JCGM 102:2011, doi:10.59161/JCGM102-2011
    [2] H. D. Patterson, R. Thompson, Biometrika 58, 545 (1971), doi:10.1093/biomet/58.3.545
    [3] R. T. Birge, Phys. Rev. 40, 207 (1932), doi:10.1103/PhysRev.40.207
    [4] G. K. Robinson, Statistical Science 6, 15 (1991), doi:10.1214/ss/1177011926
    """
    if len(curve.rhs) <= len(sources.PARAMETER_NAMES[model]):
        return None
    start = sources.start(model, curve.rhs, curve.signal_dn)
    curve = _complete(curve, model, start)
    if near is not None and near.scatter_u_rel:
        scattered = _add_scatter(curve, model, sources.to_theta(model, near.parameters))
        if scattered is not None:
            return _judge(curve, model, scattered, scattered.solution.chi_squared)
    stated = _converge(curve, model, start, scattered=False)
    if stated is not None and (model == "semilog" or stated.solution.chi_squared <= stated.dof):
        return _judge(curve, model, stated, stated.solution.chi_squared)
    # where points disagree, weights from noise alone can be so unequal that the iteration does not converge;
    # with the scatter term it does
    scattered = _add_scatter(curve, model, start if stated is None else stated.solution.parameters)
    if scattered is not None:
        return _judge(curve, model, scattered, _by_stated(scattered))
    return None if stated is None else _judge(curve, model, stated, stated.solution.chi_squared)


def _complete(curve: Curve, model: str, theta: Vector) -> Curve:
    """Return the curve with the usual uncertainty of an f-number where the points do not determine it."""
    if curve.f_number_u_rel is not None:
        return curve
    linear = sources.linearise(model, curve.rhs, curve.signal_dn, theta)
    if linear is not None and len(set(curve.f_numbers)) >= _FEWEST_F_NUMBERS and model != "semilog":
        components = list_sources(curve, linear, model=model, scattered=False)
        if gls.are_separable(linear.design, [each for each in components if each.variance is None]):
            return curve
    return replace(curve, f_number_u_rel=F_NUMBER_U_REL)


def _converge(curve: Curve, model: str, theta: Vector, *, scattered: bool) -> gls.Converged | None:
    """Update the weights until the parameters converge; None if they do not, or if no weights are left.

    Where each step is the one before it times a rate near 1, as an offset's that hardly counts, all the steps
    to come are taken at once: they are a geometric series (Aitken).
    """
    start: Sequence[float] | None = None
    last = np.zeros(len(curve.rhs))
    for turn in range(1, _MAX_ITERATIONS + 1):
        linear = linearise_curve(curve, model, theta)
        if linear is None:
            return None
        components = list_sources(curve, linear, model=model, scattered=scattered)
        try:
            solution = gls.solve(linear.design, linear.response, components, start=start)
        except LinAlgError:
            return None
        change = solution.parameters - theta
        step = linear.design @ change
        theta, start = solution.parameters, solution.variances
        if model == "semilog" or np.max(np.abs(step)) < _RELATIVE_TOLERANCE:
            return gls.Converged(linear=linear, components=components, solution=solution)
        rate = float(step @ last / (last @ last)) if turn % _PATIENCE == 0 else 0.0
        if 0.0 < rate < 1.0:
            theta = theta + rate / (1.0 - rate) * change
        last = step
    return None


def linearise_curve(curve: Curve, model: str, theta: Vector) -> sources.LinearModel | None:
    """Return the linear problem, in which the dark current's error has its expectation."""
    linear = sources.linearise(model, curve.rhs, curve.signal_dn, theta)
    if linear is None or not curve.dark_rate_shift_dn_per_s:
        return linear
    back = linear.per_dn / curve.lens_shares * curve.dark_lever_s * curve.dark_rate_shift_dn_per_s
    return replace(linear, response=linear.response + back)


def _add_scatter(curve: Curve, model: str, theta: Vector) -> gls.Converged | None:
    """Fit with the scatter between frames estimated too; None if the points do not determine it."""
    linear = linearise_curve(curve, model, theta)
    if linear is None or curve.scatter_u_rel is not None:
        return None
    components = list_sources(curve, linear, model=model, scattered=True)
    if not gls.are_separable(linear.design, [each for each in components if each.variance is None]):
        return None
    found = _converge(curve, model, theta, scattered=True)
    return found if found is not None and found.find_u(SCATTER) > 0.0 else None


def _by_stated(converged: gls.Converged) -> float:
    """Return chi^2 without the scatter between frames, each other source with the variance found for it."""
    variances = zip(converged.components, converged.solution.variances, strict=True)
    known = [replace(part, variance=variance) for part, variance in variances if part.source != SCATTER]
    return gls.solve(converged.linear.design, converged.linear.response, known).chi_squared


def _judge(curve: Curve, model: str, converged: gls.Converged, stated_chi_squared: float) -> CurveFit:
    """Compare the scatter with the uncertainties, and list the contributions to K's variance."""
    solution, dof, theta = converged.solution, converged.dof, converged.solution.parameters
    weighed = model != "semilog"
    excess = max(1.0, solution.chi_squared / dof) if weighed else 1.0
    later_scatter_u_rel, later_scatter_dof = _expect_scatter(curve, model, converged)
    # weights that were chosen by the residuals claim too much of the scatter
    factors = excess, TAIL_FACTOR if np.ptp(curve.scatter_weights) else 1.0
    shares, general = gls.predict_errors(converged, model, factors)
    rate, u_rate = converged.predict_dark_rate(curve)
    f_numbers = sorted(set(curve.f_numbers)) if weighed else []
    estimated = sum(component.variance is None for component in converged.components)
    return CurveFit(
        model=model,
        parameters=sources.from_theta(model, theta),
        covariance=np.sum(
            [np.array(general.fit), np.array(general.f_numbers), _square(general.times)], axis=0
        ),
        k_weights=solution.weights[0],
        k_shares=shares,
        predictions=(
            general,
            *(gls.predict_errors(converged, model, factors, at)[1] for at in enumerate(f_numbers)),
        ),
        repeatability_u_rel=converged.find_u(READING) if weighed else None,
        f_number_u_rel=converged.find_u(F_NUMBER) if weighed else None,
        scatter_u_rel=converged.find_u(SCATTER),
        later_scatter_u_rel=later_scatter_u_rel,
        later_scatter_dof=later_scatter_dof,
        scatter_errors_rel=converged.predict_scatter(curve.scatter_weights),
        dark_rate_dn_per_s=rate,
        dark_rate_u_dn_per_s=u_rate,
        lamp_size=converged.predict_lamp(curve) if weighed else 1.0,
        chi_squared=solution.chi_squared if weighed else None,
        stated_chi_squared=stated_chi_squared if weighed else None,
        dof=dof,
        birge_ratio=math.sqrt(excess),
        log_likelihood=solution.log_likelihood + converged.linear.log_jacobian,
        free_parameters=theta.size + estimated + (not weighed),
    )


def _expect_scatter(curve: Curve, model: str, converged: gls.Converged) -> tuple[float, float]:
    """Return the root of the mean variance between frames, 0 if the points show none, and its dof."""
    found = converged.find_u(SCATTER)
    if model == "semilog" or curve.scatter_u_rel is not None:
        return found, math.inf
    if not found:  # points that show no scatter have no outliers either
        curve = replace(curve, scatter_weights=np.ones_like(curve.scatter_weights))
    scatter = list_sources(curve, converged.linear, model=model, scattered=True)[-1]
    pairs = zip(converged.components, converged.solution.variances, strict=True)
    others = [(part, variance) for part, variance in pairs if part.source != SCATTER]
    free = [part for part, _ in others if part.variance is None]
    if not gls.are_separable(converged.linear.design, [*free, scatter]):
        return found, math.inf
    known = (replace(part, variance=variance) for part, variance in others)
    problem = Problem(converged.linear.design, converged.linear.response, (*known, scatter))
    variances = np.array([*(variance for _, variance in others), found**2])
    variance, dof = gls.expect_variance(problem, variances)
    return math.sqrt(variance), dof


def _square(rows: gls.Rows) -> Matrix:
    matrix = np.array(rows)
    return np.asarray(matrix @ matrix.T, np.float64)


def leave_scenes_out(fit: CurveFit, curve: Curve) -> list[float] | None:
    """Compute the error of the luminance of each point, predicted from the other scenes.

    The covariance, and the linearisation of a model that is not linear in ln N, are those of the whole curve;
    the parameters and the errors of the f-numbers are fitted again.
    """
    theta = sources.to_theta(fit.model, fit.parameters)
    linear = linearise_curve(curve, fit.model, theta)
    scenes = index_labels(curve.scenes)
    counts = np.bincount(scenes)
    if linear is None or len(scenes) - counts.max() <= theta.size:
        return None
    known = replace(
        curve,
        repeatability_u_rel=fit.repeatability_u_rel,
        f_number_u_rel=fit.f_number_u_rel,
        scatter_u_rel=fit.scatter_u_rel,
    )
    components = list_sources(known, linear, model=fit.model, scattered=False)
    try:
        rest = gls.leave_groups_out(linear.design, linear.response, components, scenes)
    except LinAlgError:
        return None
    f_numbers = index_labels(curve.f_numbers)
    errors: list[float] = []
    for scene, (parameters, predicted) in enumerate(rest):
        out = scenes == scene
        x_error = (
            2.0 * predicted[F_NUMBER][f_numbers[out]] if F_NUMBER in predicted else np.zeros(counts[scene])
        )
        found = sources.from_theta(fit.model, parameters).tolist()
        errors += [
            sources.invert(fit.model, found, signal) / x / math.exp(error) - 1.0
            for x, signal, error in zip(
                curve.rhs[out].tolist(), curve.signal_dn[out].tolist(), x_error.tolist(), strict=True
            )
        ]
    return errors if all(map(math.isfinite, errors)) else None


_SMALLEST_SCATTER_REL = 1e-3
_MOST_ITERATIONS = 50
_STRIDE = 3
_TOLERANCE = 1e-3


def weigh_points(curve: Curve, *, model: str) -> Curve:
    """Return the curve with a weight for the scatter of each point: 1 for most, near 0 for outliers.

    The scatter between frames is taken to follow Student's t with nu = 4 degrees of freedom instead of a
    normal distribution. With e_i the predicted error of a frame and s^2 the variance that REML finds with the
    weights so far, each round of the EM algorithm [1] sets::

        w_i = (nu + 1) / (nu + e_i^2 / s^2)

    s is at least 0.1 %: no shutter and no lamp repeat to better than that. With one
    frame per scene the error of a reading is one frame's too, and counts as scatter.
    Rounds of several outliers approach their end slowly: every third goes on in ln w as in `_converge`.

    [1] K. L. Lange, R. J. A. Little, J. M. G. Taylor, J. Am. Stat. Assoc. 84, 881 (1989),
        doi:10.1080/01621459.1989.10478852
    """
    if len(set(curve.scenes)) == len(curve.scenes) and curve.repeatability_u_rel is None:
        curve = replace(curve, repeatability_u_rel=0.0)
    fit, last = None, np.zeros(len(curve.rhs))
    for turn in range(1, _MOST_ITERATIONS + 1):
        fit = fit_curve(curve, model=model, near=fit)
        if fit is None:
            break
        spread: Vector = fit.scatter_errors_rel / max(fit.scatter_u_rel, _SMALLEST_SCATTER_REL)
        weights = (TAIL_DOF + 1.0) / (TAIL_DOF + spread**2)
        step: Vector = np.log(weights / curve.scatter_weights)
        converged = np.max(np.abs(weights - curve.scatter_weights)) < _TOLERANCE
        rate = float(step @ last / (last @ last)) if turn % _STRIDE == 0 else 0.0
        if not converged and 0.0 < rate < 1.0:
            weights = np.minimum(weights * np.exp(rate / (1.0 - rate) * step), 1.0 + 1.0 / TAIL_DOF)
        curve, last = replace(curve, scatter_weights=weights), step
        if converged:
            break
    return curve
