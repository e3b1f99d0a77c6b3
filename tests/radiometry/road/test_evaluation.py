"""A road from its luminances and readings: the worked cases by hand, wrong points, lamps and flags."""

import dataclasses
import math

import numpy as np
import pytest

from radiometry.findings import InputRejected
from radiometry.road.evaluation import evaluate_road
from radiometry.road.field import USUAL, Ground, Rows, lay_ground, light_evenly, solve_field
from radiometry.road.results import Model
from radiometry.road.site import Conditions, Criterion, Meter, Row, Site, Strip
from tests.radiometry.road.simulated import SCALE, draw_road, survey


def get_figure(result, name):
    return next(each for each in result.figures if each.figure == name)


def evaluate(surveyed, **changes):
    """The result of a survey with changes of the road, of what is seen and of its scale."""
    road, points, sight, scale, _ = surveyed
    scale = changes.pop("scale", scale)
    seen = {name: 0.0 * sight.u_rel + each for name, each in changes.pop("seen", {}).items()}
    changed = dataclasses.replace(road, **changes)
    return evaluate_road(changed, points, dataclasses.replace(sight, **seen), scale=scale)


def raise_flags(result):
    return {each.flag for each in result.flags}


@pytest.fixture(scope="module")
def surveyed():
    random = np.random.default_rng(6)
    return survey(draw_road(random), random)


@pytest.fixture(scope="module")
def result(surveyed):
    return evaluate(surveyed)


@pytest.mark.parametrize(
    ("count", "other", "same"), [(4, 0.0187, 0.0233), (8, 0.0175, 0.0225), (16, 0.0167, 0.0217)]
)
def test_scale_by_control_points_is_that_of_the_table(count, other, same):
    """u_K = 2.5 %, a meter of 2 %, luminances of points to 4 % each; roads.md, 2.10."""
    luminances, readings = np.arange(2 * count) < count, np.arange(2 * count) >= count
    for behind_k, expected in ((0.0, other), (0.02, same)):
        meters = np.where(luminances, behind_k, 0.02)[:, None]
        own_k = math.sqrt(0.025**2 - behind_k**2) * luminances[:, None]
        rows = Rows(
            values=np.zeros(2 * count),
            places=np.tile(np.arange(count), 2),
            sees_pavement=np.ones(2 * count, np.bool_),
            is_reading=readings,
            own_u=np.where(luminances, 1e-6, 0.04),
            meters=("lux",),
            shared={"camera": own_k, "meter": meters},
        )
        far = np.column_stack([1e3 * np.arange(count), np.zeros(count)])
        model = Model(patches_rel=1e-6, along_m=1.0, across_m=1.0, sigma=100.0)
        covariance = solve_field(Ground(far, far[:, 1], far[:, 1], far[None]), rows, model).levels[1]
        weights = np.array([own_k[0, 0], behind_k])
        assert math.sqrt(weights @ covariance @ weights) == pytest.approx(expected, abs=6e-5)


def test_light_below_a_lamp_is_vertical_and_falls_with_the_cube_of_the_cosine():
    lamps = np.array([(0.0, 0.0, 10.0)])
    ln_light, angles = light_evenly(np.array([(0.0, 0.0), (10.0, 0.0)]), lamps)
    assert angles == pytest.approx([0.0, 1 - math.sqrt(0.5)])
    assert ln_light == pytest.approx([math.log(0.01), math.log(0.01 * 0.5**1.5)])


def test_figures_hold_the_truth(surveyed, result):
    truth = surveyed[-1]
    for name, value in (("e_av", truth.mean()), ("e_min", truth.min()), ("u_0", truth.min() / truth.mean())):
        figure = get_figure(result, name)
        assert figure.low < value < figure.high
    assert sum(each.variance_share for each in result.budget) == pytest.approx(1.0)
    total = math.hypot(*(each.u_rel for each in result.budget))
    assert total == pytest.approx(get_figure(result, "e_av").standard_uncertainty / truth.mean(), rel=0.1)
    assert result.budget[0].source == "meter"
    assert (result.grid.points, result.grid.hidden) == (len(truth), 0)
    assert result.grid.across_m == pytest.approx(3.5 / 3)


def test_the_meter_behind_k_is_worth_less_at_the_points():
    """Of one survey: the same instrument is one error, another one averages it."""
    known = dataclasses.replace(SCALE, spectral_u_rel=0.0)
    truth = draw_road(np.random.default_rng(3), b1=0.0)
    surveyed, u_rel = survey(truth, np.random.default_rng(3), spectral=0.0, rho_u=0.005), {}
    for meter in ("lux", "another"):
        scale = dataclasses.replace(known, meter=Meter(meter=meter, u_rel=0.02))
        figure = get_figure(evaluate(surveyed, scale=scale), "e_av")
        u_rel[meter] = figure.standard_uncertainty / figure.value
    assert u_rel["lux"] > 1.1 * u_rel["another"]


def see(ground, *places):
    seen = np.ones(len(places), np.bool_)
    rows = Rows(
        values=np.zeros(len(places)),
        places=np.array(places),
        sees_pavement=seen,
        is_reading=~seen,
        own_u=np.full(len(places), 1e-4),
        meters=(),
        shared={"camera": np.zeros((len(places), 1))},
    )
    return solve_field(ground, rows, USUAL)


def test_places_that_lie_alike_share_their_light_and_near_ones_their_patch():
    """5 m beside two luminaires 30 m apart ln E differs by .3 sqrt(2 .03) at most; between them by more."""
    site = Site(rows=(Row(y_m=-1.0, height_m=8.0, spacing_m=30.0),))
    places = np.array([(5.0, 2.0), (25.0, 2.0), (15.0, 2.0), (5.01, 2.0)])
    ground = lay_ground(site, places)
    assert ground.under[0, :3] == pytest.approx(np.array([(5.0, 3.0), (5.0, 3.0), (15.0, 3.0)]))
    spread = see(ground, 0).covariance
    alike, between = (spread[0, 0] + spread[n, n] - 2.0 * spread[0, n] for n in (1, 2))
    assert alike < 0.3**2 * 2 * 0.03 * 1.01 < 0.1 * between
    once, twice = (see(ground, *each).covariance[0, 0] for each in ((0,), (0, 3)))
    assert twice == pytest.approx(once, rel=0.05)


def test_a_lens_that_falls_off_is_allowed_for():
    """cos^4 takes 40 % of the light at the ends of the field; without the allowance half of them hold."""
    held, flags = [], []
    for seed in range(4):
        truth = draw_road(np.random.default_rng(seed))
        scale = dataclasses.replace(SCALE, falls_off=True)
        above_m = 0.9 * truth.site.rows[0].spacing_m
        surveyed = survey(truth, np.random.default_rng([seed, 1]), scale=scale, above_m=above_m)
        result, light = evaluate(surveyed), surveyed[-1]
        figure = get_figure(result, "u_0")
        held.append(figure.low < light.min() / light.mean() < figure.high)
        flags.append({each.flag for each in result.flags})
    assert sum(held) >= 3
    assert all("road_falloff_assumed" in each for each in flags)


def test_edge_ratio_is_that_of_the_lamps():
    """The worse side's mean beside the lanes over that of as wide a strip within."""
    random = np.random.default_rng(0)
    truth = draw_road(random)
    edges = (Strip(name=n, kind="edge", y_m=y, width_m=3.5) for n, y in (("near", -3.5), ("far", 7.0)))
    truth.site = dataclasses.replace(truth.site, strips=(*truth.site.strips, *edges))
    _, points, *_, light = surveyed = survey(truth, random)
    figure = get_figure(evaluate(surveyed), "eir")
    parts = np.array([each.part for each in points])
    sides = [(light[parts == n].mean(), light[parts == f"{n} (inside)"].mean()) for n in ("near", "far")]
    true = min(beside / within for beside, within in sides)
    assert figure.low < true < figure.high
    assert figure.expanded_uncertainty < 0.05 * true


def test_the_slope_with_the_angle_is_found_by_many_points():
    truth = draw_road(np.random.default_rng(5), b1=0.3, patches=0.005)
    (found,) = evaluate(survey(truth, np.random.default_rng(5), count=40)).scales
    assert abs(found.slope - 0.3) < 3.0 * found.slope_u < 0.1


def test_a_wrong_point_is_named_and_not_used():
    for seed in range(2):
        random = np.random.default_rng(seed)
        surveyed = survey(draw_road(random), random, wrong=seed)
        result, truth = evaluate(surveyed), surveyed[-1]
        assert [each.name for each in result.control if each.state == "differs"] == [f"P{seed + 1}"]
        assert get_figure(result, "e_av").value == pytest.approx(truth.mean(), rel=0.1)


def test_a_sodium_road_with_a_k_of_led_is_flagged_and_right():
    """Shown a third too dark, as a camera of published response does."""
    errors = []
    for seed in range(2):
        random = np.random.default_rng(100 + seed)
        scale = dataclasses.replace(SCALE, lamp_kind="led")
        road, *_, truth = surveyed = survey(draw_road(random, lamp=0.7), random, scale=scale)
        result = evaluate(surveyed, conditions=dataclasses.replace(road.conditions, lamp_kind="sodium"))
        assert "road_lamps_differ" in raise_flags(result)
        errors.append(get_figure(result, "e_av").value / truth.mean() - 1.0)
    assert np.sqrt(np.mean(np.square(errors))) < 0.04


def test_a_factor_that_no_budget_explains_is_flagged():
    random = np.random.default_rng(8)
    flags = evaluate(survey(draw_road(random, lamp=0.5), random)).flags
    flagged = next(each for each in flags if each.flag == "road_scale_unlikely")
    assert "expected 1.00 ± 0.18" in flagged.detail
    assert flagged.where == "asphalt"


def pick(surveyed, control):
    road, points, sight, scale, truth = surveyed
    names = {each.name for each in (*points, *control)}
    kept = [n for n, each in enumerate((*points, *road.control)) if each.name in names]
    sight = type(sight)(**{name: each[:, kept] for name, each in dataclasses.asdict(sight).items()})
    return dataclasses.replace(road, control=tuple(control)), points, sight, scale, truth


def change(surveyed, **changes):
    return raise_flags(evaluate(surveyed, **changes))


def test_conditions_are_flagged_or_refused(surveyed, result):
    road, points, *_ = surveyed
    assert not raise_flags(result)
    assert "road_not_dry" in change(surveyed, conditions=Conditions(surface="moist"))
    with pytest.raises(InputRejected, match="wet"):
        change(surveyed, conditions=Conditions(surface="wet"))
    assert "road_view_steep" in change(surveyed, seen={"view_deg": 23.0})
    assert "road_place_unsure" in change(surveyed, seen={"place_u_m": 0.5})
    assert "road_points_few" in change(pick(surveyed, road.control[:3]))
    sided = [dataclasses.replace(each, y_m=1.0 + 0.1 * n) for n, each in enumerate(road.control)]
    assert "road_points_one_sided" in change(surveyed, control=tuple(sided))
    assert "road_meter_uncertified" in change(surveyed, meters=())
    assert "road_meter_uncertified" in change(
        surveyed, scale=dataclasses.replace(SCALE, meter=Meter(meter="K", u_rel=None))
    )
    hidden = tuple(each.name for each in points[:10])
    assert "road_points_hidden" in change(surveyed, hidden=hidden)
    unconfirmed = dataclasses.replace(road.requirement, confirmed=None)
    assert "road_rule_unconfirmed" in change(surveyed, requirement=unconfirmed)
    with pytest.raises(InputRejected, match="half"):
        change(surveyed, hidden=tuple(each.name for each in points[30:]))


def test_two_kinds_of_lamps_need_points_under_both(surveyed):
    road, points, sight, scale, _ = surveyed
    x = np.array([each.x_m for each in (*points, *road.control)])
    middle = sum(road.site.field_m) / 2.0
    half = dataclasses.replace(sight, red_over_green=np.where(x > middle, 1.6, 0.8)[None])
    assert "road_lamps_unread" not in change((road, points, half, scale, None))
    near = [each for each in road.control if each.x_m < middle]
    assert "road_lamps_unread" in change(pick((road, points, half, scale, None), near))


def test_moisture_that_no_patch_explains_scatters(surveyed):
    road, random = surveyed[0], np.random.default_rng(1)
    off = [
        dataclasses.replace(each, values=(each.values[0] * math.exp(0.4 * random.standard_normal()),))
        for each in road.control
    ]
    assert "road_scatters" in change(surveyed, control=tuple(off))


def test_a_point_that_a_person_left_out_is_compared_and_not_used(surveyed):
    road, *_, truth = surveyed
    off = dataclasses.replace(road.control[2], left_out="shadow", values=(1.0,))
    control = (*road.control[:2], off, *road.control[3:])
    result = evaluate(surveyed, control=control)
    left = result.control[2]
    assert (left.state, left.reason) == ("left_out", "shadow")
    assert left.without_it == pytest.approx(road.control[2].values[0], rel=0.15)
    assert get_figure(result, "e_av").value == pytest.approx(truth.mean(), rel=0.08)


def test_readings_of_a_luminance_meter_alone_leave_the_pavement(surveyed):
    """E then depends on the stated luminance factor, 15 %; where lux meters read, it does not."""
    road, points, sight, *_ = surveyed
    control = tuple(
        dataclasses.replace(each, quantity="luminance", unit="cd/m2", values=(1.1 * seen,))
        for each, seen in zip(road.control, sight.luminance_cd_m2[0, len(points) :].tolist(), strict=True)
    )
    result = evaluate(surveyed, control=control)
    figure = get_figure(result, "e_av")
    assert figure.standard_uncertainty / figure.value == pytest.approx(0.15, rel=0.15)
    assert result.budget[0].source == "reflectance"


def test_power_density_is_that_of_the_worked_road(surveyed):
    """276 W / (22.87 lx x 245 m2) = 49.3 mW/(lx m2)."""
    road = surveyed[0]
    result = evaluate(surveyed, conditions=dataclasses.replace(road.conditions, power_w=276.0))
    area = 7.0 * road.site.rows[0].spacing_m
    expected = 276e3 / (get_figure(result, "e_av").value * area)
    assert get_figure(result, "pdi").value == pytest.approx(expected, rel=1e-3)
    assert pytest.approx(49.3, abs=0.05) == 276e3 / (22.87 * 245.0)


def test_maintenance_factor_lowers_the_light_and_not_its_uniformity(surveyed, result):
    kept = dataclasses.replace(surveyed[0].requirement, maintenance_factor=0.8)
    lower = evaluate(surveyed, requirement=kept)
    assert get_figure(lower, "e_av").value == pytest.approx(0.8 * get_figure(result, "e_av").value)
    assert get_figure(lower, "u_0").value == get_figure(result, "u_0").value
    assert (result.as_found, lower.as_found) == (True, False)


def test_verdicts_of_each_rule(surveyed, result):
    figure = get_figure(result, "e_av")
    u = figure.standard_uncertainty

    def judge(limit, decision="guarded", largest=None):
        stated = dataclasses.replace(
            surveyed[0].requirement,
            criteria=(Criterion(figure="e_av", at_least=limit),),
            decision=decision,
            largest_u_rel=largest,
        )
        return evaluate(surveyed, requirement=stated).criteria[0]

    assert judge(figure.value - 2.0 * u).verdict == "conforms"
    assert judge(figure.value + 2.0 * u).verdict == "does_not"
    between = judge(figure.value - u)
    assert (between.verdict, between.probability) == ("not_decided", pytest.approx(0.84, abs=0.02))
    assert between.needed_u == pytest.approx(2.0 * u / 1.645, rel=0.01)
    assert judge(figure.value - u, "simple").verdict == "conforms"
    assert judge(figure.value - u, "shared_risk", 0.2).verdict == "conforms"
    assert judge(figure.value - u, "shared_risk", 0.01).verdict == "not_decided"


def test_luminances_of_a_driver_are_not_measured(surveyed):
    stated = dataclasses.replace(surveyed[0].requirement, road_class="M3")
    result = evaluate(surveyed, requirement=stated)
    assert result.verdict == "not_measured"
    assert {each.verdict for each in result.criteria} == {"not_measured"}
    assert {each.road_class[0] for each in result.classes} == {"C", "P"}
