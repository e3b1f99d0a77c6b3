"""Points and exposure times of a plan."""

import dataclasses

import numpy as np
import pytest

from radiometry.road.evaluation import evaluate_road
from radiometry.road.plan import list_times, plan_points
from radiometry.road.site import Area, Conditions, Criterion, Meter, Requirement, Road
from tests.radiometry.road.simulated import EN, draw_road, survey
from tests.radiometry.road.test_grid import make_site

ROAD = Road(
    site=make_site(),
    requirement=Requirement(rule=EN, road_class="C3"),
    conditions=Conditions(mains_frequency_hz=50.0, lamp_kind="sodium"),
    meters=(Meter(meter_id="lux", meter="lux", u_rel=0.02),),
)


def test_more_points_reach_a_smaller_uncertainty_and_none_the_meters():
    plans = [plan_points(ROAD, e_av_u_rel=0.1, u_0_u_rel=u) for u in (0.06, 0.04, 0.03)]
    counts = [len(each.points) - 1 for each in plans]
    assert all(each.is_reached for each in plans)
    assert counts == sorted(counts)
    assert 4 == counts[0] < counts[-1] < 30
    never = plan_points(ROAD, e_av_u_rel=0.039, u_0_u_rel=0.1)  # the meter alone has 4 %
    assert not never.is_reached
    assert len(never.points) == 41


def test_a_part_of_one_point_is_planned_too():
    area = Area(name="corner", corners_m=((0.0, 20.0), (1.0, 20.0), (1.0, 21.0), (0.0, 21.0)))
    stated = dataclasses.replace(ROAD.requirement, part="corner")
    small = dataclasses.replace(ROAD, site=make_site(areas=(area,)), requirement=stated)
    assert len(plan_points(small, e_av_u_rel=0.02, u_0_u_rel=0.5).points) == 41


def test_points_surround_the_field_and_lie_apart():
    points = plan_points(ROAD, e_av_u_rel=0.1, u_0_u_rel=0.035).points
    places = [(each.x_m, each.y_m) for each in points]
    assert len(set(places)) == len(places)
    x, y = np.array(places[:-1]).T
    assert x.min() < 17.5 < x.max()
    assert y.min() < 3.5 < y.max()
    assert [each.is_spare for each in points] == [False] * (len(points) - 1) + [True]


def test_foreseen_uncertainty_is_that_of_roads_as_planned():
    random, reached = np.random.default_rng(4), []
    for _ in range(4):
        road, points, sight, scale, _ = survey(draw_road(random), random)
        result = evaluate_road(road, points, sight, scale=scale)
        figure = result.figures[0]
        reached.append(figure.standard_uncertainty / figure.value)
    planned = plan_points(ROAD, e_av_u_rel=2 * np.mean(reached), u_0_u_rel=1.0)
    assert 5 <= len(planned.points) - 1 <= 12


def test_points_that_would_decide_a_verdict_are_counted():
    random = np.random.default_rng(6)
    road, points, sight, scale, _ = survey(draw_road(random), random)
    figure = next(
        each for each in evaluate_road(road, points, sight, scale=scale).figures if each.figure == "u_0"
    )

    def judge(share):
        limit = figure.value - share * 1.645 * figure.standard_uncertainty
        stated = dataclasses.replace(road.requirement, criteria=(Criterion(figure="u_0", at_least=limit),))
        judged = dataclasses.replace(road, requirement=stated)
        return evaluate_road(judged, points, sight, scale=scale).criteria[0]

    near, far, never = judge(0.9), judge(0.7), judge(0.01)
    assert 1 <= near.needed_points < far.needed_points == far.prospects[-1].points
    assert [each.is_decided for each in far.prospects] == [False] * (len(far.prospects) - 1) + [True]
    u = [figure.expanded_uncertainty, *(each.expanded_uncertainty for each in far.prospects)]
    assert u == sorted(u, reverse=True)
    assert u[-1] <= far.needed_u < u[-2]
    assert never.needed_points is None
    assert [(each.points, each.is_decided) for each in never.prospects] == [
        (4, False), (8, False), (16, False), (40, False)
    ]  # fmt: skip


def test_times_without_flicker_are_whole_periods():
    """Of m = 1: 1/125 s 23.4 %, 1/60 s 16.5 %, 1/30 s 8.3 %, twice those of roads.md for m = 0.5."""
    errors = {round(1 / each.time_s): each.error_rel for each in list_times(50.0, "sodium")}
    assert [errors[each] for each in (125, 60, 30, 8)] == pytest.approx(
        [0.234, 0.165, 0.083, 0.025], abs=6e-4
    )
    assert all(errors[each] < 1e-9 for each in (100, 50, 25, 10))
    plan = plan_points(ROAD, e_av_u_rel=0.1, u_0_u_rel=0.1)
    assert [round(1 / each.time_s) for each in plan.times] == [100, 50, 25, 20, 10, 5, 4]
    assert [round(1 / each.time_s) for each in plan.avoid] == [125, 120, 60, 30]
    either = {round(1 / each.time_s): each.error_rel for each in list_times(None, None)}
    assert {each for each, error in either.items() if error < 1e-9} == {20, 10, 5, 4}
    assert max(each.error_rel for each in list_times(0.0, "sodium")) == 0.0
