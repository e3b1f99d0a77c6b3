"""Corners of a grid: those that no rectangle has, and what picked corners do to the figures of its cells."""

import numpy as np
import pytest

from radiometry.frame.grid import Grid, find_homography, map_plane
from radiometry.luminance.surface import Cells, check_grid, displace_cells, judge_uniformity
from radiometry.road.lanes import LaneGrid, lay_lanes

SIZE = {"height_px": 3000, "width_px": 4000}
ROAD_M = np.array([(0.0, 0.0), (30.0, 0.0), (30.0, 7.0), (0.0, 7.0)])


def photograph(points_m, *, tilt_deg, turn_deg, focal_px=3000.0, height_m=25.0):
    """Image of points of level ground by a camera above the origin, turned about its vertical and tilted."""
    tilt, turn = np.radians([tilt_deg, turn_deg])
    about = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1.0]])
    up = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    middle = points_m - points_m.mean(axis=0)
    seen = np.column_stack([middle, np.zeros(len(middle))]) @ about.T @ up.T + (0.0, 0.0, height_m)
    return seen[:, :2] / seen[:, 2:] * focal_px + (2000.0, 1500.0)


def lanes_of(corners, **said):
    given = {"lanes": 2, "lane_width_m": 3.5, "spacing_m": 30.0, "length_m": 30.0, "corner_u_px": 2.0} | said
    return lay_lanes(LaneGrid(corners=tuple(map(tuple, np.array(corners).tolist())), **given))


def flags(grid):
    return {raised.flag for raised in check_grid(grid, **SIZE)}


@pytest.mark.parametrize("tilt", [0, 20, 45])
@pytest.mark.parametrize("turn", [0, 30, 80])
def test_a_photographed_road_is_a_rectangle_and_one_of_other_lengths_or_order_is_none(tilt, turn):
    random = np.random.default_rng(tilt + turn)
    corners = photograph(ROAD_M, tilt_deg=tilt, turn_deg=turn) + random.normal(0.0, 2.0, (4, 2))
    assert flags(lanes_of(corners)) == set()
    if tilt and turn % 90:  # seen along or across, another focal length explains other lengths
        assert "corners_implausible" in flags(lanes_of(corners, lane_width_m=7.0))
        # the first two across the lanes
        assert "corners_implausible" in flags(lanes_of(np.roll(corners, 1, axis=0)))
    assert flags(lanes_of(corners[::-1])) >= {"grid_mirrored"}


def test_a_skew_quadrilateral_and_narrow_cells_are_named():
    skew = ((1000.0, 1000.0), (2000.0, 1000.0), (2600.0, 1400.0), (1600.0, 1400.0))
    (raised,) = check_grid(Grid(corners=skew, rows=3, columns=5, corner_u_px=2.0), **SIZE)
    assert (raised.flag, "in place of 90°" in raised.detail) == ("corners_implausible", True)
    square = ((1000.0, 1000.0), (1100.0, 1000.0), (1100.0, 1009.0), (1000.0, 1009.0))
    (raised,) = check_grid(Grid(corners=square, rows=3, columns=5), **SIZE)
    assert (raised.flag, raised.detail) == ("cells_small", "The narrowest cell is 3.0 px wide.")


def test_corners_beyond_a_marked_rectangle_err_as_when_it_is_marked_again():
    """A third of the field is marked."""
    above = lanes_of(((0, 0), (100, 0), (100, 70), (0, 70)), length_m=10.0)
    assert above.corners == ((0.0, 0.0), (300.0, 0.0), (300.0, 70.0), (0.0, 70.0))
    in_x, in_y = above.move_corners()[:2]
    assert in_x[1:3] == pytest.approx(np.array([(3 * 100 - 2 * 2, 0), (300, 70)]))
    # sides of 68 and 70 px: x = 100 u 68 / (70 - 2 u) at u = 3, on a line that falls by 2 px in 100
    assert in_y[1:3] == pytest.approx(np.array([(318.75, 2 - 0.02 * 318.75), (318.75, 70)]))

    random = np.random.default_rng(3)
    seen = find_homography(photograph(ROAD_M, tilt_deg=30, turn_deg=20))
    near = seen @ np.array([(0, 0, 1), (1 / 3, 0, 1), (1 / 3, 1, 1), (0, 1, 1)]).T
    marked = (near[:2] / near[2]).T
    laid = lanes_of(marked, length_m=10.0, corner_u_px=0.5)
    told = np.sqrt(np.sum((np.array(laid.move_corners()) - laid.corners) ** 2, axis=(0, 2)))
    again = [lanes_of(marked + random.normal(0.0, 0.5, (4, 2)), length_m=10.0).corners for _ in range(200)]
    scatter = np.sqrt(np.mean(np.sum((np.array(again) - laid.corners) ** 2, axis=2), axis=0))
    assert told == pytest.approx(scatter, rel=0.2)
    assert told[1] > 5 * told[0]


@pytest.mark.parametrize(("length_m", "u_px"), [(30.0, 8.0), (10.0, 2.0)])
def test_figures_have_the_error_of_picked_corners(length_m, u_px):
    """U_o and L_av of a slope of light, measured again with 150 draws of the marked corners."""
    corners, random = photograph(ROAD_M, tilt_deg=30, turn_deg=20), np.random.default_rng(2)
    marked = map_plane(
        find_homography(corners), np.array([(0, 0), (length_m / 30, 0), (length_m / 30, 1), (0, 1)])
    )

    def light(x, y):
        return 10.0 + 6.0 * np.sin(x / 7.0) + 0.4 * y

    def measure(picked):
        """Light at the cells' middles, where the true homography has them on the road."""
        u, v = np.meshgrid((np.arange(10) + 0.5) / 10, (np.arange(6) + 0.5) / 6)
        seen = find_homography(lanes_of(picked, length_m=length_m).corners) @ np.stack(
            [u.ravel(), v.ravel(), np.ones(60)]
        )
        x, y, w = np.linalg.inv(find_homography(corners.tolist())) @ seen
        return light(30.0 * x / w, 7.0 * y / w).reshape(6, 10)

    def judge(values, shared):
        none = np.zeros((0, 6, 10))
        cells = Cells(
            values_cd_m2=values, noise_cd_m2=np.zeros((6, 10)), shared_cd_m2=shared, local_cd_m2=none
        )
        return judge_uniformity(cells)

    values = measure(marked)
    laid = lanes_of(marked, length_m=length_m, corner_u_px=u_px)
    told = judge(values, displace_cells(laid, values))
    drawn = [
        judge(measure(marked + random.normal(0.0, u_px, (4, 2))), np.zeros((0, 6, 10))) for _ in range(150)
    ]
    for name, loose in (("l_av_cd_m2", 0.15), ("u_o", 0.5), ("max_to_min", 0.5)):
        scatter = np.std([getattr(each, name).value for each in drawn])
        assert getattr(told, name).standard_uncertainty == pytest.approx(scatter, rel=loose), name
