"""Places on the ground against figures known by heart."""

import numpy as np
import pytest
from radiometry.maps.ground import place_on_earth, place_on_road, travel

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


@pytest.mark.parametrize(
    ("step_deg", "metres"),
    [((0.001, 0.0), 111.31949), ((0.0, 0.001), 110.57428)],
)
def test_a_thousandth_of_a_degree_at_the_equator(step_deg, metres):
    distances = travel(np.array([(0.0, 0.0), step_deg, step_deg]), is_in_degrees=True)
    np.testing.assert_allclose(distances, [0.0, metres, metres], rtol=1e-6)


def test_a_degree_of_longitude_at_sixty_degrees_is_half_and_a_little_more():
    """55.80 km on WGS 84, 55.66 on a sphere of the equator's radius."""
    distances = travel(np.array([(10.0, 60.0), (10.001, 60.0)]), is_in_degrees=True)
    assert distances[1] == pytest.approx(55.800, abs=0.001)


def test_metres_are_added_along_the_line():
    np.testing.assert_allclose(
        travel(np.array([(0.0, 0.0), (3.0, 4.0), (3.0, 0.0)]), is_in_degrees=False), [0, 5, 9]
    )
