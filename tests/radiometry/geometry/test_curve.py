"""The distortion curve in pixels and micrometres, and its uncertainty."""

from dataclasses import replace

import numpy as np
import pytest

from radiometry.geometry import fit
from radiometry.geometry.camera import CameraModel, project
from tests.radiometry.geometry.boards import SQUARE

NOTHING = np.zeros((9, 9))
PITCH_UM = 4.65


def curve_of(camera, covariance=NOTHING, covered_radius_px=1e9):
    return fit.compute_curve(camera, covariance, pixel_pitch_um=PITCH_UM, covered_radius_px=covered_radius_px)


def test_the_procedure_s_lens_of_9_mm():
    """1280 x 960 pixels of 4.65 um: 32 px of barrel distortion in the corner are 148.8 um."""
    plain = CameraModel(height_px=960, width_px=1280, fx_px=1935.5, fy_px=1935.5, cx_px=639.5, cy_px=479.5)
    corner = fit.find_farthest_radius_px(plain)
    assert corner == pytest.approx(799.3, abs=0.1)
    ideal = corner + 32.0
    camera = replace(plain, k1=-32.0 / ideal / (ideal / 1935.5) ** 2)
    last = curve_of(camera)[-1]
    assert last.radius_px == pytest.approx(corner, abs=0.01)
    assert last.distortion_px == pytest.approx(-32.0, abs=0.01)
    assert last.distortion_um == pytest.approx(-148.8, abs=0.05)


def test_the_curve_is_where_the_model_puts_a_direction():
    camera = replace(SQUARE, p1=0.0, p2=0.0)
    for point in curve_of(camera):
        x = point.ideal_radius_px / camera.fx_px
        seen = project(camera, np.array([[x, 0.0, 1.0]]), np.zeros(3), np.zeros(3))
        assert seen[0, 1] - camera.cx_px == pytest.approx(point.radius_px, abs=1e-9)
        assert point.radius_px - point.ideal_radius_px == pytest.approx(point.distortion_px, abs=1e-9)


def test_the_band_is_that_of_many_draws():
    random = np.random.default_rng(2)
    spread = np.diag([8.0, 8.0, 0.5, 0.5, 4e-3, 6e-3, 1e-4, 1e-4, 3e-3]) ** 2
    # fx and fy move together, k1 and k2 against each other
    spread[0, 1] = spread[1, 0] = 0.9 * 8.0**2
    spread[4, 5] = spread[5, 4] = -0.8 * 4e-3 * 6e-3
    points = curve_of(SQUARE, spread)
    ideal = np.array([point.ideal_radius_px for point in points])
    drawn = random.multivariate_normal(SQUARE.parameters, spread, 4000)
    curves = [
        fit.distort_radially(CameraModel.from_parameters(each, height_px=480, width_px=640), ideal)
        for each in drawn
    ]
    predicted = [point.standard_uncertainty_px for point in points]
    # a standard deviation of 4000 draws is known to 1.1 %
    np.testing.assert_allclose(np.std(curves, axis=0), predicted, rtol=0.05, atol=1e-9)
    assert points[-1].standard_uncertainty_um == points[-1].standard_uncertainty_px * PITCH_UM


def test_beyond_the_outermost_corner_the_curve_is_extrapolated():
    told = [
        (point.radius_px > 200.0, point.extrapolated) for point in curve_of(SQUARE, covered_radius_px=200.0)
    ]
    assert {(True, True), (False, False)} == set(told)


def test_a_curve_that_turns_back_ends_there_and_is_flagged():
    """r (1 + k1 r^2) turns where r^2 = -1 / (3 k1): at two thirds of that r."""
    camera = replace(SQUARE, k1=-1.0, k2=0.0, k3=0.0, p1=0.0, p2=0.0)
    turning = fit.find_turning_radius_px(camera)
    assert turning == pytest.approx(520.0 * np.sqrt(1 / 3) * 2 / 3, rel=1e-3)
    assert [flag.flag for flag in fit._check_model(camera)] == ["distortion_folds"]
    last = curve_of(camera)[-1]
    assert last.radius_px == pytest.approx(turning, rel=1e-3)
    assert fit.find_turning_radius_px(SQUARE) is None
    assert fit._check_model(SQUARE) == []
