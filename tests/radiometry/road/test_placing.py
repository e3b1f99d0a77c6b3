"""Homographies of marked points: places, their uncertainty, and the angle of the view."""

import numpy as np
import pytest

from radiometry.findings import InputRejected
from radiometry.frame.opencv import cv2
from radiometry.geometry.camera import CameraModel, project
from radiometry.road.placing import Mark, place_frame

CAMERA = CameraModel(
    height_px=3956, width_px=5280, fx_px=4573.0, fy_px=4573.0, cx_px=2650.0, cy_px=1960.0, k1=-0.02, k2=0.01
)
PLACES = np.array([(0.0, 0.0), (35.0, 0.0), (35.0, 7.0), (0.0, 7.0), (17.5, 0.0), (17.5, 7.0)])


def look(places_m, *, tilt_deg=12.0, height_m=60.0):
    """Image (x, y) [px] from above the middle of the road, the camera leaning along it."""
    turn = cv2.Rodrigues(np.array([0.0, np.radians(tilt_deg), 0.0]))[0]
    above = np.column_stack([places_m - (17.5, 3.5), np.zeros(len(places_m))])
    shift = np.array([0.0, 0.0, height_m])
    return project(CAMERA, above, cv2.Rodrigues(turn)[0], shift)[:, ::-1] + 0.5


def mark(places_m, seen_px, u_m=0.03):
    return [
        Mark(x_px=x, y_px=y, x_m=a, y_m=b, u_m=u_m)
        for (x, y), (a, b) in zip(seen_px.tolist(), places_m.tolist(), strict=True)
    ]


@pytest.mark.parametrize("count", [4, 6])
def test_places_and_views_of_a_bent_picture_return(count):
    placed = place_frame(mark(PLACES[:count], look(PLACES[:count])), CAMERA)
    others = np.array([(3.0, 2.0), (29.0, 6.0)])
    assert placed.to_image(others) == pytest.approx(look(others), abs=1e-4)
    assert placed.to_road(look(others)) == pytest.approx(others, abs=1e-6)
    # straight below the camera, and as far from there as it is high
    x, height = 17.5 + 60.0 * np.sin(np.radians(12.0)), 60.0 * np.cos(np.radians(12.0))
    views = placed.find_views(np.array([(x, 3.5), (x - height, 3.5)]))
    assert views == pytest.approx([0.0, 45.0], abs=1e-4)


def test_stated_uncertainty_of_places_is_what_they_scatter():
    random, seen = np.random.default_rng(3), look(PLACES)
    others, errors, stated = np.array([(8.0, 2.0), (27.0, 6.0)]), [], []
    for _ in range(300):
        off = PLACES + 0.05 * random.standard_normal(PLACES.shape)
        placed = place_frame(mark(off, seen + random.standard_normal(seen.shape), u_m=0.05), CAMERA)
        errors.append(placed.to_road(look(others)) - others)
        stated.append(placed.estimate_u_m(others))
    scatter = np.sqrt(np.mean(np.square(errors), axis=0)).max(axis=1)
    # chi^2 / dof of 4 degrees, where above 1, widens by 14 % on average
    assert np.mean(stated, axis=0) == pytest.approx(1.1 * scatter, rel=0.15)


@pytest.mark.parametrize(
    "places",
    [PLACES[:3], np.array([(0.0, 0.0), (10.0, 0.0), (20.0, 0.0), (30.0, 0.0)]), PLACES[[0, 1, 4, 2]]],
)
def test_too_few_points_or_points_on_a_line_are_refused(places):
    with pytest.raises(InputRejected, match="points"):
        place_frame(mark(places, look(places)), CAMERA)
