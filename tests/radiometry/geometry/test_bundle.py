"""The camera that made the corners comes out, as exactly as its standard errors say."""

import dataclasses

import cv2
import numpy as np
import pytest

from radiometry.findings import InputRejected, shared
from radiometry.fitting.curve import coverage_factor
from radiometry.geometry.camera import (
    PARAMETERS,
    CameraModel,
    Pose,
    choose_free_parameters,
    find_directions,
    project,
    solve,
)
from radiometry.geometry.fit import fit_geometry, list_coefficients
from radiometry.geometry.results import Params
from radiometry.geometry.target import Target
from radiometry.geometry.views import make_view
from tests.radiometry.geometry.boards import (
    BOARD,
    CAMERA,
    FREE,
    SQUARE,
    errors,
    simulate,
    simulate_rows,
    values,
)

ALL = choose_free_parameters(fix_aspect_ratio=False, radial_terms=3, tangential=True)


def views_of(rows, params=FREE):
    return [make_view(row.features, params) for row in rows]


def solve_rows(rows, free=ALL):
    return solve(views_of(rows), free, height_px=480, width_px=640)


def test_without_noise_the_truth_comes_out():
    found = solve_rows(simulate(seed=1, count=6, noise_px=0.0))
    # corners that the model is given in double precision leave nothing but rounding
    np.testing.assert_allclose(found.camera.parameters, CAMERA.parameters, rtol=1e-6, atol=1e-8)
    assert found.rms_px < 1e-6


def test_errors_are_as_large_as_predicted():
    """e^T C^-1 e of nine parameters has mean 9 and variance 18: over 30 sets 270 within 4 x 23."""
    total, rms = 0.0, []
    for seed in range(30):
        found = solve_rows(simulate(seed=seed, count=8, noise_px=0.2))
        error = found.camera.parameters - CAMERA.parameters
        total += float(error @ np.linalg.solve(found.covariance, error))
        rms.append(found.rms_px**2 * 8 * 54 / found.degrees_of_freedom)
    assert 178 < total < 362
    # the noise itself: each variance is known to sqrt(2 / 807), their mean to 0.9 %
    assert np.mean(rms) == pytest.approx(0.2**2, rel=0.04)


def test_expanded_uncertainty_of_three_small_views_covers_the_truth():
    """200 numbers of 50 sets: 95 % with a standard deviation of 3 %, as four of a set go together."""
    board = Target(kind="checkerboard", columns=3, rows=3, square_size_mm=70.0)
    camera = dataclasses.replace(SQUARE, k2=0.0, k3=0.0, p1=0.0, p2=0.0)
    params = Params(radial_terms=1, tangential=False)
    inside = []
    for seed in range(50):
        rows = simulate(seed=5000 + seed, count=3, noise_px=0.1, camera=camera, target=board)
        for each in list_coefficients(fit_geometry(rows, params)):
            if each.name in ("fx_px", "cx_px", "cy_px", "k1"):
                k = coverage_factor(each.effective_dof)
                inside.append(abs(each.value - getattr(camera, each.name)) < k * each.standard_uncertainty)
    # 3 views x 9 corners x 2, less six numbers of each pose and four of the camera
    assert round(k, 3) == 2.037
    assert np.mean(inside) > 0.87


@pytest.mark.parametrize("square", [True, False])
def test_opencv_finds_the_same_and_the_same_errors(square, simulated):
    free = choose_free_parameters(fix_aspect_ratio=square, radial_terms=3, tangential=True)
    found = solve_rows(simulated, free)
    views = views_of(simulated)
    rms, matrix, distortion, _, _, deviations, _, per_view = cv2.calibrateCameraExtended(
        [view.points_mm.astype(np.float32) for view in views],
        [np.ascontiguousarray(view.seen_px[:, ::-1], np.float32) for view in views],
        (640, 480),
        np.eye(3),
        np.zeros(5),
        flags=cv2.CALIB_FIX_ASPECT_RATIO if square else 0,
    )
    theirs = np.array([matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], *distortion.ravel()])
    # its corners are in single precision: some 1e-5 px
    np.testing.assert_allclose(found.camera.parameters, theirs, rtol=1e-4, atol=1e-5)
    ours = np.sqrt(np.diag(found.covariance))
    np.testing.assert_allclose(ours[1:], deviations.ravel()[1:9], rtol=1e-4)
    # of square pixels OpenCV tells no error of fx
    assert ours[0] == pytest.approx(ours[1] if square else float(deviations[0, 0]), rel=1e-4)
    assert found.rms_px == pytest.approx(rms, rel=1e-5)
    mine = [np.sqrt((residual**2).sum() / len(residual)) for residual in found.residuals_px]
    np.testing.assert_allclose(mine, per_view.ravel(), rtol=1e-3)


def test_what_is_not_free_is_zero_and_certain(simulated):
    params = Params(radial_terms=1, tangential=False)
    fit = fit_geometry(simulated, params)
    fixed = {name: (values(fit)[name], errors(fit)[name]) for name in ("k2", "k3", "p1", "p2")}
    assert set(fixed.values()) == {(0.0, 0.0)}
    assert values(fit)["fx_px"] == values(fit)["fy_px"]
    assert errors(fit)["fx_px"] == errors(fit)["fy_px"] > 0.0


def test_the_size_of_the_board_enters_distances_alone(simulated):
    larger = dataclasses.replace(BOARD, square_size_mm=250.0)
    grown = [
        dataclasses.replace(row, features=dataclasses.replace(row.features, target=larger))
        for row in simulated
    ]
    here, there = fit_geometry(simulated, FREE), fit_geometry(grown, FREE)
    assert values(there)["fx_px"] == pytest.approx(values(here)["fx_px"], rel=1e-8)
    assert there.points[0].distance_mm == pytest.approx(10 * here.points[0].distance_mm, rel=1e-7)


@pytest.mark.parametrize("noise_px", [0.0, 0.05, 0.5])
def test_frontal_views_do_not_determine_a_camera(noise_px):
    """Boards that all face the camera leave its distance and its focal length exchangeable."""
    poses = [
        Pose(np.zeros(3), np.array([x, y, 400.0])) for x in (-150.0, -100.0, -50.0) for y in (-90.0, -60.0)
    ]
    plain = CameraModel(height_px=480, width_px=640, fx_px=520, fy_px=520, cx_px=319.5, cy_px=239.5)
    rows = simulate_rows(plain, BOARD, poses, np.random.default_rng(1), noise_px=noise_px)
    with pytest.raises(InputRejected, match="tilted 20 to 45 degrees") as caught:
        fit_geometry(rows, FREE)
    assert caught.value.code is shared.FIT_FAILED


def test_directions_undo_the_projection():
    places = np.array([[10.0, 20.0], [229.0, 332.0], [400.0, 600.0]])
    directions = find_directions(CAMERA, places)
    back = project(CAMERA, np.column_stack((directions, np.ones(3))), np.zeros(3), np.zeros(3))
    np.testing.assert_allclose(back, places, atol=1e-7)
    assert directions[1] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_the_model_by_hand():
    """At (x, y) = (0.2, 0.1): r^2 = 0.05."""
    radial = 1 - 0.25 * 0.05 + 0.08 * 0.05**2 - 0.01 * 0.05**3
    x = 0.2 * radial + 2 * 0.0008 * 0.02 - 0.0006 * (0.05 + 2 * 0.04)
    y = 0.1 * radial + 0.0008 * (0.05 + 2 * 0.01) - 2 * 0.0006 * 0.02
    seen = project(CAMERA, np.array([[0.2, 0.1, 1.0]]), np.zeros(3), np.zeros(3))
    np.testing.assert_allclose(seen, [[515.0 * y + 229.0, 520.0 * x + 332.0]], rtol=1e-12)


def test_names_are_in_opencv_s_order():
    assert CameraModel.from_parameters(CAMERA.parameters, height_px=480, width_px=640) == CAMERA
    assert PARAMETERS[-1] == "k3"
    np.testing.assert_array_equal(CAMERA.distortion, CAMERA.parameters[4:])
    assert SQUARE.centre_px == (239.5, 319.5)
