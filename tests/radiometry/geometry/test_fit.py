"""A fit: OpenCV's published numbers, any order, what is left out, and what is flagged."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from pydantic import TypeAdapter

from radiometry.findings import InputRejected, shared
from radiometry.fitting.curve import coverage_factor
from radiometry.fitting.evidence import Exclusion
from radiometry.geometry import views as geometry_views
from radiometry.geometry.camera import (
    PARAMETERS,
    CameraModel,
    Pose,
    choose_free_parameters,
    project,
    solve,
)
from radiometry.geometry.fit import fit_geometry, list_coefficients
from radiometry.geometry.results import Fit, Params
from radiometry.geometry.target import locate_corners_mm
from radiometry.geometry.verdicts import plan_views
from radiometry.geometry.views import make_view
from simulation.boards import draw_poses
from tests.radiometry.geometry.boards import (
    BOARD,
    CAMERA,
    CHARUCO,
    FREE,
    SQUARE,
    errors,
    make_row,
    raised,
    read_picture,
    simulate,
    simulate_rows,
    transpose,
    values,
    with_features,
)
from tests.support.data import data_file

PUBLISHED = {
    "fx_px": 535.9157,
    "fy_px": 535.9157,
    "cx_px": 342.2832,
    "cy_px": 235.5708,
    "k1": -0.26637,
    "k2": -0.03859,
    "k3": 0.23839,
    "rms_px": 0.39259,
}
# what docs/geometry.md prints beside them: value and standard uncertainty
HERE = {
    "fx_px": (533.05, 0.85),
    "fy_px": (533.05, 0.85),
    "cx_px": (342.24, 0.91),
    "cy_px": (233.95, 0.98),
    "k1": (-0.2844, 0.0106),
    "k2": (0.056, 0.081),
    "k3": (0.094, 0.173),
    "rms_px": (0.1797, 0.0035),
}


def spoil(row, by_px):
    moved = tuple(
        (place[0] + by_px * (number % 2), place[1]) for number, place in enumerate(row.features.fitted_px)
    )
    return with_features(row, fitted_px=moved)


@pytest.fixture(scope="module")
def opencv_fit(opencv_rows):
    return fit_geometry(opencv_rows, Params(pixel_pitch_um=4.65))


def test_opencv_s_set_gives_what_the_page_prints(opencv_fit):
    for name, (value, u) in HERE.items():
        assert values(opencv_fit)[name] == pytest.approx(value, abs=u / 50), name
        assert errors(opencv_fit)[name] == pytest.approx(u, rel=0.05), name
    assert (opencv_fit.views, opencv_fit.corners) == (13, 13 * 54)
    assert not {"view_outlier", "view_mirrored"} & raised(opencv_fit)


def test_the_right_camera_agrees_with_windows_that_keep_clear_of_the_next_corner():
    """537.0 with windows of 5; one of 11 pixels reaches the edges of halved outer squares: 541.4."""
    rows = [read_picture(path) for path in sorted(data_file("checkerboard-right").glob("*.jpg"))]
    fit = fit_geometry(rows, Params())
    assert abs(values(fit)["fx_px"] - 537.0) < errors(fit)["fx_px"] < 1.1
    assert fit.rms_px < 0.19


def test_the_covariance_holds_what_corners_of_one_view_share(opencv_fit):
    """Views disagree by twice what corners explain: that is the jackknife's error of most parameters."""
    assert opencv_fit.birge_ratio == pytest.approx(2.13, abs=0.02)
    assert opencv_fit.effective_dof == 13 * 8 - 8
    covered = []
    for seed in range(12):
        random = np.random.default_rng(700 + seed)
        bent = []
        for view in views_of(simulate(seed=700 + seed, count=8, noise_px=0.05, camera=SQUARE)):
            x, y = (view.seen_px - view.seen_px.mean(axis=0)).T / np.ptp(view.seen_px, axis=0).max()
            bend = np.column_stack([x * x, x * y, y * y]) @ random.normal(0.0, 1.0, (3, 2))
            bent.append(replace(view, seen_px=view.seen_px + bend))
        found = solve(bent, ALL, height_px=480, width_px=640, tolerance_rel=1e-6)
        widened, ratio, dof = geometry_views.widen(bent, found, ALL)
        assert ratio > 2.0
        off = np.abs(widened.camera.parameters - SQUARE.parameters)
        covered.append(off < coverage_factor(dof) * np.sqrt(np.diag(widened.covariance)))
    # 108 numbers, of which nine of a set go together: 95 % with a standard deviation of 4 %
    assert np.mean(covered) > 0.85


def place_as_opencv(path):
    """Return corners as OpenCV's sample places them, in a window of 11 px whatever it reaches."""
    picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
    _, start = cv2.findChessboardCorners(picture, (9, 6), flags=flags)
    placed = cv2.cornerSubPix(picture, start, (11, 11), (-1, -1), (3, 30, 0.1))
    return tuple((float(row), float(col)) for col, row in placed.reshape(-1, 2))


@pytest.fixture(scope="module")
def sample_rows(opencv_rows):
    return tuple(
        with_features(row, fitted_px=place_as_opencv(data_file("checkerboard") / row.frame))
        for row in opencv_rows
    )


def test_opencv_s_corners_give_opencv_s_published_numbers(sample_rows):
    """Within a twentieth of a standard error: today's corner finder starts elsewhere than that of 2012."""
    fit = fit_geometry(sample_rows, Params())
    for name, published in PUBLISHED.items():
        tolerance = errors(fit)[name] / 20.0
        assert values(fit)[name] == pytest.approx(published, abs=tolerance), name


def test_an_outlier_is_named_and_rejected_on_request(sample_rows):
    """Corners of left02 are 21.8 px apart: a window of 23 px reaches the next one."""
    fit = fit_geometry(sample_rows, Params())
    point = {each.frame: each for each in fit.points}["left02.jpg"]
    assert point.rms_px == pytest.approx(1.18, abs=0.005)
    assert point.used
    outliers = [flag.where for flag in fit.flags if flag.flag == "view_outlier"]
    assert outliers == ["frame left02.jpg"]
    strict = fit_geometry(sample_rows, Params(reject_above_px=1.0))
    rejected = {each.frame: each for each in strict.points}["left02.jpg"]
    assert not rejected.used
    assert rejected.left_out == "it fits to 1.18 px, worse than the limit of 1 px"
    assert (strict.views, strict.points[0].used) == (12, True)
    assert strict.rms_px == pytest.approx(0.220, abs=0.001)
    # against a camera that it had no part in it fits no better
    assert rejected.rms_px > 1.1


def test_what_is_reported_in_millimetres(opencv_fit):
    distance = opencv_fit.principal_distance_mm
    assert distance.value == pytest.approx(values(opencv_fit)["fx_px"] * 0.00465)
    assert distance.standard_uncertainty == pytest.approx(errors(opencv_fit)["fx_px"] * 0.00465)
    assert opencv_fit.offset_col.value == values(opencv_fit)["cx_px"] - 319.5
    assert opencv_fit.offset_col_um.value == pytest.approx(opencv_fit.offset_col.value * 4.65)
    plain = fit_geometry(simulate(seed=2, count=4, noise_px=0.1), FREE)
    assert plain.principal_distance_mm is None
    assert plain.offset_row_um is None
    assert {each.distortion_um for each in plain.curve} == {None}


def test_figures_and_json(opencv_fit):
    figures = list_coefficients(opencv_fit)
    assert [each.name for each in figures] == [
        *("fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "k3", "p1", "p2", "rms_px")
    ]
    assert {each.unit for each in figures} == {"px", "1"}
    assert {each.model for each in figures} == {"brown_conrady"}
    rms = figures[-1]
    assert rms.standard_uncertainty == pytest.approx(rms.value / math.sqrt(2 * (13 * 108 - 8 - 78)))
    adapter = TypeAdapter(Fit)
    assert adapter.validate_json(adapter.dump_json(opencv_fit)) == opencv_fit
    assert b"NaN" not in adapter.dump_json(opencv_fit)


def test_the_order_of_frames_changes_no_bit(simulated):
    rows = [simulated[place] for place in np.random.default_rng(4).permutation(len(simulated))]
    assert fit_geometry(rows, FREE) == fit_geometry(simulated, FREE)


def test_parameters_of_a_charuco_board():
    """Every view shows another part of the board."""
    random = np.random.default_rng(3)
    rows = []
    for number, pose in enumerate(draw_poses(SQUARE, CHARUCO, random, count=14)):
        indices = np.sort(random.choice(CHARUCO.corners, 18, replace=False))
        seen = project(SQUARE, locate_corners_mm(CHARUCO, indices), pose.rotation, pose.shift)
        seen = seen + random.normal(0.0, 0.1, seen.shape)
        rows.append(make_row(f"view-{number}", SQUARE, CHARUCO, indices, seen))
    fit = fit_geometry(rows, Params())
    for name in ("fx_px", "cx_px", "cy_px", "k1", "p1", "p2"):
        assert abs(values(fit)[name] - getattr(SQUARE, name)) < 4.0 * errors(fit)[name], name
    assert fit.corners == 14 * 18


def test_views_that_fit_badly_are_rejected_the_worst_first(simulated):
    rows = list(simulated)
    rows[3], rows[7] = spoil(rows[3], 30.0), spoil(rows[7], 12.0)
    fit = fit_geometry(rows, FREE)
    left_out = {each.frame: each.left_out for each in fit.points if not each.used}
    assert set(left_out) == {rows[3].frame, rows[7].frame}
    assert all("worse than the limit of 2 px" in reason for reason in left_out.values())
    others = fit_geometry([row for row in simulated if row.frame not in left_out], FREE)
    assert values(fit) == values(others)
    kept = fit_geometry(rows, replace(FREE, reject_above_px=None))
    assert kept.views == 15
    assert "reprojection_large" in raised(kept)


def test_three_views_are_never_rejected():
    rows = list(simulate(seed=8, count=3, noise_px=0.1))
    rows[0] = spoil(rows[0], 7.0)
    fit = fit_geometry(rows, Params(radial_terms=1, tangential=False))
    assert fit.views == 3
    assert {"few_views", "reprojection_large"} <= raised(fit)


def unseen(row):
    return with_features(row, not_found="the board was not found", indices=(), fitted_px=())


def test_frames_that_are_left_out_say_why(simulated):
    rows = list(simulated)
    rows[0] = unseen(rows[0])
    rows[1] = transpose(rows[1])
    rows[2] = with_features(rows[2], target=replace(BOARD, square_size_mm=20.0))
    rows[4] = replace(rows[4], role="field")
    exclusion = Exclusion(frame=rows[3].frame, reason="glare", by="Ann")
    fit = fit_geometry(rows, replace(FREE, exclude=(exclusion,)))
    reasons = {each.frame: each.left_out for each in fit.points}
    assert reasons[rows[0].frame] == "the board was not found"
    assert reasons[rows[1].frame].startswith("it is 480 x 640 pixels, most are 640 x 480")
    assert reasons[rows[2].frame] == "it was searched for another board than most"
    assert reasons[rows[3].frame] == "glare (Ann)"
    assert rows[4].frame not in reasons
    assert fit.views == 10


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda rows: rows[:2], "3 views of the board are needed at least, 2 can be used"),
        (lambda _: [], "3 views of the board are needed at least, 0 can be used"),
        (lambda rows: [unseen(rows[0])], "at least, 0 can be used; others: the board was not found"),
        (
            lambda rows: [replace(rows[0], features=None), *rows[1:]],
            "not searched for the board yet: frame view-000",
        ),
    ],
)
def test_what_a_fit_lacks(change, said, simulated):
    rows = change(list(simulated))
    assert any(each.endswith(said) for each in geometry_views.missing(rows, FREE))
    with pytest.raises(InputRejected, match=said) as caught:
        fit_geometry(rows, FREE)
    assert caught.value.code is shared.FIT_INCOMPLETE


def test_what_is_missing_by_name(simulated):
    assert geometry_views.missing(simulated, FREE) == ()
    exclude = (Exclusion(frame="nobody", reason="x", by="y"), Exclusion(frame="later", reason="x", by="y"))
    params = replace(FREE, exclude=exclude)
    assert geometry_views.missing(simulated, params, unread=["later", "soon"]) == (
        "to be left out, but not of this campaign: frame nobody",
        "not read yet: frame soon",
    )
    # what is still coming may be enough
    assert geometry_views.missing(simulated[:1], FREE, unread=["b", "a"]) == ("not read yet: frames a, b",)


def test_a_good_set_raises_nothing_and_needs_nothing():
    rows = simulate(seed=13, count=40, noise_px=0.1, camera=SQUARE, tilt_deg=45.0)
    assert raised(fit_geometry(rows, Params())) == set()
    assert plan_views(rows, Params()) == plan_views([], Params()) == ()


def test_poor_sets_are_flagged(simulated):
    middle = [
        Pose(np.array([0.02 * n, 0.02, 0.0]), np.array([-100.0, -60.0, 900.0 + 40 * n])) for n in range(6)
    ]
    rows = simulate_rows(SQUARE, BOARD, middle, np.random.default_rng(2), noise_px=0.01)
    poor = fit_geometry(rows, Params(radial_terms=1, tangential=False))
    assert {"few_views", "coverage_poor", "tilt_poor"} <= raised(poor)
    assert poor.coverage.share < 0.3
    nodding = [
        Pose(np.array([angle, 0.0, 0.0]), np.array([-100.0, -60.0, 450.0]))
        for angle in np.linspace(-0.6, 0.6, 8)
    ]
    rows = simulate_rows(SQUARE, BOARD, nodding, np.random.default_rng(2), noise_px=0.01)
    fit = fit_geometry(rows, Params(radial_terms=1, tangential=False))
    told = {flag.flag: flag.detail for flag in fit.flags}
    assert "turn about one axis" in told["tilt_poor"]
    wide = replace(CAMERA, fy_px=540.0)
    skewed = simulate(seed=3, count=12, noise_px=0.05, camera=wide)
    assert "pixels_not_square" in raised(fit_geometry(skewed, FREE))
    assert "pixels_not_square" not in raised(fit_geometry(simulated, FREE))


def test_tilts_and_distances():
    turned = np.radians(30.0)
    poses = [Pose(np.array([turned, 0.0, 0.0]), np.array([-100.0, -60.0, 600.0]))]
    poses += list(draw_poses(CAMERA, BOARD, np.random.default_rng(5), count=11))
    rows = simulate_rows(CAMERA, BOARD, poses, np.random.default_rng(5), noise_px=0.02)
    point = fit_geometry(rows, FREE).points[0]
    assert point.tilt_deg == pytest.approx(30.0, abs=0.2)
    assert point.distance_mm == pytest.approx(math.hypot(100, 60, 600), rel=0.005)


# --- The camera that made the corners comes out, as exactly as its standard errors say


ALL = choose_free_parameters(fix_aspect_ratio=False, radial_terms=3, tangential=True)


def views_of(rows):
    return [make_view(row.features) for row in rows]


def solve_rows(rows, free=ALL):
    return solve(views_of(rows), free, height_px=480, width_px=640)


def test_without_noise_the_truth_comes_out():
    found = solve_rows(simulate(seed=1, count=6, noise_px=0.0))
    # corners that the model is given in double precision leave nothing but rounding
    np.testing.assert_allclose(found.camera.parameters, CAMERA.parameters, rtol=1e-6, atol=1e-8)
    assert found.rms_px < 1e-6


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
