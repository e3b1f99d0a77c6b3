"""Curve of one ISO value: four models fitted, judged and compared."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, get_args

import numpy as np

from radiometry.findings import InputRejected, shared
from radiometry.fitting.components import Vector
from radiometry.fitting.curve import CurveFit, fit_curve
from radiometry.fitting.evidence import Quantity
from radiometry.fitting.robust import weigh_points
from radiometry.fitting.sources import Curve
from radiometry.frame.exposure import expect_luminance_k
from radiometry.luminance.coefficient import Coefficient
from radiometry.luminance.decision import compute_risk, decide
from radiometry.luminance.flicker import estimate_flicker
from radiometry.luminance.lamp_kinds import find_modulation
from radiometry.luminance.points import Candidate, IsoSeries
from radiometry.luminance.report import list_budget, report_coefficient, report_model, report_points
from radiometry.luminance.results import IsoFit, Point
from radiometry.luminance.rows import Model, Params

_MOST_ITERATIONS, _TOLERANCE = 30, 0.01
_NO_LENS = Quantity(value=1.0, standard_uncertainty=0.0, unit="1")


def fit_series(
    series: IsoSeries, params: Params, *, calibration_u_rel: float, certified: bool
) -> tuple[IsoFit, tuple[Point, ...]]:
    """Fit all models to one ISO value and report the requested one.

    Parameters
    ----------
    series : IsoSeries
        Frames of one ISO value.
    params : Params
        Parameters of the fit.
    calibration_u_rel : float
        Relative standard uncertainty of the meter's calibration, common to all
        points: it does not average down.
    certified : bool
        False if K is relative only.

    Returns
    -------
    tuple[IsoFit, tuple[Point, ...]]
        Fit of the ISO value, and its points.

    Raises
    ------
    InputRejected
        `fit_failed` if the fit of the requested model does not converge.
    """
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
    """Return the verdict: each point with U of K at its f-number, where that was calibrated."""
    own = {each.f_number: each for each in coefficient.apertures or ()}
    against = {"tolerance_rel": params.tolerance_rel}
    judged = [
        (abs(point.residual_rel), own.get(point.f_number, coefficient))
        for point in points
        if point.residual_rel is not None
    ]
    widths = [(error, k.expanded_uncertainty / abs(k.luminance_k)) for error, k in judged]
    verdict: dict[str, Any] = {
        "largest_residual_rel": max(error for error, _ in judged),
        "passed": all(
            decide(params.acceptance, error_rel=error, expanded_u_rel=width if certified else None, **against)
            for error, width in widths
        ),
    }
    if params.acceptance and certified:
        verdict["expanded_u_rel"] = max(widths, key=sum)[1]
        verdict["beyond_tolerance_risk"] = max(
            compute_risk(
                error_rel=error, u_rel=k.luminance_k_standard_uncertainty / abs(k.luminance_k), **against
            )
            for error, k in judged
        )
    return verdict


def fit_coefficient(
    series: IsoSeries, params: Params, *, calibration_u_rel: float, curve: Curve | None = None
) -> tuple[Coefficient, CurveFit]:
    """Fit the requested model; the meter's calibration is added to u(K) at the end.

    Parameters
    ----------
    series : IsoSeries
        Frames of one ISO value.
    params : Params
        Parameters of the fit.
    calibration_u_rel : float
        Relative standard uncertainty of the meter's calibration.
    curve : Curve or None, default: None
        Points of the series; None to make them.

    Returns
    -------
    tuple[Coefficient, CurveFit]
        Coefficient, and the fit that it is from.

    Raises
    ------
    InputRejected
        `fit_failed` if the fit does not converge.
    """
    fit = fit_curve(curve or learn_lamp(_curve(series, params)), model=params.model)
    if fit is None:
        raise InputRejected(
            shared.FIT_FAILED,
            f"The fit of the {params.model} model to the points of ISO {series.iso:g} did not converge: "
            "look at them for a reading or a unit that is wrong, or choose the proportional model.",
        )
    return report_coefficient(series, params, fit, calibration_u_rel), fit


def learn_dark_rate(series: IsoSeries, params: Params) -> tuple[IsoSeries, Curve]:
    """Estimate the dark current from the light frames where dark frames of one time do not show it.

    Parameters
    ----------
    series : IsoSeries
        Frames of one ISO value.
    params : Params
        Parameters of the fit.

    Returns
    -------
    tuple[IsoSeries, Curve]
        The series with that dark signal against time, and its points.

    Notes
    -----
    An offset that grows with the exposure time is predicted together with K, from
    its plausible size v as prior variance: N - D - I (t - t_0) = K X. A prediction I
    beyond it replaces v by I^2 + u(I)^2, the estimate of a variance from one value
    by the EM algorithm. Light frames at the time of the dark frames cannot tell; I
    then stays 0 within its plausible size.
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
            _curve(series, params),
            dark_rate_u_dn_per_s=max(prior.rate_u_dn_per_s, math.hypot(rate, u_rate)),
            dark_rate_shift_dn_per_s=rate,
        )
        if converged:
            break
    return series, curve


def learn_lamp(curve: Curve) -> Curve:
    """Return the curve with the change between readings and frames of a lamp that drifts as the frames show.

    Notes
    -----
    A reading whose time is not known lies p of a scene from the middle of its frames, and
    errs by p r. With p of mean 0 and independent of the drift r, the variance of p r is
    var(p) (r^2 + u(r)^2), where r is predicted from the frames' own times and its prior
    uncertainty, which is all that is left where they show nothing.
    """
    if not np.any(curve.lamp_level_u_rel) or not np.any(curve.lamp_u_rel):
        return curve
    fit = fit_curve(curve, model="proportional")
    size = 1.0 if fit is None else fit.lamp_size
    return replace(curve, lamp_level_u_rel=size * curve.lamp_level_u_rel)


def _curve(series: IsoSeries, params: Params) -> Curve:
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
        scatter_weights=np.ones(len(used)),
        f_number_u_rel=params.f_number_u_rel,
        time_u_rel=params.exposure_time_u_rel,
        repeatability_u_rel=params.meter_repeatability_rel,
        lens_shares=through,
        lens_u_rel=np.array([share.standard_uncertainty for share in shares]) / through,
    )
    return weigh_points(curve, model=params.model) if params.estimator == "robust" else curve


def _estimate_flicker(used: Sequence[Candidate], params: Params) -> Vector | None:
    """Return u of the part of the lamp's periods that each frame sees; None where nothing is stated of it."""
    mains, kind = params.mains_frequency_hz, params.lamp_kind
    if mains is None and kind is None:
        return None
    depth = find_modulation(kind, params.lamp_modulation)
    return np.array([estimate_flicker(c.settings.exposure_time_s, mains, modulation=depth)[1] for c in used])
