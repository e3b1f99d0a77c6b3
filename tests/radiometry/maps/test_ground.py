"""Places on the ground against figures known by heart."""

import numpy as np

from radiometry.maps import place_on_earth, place_on_road

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
