"""K from rows: by hand, its uncertainty, the models beside one another, and what does not matter."""

import json
import math
import random as python_random
from dataclasses import asdict, replace

import numpy as np
import pytest
from pydantic import TypeAdapter
from scipy.stats import multivariate_normal

from radiometry.findings import InputRejected, shared
from radiometry.fitting.evidence import Exclusion
from radiometry.luminance import codes
from radiometry.luminance import method as luminance
from radiometry.luminance.corrections import estimate_flicker
from radiometry.luminance.results import Coefficient
from radiometry.luminance.rows import Params
from radiometry.luminance.suggestions import find_gaps, plan
from tests.radiometry.coefficients import apply_coefficient
from tests.radiometry.evidence import reading
from tests.radiometry.luminance.exact import (
    DARK,
    DARKS,
    LIGHTS,
    PARAMS,
    READINGS,
    ROWS,
    SCENES,
    K,
    dark,
    fit,
    light,
    point,
    raised,
    statistics,
)


def test_exact_points_give_k_their_own_numbers_its_range_and_no_flag():
    result = fit()
    coefficient = result.iso_fits[0].coefficient
    assert coefficient.luminance_k == pytest.approx(K, rel=1e-9)
    assert coefficient.luminance_k_unit == "DN*m2/(cd*s)"
    assert coefficient.dark_signal_dn == DARK
    assert (result.flags, result.passed) == ((), True)
    found = point(result, "middle-3200-8")
    assert found.rhs == pytest.approx(0.1 * 3200 * 5.0 / 64)
    assert found.adjusted_signal_dn == pytest.approx(K * found.rhs)
    assert found.fitted_signal_dn == pytest.approx(found.adjusted_signal_dn)
    assert found.fitted_luminance_cd_m2 == pytest.approx(5.0)
    assert found.residual_rel == pytest.approx(0.0, abs=1e-9)
    assert sum(p.weight for p in result.points) == pytest.approx(1.0)
    assert coefficient.exposure_times_s == pytest.approx((0.01, 0.1, 1.0))
    assert coefficient.f_number_range == (5.6, 16.0)
    assert coefficient.rhs_range == pytest.approx((6.25, 1600 / 5.6**2))
    assert coefficient.signal_range_dn == pytest.approx((187.5, 48000 / 5.6**2))


def test_uncertainty_by_hand():
    """Three scenes at 1 %, f-numbers at 2 * 1.5 %, times at 0.5 % (one per scene); meter 1.5, lamp 0.6 %."""
    rows = tuple(replace(r, statistics=(replace(r.statistics[0], std_dn=1.0, n=10**8),)) for r in ROWS)
    iso_fit = fit(rows).iso_fits[0]
    coefficient = iso_fit.coefficient
    expected = math.sqrt((0.01**2 + 4 * 0.015**2 + 0.005**2) / 3 + 0.015**2 + 0.006**2)
    assert coefficient.luminance_k_standard_uncertainty / K == pytest.approx(expected, rel=1e-4)
    assert coefficient.expanded_uncertainty == pytest.approx(1.96 * K * expected, rel=1e-3)
    budget = {entry.source: entry for entry in iso_fit.budget}
    assert budget["meter calibration"].u_rel == pytest.approx(0.015)
    assert budget["f-number"].u_rel == pytest.approx(0.03 / math.sqrt(3), rel=1e-3)
    assert sum(entry.variance_share for entry in iso_fit.budget) == pytest.approx(1.0)


def test_order_changes_no_bit_of_a_scattered_campaign(drawn):
    random, shuffler, params = np.random.default_rng(5), python_random.Random(4), Params(panel_rho=0.8)
    rows = [
        replace(
            row,
            statistics=tuple(replace(s, mean_dn=DARK + (s.mean_dn - DARK) * factor) for s in row.statistics),
        )
        for row, factor in zip(drawn.rows, random.normal(1.0, 0.01, len(drawn.rows)), strict=True)
    ]
    readings = list(drawn.readings)
    first = luminance.fit(rows, readings, params)
    assert first.iso_fits[0].models[0].frame_scatter_rel == pytest.approx(0.01, rel=0.5)
    found = first.iso_fits[0].models[0].frame_scatter_rel
    assert first.iso_fits[0].coefficient.frame_scatter_rel == pytest.approx(found, rel=0.1)
    shuffler.shuffle(rows)
    shuffler.shuffle(readings)
    assert luminance.fit(rows, readings, params) == first


@pytest.mark.parametrize("model", ["proportional", "semilog"])
def test_results_are_plain_finite_json(drawn, model):
    result = luminance.fit(drawn.rows, drawn.readings, Params(model=model))
    text = json.dumps(asdict(result), allow_nan=False)
    back = json.loads(text)["iso_fits"][0]["coefficient"]
    again = TypeAdapter(Coefficient).validate_python(back)
    assert again.luminance_k == result.iso_fits[0].coefficient.luminance_k
    exposure = drawn.rows[0].exposure
    apply_coefficient(drawn.rows[0].statistics, exposure=exposure, coefficients=[again])


def test_every_iso_has_its_own_k_and_all_models_are_reported_the_true_one_with_the_best_aicc(drawn):
    iso_fits = luminance.fit(drawn.rows, drawn.readings, PARAMS).iso_fits
    assert [each.coefficient.iso for each in iso_fits] == [3200.0, 12800.0]
    for k in (each.coefficient for each in iso_fits):
        assert abs(k.luminance_k - 30.0) < 3 * k.luminance_k_standard_uncertainty
    reports = {m.model: m for m in iso_fits[0].models}
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
    readings = [replace(r, value=r.value * 1.1) if r.scene == "dim" else r for r in READINGS]
    report = fit(readings=readings).iso_fits[0].models[0]
    others = 1 / math.sqrt(1.1)  # either of the others, seen from the mean of itself's like and the wrong one
    assert report.left_out_max_rel == pytest.approx(1 - 1 / 1.1, rel=2e-3)
    assert report.left_out_rms_rel == pytest.approx(
        math.sqrt(((1 - 1 / 1.1) ** 2 + 2 * (1 / others - 1) ** 2) / 3), rel=2e-2
    )


def test_semilog_is_flagged_and_fails_where_proportional_passes():
    result = fit(params=replace(PARAMS, model="semilog"))
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
    assert fit(rows, params=replace(PARAMS, tolerance_rel=0.07)).passed


def test_rules_judge_the_uncertainty_of_k():
    """A residual holds its reading's error: a guarded verdict does not take it for that of K."""
    rows = (*LIGHTS[1:], light("bright", 5.6, k=K * 1.02), *DARKS)
    apertures = fit(rows).iso_fits[0].coefficient.apertures
    widest = max(k.luminance_k_standard_uncertainty / k.luminance_k for k in apertures)
    for rule, factor, risk in (("guarded", 1.645, 0.1), ("shared_risk", 1.96, 0.05)):
        for tolerance, passed in ((0.9 * factor * widest, False), (1.5 * factor * widest, True)):
            stated = replace(PARAMS, acceptance=rule, tolerance_rel=tolerance)
            result = fit(rows, params=stated)
            (one,) = result.iso_fits
            assert result.passed is passed
            assert one.expanded_u_rel == max(k.expanded_uncertainty / k.luminance_k for k in apertures)
            assert (one.beyond_tolerance_risk < risk) is passed
            if not passed:
                (flag,) = [each for each in result.flags if each.flag == codes.TOLERANCE_EXCEEDED]
                assert f"U {one.expanded_u_rel:.1%}" in flag.detail
    assert fit(rows).iso_fits[0].expanded_u_rel is None


def test_an_offset_that_hardly_counts_converges():
    """Frames without noise: nearly every offset is as likely, and each step is 0.999 of the one before."""
    random = np.random.default_rng(0)
    scenes = {scene: 50.0 / 2.5**n for n, scene in enumerate("abcdefg")}
    rows = [
        light(scene, f, time_s=0.5 / value, mean_dn=DARK + K * 0.5 * 3200.0 / f**2)
        for scene, value in scenes.items()
        for f in (2.8, 4.0, 5.6, 8.0)
    ]
    rows += DARKS
    quiet = [replace(row, statistics=(replace(row.statistics[0], std_dn=1.0),)) for row in rows]
    readings = [
        reading(scene, value * (1.0 + 0.005 * random.standard_normal()))
        for scene, value in scenes.items()
        for _ in range(2)
    ]
    stated = Params(model="affine", f_number_u_rel=0.015)
    found = fit(quiet, readings, stated).iso_fits[0].coefficient
    assert abs(found.parameters[1]) < 2.0 * math.sqrt(found.covariance[1][1])
    assert found.luminance_k == pytest.approx(K, rel=0.01)


def test_flicker_of_the_lamp_is_a_line_of_k_where_the_mains_is_stated():
    """Exposures of whole periods of 50 Hz mains, and a lamp on direct current, have no such line."""
    plain, whole, direct, stated = (
        fit(params=replace(PARAMS, mains_frequency_hz=mains, lamp_modulation=depth)).iso_fits[0]
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
    stated = replace(PARAMS, acceptance=rule, tolerance_rel=0.5)
    bare = [replace(r, expanded_uncertainty_rel=None, coverage_factor=None) for r in READINGS]
    result = fit(readings=bare, params=stated)
    assert result.passed is (rule == "simple")
    assert result.iso_fits[0].expanded_u_rel is None
    assert result.iso_fits[0].beyond_tolerance_risk is None
    details = [each.detail for each in result.flags if each.flag == codes.TOLERANCE_EXCEEDED]
    assert ["meter certificate" in each for each in details] == [True] * (rule != "simple")


def test_lamp_response_and_colour_are_kept_with_k():
    stated = replace(PARAMS, lamp="A", camera_response="Nikon D5100", focus_distance_m=1.5)
    result = fit(params=stated)
    assert (result.spectral.lamp, result.spectral.camera_response) == ("A", "Nikon D5100")
    assert result.spectral.f1_prime == pytest.approx(0.65, abs=0.006)
    kept = result.iso_fits[0].coefficient.conditions
    assert (kept.lamp, kept.focus_distance_m, kept.colour) == ("A", 1.5, None)  # these frames are grey
    assert (fit().spectral, fit().iso_fits[0].coefficient.conditions) == (None, None)
    with pytest.raises(InputRejected):
        replace(PARAMS, lamp="candle")


def test_several_readings_of_a_scene_are_averaged():
    more = [*READINGS, replace(READINGS[0], value=52.0)]
    scene = next(s for s in fit(readings=more).scenes if s.scene == "bright")
    assert (scene.readings, scene.luminance_cd_m2) == (2, 51.0)
    assert scene.spread_rel == pytest.approx(2 / 51)


def test_the_basis_is_used():
    """All f/11 for 11.314: K found on the APEX basis is greater by (11.314 / 11)^2 = 5.8 %."""
    rows = [
        replace(
            row,
            exposure=replace(
                row.exposure,
                f_number_apex=row.exposure.f_number * 2**3.5 / 11,
                exposure_time_apex_s=row.exposure.exposure_time_s,
            ),
        )
        for row in ROWS
    ]
    result = fit(rows, params=replace(PARAMS, exposure_basis="apex"))
    assert result.iso_fits[0].coefficient.luminance_k == pytest.approx(K * 2**7 / 121, rel=1e-9)
    assert result.iso_fits[0].coefficient.exposure_basis == "apex"


# --- Points that a fit leaves out, each with its reason, and what keeps it from starting


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"statistics": statistics(3000.0, saturated=0.0011)}, "0.11% of its samples are saturated"),
        ({"statistics": statistics(DARK + 0.3)}, "less than 3 standard errors above dark"),
        ({"scene": "unread"}, "no luminance reading"),
    ],
)
def test_a_point_is_left_out_with_its_reason(changes, reason):
    result = fit((*ROWS, replace(light("dim", 11.0, name="odd"), **changes)))
    odd = point(result, "odd")
    assert not odd.used
    assert reason in odd.left_out
    assert (odd.weight, odd.residual_rel) == (0.0, None)
    assert result.iso_fits[0].coefficient.luminance_k == pytest.approx(K, rel=1e-9)

    kept = statistics(DARK + 100.0, saturated=0.001)
    assert point(fit((*ROWS, light("dim", 11.0, name="odd", statistics=kept))), "odd").used


def test_frames_excluded_by_hand_do_not_count_and_say_who_and_why():
    exclude = (
        Exclusion(frame="odd", reason="someone walked past", by="R. Ecorder"),
        Exclusion(frame="lit", reason="lamp was on", by="me"),
    )
    rows = (*LIGHTS, *DARKS[:1], dark("lit", mean_dn=900.0), light("dim", 11.0, k=99.0, name="odd"))
    result = fit(rows, params=replace(PARAMS, exclude=exclude))
    assert point(result, "odd").left_out == "excluded by R. Ecorder: someone walked past"
    coefficient = result.iso_fits[0].coefficient
    assert (coefficient.luminance_k, coefficient.dark_signal_dn) == (pytest.approx(K, rel=1e-9), DARK)


TOO_FEW = "ISO 3200 has 2 usable scenes, a fit needs 3: photograph more light levels"
NEW = light("dim", 11.0, name="new")
WAITING = tuple(replace(row, statistics=None) for row in ROWS)
BARE = tuple(replace(row, has_region=False) for row in WAITING)


@pytest.mark.parametrize(
    ("rows", "excluded", "missing"),
    [
        (ROWS, None, []),
        ((*ROWS, replace(NEW, scene="level-4")), "new", []),  # it needs no reading
        ((*ROWS, replace(NEW, statistics=None)), "new", []),
        (ROWS, "ghost", ["to be left out, but not of this campaign: frame ghost"]),
        (BARE, None, ["the campaign has no region (ROI)"]),
        ((*BARE[:1], *ROWS[1:]), None, ["no region (ROI): frame bright-3200-5.6"]),
        (
            WAITING,
            None,
            ["no statistics yet: frames bright-3200-5.6, bright-3200-8, bright-3200-16 and 12 more"],
        ),
        ((*WAITING[:2], *ROWS[2:]), None, ["no statistics yet: frames bright-3200-5.6, bright-3200-8"]),
        ((), None, ["the campaign has no light frame that can be used"]),
    ],
)
def test_what_is_missing_is_listed_by_name(rows, excluded, missing):
    exclude = (Exclusion(frame=excluded, reason="blurred", by="me"),) if excluded else ()
    assert [*luminance.missing(rows, READINGS, replace(PARAMS, exclude=exclude))] == missing


@pytest.mark.parametrize(
    ("rows", "sentence"),
    [
        ((*ROWS, replace(NEW, statistics=None)), "no statistics yet: frame new"),
        ((*ROWS, replace(NEW, scene=None)), "no scene: frame new"),
        ([row for row in ROWS if row.scene != "bright"], TOO_FEW),
    ],
)
def test_what_keeps_a_fit_from_starting_is_said_by_name(rows, sentence):
    assert any(found.startswith(sentence) for found in luminance.missing(rows, READINGS, PARAMS))
    with pytest.raises(InputRejected) as refusal:
        fit(rows)
    assert refusal.value.code is shared.FIT_INCOMPLETE
    assert sentence in refusal.value.message


def test_a_scene_without_a_reading_is_named_and_does_not_stop_the_others():
    scenes = ("level-10", "level-2")
    rows = (*ROWS, *(replace(light("dim", 11.0, name=each), scene=each) for each in scenes))
    (unread,) = luminance.missing(rows, READINGS, PARAMS)
    assert unread == "scenes level-2 and level-10 have no luminance reading"
    assert (unread.finding, unread.subjects) == (codes.READING_MISSING, ("scene level-2", "scene level-10"))
    assert fit(rows).passed


def test_scenes_that_lack_readings_alone_are_one_cause():
    """As of a card whose scenes were proposed, and whose readings have other names: no level is missing."""
    names = {scene: f"Scene {n}" for n, scene in enumerate(("bright", "middle", "dim"), start=1)}
    rows = [replace(row, scene=names.get(row.scene)) for row in ROWS]
    assert luminance.missing(rows, READINGS, PARAMS) == ("scenes 1 to 3 have no luminance reading",)
    assert not [each for each in plan(rows, READINGS, PARAMS) if "level" in each]
    with pytest.raises(InputRejected, match="ISO 3200 has 0 usable scenes"):
        luminance.fit(rows, READINGS, PARAMS)


def test_what_is_not_read_yet_is_named_and_may_be_the_light_frames():
    assert luminance.missing((), (), PARAMS, unread=("b", "a")) == ("not read yet: frames a, b",)


# --- Frames to photograph next, and the exposure times that a camera can take


def suggest(*more, darks=DARKS, mean_dn=None, luminance=None):
    """A scene "dim" that lacks two apertures, whose frame at f/5.6 has a signal of its own."""
    own = light("dim", 5.6, mean_dn=mean_dn, k=30.0 if luminance is None else 60.0 * luminance)
    gaps = find_gaps((*LIGHTS[:6], own, *darks, *more), READINGS, PARAMS)
    return {(gap.role, gap.at.get("f_number")): gap.exposure_time_s for gap in gaps if not gap.text}


def test_missing_apertures_have_the_time_of_half_the_span():
    """Half of 3839 DN at f/8 and 0.5 cd/m2: 2.56 s, longer than what the other frames show."""
    assert suggest() == {("light", 8.0): None, ("light", 16.0): None}
    found = suggest(dark("long", time_s=4.0))
    assert found == {("light", 8.0): pytest.approx(2.52, abs=0.01), ("light", 16.0): None}


def test_without_dark_frames_one_of_a_time_that_was_taken_is_suggested():
    assert suggest(darks=())["dark", 5.6] == 0.1


@pytest.mark.parametrize(("luminance", "known"), [(0.0, False), (1e-4, False), (5.0, True), (5e4, False)])
def test_no_time_is_suggested_that_a_camera_may_not_have(luminance, known):
    assert (suggest(luminance=luminance)["light", 8.0] is not None) is known
