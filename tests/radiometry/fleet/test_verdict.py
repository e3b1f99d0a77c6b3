"""What a verdict says, of which determinations, in which unit."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from radiometry.fleet.determinations import Key, are_separable, fit_effects
from radiometry.fleet.results import compute_power, count_repeats, find_sensitivity, judge_deviations
from radiometry.fleet.verdict import judge_fleet
from tests.radiometry.fleet.fleets import LUMINANCE_K, PRINCIPAL_POINT, determine, draw_fleet, fleet_of

ALIKE = [[33.0, 33.2, 32.9], [33.1, 33.0, 33.2], [32.9, 33.0, 33.1]]
APART = [[30.0, 30.2, 29.9], [33.1, 33.0, 33.2], [36.2, 36.0, 36.1]]


def judge(rows, *, method="luminance", tolerance=0.04, cameras=None):
    named = cameras or sorted({row.source.camera for row in rows})
    return judge_fleet(rows, method=method, cameras=named, tolerance=tolerance)


def only(rows, **said):
    (parameter,) = judge(rows, **said).parameters
    return parameter


def test_a_shared_set_says_what_it_costs_whom():
    found = only(fleet_of(ALIKE))
    # means 33.0333, 33.1, 33.0; their mean 33.0444; MS_w = (.14 / 3 + .02 + .02) / 6
    within = (0.14 / 3 + 0.02 + 0.02) / 6
    assert found.outcome == "shared"
    assert found.within_variance.value == pytest.approx(within)
    assert found.costliest == "B"
    assert found.cost.value == pytest.approx(100 * (33.1 / (99.1333333 / 3) - 1), rel=1e-6)
    u = 100 / 33.044444 * math.sqrt(within / 3 * 2 / 3)
    assert found.cost.standard_uncertainty == pytest.approx(u, rel=1e-6)
    assert found.cost.unit == "%"
    assert "one set serves all 3 cameras" in found.said
    assert "4 % of the luminance" in found.said
    assert "B the most, 0.17 % (u = 0.17 %)" in found.said


def test_cameras_that_differ_beyond_the_tolerance_need_their_own():
    found = only(fleet_of(APART))
    assert found.outcome == "per_camera"
    assert found.effects[0].f_p_value < 1e-6
    assert {each.label for each in found.effects[0].deviations} == {"A", "B", "C"}
    assert "one set does not serve all 3 cameras. A lies 9.20 % (u = 0.17 %)" in found.said


def test_a_certain_difference_within_the_tolerance_is_shared():
    found = only(fleet_of(APART), tolerance=0.15)
    assert found.effects[0].f_p_value < 1e-6
    assert found.outcome == "shared"


def test_what_is_not_shown_says_what_would_show_it():
    found = only(fleet_of([[33.0, 34.5], [32.4, 33.4], [33.9, 32.6]]), tolerance=0.04)
    assert (found.outcome, found.judgement.outcome) == ("cannot_tell", "cannot_tell")
    assert found.repeats_needed > 2
    assert f"{found.repeats_needed} repeats of each camera" in found.said


@pytest.mark.parametrize(
    "values", [[[33.0], [36.0], [30.0]], [[33.0, 33.1], [33.0, 33.1]], [[1.0, 2.0, 3.0]]]
)
def test_too_few_repeats_or_cameras_tell_nothing(values):
    found = only(fleet_of(values))
    assert found.outcome == "cannot_tell"
    assert found.judgement is None
    assert "fewer than 3" in found.said or "Only one camera" in found.said


def test_copied_values_are_no_repeats():
    found = only(fleet_of([[33.0] * 4, [36.0] * 4]))
    assert found.outcome == "cannot_tell"
    assert "agree to the last digit" in found.said


def test_equal_values_are_shared():
    assert only(fleet_of([[64.0] * 4] * 3)).outcome == "shared"


def test_two_versions_of_one_campaign_are_one_repeat():
    twice = [
        determine(value, camera, repeat, campaign=camera, version=f"{camera}{repeat}")
        for camera in "AB"
        for repeat, value in enumerate((33.0, 33.1, 33.0, 33.2))
    ]
    verdict = judge(twice)
    assert verdict.parameters[0].repeats == 2
    assert verdict.outcome == "cannot_tell"
    assert {each.version for each in verdict.left_out} == {f"{c}{n}" for c in "AB" for n in range(3)}
    assert "same campaign" in verdict.left_out[0].why


def test_a_camera_without_a_version_leaves_the_fleet_open():
    verdict = judge(fleet_of(ALIKE), cameras=["A", "B", "C", "Z"])
    assert (verdict.outcome, verdict.parameters[0].outcome) == ("cannot_tell", "shared")
    assert verdict.parameters[0].cameras_without == ("Z",)
    assert "Z without a published version" in verdict.said


def test_effect_in_another_unit_needs_its_own_tolerance():
    dark = Key(name="dark_signal_dn", unit="DN", model="proportional", iso=3200.0)
    rows = fleet_of(ALIKE) + fleet_of([[64.0, 64.2, 64.1], [64.1, 64.0, 64.2]], key=dark)
    verdict = judge(rows)
    by_name = {each.key.name: each for each in verdict.parameters}
    assert verdict.outcome == "shared"
    assert not by_name["dark_signal_dn"].judged
    assert "No tolerance" in by_name["dark_signal_dn"].said
    named = judge(rows, tolerance={"dark_signal_dn": 1.0})
    assert {each.key.name: each.outcome for each in named.parameters} == {
        "luminance_k": "cannot_tell",
        "dark_signal_dn": "shared",
    }


def four_vision(rng, *, principal_px, lens_px):
    """S2's swaps: one body with every lens, one lens on every body, and one camera several times."""
    mounted = [("b1", lens) for lens in "1234"] + [(f"b{n}", "1") for n in range(2, 6)] + [("b1", "1")] * 5
    return [
        determine(
            640 + principal_px[body] + lens_px[lens] + 0.3 * rng.standard_normal(),
            body,
            number,
            lens=lens,
            key=PRINCIPAL_POINT,
            u=0.3,
        )
        for number, (body, lens) in enumerate(mounted)
    ]


def test_swaps_say_whether_it_is_the_lens_or_the_body():
    """Lenses agree within 5 um, which is 1.08 px of 4.65 um; bodies differ by +-388 um, which is 83.4 px."""
    bodies = {"b1": 83.4, "b2": -83.4, "b3": 20.0, "b4": -40.0, "b5": 20.0}
    lenses = {"1": 0.54, "2": -0.54, "3": 0.3, "4": -0.3}
    rng = np.random.default_rng(11)
    found = only(four_vision(rng, principal_px=bodies, lens_px=lenses), method="geometry", tolerance=3.0)
    body, lens = found.effects
    assert (body.factor, lens.factor) == ("body", "lens")
    assert body.judgement.outcome == "per_camera"
    assert lens.judgement.outcome == "shared"
    assert found.outcome == "per_camera"
    for effect, truth in ((body, bodies), (lens, lenses)):
        for each in effect.deviations:
            off = abs(each.deviation.value - truth[each.label])
            assert off < 4 * each.deviation.standard_uncertainty
    assert found.cost.unit == "px"
    assert found.cost.value == pytest.approx(83.4, abs=2.0)
    assert "the bodies differ by more than the tolerance and the lenses agree" in found.said


def test_lenses_that_never_moved_cannot_be_told_from_bodies():
    rows = [
        determine(640 + 80 * index + 0.1 * repeat, body, repeat, lens=f"L{body}", key=PRINCIPAL_POINT, u=0.3)
        for index, body in enumerate("ABC")
        for repeat in range(3)
    ]
    found = only(rows, method="geometry", tolerance=1.0)
    assert [effect.factor for effect in found.effects] == ["camera"]
    assert "body_and_lens_confounded" in {flag.flag for flag in found.flags}
    assert found.outcome == "per_camera"


def test_a_body_with_another_lens_is_another_camera():
    """Else the lenses' difference would pass for poor repeatability, and hide everything."""
    rows = [
        determine(33.0 + 3 * (lens == "M") + 0.1 * repeat, body, repeat, lens=lens)
        for body, lens in (("A", "L"), ("A", "M"), ("B", "N"))
        for repeat in range(3)
    ]
    found = only(rows)
    assert found.within_variance.value == pytest.approx(0.01)
    assert {each.label for each in found.effects[0].deviations} == {"A with lens L", "A with lens M", "B"}
    assert found.outcome == "per_camera"


def test_flags_of_the_repeats():
    rows = [determine(33 + 0.1 * n, camera, n, u=0.01, days=n / 24) for camera in "AB" for n in range(4)]
    assert {flag.flag for flag in only(rows).flags} == {"repeats_exceed_uncertainty", "repeats_of_one_day"}
    assert only(fleet_of(ALIKE)).flags == ()


@settings(max_examples=30)
@given(st.integers(0, 2**32), st.floats(0.1, 1e4), st.permutations(range(4)))
def test_neither_unit_nor_order_changes_a_relative_verdict(seed, scale, order):
    rng = np.random.default_rng(seed)
    truths = 33 * (1 + 0.03 * rng.standard_normal(4))
    values = [truth + 0.4 * rng.standard_normal(3) for truth in truths]
    plain = only(fleet_of(values))
    other = only(fleet_of([scale * values[index] for index in order]))
    assert other.judgement.equivalence_p_value == pytest.approx(plain.judgement.equivalence_p_value, rel=1e-6)
    assert other.judgement.exceedance_p_value == pytest.approx(plain.judgement.exceedance_p_value, rel=1e-6)
    assert other.cost.value == pytest.approx(plain.cost.value, rel=1e-6)


def test_the_tests_by_hand():
    """v = 6: t_0.95 = 1.943, t_0.9875 = 2.969; with k = 2 a p of 0.05 is 0.0125 one-sided."""
    at = np.array([1.0, -1.0])
    u = np.array([1.0, 1.0])
    assert judge_deviations(at, u, dof=6, limit=1 + 1.95).outcome == "shared"
    assert judge_deviations(at, u, dof=6, limit=1 + 1.94).outcome == "cannot_tell"
    assert judge_deviations(at * 10, u, dof=6, limit=10 - 2.97).outcome == "per_camera"
    assert judge_deviations(at * 10, u, dof=6, limit=10 - 2.96).outcome == "cannot_tell"
    assert judge_deviations(at, u / 1000, dof=2, limit=5.0).outcome == "cannot_tell"


CORNER = {"fx_px": 1000.0, "fy_px": 1000.0, "cx_px": 600.0, "cy_px": 450.0}


@pytest.mark.parametrize(
    ("method", "name", "unit", "kind", "effect_unit", "factor"),
    [
        ("luminance", "luminance_k", "DN", "relative", "%", 100 / 50),
        ("luminance", "dark_signal_dn", "DN", "absolute", "DN", 1.0),
        ("geometry", "cx_px", "px", "absolute", "px", 1.0),
        # the corner lies at x = .6, y = .45, r = .75
        ("geometry", "k1", "1", "absolute", "px", 1000 * 0.75**3),
        ("geometry", "k2", "1", "absolute", "px", 1000 * 0.75**5),
        ("geometry", "k3", "1", "absolute", "px", 1000 * 0.75**7),
        ("geometry", "p1", "1", "absolute", "px", 1000 * math.hypot(0.54, 0.5625 + 2 * 0.2025)),
        ("geometry", "p2", "1", "absolute", "px", 1000 * math.hypot(0.5625 + 2 * 0.36, 0.54)),
        ("vignetting", "k1", "1", "relative", "%", 100.0),
        ("vignetting", "corner_falloff", "1", "relative", "%", 100.0),
        ("vignetting", "corner_falloff", "%", "relative", "%", 1.0),
        ("vignetting", "centre_row_px", "px", "absolute", "px", 1.0),
        ("sharpness", "mtf50_cycles_per_pixel", "c/p", "relative", "%", 2.0),
    ],
)
def test_effect_of_a_difference(method, name, unit, kind, effect_unit, factor):
    found = find_sensitivity(method, Key(name=name, unit=unit, model="m"), CORNER, mean=50.0)
    assert (found.kind, found.unit) == (kind, effect_unit)
    assert found.factor == pytest.approx(factor)
    assert found.accept(0.5).limit == (50.0 if kind == "relative" else 0.5)


def test_a_distortion_without_its_scale_is_not_judged():
    rows = fleet_of(ALIKE, key=Key(name="k1", unit="1", model="m"))
    found = only(rows, method="geometry", tolerance=1.0)
    assert (found.outcome, found.cost) == ("cannot_tell", None)
    assert "fx_px" in found.said


def test_a_share_of_nothing_is_not_judged():
    rows = fleet_of([[0.1, -0.1, 0.0], [-0.1, 0.2, 0.0]], key=Key(name="skew", unit="1", model="m"))
    found = only(rows)
    assert (found.outcome, found.cost) == ("cannot_tell", None)
    assert "not clear of 0" in found.said


def test_another_model_or_setting_is_another_parameter():
    affine = Key(name="luminance_k", unit="DN*m2/(cd*s)", model="affine", iso=3200.0)
    rows = fleet_of(ALIKE) + fleet_of(APART, key=affine)
    assert {str(each.key) for each in judge(rows).parameters} == {str(LUMINANCE_K)}
    assert [each.outcome for each in judge(rows).parameters] == ["shared", "per_camera"]


@pytest.mark.parametrize(("cameras", "tolerance"), [(2, 2.0), (5, 3.0)])
def test_the_number_of_repeats_does_what_it_promises(cameras, tolerance):
    """400 equal fleets: shared in 90 % or more, less three standard deviations; a repeat less does not."""
    repeats = count_repeats(cameras=cameras, tolerance_in_repeatabilities=tolerance)
    rng = np.random.default_rng(5)
    found = sum(
        only(
            draw_fleet(
                rng, truths=[500.0] * cameras, repeats=repeats, repeatability=1.0, key=PRINCIPAL_POINT
            ),
            method="geometry",
            tolerance=tolerance,
        ).outcome
        == "shared"
        for _ in range(400)
    )
    assert found / 400 >= 0.9 - 3 * (0.09 / 400) ** 0.5
    less = compute_power(cameras=cameras, repeats=repeats - 1, tolerance_in_repeatabilities=tolerance)
    assert less < 0.9


def test_the_table_of_repeats_in_the_documentation():
    """docs/fleet.md prints it."""
    table = {
        tolerance: [count_repeats(cameras=k, tolerance_in_repeatabilities=tolerance) for k in (2, 3, 5, 10)]
        for tolerance in (0.75, 1.0, 1.5, 2.0, 3.0, 5.0)
    }
    assert table == {
        0.75: [13, 18, 23, 29],
        1.0: [8, 10, 13, 17],
        1.5: [4, 5, 6, 8],
        2.0: [3, 4, 4, 5],
        3.0: [3, 2, 2, 3],
        5.0: [3, 2, 2, 2],
    }
    assert count_repeats(cameras=5, tolerance_in_repeatabilities=0.1) is None


# --- Levels and variance components against hand computation and against scipy


BALANCED = np.array([10.0, 12.0, 13.0, 15.0, 19.0, 21.0])
PAIRS = np.array([0, 0, 1, 1, 2, 2])


def test_a_balanced_fleet_by_hand():
    """Means 11, 14, 20; mean 15; MS_w = (2 + 2 + 2) / 3 = 2; MS_b = 2 (16 + 1 + 25) / 2 = 42; F = 21."""
    effects = fit_effects(BALANCED, [PAIRS])
    (factor,) = effects.factors
    assert effects.mean == pytest.approx(15.0)
    assert factor.deviations == pytest.approx([-4.0, -1.0, 5.0])
    assert (effects.dof, factor.dof) == (3, 2)
    assert effects.within_variance == pytest.approx(2.0)
    assert factor.f_statistic == effects.f_statistic == pytest.approx(21.0)
    assert factor.f_p_value == effects.f_p_value == pytest.approx(stats.f.sf(21.0, 2, 3))
    assert factor.variance == pytest.approx((42 - 2) / 2)
    # u(s_b^2) = sqrt(2 / 4 (42^2 / 2 + 2^2 / 3))
    assert factor.variance_u == pytest.approx((0.5 * (42**2 / 2 + 4 / 3)) ** 0.5)
    # of one camera's mean from the mean of three: s^2 / n (1 - 1 / k)
    assert effects.standard_errors(factor.contrasts) == pytest.approx([(2 / 2 * 2 / 3) ** 0.5] * 3)


def test_an_unbalanced_fleet_by_hand():
    """Means 2, 8 (4 and 2 values): the mean is that of the cameras, 5, not of the values, 4."""
    values = np.array([1.0, 2.0, 2.0, 3.0, 7.0, 9.0])
    effects = fit_effects(values, [np.array([0, 0, 0, 0, 1, 1])])
    (factor,) = effects.factors
    assert effects.mean == pytest.approx(5.0)
    assert factor.deviations == pytest.approx([-3.0, 3.0])
    assert effects.within_variance == pytest.approx((2 + 2) / 4)
    # SS_b = 4 * 2^2 + 2 * 4^2 = 48; n0 = (6 - (16 + 4) / 6) / 1
    assert factor.f_statistic == pytest.approx(48.0)
    assert factor.variance == pytest.approx((48 - 1) / (6 - 20 / 6))
    assert effects.standard_errors(factor.contrasts) == pytest.approx([(1 / 4 * (1 / 4 + 1 / 2)) ** 0.5] * 2)


@settings(max_examples=30)
@given(st.lists(st.lists(st.integers(-50, 50), min_size=2, max_size=6), min_size=2, max_size=5))
def test_the_f_test_is_scipy_s(fleet):
    values = np.array([value for repeats in fleet for value in repeats], dtype=float) / 7
    labels = np.repeat(np.arange(len(fleet)), [len(repeats) for repeats in fleet])
    effects = fit_effects(values + 1000.0, [labels])
    if effects.within_variance == 0.0:
        assert effects.factors[0].f_statistic is None
        return
    expected = stats.f_oneway(*(np.array(repeats) / 7 for repeats in fleet))
    assert effects.factors[0].f_statistic == pytest.approx(expected.statistic, rel=1e-6, abs=1e-8)
    assert effects.factors[0].f_p_value == pytest.approx(expected.pvalue, rel=1e-5, abs=1e-12)


def test_bodies_and_lenses_are_told_apart_by_swaps():
    """Body effects -3, 0, 3 and lens effects -1, 1, without noise: found exactly, from five of six pairs."""
    bodies, lenses = np.array([0, 0, 1, 1, 2, 2]), np.array([0, 1, 0, 1, 0, 0])
    values = 100.0 + np.array([-3.0, 0.0, 3.0])[bodies] + np.array([-1.0, 1.0])[lenses]
    effects = fit_effects(values, [bodies, lenses])
    assert effects.mean == pytest.approx(100.0)
    assert effects.factors[0].deviations == pytest.approx([-3, 0, 3])
    assert effects.factors[1].deviations == pytest.approx([-1, 1])
    assert effects.within_variance == 0.0
    assert effects.dof == 6 - (1 + 2 + 1)


def test_the_components_of_bodies_and_lenses_are_unbiased():
    """400 fleets of unbalanced swaps: mean components 9 and 4 within three standard errors."""
    rng = np.random.default_rng(3)
    bodies = np.repeat([0, 0, 0, 1, 1, 2, 3, 3, 4], 2)
    lenses = np.repeat([0, 1, 2, 0, 3, 1, 2, 3, 0], 2)
    found = []
    for _ in range(400):
        values = 3 * rng.standard_normal(5)[bodies] + 2 * rng.standard_normal(4)[lenses]
        effects = fit_effects(values + rng.standard_normal(18), [bodies, lenses])
        found.append([factor.variance for factor in effects.factors])
    mean, error = np.mean(found, axis=0), np.std(found, axis=0) / 20
    assert np.all(np.abs(mean - [9, 4]) < 3 * error)


@pytest.mark.parametrize(
    ("bodies", "lenses", "separable"),
    [
        ([0, 1, 2, 0], [0, 0, 0, 1], True),  # one lens on all bodies, two lenses on one body
        ([0, 0, 1, 1], [0, 0, 1, 1], False),  # each its own
        ([0, 0, 1, 2], [0, 1, 2, 2], False),  # body 0's lenses never came to the others
        ([0, 0, 1, 1], [0, 1, 1, 2], True),
    ],
)
def test_what_swaps_link(bodies, lenses, separable):
    assert are_separable([np.array(bodies), np.array(lenses)]) is separable


def test_equal_numbers_have_no_scatter():
    assert (
        fit_effects(np.array([0.1, 0.1, 0.3, 0.3, 0.3]), [np.array([0, 0, 1, 1, 1])]).within_variance == 0.0
    )
