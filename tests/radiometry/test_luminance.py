"""The luminance calibration from rows to verdict, and back from a coefficient to a luminance."""

import dataclasses
import json
import math
import random as python_random

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from radiometry.errors import Code, InputRejected
from radiometry.evidence import Exclusion
from radiometry.exposure import Exposure
from radiometry.flags import Flag
from radiometry.luminance.budget import explain_budget
from radiometry.luminance.dark import estimate_dark
from radiometry.methods import luminance
from radiometry.methods.luminance import FrameRow, Params, Reading
from radiometry.roi import Polygon
from radiometry.simulate import Sensor, Shot, render_frame
from radiometry.statistics import ChannelStatistics, Signal

K, DARK = 30.0, 256.0
SCENES = {"bright": 50.0, "middle": 5.0, "dim": 0.5}
READINGS = tuple(
    Reading(scene=s, quantity="luminance", value=v, expanded_uncertainty_rel=0.03, coverage_factor=2.0)
    for s, v in SCENES.items()
)


def statistics(mean_dn, *, saturated=0.0, white=4095.0, channel="grey"):
    return (
        ChannelStatistics(
            channel=channel,
            n=10000,
            min_dn=0,
            max_dn=4095,
            mean_dn=mean_dn,
            median_dn=mean_dn,
            std_dn=20.0,
            saturated_share=saturated,
            zero_share=0.0,
            black_level_dn=DARK,
            white_level_dn=white,
        ),
    )


def light(scene, f_number, *, time_s=None, iso=3200.0, name=None, k=K, mean_dn=None, **changes):
    """A frame that obeys N = D + K X exactly."""
    time_s = time_s or 0.1 * 5.0 / SCENES[scene]
    exposure = Exposure(exposure_time_s=time_s, f_number=f_number, iso=iso)
    signal = DARK + k * time_s * iso * SCENES[scene] / f_number**2 if mean_dn is None else mean_dn
    row = FrameRow(
        frame=name or f"{scene}-{iso:g}-{f_number:g}",
        role="light",
        scene=scene,
        exposure=exposure,
        statistics=statistics(signal),
    )
    return dataclasses.replace(row, **changes)


def dark(name, *, mean_dn=DARK, time_s=0.1, iso=3200.0):
    exposure = Exposure(exposure_time_s=time_s, f_number=4.0, iso=iso)
    return FrameRow(frame=name, role="dark", scene=None, exposure=exposure, statistics=statistics(mean_dn))


LIGHTS = tuple(light(scene, f) for scene in SCENES for f in (5.6, 8.0, 16.0))
DARKS = tuple(dark(f"dark-{t:g}-{n}", time_s=t) for t in (0.01, 0.1, 1.0) for n in range(2))
ROWS = LIGHTS + DARKS
PARAMS = Params(meter_repeatability_rel=0.01)


def fit(rows=ROWS, readings=READINGS, params=PARAMS):
    return luminance.fit(rows, readings, params)


def raised(result, flag):
    return [found.where for found in result.flags if found.flag == flag.value]


def point(result, frame):
    return next(p for p in result.points if p.frame == frame)


# --- the fit


def test_exact_points_give_k_and_no_flag():
    result = fit()
    coefficient = result.iso_fits[0].coefficient
    assert coefficient.luminance_k == pytest.approx(K, rel=1e-9)
    assert coefficient.luminance_k_unit == "DN*m2/(cd*s)"
    assert coefficient.dark_signal_dn == DARK
    assert result.flags == ()
    assert result.passed


def test_uncertainty_by_hand():
    """Three scenes at 1 %, f-numbers at 2 * 1.5 %, times (one per scene) at 0.5 %; the meter's 1.5 %."""
    rows = tuple(
        dataclasses.replace(r, statistics=(dataclasses.replace(r.statistics[0], std_dn=1.0, n=10**8),))
        for r in ROWS
    )
    iso_fit = fit(rows).iso_fits[0]
    coefficient = iso_fit.coefficient
    expected = math.sqrt((0.01**2 + 4 * 0.015**2 + 0.005**2) / 3 + 0.015**2)
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


def test_order_changes_nothing_to_the_last_bit(drawn):
    params = Params(panel_rho=0.8)
    first = luminance.fit(drawn.rows, drawn.readings, params)
    shuffler = python_random.Random(4)
    for _ in range(3):
        rows, readings = list(drawn.rows), list(drawn.readings)
        shuffler.shuffle(rows)
        shuffler.shuffle(readings)
        assert luminance.fit(rows, readings, params) == first


@pytest.mark.parametrize("model", ["proportional", "affine", "power", "semilog"])
def test_results_are_plain_finite_json(drawn, model):
    result = luminance.fit(drawn.rows, drawn.readings, Params(model=model))
    text = json.dumps(dataclasses.asdict(result), allow_nan=False)
    back = json.loads(text)["iso_fits"][0]["coefficient"]
    again = luminance.Coefficient(**back)
    assert again.luminance_k == result.iso_fits[0].coefficient.luminance_k
    exposure = drawn.rows[0].exposure
    luminance.apply(drawn.rows[0].statistics, exposure=exposure, coefficients=[again])


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
    u_dark = coefficient.dark_signal_standard_uncertainty_dn
    covariance = (0.2**2 * np.eye(12) + u_dark**2) / np.outer(fitted, fitted)
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
    assert raised(result, Flag.SEMILOG_MODEL) == [""]
    assert raised(result, Flag.TOLERANCE_EXCEEDED) == ["iso 3200"]
    assert result.iso_fits[0].coefficient.luminance_k_unit == "DN"
    assert fit().passed


def test_verdict_is_the_largest_error_against_the_tolerance():
    rows = (*LIGHTS[1:], light("bright", 5.6, k=K * 1.06), *DARKS)
    result = fit(rows)
    worst = max(abs(p.residual_rel) for p in result.points)
    assert result.iso_fits[0].largest_residual_rel == worst
    assert 0.04 < worst < 0.065
    assert not result.passed
    assert raised(result, Flag.TOLERANCE_EXCEEDED) == ["iso 3200"]
    assert fit(rows, params=dataclasses.replace(PARAMS, tolerance_rel=0.07)).passed


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


# --- points left out


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"statistics": statistics(3000.0, saturated=0.0011)}, "0.11% of its samples are saturated"),
        ({"statistics": statistics(DARK + 0.3)}, "less than 3 standard errors above dark"),
        ({"scene": "unread"}, "no luminance reading"),
    ],
)
def test_a_point_is_left_out_with_its_reason(changes, reason):
    result = fit((*ROWS, dataclasses.replace(light("dim", 11.0, name="odd"), **changes)))
    odd = point(result, "odd")
    assert not odd.used
    assert reason in odd.left_out
    assert (odd.weight, odd.residual_rel) == (0.0, None)
    assert result.iso_fits[0].coefficient.luminance_k == pytest.approx(K, rel=1e-9)


def test_a_thousandth_saturated_still_counts():
    rows = (*ROWS, light("dim", 11.0, name="odd"))
    kept = dataclasses.replace(rows[-1].statistics[0], saturated_share=0.001)
    assert point(fit((*rows[:-1], dataclasses.replace(rows[-1], statistics=(kept,)))), "odd").used


def test_a_frame_excluded_by_hand_says_who_and_why():
    exclude = (Exclusion(frame="odd", reason="someone walked past", by="R. Ecorder"),)
    rows = (*ROWS, light("dim", 11.0, k=99.0, name="odd"))
    result = fit(rows, params=dataclasses.replace(PARAMS, exclude=exclude))
    assert point(result, "odd").left_out == "excluded by R. Ecorder: someone walked past"
    assert result.iso_fits[0].coefficient.luminance_k == pytest.approx(K, rel=1e-9)


def test_an_excluded_dark_frame_does_not_count():
    exclude = (Exclusion(frame="lit", reason="lamp was on", by="me"),)
    rows = (*LIGHTS, *DARKS[:1], dark("lit", mean_dn=900.0))
    result = fit(rows, params=dataclasses.replace(PARAMS, exclude=exclude))
    assert result.iso_fits[0].coefficient.dark_signal_dn == DARK


# --- what is missing


def test_nothing_is_missing():
    assert luminance.missing(ROWS, READINGS, PARAMS) == ()


@pytest.mark.parametrize(
    ("rows", "readings", "sentence"),
    [
        (DARKS, READINGS, "the campaign has no light frame"),
        (
            (*ROWS, light("dim", 11.0, name="new", statistics=None)),
            READINGS,
            "frame new has no statistics yet",
        ),
        (
            (*ROWS, dataclasses.replace(light("dim", 11.0, name="new"), scene=None)),
            READINGS,
            "frame new has no scene",
        ),
        (
            ROWS,
            READINGS[1:],
            "ISO 3200 has 2 usable scenes, a fit needs 3: scene bright: a frame was left out ",
        ),
        (LIGHTS[:6], READINGS, "ISO 3200 has 2 usable scenes, a fit needs 3: photograph more light levels"),
        (ROWS, [], "ISO 3200 has 0 usable scenes"),
    ],
)
def test_what_keeps_a_fit_from_starting_is_said_by_name(rows, readings, sentence):
    assert any(found.startswith(sentence) for found in luminance.missing(rows, readings, PARAMS))
    with pytest.raises(InputRejected) as refusal:
        fit(rows, readings)
    assert refusal.value.code is Code.FIT_INCOMPLETE
    assert sentence in refusal.value.message


def test_a_scene_without_a_reading_is_named_and_does_not_stop_the_others():
    rows = (*ROWS, dataclasses.replace(light("dim", 11.0, name="new"), scene="level-4"))
    assert luminance.missing(rows, READINGS, PARAMS) == ("scene level-4 has no luminance reading",)
    assert fit(rows).passed


def test_a_scene_of_which_every_frame_is_excluded_needs_no_reading():
    rows = (*ROWS, dataclasses.replace(light("dim", 11.0, name="new"), scene="level-4"))
    params = dataclasses.replace(PARAMS, exclude=(Exclusion(frame="new", reason="", by="me"),))
    assert luminance.missing(rows, READINGS, params) == ()


def test_a_campaign_without_a_region_says_so_once():
    bare = [dataclasses.replace(row, statistics=None, has_region=False) for row in ROWS]
    assert luminance.missing(bare, READINGS, PARAMS) == ("the campaign has no region (ROI)",)
    assert luminance.missing((*bare[:1], *ROWS[1:]), READINGS, PARAMS) == (
        "frame bright-3200-5.6 has no region (ROI)",
    )


def test_the_first_of_many_waiting_frames_are_named_and_the_rest_counted():
    waiting = [dataclasses.replace(row, statistics=None) for row in ROWS]
    assert luminance.missing(waiting, READINGS, PARAMS) == (
        "frames bright-3200-16, bright-3200-5.6, bright-3200-8 and 12 more have no statistics yet",
    )
    assert luminance.missing((*waiting[:2], *ROWS[2:]), READINGS, PARAMS) == (
        "frames bright-3200-5.6 and bright-3200-8 have no statistics yet",
    )


def test_what_is_not_read_yet_is_named_and_may_be_the_light_frames():
    assert luminance.missing((), (), PARAMS, unread=("b", "a")) == ("frames a and b have not been read yet",)
    assert luminance.missing((), (), PARAMS) == ("the campaign has no light frame",)


def test_excluding_an_unknown_frame_is_said():
    params = dataclasses.replace(PARAMS, exclude=(Exclusion(frame="ghost", reason="", by="me"),))
    assert luminance.missing(ROWS, READINGS, params) == (
        "frame ghost is to be left out, but the campaign has no such frame",
    )


def test_an_excluded_frame_need_not_be_extracted():
    params = dataclasses.replace(PARAMS, exclude=(Exclusion(frame="new", reason="blurred", by="me"),))
    assert luminance.missing((*ROWS, light("dim", 11.0, name="new", statistics=None)), READINGS, params) == ()


# --- dark


def signal(value, u=0.1, black=250.0):
    return Signal(
        value_dn=value,
        standard_uncertainty_dn=u,
        saturated_share=0.0,
        black_level_dn=black,
        white_level_dn=4346.0,
    )


def test_dark_is_the_median():
    found = estimate_dark([signal(256.0), signal(259.0), signal(257.0)], [])
    assert found.signal_dn == 257.0
    spread = np.var([256, 259, 257], ddof=1)
    assert found.standard_uncertainty_dn == pytest.approx(math.sqrt(math.pi / 2 * spread / 3))
    assert found.frame_spread_dn == pytest.approx(math.sqrt(spread - 0.01))
    assert found.dof == 2


def test_quiet_dark_frames_are_not_better_than_their_noise():
    found = estimate_dark([signal(256.0), signal(256.0)], [])
    assert found.standard_uncertainty_dn == pytest.approx(0.1 / math.sqrt(2))
    assert found.frame_spread_dn == 0.0


def test_without_dark_frames_the_black_level_stands_in():
    found = estimate_dark([], [signal(900.0), signal(800.0)])
    assert (found.signal_dn, found.standard_uncertainty_dn) == (250.0, 1.0)


# --- flags


@pytest.mark.parametrize(
    ("rows", "readings", "params", "flag", "where"),
    [
        (LIGHTS, READINGS, PARAMS, Flag.DARK_FROM_BLACK_LEVEL, "iso 3200"),
        ((*LIGHTS, DARKS[0]), READINGS, PARAMS, Flag.DARK_FROM_FEW_FRAMES, "iso 3200"),
        ((*LIGHTS, *DARKS[:4]), READINGS, PARAMS, Flag.DARK_EXPOSURE_DIFFERS, "iso 3200"),
        ((*ROWS, dark("warm", mean_dn=DARK + 20)), READINGS, PARAMS, Flag.DARK_VARIES, "iso 3200"),
        (
            (*ROWS[1:], dataclasses.replace(LIGHTS[0], rendered=True)),
            READINGS,
            PARAMS,
            Flag.RENDERED,
            "iso 3200",
        ),
        (
            (*ROWS[1:], dataclasses.replace(LIGHTS[0], gain_maps=("ab",))),
            READINGS,
            PARAMS,
            Flag.GAIN_MAPS_DIFFER,
            "iso 3200",
        ),
        ((*LIGHTS[::3], *LIGHTS[1:3], *DARKS), READINGS, PARAMS, Flag.FEW_POINTS, "iso 3200"),
        (ROWS, READINGS, Params(), Flag.METER_REPEATABILITY_ESTIMATED, "iso 3200"),
        (
            ROWS,
            [dataclasses.replace(READINGS[0], expanded_uncertainty_rel=None), *READINGS[1:]],
            PARAMS,
            Flag.METER_CERTIFICATE_MISSING,
            "",
        ),
        (ROWS, READINGS, dataclasses.replace(PARAMS, exposure_basis="apex"), Flag.APEX_MISSING, "iso 3200"),
        (
            ROWS,
            (*READINGS, *(Reading(scene="dim", quantity="illuminance", value=v) for v in (10.0, 10.21))),
            PARAMS,
            Flag.LAMP_DRIFT,
            "scene dim",
        ),
        (
            ROWS,
            (*READINGS, Reading(scene="dim", quantity="illuminance", value=0.5 * math.pi / 0.8 * 10.764)),
            dataclasses.replace(PARAMS, panel_rho=0.8),
            Flag.RHO_CROSS_CHECK,
            "scene dim",
        ),
    ],
)
def test_a_flag_says_where(rows, readings, params, flag, where):
    assert raised(fit(rows, readings, params), flag) == [where]
    assert raised(fit(), flag) == []


def test_agreement_raises_no_flag():
    readings = (*READINGS, *(Reading(scene="dim", quantity="illuminance", value=v) for v in (1.95, 1.98)))
    result = fit(readings=readings, params=dataclasses.replace(PARAMS, panel_rho=0.8))
    assert result.flags == ()
    dim = next(s for s in result.scenes if s.scene == "dim")
    assert dim.rho_e_pi_cd_m2 == pytest.approx(0.8 * 1.965 / math.pi)


@pytest.mark.parametrize(("exponent", "flagged"), [(1.03, True), (0.97, True), (1.01, False)])
def test_a_bent_response_is_flagged(exponent, flagged):
    rows = [
        dataclasses.replace(row, statistics=statistics(DARK + (row.statistics[0].mean_dn - DARK) ** exponent))
        for row in LIGHTS
    ]
    assert raised(fit((*rows, *DARKS)), Flag.NONLINEAR) == (["iso 3200"] if flagged else [])


@pytest.mark.parametrize(
    ("factor", "flagged"), [(4.5, True), (3.5, False), (1 / 3.5, False), (1 / 4.5, True)]
)
def test_an_implausible_k_is_flagged(factor, flagged):
    """Expected here: (4095 - 256) / 120 = 32; readings in foot-lamberts would be off by 3.4."""
    readings = [dataclasses.replace(r, value=r.value * K / 32.0 / factor) for r in READINGS]
    assert raised(fit(readings=readings), Flag.IMPLAUSIBLE_K) == (["iso 3200"] if flagged else [])


def test_scatter_beyond_the_claims_is_flagged():
    rows = [light(s, f, k=K * (1 + (-1) ** n * 0.1)) for s in SCENES for n, f in enumerate((5.6, 8.0, 16.0))]
    result = fit((*rows, *DARKS), params=dataclasses.replace(PARAMS, f_number_u_rel=0.001))
    assert raised(result, Flag.SCATTER_EXCEEDS_UNCERTAINTY) == ["iso 3200"]
    (iso_fit,) = result.iso_fits
    scatter = iso_fit.models[0].frame_scatter_rel
    assert scatter == pytest.approx(np.std(np.log([1.1, 0.9, 1.1] * 3), ddof=1), rel=0.02)
    assert iso_fit.birge_ratio == pytest.approx(1.0, abs=0.01)
    assert iso_fit.models[0].stated_chi_squared > 100
    (line,) = (line for line in explain_budget(iso_fit) if line.source == "scatter between frames")
    assert (line.kind, line.input_uncertainty) == ("A", scatter)
    assert line.sensitivity == pytest.approx(1 / 3, rel=0.01)


@pytest.mark.parametrize(("error", "flagged"), [(0.0001, False), (0.03, True)])
def test_only_scatter_that_chance_does_not_explain_is_flagged(error, flagged):
    """Frames of 0.2 DN noise in 20 DN and more: a tenth of a per mille is within, 3 % are not."""
    rows = [
        light(s, f, k=K * (1 + (-1) ** (n + m) * error))
        for m, s in enumerate(SCENES)
        for n, f in enumerate((5.6, 8.0, 16.0))
    ]
    result = fit((*rows, *DARKS))
    assert raised(result, Flag.SCATTER_EXCEEDS_UNCERTAINTY) == (["iso 3200"] if flagged else [])
    assert ("scatter between frames" in {entry.source for entry in result.iso_fits[0].budget}) is flagged


def test_a_scene_is_predicted_with_the_scatter_that_was_found():
    """Of seven nearly noiseless frames one is 14 % low: it pulls the predictions by a fifth, no more."""
    shots = {"bright": (5.6, 8.0, 16.0), "middle": (5.6, 8.0), "dim": (8.0, 16.0)}
    rows = [light(s, f, k=K * (0.86 if (s, f) == ("bright", 5.6) else 1.0)) for s in shots for f in shots[s]]
    quiet = [
        dataclasses.replace(r, statistics=(dataclasses.replace(r.statistics[0], std_dn=1.0, n=10**8),))
        for r in (*rows, *DARKS)
    ]
    report = fit(quiet).iso_fits[0].models[0]
    pulled = 1 - 0.86 ** (1 / 5)
    assert report.left_out_max_rel == pytest.approx(0.14, abs=0.005)
    assert report.left_out_rms_rel == pytest.approx(math.sqrt((0.14**2 + 4 * pulled**2) / 7), rel=0.05)


def test_order_changes_no_bit_of_a_scattered_campaign(drawn):
    random = np.random.default_rng(5)
    rows = [
        dataclasses.replace(
            row,
            statistics=tuple(
                dataclasses.replace(s, mean_dn=DARK + (s.mean_dn - DARK) * factor) for s in row.statistics
            ),
        )
        for row, factor in zip(drawn.rows, random.normal(1.0, 0.01, len(drawn.rows)), strict=True)
    ]
    first = luminance.fit(rows, drawn.readings, PARAMS)
    assert first.iso_fits[0].models[0].frame_scatter_rel == pytest.approx(0.01, rel=0.5)
    assert luminance.fit(rows[::-1], drawn.readings, PARAMS) == first


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


# --- apply


def apply(mean_dn, *, exposure=None, model="proportional", **changes):
    coefficients = [f.coefficient for f in fit(params=dataclasses.replace(PARAMS, model=model)).iso_fits]
    exposure = exposure or Exposure(exposure_time_s=0.1, f_number=8.0, iso=3200.0)
    return luminance.apply(
        statistics(mean_dn, **changes), exposure=exposure, coefficients=coefficients
    ), coefficients[0]


def test_apply_by_hand():
    applied, coefficient = apply(DARK + 300.0)
    assert applied.luminance_cd_m2.value == pytest.approx(300.0 * 64 / (K * 0.1 * 3200))
    u_n = math.sqrt(20.0**2 / 10000)
    expected = math.sqrt(
        (coefficient.luminance_k_standard_uncertainty / coefficient.luminance_k) ** 2
        + 0.005**2
        + 4 * 0.015**2
        + (u_n**2 + coefficient.dark_signal_standard_uncertainty_dn**2) / 300.0**2
    )
    assert applied.luminance_cd_m2.standard_uncertainty / applied.luminance_cd_m2.value == pytest.approx(
        expected
    )
    assert applied.luminance_cd_m2.unit == "cd/m2"
    assert applied.flags == ()


@pytest.mark.parametrize("model", ["affine", "power"])
def test_other_models_apply_to_the_same_luminance(model):
    applied, _ = apply(DARK + 300.0, model=model)
    assert applied.luminance_cd_m2.value == pytest.approx(300.0 * 64 / (K * 0.1 * 3200), rel=1e-6)
    assert 0.03 < applied.luminance_cd_m2.standard_uncertainty / applied.luminance_cd_m2.value < 0.1


def test_a_signal_below_dark_is_not_clipped():
    applied, _ = apply(DARK - 3.0)
    assert applied.luminance_cd_m2.value == pytest.approx(-3.0 * 64 / (K * 0.1 * 3200))
    assert [f.flag for f in applied.flags] == ["outside_signals", "below_detection"]


def test_a_model_without_an_answer_is_refused():
    with pytest.raises(InputRejected, match="no luminance for a signal of -3 DN") as refusal:
        apply(DARK - 3.0, model="power")
    assert refusal.value.code is Code.FIT_FAILED


@pytest.mark.parametrize(
    ("changes", "flag"),
    [
        ({"exposure_time_s": 0.3}, Flag.OUTSIDE_EXPOSURE_TIMES),
        ({"f_number": 4.0}, Flag.OUTSIDE_F_NUMBERS),
        ({"f_number": 22.0}, Flag.OUTSIDE_F_NUMBERS),
    ],
)
def test_what_was_not_calibrated_is_flagged(changes, flag):
    exposure = Exposure(**{"exposure_time_s": 0.1, "f_number": 8.0, "iso": 3200.0, **changes})
    assert [f.flag for f in apply(DARK + 300.0, exposure=exposure)[0].flags] == [flag.value]


def test_a_saturated_measurement_is_flagged():
    assert [f.flag for f in apply(DARK + 1000.0, saturated=0.5)[0].flags] == ["saturated"]


def test_an_unknown_iso_is_refused():
    with pytest.raises(InputRejected, match="taken at ISO 1600; this calibration holds ISO 3200") as refusal:
        apply(500.0, exposure=Exposure(exposure_time_s=0.1, f_number=8.0, iso=1600.0))
    assert refusal.value.code is Code.ISO_NOT_CALIBRATED


def test_the_map_scale_agrees_with_apply():
    applied, coefficient = apply(DARK + 300.0)
    exposure = Exposure(exposure_time_s=0.1, f_number=8.0, iso=3200.0)
    assert 300.0 * luminance.luminance_per_dn(coefficient, exposure) == pytest.approx(
        applied.luminance_cd_m2.value
    )
    _, bent = apply(DARK + 300.0, model="affine")
    with pytest.raises(InputRejected, match="this one is affine"):
        luminance.luminance_per_dn(bent, exposure)


# --- extract


def test_extract_measures_the_region_in_a_window():
    sensor = Sensor(height_px=80, width_px=90)
    settings = dataclasses.replace(LIGHTS[0].exposure).on_basis("nominal")
    shot = Shot(frame="f", role="light", scene="s", stated=settings, true=settings, luminance_cd_m2=0.05)
    frame = render_frame(sensor, shot, np.random.default_rng(1), row0=11, col0=20, height=30, width=40)
    polygon = Polygon.from_points([(25, 15), (50, 18), (45, 38)])
    rows = luminance.extract(frame, polygon)
    assert [row.channel for row in rows] == ["R", "G1", "G2", "B", "grey"]
    assert rows[-1].n == pytest.approx(0.5 * abs(25 * 23 - 20 * 3), abs=30)
    with pytest.raises(InputRejected) as refusal:
        luminance.extract(frame, Polygon.from_points([(0, 0), (9, 0), (9, 9)]))
    assert refusal.value.code is Code.ROI_EMPTY


@pytest.mark.parametrize(
    "changes",
    [
        {"model": "cubic"},
        {"channel": "red"},
        {"exposure_basis": "exif"},
        {"tolerance_rel": math.nan},
        {"f_number_u_rel": -0.1},
    ],
)
def test_impossible_parameters_are_our_own_fault(changes):
    with pytest.raises(ValueError, match=r"unknown model|outside \[0, 1\)"):
        Params(**changes)
