"""Coverage: by hand, by the geometry of rays, and at the horizon."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from radiometry.tools.coverage import View, compute_coverage

LENS = {"focal_length_mm": 9.0, "sensor_width_mm": 6.4, "sensor_height_mm": 4.8, "pixel_pitch_um": 4.65}


def view(**changes):
    return View(**({"height_m": 50.0, "tilt_deg": 0.0} | LENS | changes))


def cast(one, u_mm, v_mm):
    """Where a ray through (u, v) of the sensor meets the ground: by rotating it."""
    tilt, turn = math.radians(one.tilt_deg), math.radians(one.azimuth_deg)
    ray = np.array([u_mm, v_mm, -one.focal_length_mm])  # x right, y ahead, z up
    about_x = np.array([[1, 0, 0], [0, math.cos(tilt), -math.sin(tilt)], [0, math.sin(tilt), math.cos(tilt)]])
    about_z = np.array([[math.cos(turn), math.sin(turn), 0], [-math.sin(turn), math.cos(turn), 0], [0, 0, 1]])
    x, y, z = about_z @ about_x @ ray
    return np.array([x, y]) * one.height_m / -z


@pytest.mark.parametrize(("height_m", "gsd_m"), [(50.0, 0.0258), (300.0, 0.155)])
def test_a_nadir_camera_has_one_ground_sample_distance(height_m, gsd_m):
    seen = compute_coverage(view(height_m=height_m))
    for name in ("near", "centre", "far"):
        assert getattr(seen, f"gsd_{name}_m") == pytest.approx(gsd_m, rel=2e-3)
        assert getattr(seen, f"gsd_{name}_along_m") == pytest.approx(getattr(seen, f"gsd_{name}_m"))
    assert -seen.near_m == pytest.approx(seen.far_m)
    assert seen.far_m == pytest.approx(height_m * 2.4 / 9.0)


def test_the_field_of_view_follows_the_sensor_that_is_given():
    seen = compute_coverage(view())
    assert (seen.horizontal_fov_deg, seen.vertical_fov_deg) == pytest.approx((39.15, 29.86), abs=0.005)
    wide = compute_coverage(view(focal_length_mm=6.0))
    assert (wide.horizontal_fov_deg, wide.vertical_fov_deg) == pytest.approx((56.14, 43.60), abs=0.005)


def test_a_tilted_camera_by_hand():
    seen = compute_coverage(view(tilt_deg=45.0))
    half = math.degrees(math.atan(2.4 / 9.0))
    assert seen.near_m == pytest.approx(50.0 * math.tan(math.radians(45.0 - half)))
    assert seen.far_m == pytest.approx(50.0 * math.tan(math.radians(45.0 + half)))
    assert seen.gsd_centre_m == pytest.approx(50.0 / math.cos(math.radians(45.0)) * 4.65e-3 / 9.0)
    assert seen.gsd_centre_along_m == pytest.approx(seen.gsd_centre_m / math.cos(math.radians(45.0)))
    assert seen.gsd_near_m < seen.gsd_centre_m < seen.gsd_far_m
    assert not seen.horizon_in_view


views = st.builds(
    View,
    height_m=st.floats(1.0, 500.0),
    tilt_deg=st.floats(0.0, 60.0),
    azimuth_deg=st.floats(-360.0, 360.0),
    focal_length_mm=st.floats(8.0, 50.0),
    sensor_width_mm=st.floats(1.0, 6.0),
    sensor_height_mm=st.floats(1.0, 6.0),
    pixel_pitch_um=st.floats(1.0, 10.0),
)


@settings(max_examples=40)
@given(views)
def test_the_corners_are_where_rays_meet_the_ground(one):
    seen = compute_coverage(one)
    u, v = one.sensor_width_mm / 2, one.sensor_height_mm / 2
    rays = [cast(one, *corner) for corner in ((-u, -v), (u, -v), (u, v), (-u, v))]
    np.testing.assert_allclose(np.array(seen.footprint), rays, rtol=1e-9, atol=1e-9 * one.height_m)


@settings(max_examples=40)
@given(views)
def test_a_ground_sample_distance_is_the_way_between_two_rays(one):
    seen = compute_coverage(one)
    pitch, step = one.pixel_pitch_um * 1e-3, 1e-5
    for name, v in (("near", -one.sensor_height_mm / 2), ("centre", 0.0), ("far", one.sensor_height_mm / 2)):
        across = np.linalg.norm(cast(one, step, v) - cast(one, -step, v)) / (2 * step) * pitch
        along = np.linalg.norm(cast(one, 0.0, v + step) - cast(one, 0.0, v - step)) / (2 * step) * pitch
        assert getattr(seen, f"gsd_{name}_m") == pytest.approx(across, rel=1e-6)
        assert getattr(seen, f"gsd_{name}_along_m") == pytest.approx(along, rel=1e-6)


@pytest.mark.parametrize("tilt_deg", [75.0686, 80.0, 89.9])
def test_a_horizon_in_view_has_no_far_edge(tilt_deg):
    seen = compute_coverage(view(tilt_deg=tilt_deg))
    assert seen.horizon_in_view
    assert (seen.far_m, seen.gsd_far_m, seen.gsd_far_along_m, seen.footprint) == (None, None, None, None)
    assert math.isfinite(seen.near_m)
    assert math.isfinite(seen.gsd_centre_m)


def test_just_below_the_horizon_there_is_a_far_edge():
    assert compute_coverage(view(tilt_deg=75.0)).far_m > 10_000.0


def test_five_cameras_of_a_rig_lie_around_their_nadir():
    nadir = compute_coverage(view(focal_length_mm=6.0))
    sides = [compute_coverage(view(tilt_deg=45.0, azimuth_deg=azimuth)) for azimuth in (0, 90, 180, 270)]
    centres = np.array([np.mean(seen.footprint, axis=0) for seen in sides])
    ahead = centres[0][1]
    np.testing.assert_allclose(centres, [[0, ahead], [ahead, 0], [0, -ahead], [-ahead, 0]], atol=1e-9)
    np.testing.assert_allclose(np.mean(nadir.footprint, axis=0), 0.0, atol=1e-9)


@pytest.mark.parametrize("changes", [{"tilt_deg": 89.9999}, {"tilt_deg": -1.0}, {"height_m": 0.0}])
def test_what_cannot_be_is_refused(changes):
    with pytest.raises(ValueError, match="cannot be"):
        view(**changes)
