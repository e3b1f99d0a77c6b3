"""Results of the curve of one ISO value: coefficient, models, budget and points."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from radiometry.fitting import models
from radiometry.fitting.components import Vector
from radiometry.fitting.cross_validation import leave_scenes_out
from radiometry.fitting.curve import F_NUMBER_U_REL, CurveFit, coverage_factor
from radiometry.fitting.evidence import BudgetEntry
from radiometry.fitting.prediction import Prediction
from radiometry.fitting.sources import Curve
from radiometry.luminance.coefficient import Aperture, Coefficient, ErrorSplit
from radiometry.luminance.conditions import CalibrationConditions
from radiometry.luminance.points import Candidate, IsoSeries
from radiometry.luminance.results import ModelFit, Point
from radiometry.luminance.rows import Params


def report_model(fit: CurveFit, curve: Curve) -> ModelFit:
    """Return one model as it was fitted."""
    left_out = leave_scenes_out(fit, curve)
    dof = fit.effective_dof()
    return ModelFit(
        model=fit.model,
        parameter_names=models.PARAMETER_NAMES[fit.model],
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
    residual = curve.signal_dn - models.predict(fit.model, fit.parameters, curve.rhs)
    total = float(np.sum((curve.signal_dn - np.mean(curve.signal_dn)) ** 2))
    return _finite(1.0 - float(residual @ residual) / total) if total > 0.0 else None


def _aicc(fit: CurveFit, n: int) -> float | None:
    """Compute Akaike's criterion, corrected for few points; None if the correction is not defined.

    Notes
    -----
    With L the density of the signals in DN for every model [1]_::

        AICc = 2 q - 2 ln L + 2 q (q + 1) / (n - q - 1)

    References
    ----------
    .. [1] K. P. Burnham, D. R. Anderson, Model Selection and Multimodel Inference,
           Springer 2002, section 2.4, doi:10.1007/b97636
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
        luminance_k_unit=models.K_UNITS[fit.model],
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
        parameter_names=models.PARAMETER_NAMES[fit.model],
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
        conditions=_find_conditions(used, params),
        errors=_split(fit.predictions[0]) if fit.model != "semilog" else None,
        apertures=tuple(_aperture(each, fit, used, calibration) for each in fit.predictions[1:]) or None,
    )


def _expand(prediction: Prediction, k: float, calibration_u_rel: float) -> tuple[float, float, float]:
    """Return u(K) with the meter's calibration, its coverage factor and its degrees of freedom."""
    dof = prediction.effective_dof(calibration_u_rel**2)
    u_rel = math.sqrt(prediction.k_variance_rel + calibration_u_rel**2)
    return abs(k) * u_rel, coverage_factor(dof), dof


def _foresee(params: Params, fit: CurveFit) -> float:
    """Return u(f) / f of an aperture that was not calibrated: it may be rounded as any nominal value is."""
    if params.f_number_u_rel is not None:
        return params.f_number_u_rel
    return max(fit.f_number_u_rel or 0.0, F_NUMBER_U_REL)


def _split(prediction: Prediction) -> ErrorSplit:
    return ErrorSplit(fit=prediction.fit, f_numbers=prediction.f_numbers, exposure_times=prediction.times)


def _aperture(
    prediction: Prediction, fit: CurveFit, used: Sequence[Candidate], calibration_u_rel: float
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


def list_budget(fit: CurveFit, calibration_u_rel: float) -> tuple[BudgetEntry, ...]:
    """List the contributions to u(K); the variance shares add up to one."""
    shares = dict(fit.k_shares)
    if fit.model != "semilog":
        shares["meter calibration"] = ("B", calibration_u_rel**2)
    total = math.fsum(share for _, share in shares.values())
    return tuple(
        BudgetEntry(source=source, kind=kind, u_rel=math.sqrt(share), variance_share=share / total)
        for source, (kind, share) in shares.items()
    )


def report_points(
    series: IsoSeries, fit: CurveFit, robust: Vector | None, *, channel: str
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
        fitted = _finite(float(models.predict(model, parameters, candidate.rhs * factor)))
        rhs = models.invert(model, parameters, adjusted) / factor
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
