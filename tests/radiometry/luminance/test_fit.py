"""K from rows: by hand, its uncertainty, the models beside one another, and what does not matter."""

import dataclasses
import json
import math
import random as python_random

import numpy as np
import pytest
from pydantic import TypeAdapter
from scipy.stats import multivariate_normal

from radiometry.findings import InputRejected
from radiometry.luminance import codes
from radiometry.luminance import method as luminance
from radiometry.luminance.corrections import estimate_flicker
from radiometry.luminance.results import Coefficient
from radiometry.luminance.rows import Params
from tests.radiometry.coefficients import apply_coefficient
from tests.radiometry.luminance.exact import (
    DARK,
    DARKS,
    LIGHTS,
    PARAMS,
    READINGS,
    ROWS,
    SCENES,
    K,
    fit,
    light,
    point,
    raised,
)


def test_exact_points_give_k_and_no_flag():
    result = fit()
    coefficient = result.iso_fits[0].coefficient
    assert coefficient.luminance_k == pytest.approx(K, rel=1e-9)
    assert coefficient.luminance_k_unit == "DN*m2/(cd*s)"
    assert coefficient.dark_signal_dn == DARK
    assert result.flags == ()
    assert result.passed


def test_uncertainty_by_hand():
    """Three scenes at 1 %, f-numbers at 2 * 1.5 %, times at 0.5 % (one per scene); meter 1.5, lamp 0.6 %."""
    rows = tuple(
        dataclasses.replace(r, statistics=(dataclasses.replace(r.statistics[0], std_dn=1.0, n=10**8),))
        for r in ROWS
    )
    iso_fit = fit(rows).iso_fits[0]
    coefficient = iso_fit.coefficient
    expected = math.sqrt((0.01**2 + 4 * 0.015**2 + 0.005**2) / 3 + 0.015**2 + 0.006**2)
    assert coefficient.luminance_k_standard_uncertainty / K == pytest.approx(expected, rel=1e-4)
    assert coefficient.expanded_uncertainty == pytest.approx(1.96 * K * expected, rel=1e-3)
    budget = {entry.source: entry for entry in iso_fit.budget}
    assert budget["meter calibration"].u_rel == pytest.approx(0.015)
    assert budget["f-number"].u_rel == pytest.approx(0.03 / math.sqrt(3), rel=1e-3)
    assert sum(entry.variance_share for entry in iso_fit.budget) == pytest.approx(1.0)


def test_the_meters_calibration_does_not_average_down():
    with_meter, without = (
        fit(),
        fit(readings=[dataclasses.replace(r, expanded_uncertainty_rel=0.0) for r in READINGS]),
    )
    u_with, u_without = (
        r.iso_fits[0].coefficient.luminance_k_standard_uncertainty / K for r in (with_meter, without)
    )
    assert u_with**2 - u_without**2 == pytest.approx(0.015**2, rel=1e-9)


def test_order_changes_no_bit_of_a_scattered_campaign(drawn):
    random, shuffler, params = np.random.default_rng(5), python_random.Random(4), Params(panel_rho=0.8)
    rows = [
        dataclasses.replace(
            row,
            statistics=tuple(
                dataclasses.replace(s, mean_dn=DARK + (s.mean_dn - DARK) * factor) for s in row.statistics
            ),
        )
        for row, factor in zip(drawn.rows, random.normal(1.0, 0.01, len(drawn.rows)), strict=True)
    ]
    readings = list(drawn.readings)
    first = luminance.fit(rows, readings, params)
    assert first.iso_fits[0].models[0].frame_scatter_rel == pytest.approx(0.01, rel=0.5)
    assert first.iso_fits[0].coefficient.frame_scatter_rel == first.iso_fits[0].models[0].frame_scatter_rel
    shuffler.shuffle(rows)
    shuffler.shuffle(readings)
    assert luminance.fit(rows, readings, params) == first


@pytest.mark.parametrize("model", ["proportional", "affine", "power", "semilog"])
def test_results_are_plain_finite_json(drawn, model):
    result = luminance.fit(drawn.rows, drawn.readings, Params(model=model))
    text = json.dumps(dataclasses.asdict(result), allow_nan=False)
    back = json.loads(text)["iso_fits"][0]["coefficient"]
    again = TypeAdapter(Coefficient).validate_python(back)
    assert again.luminance_k == result.iso_fits[0].coefficient.luminance_k
    exposure = drawn.rows[0].exposure
    apply_coefficient(drawn.rows[0].statistics, exposure=exposure, coefficients=[again])


def test_every_iso_has_its_own_k(drawn):
    result = luminance.fit(drawn.rows, drawn.readings, PARAMS)
    assert [f.coefficient.iso for f in result.iso_fits] == [3200.0, 12800.0]
    for iso_fit in result.iso_fits:
        coefficient = iso_fit.coefficient
        assert abs(coefficient.luminance_k - 30.0) < 3 * coefficient.luminance_k_standard_uncertainty


def test_all_models_are_reported_and_the_true_one_has_the_best_aicc(drawn):
    reports = {m.model: m for m in luminance.fit(drawn.rows, drawn.readings, PARAMS).iso_fits[0].models}
    assert list(reports) == ["proportional", "affine", "power", "semilog"]
    assert min(reports.values(), key=lambda m: m.aicc).model != "semilog"
    assert reports["proportional"].aicc < reports["semilog"].aicc - 100
    assert reports["semilog"].left_out_max_rel > 10 * reports["proportional"].left_out_max_rel
    assert abs(reports["power"].parameters[1] - 1) < 3 * math.sqrt(reports["power"].covariance[1][1])
    assert reports["proportional"].r_squared > 0.99


def test_aicc_by_hand():
    """K and the scatter between frames: -2 ln L of twelve normal ln N, the change of axis, the penalty."""
    params = Params(meter_repeatability_rel=0.0, f_number_u_rel=0.0, exposure_time_u_rel=0.0)
    rows = [
        light(s, f, k=K * 1.01 ** (-1) ** n) for s in SCENES for n, f in enumerate((5.6, 8.0, 16.0, 11.0))
    ]
    result = fit((*rows, *DARKS), params=params)
    report, coefficient = result.iso_fits[0].models[0], result.iso_fits[0].coefficient
    signal = np.array([p.adjusted_signal_dn for p in result.points])
    fitted = np.array([p.fitted_signal_dn for p in result.points])
    times = np.array([p.exposure_time_s for p in result.points])
    u_dark, u_rate = (
        coefficient.dark_signal_standard_uncertainty_dn,
        coefficient.dark_rate_standard_uncertainty_dn_per_s * (times - coefficient.dark_time_s),
    )
    covariance = (0.2**2 * np.eye(12) + u_dark**2 + np.outer(u_rate, u_rate)) / np.outer(fitted, fitted)
    covariance += 0.006**2
    covariance += report.frame_scatter_rel**2 * np.eye(12)
    density = multivariate_normal(np.log(fitted), covariance).logpdf(np.log(signal)) - np.log(signal).sum()
    assert report.aicc == pytest.approx(2 * 2 - 2 * density + 12 / 9)


def test_leaving_a_scene_out_by_hand():
    """One reading is 10 % high: its scene's prediction from the two others is that much too low."""
    readings = [dataclasses.replace(r, value=r.value * 1.1) if r.scene == "dim" else r for r in READINGS]
    report = fit(readings=readings).iso_fits[0].models[0]
    others = 1 / math.sqrt(1.1)  # either of the others, seen from the mean of itself's like and the wrong one
    assert report.left_out_max_rel == pytest.approx(1 - 1 / 1.1, rel=2e-3)
    assert report.left_out_rms_rel == pytest.approx(
        math.sqrt(((1 - 1 / 1.1) ** 2 + 2 * (1 / others - 1) ** 2) / 3), rel=2e-2
    )


def test_semilog_is_flagged_and_fails_where_proportional_passes():
    result = fit(params=dataclasses.replace(PARAMS, model="semilog"))
    assert raised(result, codes.SEMILOG_MODEL) == [""]
    assert raised(result, codes.TOLERANCE_EXCEEDED) == ["iso 3200"]
    assert result.iso_fits[0].coefficient.luminance_k_unit == "DN"
    assert fit().passed


def test_verdict_is_the_largest_error_against_the_tolerance():
    rows = (*LIGHTS[1:], light("bright", 5.6, k=K * 1.06), *DARKS)
    result = fit(rows)
    worst = max(abs(p.residual_rel) for p in result.points)
    assert result.iso_fits[0].largest_residual_rel == worst
    assert 0.04 < worst < 0.065
    assert not result.passed
    assert raised(result, codes.TOLERANCE_EXCEEDED) == ["iso 3200"]
    assert fit(rows, params=dataclasses.replace(PARAMS, tolerance_rel=0.07)).passed


def test_guard_band_needs_the_tolerance_for_error_and_uncertainty_together():
    rows = (*LIGHTS[1:], light("bright", 5.6, k=K * 1.02), *DARKS)
    for rule, tolerance in (("guarded", 0.02), ("guarded", 0.2), ("shared_risk", 0.04), ("shared_risk", 0.2)):
        stated = dataclasses.replace(PARAMS, acceptance=rule, tolerance_rel=tolerance)
        result = fit(rows, params=stated)
        (one,) = result.iso_fits
        u_of = {k.f_number: k.expanded_uncertainty / k.luminance_k for k in one.coefficient.apertures}
        used = [(abs(p.residual_rel), u_of[p.f_number]) for p in result.points]
        assert one.expanded_u_rel == max(used, key=sum)[1]
        assert one.largest_residual_rel < 0.02
        assert result.passed is (max(map(sum if rule == "guarded" else max, used)) <= tolerance)
        assert 0.0 <= one.beyond_tolerance_risk < 0.5
        if not result.passed:
            (flag,) = [each for each in result.flags if each.flag == codes.TOLERANCE_EXCEEDED]
            assert f"U {one.expanded_u_rel:.1%}" in flag.detail
    assert fit(rows).iso_fits[0].expanded_u_rel is None


def test_flicker_of_the_lamp_is_a_line_of_k_where_the_mains_is_stated():
    """Exposures of whole periods of 50 Hz mains, and a lamp on direct current, have no such line."""
    plain, whole, direct, stated = (
        fit(params=dataclasses.replace(PARAMS, mains_frequency_hz=mains, lamp_modulation=depth)).iso_fits[0]
        for mains, depth in ((None, None), (50.0, 1.0), (47.0, 0.0), (47.0, 0.5))
    )
    assert plain.budget == whole.budget == direct.budget
    (line,) = [entry for entry in stated.budget if entry.source == "flicker"]
    us = [estimate_flicker(point.exposure_time_s, 47.0, modulation=(0.5, 0.5))[1] for point in fit().points]
    # one error per frame averages over the frames
    assert max(us) / len(us) / 2 < line.u_rel < max(us) / math.sqrt(len(us) / 2)
    assert line.kind == "B"


@pytest.mark.parametrize("rule", ["simple", "guarded", "shared_risk"])
def test_a_guard_band_accepts_no_k_that_is_relative_only(rule):
    stated = dataclasses.replace(PARAMS, acceptance=rule, tolerance_rel=0.5)
    bare = [dataclasses.replace(r, expanded_uncertainty_rel=None, coverage_factor=None) for r in READINGS]
    result = fit(readings=bare, params=stated)
    assert result.passed is (rule == "simple")
    assert result.iso_fits[0].expanded_u_rel is None
    assert result.iso_fits[0].beyond_tolerance_risk is None
    details = [each.detail for each in result.flags if each.flag == codes.TOLERANCE_EXCEEDED]
    assert ["meter certificate" in each for each in details] == [True] * (rule != "simple")


def test_lamp_response_and_colour_are_kept_with_k():
    stated = dataclasses.replace(PARAMS, lamp="A", camera_response="Nikon D5100", focus_distance_m=1.5)
    result = fit(params=stated)
    assert (result.spectral.lamp, result.spectral.camera_response) == ("A", "Nikon D5100")
    assert result.spectral.f1_prime == pytest.approx(0.65, abs=0.006)
    kept = result.iso_fits[0].coefficient.conditions
    assert (kept.lamp, kept.focus_distance_m, kept.colour) == ("A", 1.5, None)  # these frames are grey
    assert (fit().spectral, fit().iso_fits[0].coefficient.conditions) == (None, None)
    with pytest.raises(InputRejected):
        dataclasses.replace(PARAMS, lamp="candle")


def test_points_carry_their_numbers():
    found = point(fit(), "middle-3200-8")
    assert found.rhs == pytest.approx(0.1 * 3200 * 5.0 / 64)
    assert found.adjusted_signal_dn == pytest.approx(K * found.rhs)
    assert found.fitted_signal_dn == pytest.approx(found.adjusted_signal_dn)
    assert found.fitted_luminance_cd_m2 == pytest.approx(5.0)
    assert found.residual_rel == pytest.approx(0.0, abs=1e-9)
    assert sum(p.weight for p in fit().points) == pytest.approx(1.0)


def test_several_readings_of_a_scene_are_averaged():
    more = [*READINGS, dataclasses.replace(READINGS[0], value=52.0)]
    scene = next(s for s in fit(readings=more).scenes if s.scene == "bright")
    assert (scene.readings, scene.luminance_cd_m2) == (2, 51.0)
    assert scene.spread_rel == pytest.approx(2 / 51)


def test_the_range_of_validity():
    coefficient = fit().iso_fits[0].coefficient
    assert coefficient.exposure_times_s == pytest.approx((0.01, 0.1, 1.0))
    assert coefficient.f_number_range == (5.6, 16.0)
    assert coefficient.rhs_range == pytest.approx((6.25, 1600 / 5.6**2))
    assert coefficient.signal_range_dn == pytest.approx((187.5, 48000 / 5.6**2))


def test_the_basis_is_used():
    """All f/11 for 11.314: K found on the APEX basis is greater by (11.314 / 11)^2 = 5.8 %."""
    rows = [
        dataclasses.replace(
            row,
            exposure=dataclasses.replace(
                row.exposure,
                f_number_apex=row.exposure.f_number * 2**3.5 / 11,
                exposure_time_apex_s=row.exposure.exposure_time_s,
            ),
        )
        for row in ROWS
    ]
    result = fit(rows, params=dataclasses.replace(PARAMS, exposure_basis="apex"))
    assert result.iso_fits[0].coefficient.luminance_k == pytest.approx(K * 2**7 / 121, rel=1e-9)
    assert result.iso_fits[0].coefficient.exposure_basis == "apex"
