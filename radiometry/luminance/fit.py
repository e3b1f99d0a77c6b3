"""Curve of one ISO value: four models fitted and compared, the verdict, and the results."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, get_args

import numpy as np
import scipy

from radiometry.findings import shared
from radiometry.fitting import components, evidence, gls, sources
from radiometry.fitting.curve import (
    F_NUMBER_U_REL,
    CurveFit,
    coverage_factor,
    fit_curve,
    leave_scenes_out,
    weigh_points,
)
from radiometry.fitting.evidence import Acceptance
from radiometry.fitting.sources import Curve
from radiometry.frame.exposure import expect_luminance_k
from radiometry.luminance.corrections import estimate_flicker
from radiometry.luminance.points import Candidate, IsoSeries
from radiometry.luminance.results import Aperture, Coefficient, ErrorSplit, IsoFit, ModelFit, Point
from radiometry.luminance.rows import CalibrationConditions, Model, Params
from radiometry.spectral.lamps import find_modulation

_MOST_ITERATIONS, _TOLERANCE = 30, 0.01
_NO_LENS = evidence.Quantity(1.0, 0.0, "1")


def fit_series(
    series: IsoSeries, params: Params, *, calibration_u_rel: float, certified: bool
) -> tuple[IsoFit, tuple[Point, ...]]:
    """Fit all models to one ISO value and report the requested one."""
    series, curve = learn_dark_rate(series, params)
    curve = learn_lamp(curve)
    coefficient, chosen = fit_coefficient(series, params, calibration_u_rel=calibration_u_rel, curve=curve)
    others = [fit_curve(curve, model=model) if model != params.model else chosen for model in get_args(Model)]
    robust = curve.scatter_weights if params.estimator == "robust" else None
    points = report_points(series, chosen, robust, channel=params.channel)
    return IsoFit(
        coefficient=coefficient,
        models=tuple(report_model(fit, curve) for fit in others if fit is not None),
        budget=list_budget(chosen, calibration_u_rel),
        chi_squared_per_dof=None if chosen.chi_squared is None else chosen.chi_squared / chosen.dof,
        birge_ratio=chosen.birge_ratio,
        expected_k=expect_luminance_k(
            black_level_dn=coefficient.black_level_dn, white_level_dn=coefficient.white_level_dn
        ),
        **_judge(points, coefficient, params, certified=certified),
    ), points


def _judge(
    points: Sequence[Point], coefficient: Coefficient, params: Params, *, certified: bool
) -> dict[str, Any]:
    """Return the verdict: the residuals of the points, and u of K at each f-number, against the tolerance."""
    errors = [
        (k.luminance_k_standard_uncertainty / abs(k.luminance_k), k.effective_dof or math.inf)
        for k in coefficient.apertures or (coefficient,)
    ]
    risk, u_rel, dof = max(
        (compute_risk(u_rel=u, dof=dof, tolerance_rel=params.tolerance_rel), u, dof) for u, dof in errors
    )
    residual = max(abs(point.residual_rel) for point in points if point.residual_rel is not None)
    verdict: dict[str, Any] = {
        "largest_residual_rel": residual,
        "passed": decide(
            params.acceptance,
            residual_rel=residual,
            u_rel=u_rel if certified else math.inf,
            dof=dof,
            tolerance_rel=params.tolerance_rel,
        ),
    }
    if params.acceptance and certified:
        verdict["expanded_u_rel"] = coverage_factor(dof) * u_rel
        verdict["beyond_tolerance_risk"] = risk
    return verdict


def fit_coefficient(
    series: IsoSeries, params: Params, *, calibration_u_rel: float, curve: Curve | None = None
) -> tuple[Coefficient, CurveFit]:
    """Fit the requested model; the meter's calibration is added to u(K) at the end."""
    fit = fit_curve(curve or learn_lamp(_curve(series, params)), model=params.model)
    if fit is None:
        raise shared.FIT_FAILED.reject(
            f"The fit of the {params.model} model to the points of ISO {series.iso:g} did not converge: "
            "look at them for a reading or a unit that is wrong."
        )
    return report_coefficient(series, params, fit, calibration_u_rel), fit


def learn_dark_rate(series: IsoSeries, params: Params) -> tuple[IsoSeries, Curve]:
    """Estimate the dark current from the light frames where dark frames of one time do not show it.

    An offset that grows with the exposure time is predicted together with K, from its plausible size v as
    prior variance: N - D - I (t - t_0) = K X. A prediction I beyond it replaces v by I^2 + u(I)^2, the
    estimate of a variance from one value by the EM algorithm. Light frames at the time of the dark frames
    cannot tell; I then stays 0 within its plausible size.
    """
    prior, curve = series.dark, _curve(series, params)
    if prior.rate_measured or not (prior.rate_u_dn_per_s and np.any(curve.dark_lever_s)):
        return series, curve
    for _ in range(_MOST_ITERATIONS):
        fit = fit_curve(curve, model="proportional")
        if fit is None:
            break
        rate, u_rate = fit.dark_rate_dn_per_s, fit.dark_rate_u_dn_per_s
        dark = replace(prior, rate_dn_per_s=rate, rate_u_dn_per_s=u_rate)
        found = replace(
            series,
            dark=dark,
            candidates=tuple(replace(c, dark=dark.at(c.settings.exposure_time_s)) for c in series.candidates),
        )
        if any(c.above_dark_dn <= 0.0 for c in found.used):
            break
        converged = abs(rate - curve.dark_rate_shift_dn_per_s) < _TOLERANCE * u_rate
        series = found
        curve = replace(
            _curve(series, params, curve.scatter_weights),
            dark_rate_u_dn_per_s=max(prior.rate_u_dn_per_s, math.hypot(rate, u_rate)),
            dark_rate_shift_dn_per_s=rate,
        )
        if converged:
            break
    return series, curve


def learn_lamp(curve: Curve) -> Curve:
    """Return the curve with the change between readings and frames of a lamp that drifts as the frames show.

    A reading whose time is not known lies p of a scene from the middle of its frames, and errs by p r. With p
    of mean 0 and independent of the drift r, the variance of p r is var(p) (r^2 + u(r)^2), where r is
    predicted from the frames' own times and its prior uncertainty, which is all that is left where they show
    nothing.
    """
    if not np.any(curve.lamp_level_u_rel) or not np.any(curve.lamp_u_rel):
        return curve
    fit = fit_curve(curve, model="proportional")
    size = 1.0 if fit is None else fit.lamp_size
    return replace(curve, lamp_level_u_rel=size * curve.lamp_level_u_rel)


def _curve(series: IsoSeries, params: Params, weights: components.Vector | None = None) -> Curve:
    """Return the points of a series; a robust fit begins with the ``weights`` of an earlier one."""
    used = series.used
    shares = [c.lens_share or _NO_LENS for c in used]
    through = np.array([share.value for share in shares])
    dark = series.dark
    curve = Curve(
        rhs=np.array([candidate.rhs for candidate in used], np.float64),
        signal_dn=np.array([c.adjusted_dn for c in used]),
        signal_u_dn=np.array(
            [math.hypot(c.signal.standard_uncertainty_dn, dark.frame_spread_dn) for c in used]
        )
        / through,
        scenes=tuple(c.scene for c in used),
        f_numbers=tuple(c.settings.f_number for c in used),
        times_s=tuple(c.settings.exposure_time_s for c in used),
        readings=np.array([c.readings for c in used]),
        dark_u_dn=dark.standard_uncertainty_dn,
        dark_dof=dark.dof,
        dark_lever_s=np.array([c.settings.exposure_time_s - dark.time_s for c in used]),
        dark_rate_u_dn_per_s=dark.rate_u_dn_per_s,
        dark_rate_measured=dark.rate_measured,
        lamp_u_rel=np.array([c.lamp.u_rel for c in used]),
        lamp_labels=tuple(c.lamp.label for c in used),
        lamp_level_u_rel=np.array([c.lamp.level_u_rel for c in used]),
        flicker_u_rel=_estimate_flicker(used, params),
        scatter_weights=np.ones(len(used)) if weights is None else weights,
        f_number_u_rel=params.f_number_u_rel,
        time_u_rel=params.exposure_time_u_rel,
        repeatability_u_rel=params.meter_repeatability_rel,
        lens_shares=through,
        lens_u_rel=np.array([share.standard_uncertainty for share in shares]) / through,
    )
    return weigh_points(curve, model=params.model) if params.estimator == "robust" else curve


def _estimate_flicker(used: Sequence[Candidate], params: Params) -> components.Vector | None:
    """Return u of the part of the lamp's periods that each frame sees; None where nothing is stated of it."""
    mains, kind = params.mains_frequency_hz, params.lamp_kind
    if mains is None and kind is None:
        return None
    depth = find_modulation(kind, params.lamp_modulation)
    return np.array([estimate_flicker(c.settings.exposure_time_s, mains, modulation=depth)[1] for c in used])


def decide(
    rule: Acceptance | None, *, residual_rel: float, u_rel: float, dof: float, tolerance_rel: float
) -> bool:
    """Return True if K is accepted by a decision rule.

    With the largest residual r, the tolerance T and Student's t of u(K) [1]: simple r <= T; guarded
    t_95 u(K) <= T, one-sided; shared risk r <= T and U = t_97.5 u(K) <= T. A residual holds the error of its
    scene's reading, too: it cannot say how far off K is, whose own estimated error is 0.

    [1] JCGM 106:2012, sections 8 and 9.3, doi:10.59161/JCGM106-2012
    """
    if rule == "guarded":
        return float(scipy.special.stdtrit(dof, 0.95)) * u_rel <= tolerance_rel
    widest = coverage_factor(dof) * u_rel if rule == "shared_risk" else 0.0
    return max(residual_rel, widest) <= tolerance_rel


def compute_risk(*, u_rel: float, dof: float, tolerance_rel: float) -> float:
    """Compute the probability that K is off by more than the tolerance.

    The specific risk of a decision [1] for an error of mean 0, with Student's t of its degrees of freedom::

        p = 2 P(t > T / u)

    [1] JCGM 106:2012, section 9.3, doi:10.59161/JCGM106-2012
    """
    return 2.0 * float(scipy.special.stdtr(dof, -tolerance_rel / u_rel)) if u_rel else 0.0


def report_model(fit: CurveFit, curve: Curve) -> ModelFit:
    left_out = leave_scenes_out(fit, curve)
    dof = fit.effective_dof()
    return ModelFit(
        model=fit.model,
        parameter_names=sources.PARAMETER_NAMES[fit.model],
        parameters=tuple(float(value) for value in fit.parameters),
        covariance=tuple(tuple(float(value) for value in row) for row in fit.covariance),
        r_squared=_r_squared(fit, curve),
        aicc=_aicc(fit, len(curve.rhs)),
        chi_squared=fit.chi_squared,
        dof=fit.dof,
        birge_ratio=fit.birge_ratio,
        effective_dof=_finite(dof),
        meter_repeatability_rel=fit.repeatability_u_rel,
        left_out_max_rel=max(map(abs, left_out)) if left_out else None,
        left_out_rms_rel=math.hypot(*left_out) / math.sqrt(len(left_out)) if left_out else None,
        frame_scatter_rel=fit.scatter_u_rel or None,
        stated_chi_squared=fit.stated_chi_squared if fit.scatter_u_rel else None,
        f_number_u_rel=fit.f_number_u_rel,
    )


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _r_squared(fit: CurveFit, curve: Curve) -> float | None:
    """Compute 1 - SS_residual / SS_total of the signals [DN^2], on the same axis for every model."""
    residual = curve.signal_dn - sources.predict(fit.model, fit.parameters, curve.rhs)
    total = float(np.sum((curve.signal_dn - np.mean(curve.signal_dn)) ** 2))
    return _finite(1.0 - float(residual @ residual) / total) if total > 0.0 else None


def _aicc(fit: CurveFit, n: int) -> float | None:
    """Compute Akaike's criterion, corrected for few points; None if the correction is not defined.

    With L the density of the signals in DN for every model [1]::

        AICc = 2 q - 2 ln L + 2 q (q + 1) / (n - q - 1)

    [1] K. P. Burnham, D. R. Anderson, Model Selection and Multimodel Inference, Springer 2002, section 2.4,
    doi:10.1007/b97636
    """
    q = fit.free_parameters
    if n - q - 1 <= 0:
        return None
    return 2 * q - 2 * fit.log_likelihood + 2 * q * (q + 1) / (n - q - 1)


def report_coefficient(
    series: IsoSeries, params: Params, fit: CurveFit, calibration_u_rel: float
) -> Coefficient:
    """Return the calibration of the ISO value, with K at each f-number."""
    used = series.used
    k = float(fit.parameters[0])
    # semilog has no K that scales with the meter: its slope is in DN
    calibration = calibration_u_rel if fit.model != "semilog" else 0.0
    u_k, factor, dof = _expand(fit.predictions[0], k, calibration)
    adjusted = [c.above_dark_dn for c in used]
    rhs = [c.rhs for c in used if c.rhs is not None]
    return Coefficient(
        iso=series.iso,
        model=fit.model,
        channel=params.channel,
        exposure_basis=params.exposure_basis,
        luminance_k=k,
        luminance_k_standard_uncertainty=u_k,
        luminance_k_unit=sources.K_UNITS[fit.model],
        expanded_uncertainty=factor * u_k,
        coverage_factor=factor,
        effective_dof=_finite(dof),
        dark_signal_dn=series.dark.signal_dn,
        dark_signal_standard_uncertainty_dn=series.dark.standard_uncertainty_dn,
        dark_time_s=series.dark.time_s,
        dark_rate_dn_per_s=series.dark.rate_dn_per_s,
        dark_rate_standard_uncertainty_dn_per_s=series.dark.rate_u_dn_per_s,
        black_level_dn=math.fsum(sorted(c.signal.black_level_dn for c in used)) / len(used),
        white_level_dn=min(c.signal.white_level_dn for c in used),
        parameter_names=sources.PARAMETER_NAMES[fit.model],
        parameters=tuple(float(value) for value in fit.parameters),
        covariance=tuple(tuple(float(value) for value in row) for row in fit.covariance),
        meter_calibration_u_rel=calibration_u_rel,
        f_number_u_rel=_foresee(params, fit),
        exposure_time_u_rel=params.exposure_time_u_rel,
        exposure_times_s=tuple(sorted({c.settings.exposure_time_s for c in used})),
        f_number_range=_range([c.settings.f_number for c in used]),
        signal_range_dn=_range(adjusted),
        rhs_range=_range(rhs),
        vignetting=params.vignetting,
        frame_scatter_rel=fit.later_scatter_u_rel or None,
        frame_scatter_dof=_finite(fit.later_scatter_dof),
        conditions=_find_conditions(used, params),
        errors=_split(fit.predictions[0]) if fit.model != "semilog" else None,
        apertures=tuple(_aperture(each, fit, used, calibration) for each in fit.predictions[1:]) or None,
    )


def _expand(prediction: gls.Prediction, k: float, calibration_u_rel: float) -> tuple[float, float, float]:
    """Return u(K) with the meter's calibration, its coverage factor and its degrees of freedom."""
    dof = prediction.effective_dof(calibration_u_rel**2)
    u_rel = math.sqrt(prediction.k_variance_rel + calibration_u_rel**2)
    return abs(k) * u_rel, coverage_factor(dof), dof


def _foresee(params: Params, fit: CurveFit) -> float:
    """Return u(f) / f of an aperture that was not calibrated: it may be rounded as any nominal value is."""
    if params.f_number_u_rel is not None:
        return params.f_number_u_rel
    return max(fit.f_number_u_rel or 0.0, F_NUMBER_U_REL)


def _split(prediction: gls.Prediction) -> ErrorSplit:
    return ErrorSplit(fit=prediction.fit, f_numbers=prediction.f_numbers, exposure_times=prediction.times)


def _aperture(
    prediction: gls.Prediction, fit: CurveFit, used: Sequence[Candidate], calibration_u_rel: float
) -> Aperture:
    slope = float(fit.parameters[1]) if fit.model == "power" else 1.0
    k = float(fit.parameters[0]) * math.exp(slope * prediction.x_error)
    u_k, factor, dof = _expand(prediction, k, calibration_u_rel)
    scenes = [c.scene for c in used if c.settings.f_number == prediction.f_number]
    return Aperture(
        f_number=prediction.f_number or 0.0,
        scenes=len(set(scenes)),
        frames=len(scenes),
        luminance_k=k,
        luminance_k_standard_uncertainty=u_k,
        expanded_uncertainty=factor * u_k,
        coverage_factor=factor,
        effective_dof=_finite(dof),
        x_factor=math.exp(prediction.x_error),
        errors=_split(prediction),
    )


def _find_conditions(used: Sequence[Candidate], params: Params) -> CalibrationConditions | None:
    """Return what the campaign states of lamp and distance, with the colour of its frames."""
    stated = CalibrationConditions(
        lamp=params.lamp,
        camera_response=params.camera_response,
        focus_distance_m=params.focus_distance_m,
        focal_length_mm=params.focal_length_mm,
        lamp_kind=params.lamp_kind,
    )
    if stated == CalibrationConditions():
        return None
    colours = [c.colour for c in used if c.colour]
    if not colours or len(colours) < len(used):
        return stated
    red, blue = np.median(colours, axis=0)
    return replace(stated, colour=(float(red), float(blue)))


def _range(values: Sequence[float]) -> tuple[float, float]:
    return min(values), max(values)


def list_budget(fit: CurveFit, calibration_u_rel: float) -> tuple[evidence.BudgetEntry, ...]:
    """List the contributions to u(K); the variance shares add up to one."""
    shares = dict(fit.k_shares)
    if fit.model != "semilog":
        shares["meter calibration"] = ("B", calibration_u_rel**2)
    total = math.fsum(share for _, share in shares.values())
    return tuple(
        evidence.BudgetEntry(source=source, kind=kind, u_rel=math.sqrt(share), variance_share=share / total)
        for source, (kind, share) in shares.items()
    )


def report_points(
    series: IsoSeries, fit: CurveFit, robust: components.Vector | None, *, channel: str
) -> tuple[Point, ...]:
    """Report every light frame: the used ones with their weight, all with the values of the curve."""
    names = [c.frame for c in series.used]
    weights = dict(zip(names, fit.k_weights.tolist(), strict=True))
    weighed = {} if robust is None else dict(zip(names, robust.tolist(), strict=True))
    factors = {each.f_number: math.exp(each.x_error) for each in fit.predictions[1:]}
    parameters = fit.parameters.tolist()
    return tuple(
        replace(
            _point(series.iso, fit.model, parameters, c, factors.get(c.settings.f_number)),
            weight=weights.get(c.frame, 0.0),
            robust_weight=weighed.get(c.frame),
            min_dn=min(row.min_dn for row in c.select_rows(channel)),
            max_dn=max(row.max_dn for row in c.select_rows(channel)),
        )
        for c in series.candidates
    )


def _point(
    iso: float, model: str, parameters: list[float], candidate: Candidate, x_factor: float | None
) -> Point:
    adjusted = candidate.adjusted_dn
    factor = 1.0 if x_factor is None else x_factor
    fitted = error = None
    if candidate.rhs is not None:
        fitted = _finite(float(sources.predict(model, parameters, candidate.rhs * factor)))
        rhs = sources.invert(model, parameters, adjusted) / factor
        error = _finite(rhs / candidate.rhs - 1.0) if not candidate.left_out else None
    luminance = candidate.luminance_cd_m2
    return Point(
        frame=candidate.frame,
        scene=candidate.scene,
        iso=iso,
        exposure_time_s=candidate.settings.exposure_time_s,
        f_number=candidate.settings.f_number,
        used=not candidate.left_out,
        left_out=candidate.left_out,
        luminance_cd_m2=luminance,
        rhs=candidate.rhs,
        signal_dn=candidate.signal.value_dn,
        signal_standard_uncertainty_dn=candidate.signal.standard_uncertainty_dn,
        saturated_share=candidate.signal.saturated_share,
        dark_signal_dn=candidate.dark.signal_dn,
        adjusted_signal_dn=adjusted,
        fitted_signal_dn=fitted,
        fitted_luminance_cd_m2=luminance * (1.0 + error)
        if luminance is not None and error is not None
        else None,
        residual_rel=error,
        weight=0.0,
        lens_share=candidate.lens_share,
        x_factor=x_factor,
    )
