"""Isolines of a map: where a plane and a cone have them, either way the map lies."""

import math

import numpy as np
import pytest

from radiometry.maps import (
    PixelUncertainty,
    choose_levels,
    choose_step,
    is_ragged,
    place_on_earth,
    place_on_road,
    trace_isolines,
)

ROWS, COLS = np.mgrid[0:40, 0:60] + 0.5


def trace(plane, levels, **how):
    return trace_isolines(plane, levels, **({"step": 1, "left_px": 0.0, "top_px": 0.0} | how))


def test_of_a_plane_it_is_the_straight_line_that_it_must_be():
    """L = 2 x + 1 at the centres: 21 lies at x = 10, with a slope of 2 a pixel."""
    (line,) = trace(2.0 * COLS + 1.0, [21.0])
    assert len(line.lines) == 1
    assert np.allclose(line.lines[0][:, 0], 10.0)
    assert sorted(line.lines[0][:, 1]) == [0.5, 39.5]
    assert line.slope_per_px == pytest.approx(2.0)


def test_squares_are_placed_at_their_centres():
    """Means over squares of 4 from (8, 20) on: the same plane, the same line."""
    plane = (2.0 * COLS + 1.0).reshape(10, 4, 15, 4).mean((1, 3))
    (line,) = trace(plane, [21.0], step=4, left_px=8.0, top_px=20.0)
    assert np.allclose(line.lines[0][:, 0], 18.0)
    assert line.slope_per_px == pytest.approx(2.0)


def test_of_a_cone_it_is_a_closed_circle():
    plane = 30.0 - np.hypot(COLS - 30.0, ROWS - 20.0)
    (line,) = trace(plane, [18.0])
    (circle,) = line.lines
    assert circle[0].tolist() == circle[-1].tolist()
    assert np.allclose(np.hypot(circle[:, 0] - 30.0, circle[:, 1] - 20.0), 12.0, atol=0.15)
    assert len(circle) < 60


def test_a_line_ends_at_what_is_unknown():
    plane = ROWS.copy()
    plane[:, 30:33] = np.nan
    (line,) = trace(plane, [20.0])
    assert sorted(sorted(part[:, 0]) for part in line.lines) == [[0.5, 29.5], [33.5, 59.5]]


def test_a_ring_around_one_square_is_noise_and_counted():
    plane = np.zeros((20, 20))
    plane[5, 5] = plane[12, 12] = plane[12, 13] = plane[13, 12] = plane[13, 13] = 1.0
    (line,) = trace(plane, [0.4])
    assert (len(line.lines), line.rings_left_out) == (1, 1)


def test_lines_of_noise_are_ragged_and_of_a_slope_are_not():
    """A slope of .1 a pixel: noise of .05 moves a line by half a pixel, noise of .2 by two."""
    (line,) = trace(0.1 * COLS, [3.0])
    known = {"relative": 0.0, "constant": 0.0, "reference": 10.0}
    assert not is_ragged([line], PixelUncertainty(**known, pixel=0.05), step=1)
    assert is_ragged([line], PixelUncertainty(**known, pixel=0.2), step=1)
    noise = np.random.default_rng(3).normal(0.0, 1.0, (40, 60))
    assert is_ragged(trace(noise, [2.5]), None, step=1)


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0.08, 3.0, (0.1, 0.2, 0.5, 1.0, 2.0)),
        (0.008, 90.0, (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0)),
        (1.0, 2.0, (1.2, 1.4, 1.6, 1.8)),
        (2.0, 2.0, ()),
    ],
)
def test_round_levels(low, high, expected):
    assert choose_levels(low, high, logarithmic=True) == expected
    assert choose_levels(-0.9, 0.8, logarithmic=False) == (-0.5, 0.0, 0.5)


def test_the_squares_are_as_large_as_noise_asks_for():
    """Noise .2, levels .5 apart, a quarter of that wanted: squares of 2; of green pixels, 1.41 times that."""
    noise = {"relative": 0.0, "constant": 0.0, "pixel": 0.2, "reference": 100.0}
    asked = {"pixels": 1_000_000, "most": 1_000_000}
    plain, green = PixelUncertainty(**noise), PixelUncertainty(**noise, likeness=2.0)
    assert choose_step([0.5, 1.0], uncertainty=plain, **asked) == 2
    assert choose_step([0.5, 1.0], uncertainty=green, **asked) == math.ceil(1.6 * math.sqrt(2.0))
    assert choose_step([0.5, 1.0], uncertainty=None, pixels=1_000_000, most=40_000) == 5


# --- Places on the ground against figures known by heart


MARKED = [(100.0, 300.0), (500.0, 300.0), (400.0, 100.0), (200.0, 100.0)]
LANES = {"marked": MARKED, "length_m": 30.0, "lanes": 2, "lane_width_m": 3.5}


def test_the_marked_corners_are_the_corners_of_the_lanes():
    placed = place_on_road(LANES, np.array(MARKED))
    np.testing.assert_allclose(np.sort(placed, axis=0), [[0, 0], [0, 0], [30, 7], [30, 7]], atol=1e-9)


def test_the_middle_of_a_picture_of_a_road_is_not_the_middle_of_the_road():
    """Its diagonals meet at two thirds of the height where the far end looks half as long as the near one."""
    meeting = np.array([(300.0, 300.0 - 200.0 * 2.0 / 3.0)])
    np.testing.assert_allclose(place_on_road(LANES, meeting), [[15.0, 3.5]])


def test_places_far_beyond_the_marked_corners_are_not_told():
    assert place_on_road(LANES, np.array([(300.0, 200.0), (300.0, 20.0)])) is None


def test_an_affine_transformation_is_read_as_gdal_counts():
    placed = place_on_earth((11.0, 1e-6, 2e-6, 48.0, 3e-6, -1e-6), np.array([(0.0, 0.0), (10.0, 100.0)]))
    np.testing.assert_allclose(placed, [(11.0, 48.0), (11.00021, 47.99993)], rtol=1e-12)
