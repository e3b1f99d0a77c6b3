"""Lanes in the image of a road: the points of EN 13201-3, and how well picked corners place them."""

from dataclasses import replace

import numpy as np
import pytest

from radiometry.frame.grid import LaneGrid, describe_lanes, find_homography, lay_lanes

# 30 m along and 7 m across at 10 px/m
FLAT = LaneGrid(
    corners=((0.0, 0.0), (300.0, 0.0), (300.0, 70.0), (0.0, 70.0)),
    lanes=2,
    lane_width_m=3.5,
    spacing_m=30.0,
    length_m=30.0,
    corner_u_px=1.0,
)


def test_homography_of_a_hand_computed_trapezoid():
    """A far side half as long as the near one: its middle line lies at a third of the height."""
    h = find_homography([(30.0, 10.0), (70.0, 10.0), (90.0, 60.0), (10.0, 60.0)])
    # by hand from (0, 0), (1, 0), (1, 1), (0, 1): g = 0, k = -1/2
    assert h == pytest.approx(np.array([[40.0, -25.0, 30.0], [0.0, 20.0, 10.0], [0.0, -0.5, 1.0]]))
    x, y, w = h @ (0.5, 0.5, 1.0)
    assert (x / w, y / w) == pytest.approx((50.0, 10.0 + 50.0 / 3.0))


@pytest.mark.parametrize(("spacing", "columns"), [(20, 10), (30, 10), (30.1, 11), (33, 11), (40, 14)])
def test_points_are_at_most_three_metres_apart_beyond_thirty(spacing, columns):
    assert replace(FLAT, spacing_m=spacing).columns == columns


def test_points_are_those_of_the_standard():
    """D = S / 10 from D / 2 on; a third of a lane across from a sixth on."""
    found = describe_lanes(FLAT)
    assert (found["along_m"], found["across_m"]) == pytest.approx((3.0, 3.5 / 3))
    assert found["points_m"][0][0] == pytest.approx([1.5, 3.5 / 6])
    assert found["points_m"][5][9] == pytest.approx([28.5, 7.0 - 3.5 / 6], abs=1e-6)


def test_uncertainty_of_points_is_that_of_corners_picked_again_and_again():
    """In perspective, against 500 draws of all eight coordinates at once."""
    size, random = np.array([30.0, 7.0]), np.random.default_rng(1)
    seen = replace(FLAT, corners=((300.0, 100.0), (700.0, 110.0), (900.0, 600.0), (60.0, 580.0)))
    told = describe_lanes(seen)
    points = np.array(told["points_m"]).reshape(-1, 2)
    image = np.column_stack([points / size, np.ones(len(points))]) @ find_homography(seen.corners).T
    errors = []
    for _ in range(500):
        picked = find_homography((np.array(seen.corners) + random.normal(size=(4, 2))).tolist())
        back = image @ np.linalg.inv(picked).T
        errors.append(np.sum((back[:, :2] / back[:, 2:] * size - points) ** 2, axis=1))
    assert told["point_u_m"] == pytest.approx(np.sqrt(np.mean(errors, axis=0).max()), rel=0.1)


def test_field_is_laid_from_a_rectangle_of_another_length():
    grid = lay_lanes(replace(FLAT, spacing_m=24.0))
    assert (grid.rows, grid.columns) == (6, 10)
    assert np.array(grid.corners) == pytest.approx(np.array([(0, 0), (240, 0), (240, 70), (0, 70)]))
    assert lay_lanes(FLAT).corners == FLAT.corners
