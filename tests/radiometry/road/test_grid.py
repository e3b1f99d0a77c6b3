"""Grids of EN 13201-3 and RP-8 by their tables, and the classes as they were read."""

import numpy as np
import pytest

from radiometry.findings import InputRejected
from radiometry.road.field import light_evenly
from radiometry.road.grid import lay_points
from radiometry.road.observations import lay_cells
from radiometry.road.rules import find_criteria, find_rule, list_rules
from radiometry.road.site import Area, ControlPoint, Requirement, Road, Row, Site, Strip
from tests.radiometry.road.simulated import LUX

EN, RP8 = (rule.name for rule in list_rules())


def make_site(spacing_m=35.0, *others, **more):
    lanes = tuple(
        Strip(name=str(n + 1), kind="lane", y_m=3.5 * n, width_m=3.5, surface="asphalt") for n in range(2)
    )
    row = Row(y_m=-1.0, height_m=10.0, spacing_m=spacing_m)
    return Site(rows=(row,), strips=(*lanes, *others), **more)


@pytest.mark.parametrize(
    ("spacing_m", "along", "distance_m"),
    [
        (24, 10, 2.40), (30, 10, 3.00), (33, 11, 3.00), (35, 12, 2.92),
        (36, 12, 3.00), (40, 14, 2.86), (45, 15, 3.00), (50, 17, 2.94),
    ],
)  # fmt: skip
def test_points_along_are_those_of_the_table(spacing_m, along, distance_m):
    points = lay_points(make_site(float(spacing_m)), find_rule(EN).grid)
    x = sorted({point.x_m for point in points})
    assert len(x) == along
    assert np.diff(x) == pytest.approx(spacing_m / along)
    assert round(spacing_m / along, 2) == distance_m
    assert x[0] == pytest.approx(spacing_m / along / 2)


def test_two_lanes_have_72_points():
    points = lay_points(make_site(), find_rule(EN).grid)
    assert len(points) == 72
    assert sorted({point.y_m for point in points}) == pytest.approx(3.5 / 3 * (np.arange(6) + 0.5))
    assert (points[0].name, points[-1].name) == ("1/1-1", "2/3-12")


def test_rp8_has_two_points_a_lane_a_quarter_from_its_edges():
    points = lay_points(make_site(60.0), find_rule(RP8).grid)
    assert sorted({point.y_m for point in points}) == pytest.approx([0.875, 2.625, 4.375, 6.125])
    assert len({point.x_m for point in points}) == 12


def test_edges_are_compared_with_as_wide_a_strip_of_the_lanes():
    far = Strip(name="far", kind="edge", y_m=7.0, width_m=3.5)
    points = lay_points(make_site(35.0, far), find_rule(EN).grid)
    assert {p.y_m for p in points if p.part == "far (inside)"} == {p.y_m for p in points if p.part == "2"}
    assert min(p.y_m for p in points if p.part == "far") == pytest.approx(7.0 + 3.5 / 6)


def test_an_area_has_the_points_within_its_outline():
    area = Area(name="corner", corners_m=((0.0, 0.0), (12.0, 0.0), (0.0, 12.0)))
    points = [p for p in lay_points(make_site(35.0, areas=(area,)), find_rule(EN).grid) if p.part == "corner"]
    assert len(points) == 8 * 7 / 2
    assert all(point.x_m + point.y_m < 12.0 for point in points)


def test_classes_are_those_of_the_table():
    def limits(rule, name):
        found = find_criteria(Requirement(rule=rule, road_class=name))
        return [(each.figure, each.at_least, each.at_most) for each in found]

    assert limits(EN, "C3") == [("e_av", 15.0, None), ("u_0", 0.4, None)]
    assert limits(EN, "P2") == [("e_av", 10.0, 15.0), ("e_min", 2.0, None)]
    assert limits(EN, "M4")[3:] == [("f_ti", None, 15.0), ("eir", 0.3, None)]
    assert limits(RP8, "major/local low") == [("e_av", 13.0, None), ("average_to_min", None, 3.0)]
    assert [len(rule.classes) for rule in list_rules()] == [18, 18]


@pytest.mark.parametrize("asked", [("EN 13201-2:2003", "C3"), (EN, "ME3")])
def test_unknown_rules_and_classes_are_refused(asked):
    with pytest.raises(InputRejected, match="road-rules"):
        find_criteria(Requirement(rule=asked[0], road_class=asked[1]))


def test_a_site_with_a_name_twice_is_refused():
    with pytest.raises(InputRejected, match="different names"):
        lay_points(make_site(35.0, Strip(name="1", kind="walkway", y_m=8.0, width_m=2.0)), find_rule(EN).grid)


def test_luminances_are_averaged_on_the_point_s_own_strip_or_area():
    """Two thirds by a half of 2.92 x 1.17 m; 0.4 m by the kerb, a receiver's width by an area's border."""
    area = Area(name="corner", corners_m=((0.0, 20.0), (9.0, 20.0), (9.0, 29.0)))
    site = make_site(35.0, areas=(area,))
    points = lay_points(site, find_rule(EN).grid)
    control = tuple(
        ControlPoint(name=n, x_m=4.0, y_m=y, **LUX, values=(9.0,))
        for n, y in (("middle", 1.75), ("kerb", 0.2))
    )
    stated = Road(site=site, requirement=Requirement(rule=EN, road_class="C3"), control=control)
    cells = lay_cells(stated, points)
    sides = dict(zip(cells.names, cells.sides_m.tolist(), strict=True))
    assert sides["1/2-7"] == sides["middle"] == pytest.approx([2 / 3 * 35 / 12, 3.5 / 6])
    assert sides["kerb"][1] == pytest.approx(0.4)
    steps = (np.arange(40) + 0.5) / 40 - 0.5
    spots = cells.xy_m[6] + np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2) * cells.sides_m[6]
    light = [
        np.exp(light_evenly(xy, np.array(site.list_lamps()))[0]).mean() for xy in (spots, cells.xy_m[6:7])
    ]
    assert cells.brighter[6] - 1.0 == pytest.approx(light[0] / light[1] - 1.0, rel=0.05)
    of_area = {tuple(np.round(sides[p.name], 6)) for p in points if p.part == "corner"}
    assert (site.receiver_m, site.receiver_m) in of_area
    assert len(of_area) == 2
