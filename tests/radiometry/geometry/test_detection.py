"""Boards are found where they are, in pictures and in mosaics, to a tenth of a pixel."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from radiometry.geometry.camera import CameraModel, make_grey, project
from radiometry.geometry.target import Target, locate_corners_mm
from simulation.boards import View, draw_poses, set_up
from tests.radiometry.geometry.boards import BOARD, CHARUCO, extract, make_frame

# half of the usual camera in every direction
SMALL = CameraModel(
    height_px=240, width_px=320, fx_px=260, fy_px=260, cx_px=166, cy_px=114, k1=-0.25, k2=0.08
)
PICTURE = {"dark_dn": 20.0, "bright_dn": 220.0, "noise_dn": 1.0}
RAW = {"dark_dn": 200.0, "bright_dn": 3500.0, "noise_dn": 15.0}
BIG_BOARD = Target(kind="checkerboard", columns=5, rows=4, square_size_mm=25.0)
SQUARES = replace(BIG_BOARD, columns=6, rows=5)


def render(target, seed, light=PICTURE):
    random = np.random.default_rng(seed)
    (pose,) = draw_poses(SMALL, target, random, count=1)
    frame = set_up(SMALL, **light).photograph(View(board=target, pose=pose), random)
    return frame.samples_dn.astype(float), pose


def truth(target, pose, indices):
    return project(SMALL, locate_corners_mm(target, np.array(indices)), pose.rotation, pose.shift)


def largest_error(features, target, pose):
    """A checkerboard may be read from either end."""
    seen, there = np.array(features.fitted_px), truth(target, pose, features.indices)
    return min(np.abs(seen - there).max(), np.abs(seen[::-1] - there).max())


@pytest.fixture(scope="module")
def picture():
    return render(BIG_BOARD, 3)


@pytest.fixture(scope="module")
def raw():
    return render(BIG_BOARD, 3, RAW)


@pytest.mark.parametrize("cfa", ["grey", "rgb"])
def test_a_board_in_a_picture(cfa, picture):
    drawn, pose = picture
    found = extract(make_frame(drawn, cfa=cfa, bits=8), target=BIG_BOARD)
    assert found.features.not_found == ""
    assert found.features.indices == tuple(range(20))
    # noise of 1 in a step of 200 leaves some thousandths of a pixel; whole numbers and the blur do the rest
    assert largest_error(found.features, BIG_BOARD, pose) < 0.1
    assert found.features.edge_rise_px == pytest.approx(2.5, abs=0.7)
    assert [row.channel for row in found.statistics][-1] == "grey"


@pytest.mark.parametrize("cfa", ["RGGB", "GBRG", "grey"])
def test_a_board_in_a_raw_frame(cfa, raw):
    drawn, pose = raw
    found = extract(make_frame(drawn, cfa=cfa, bits=12), target=BIG_BOARD, bits=12)
    assert largest_error(found.features, BIG_BOARD, pose) < 0.1


def test_a_mosaic_leaves_no_pattern_and_no_shift():
    even = make_frame(np.full((64, 80), 1000.0), cfa="RGGB")
    fine = make_grey(even, bits_per_sample=12).fine
    assert np.ptp(fine) == 0.0
    assert fine[0, 0] == (500 + 2 * 1000 + 600) / 4
    ramp = np.add.outer(np.arange(64) * 20.0, np.arange(80) * 10.0)
    fine = make_grey(make_frame(ramp, cfa="grey"), bits_per_sample=12).fine
    np.testing.assert_array_equal(fine, ramp)


def test_corners_in_a_window_are_told_in_the_whole_frame(picture):
    drawn, _ = picture
    frame = make_frame(drawn, bits=8)
    whole = extract(frame, target=BIG_BOARD).features
    places = np.array(whole.fitted_px)
    top, left = np.maximum(np.floor(places.min(axis=0)).astype(int) - 25, 0)
    cut = replace(frame, samples_dn=frame.samples_dn[top:, left:], row0=int(top), col0=int(left))
    there = extract(cut, target=BIG_BOARD).features
    assert max(top, left) > 0
    np.testing.assert_allclose(there.fitted_px, places, atol=2e-3)
    assert (there.height_px, there.width_px) == (240, 320)


def test_a_part_of_a_charuco_board_is_enough():
    drawn, pose = render(CHARUCO, 4)
    found = extract(make_frame(drawn, bits=8), target=CHARUCO).features
    assert len(found.indices) >= 12
    seen, there = np.array(found.fitted_px), truth(CHARUCO, pose, found.indices)
    # no other way round: every corner has its number
    assert np.abs(seen - there).max() < 0.2
    column = np.array(there)[:, 1].mean()
    half = drawn.copy()
    half[:, : int(column)] = 128.0
    part = extract(make_frame(half, bits=8), target=CHARUCO).features
    assert 6 <= len(part.indices) < len(found.indices)
    assert np.abs(np.array(part.fitted_px) - truth(CHARUCO, pose, part.indices)).max() < 0.2
    assert part.edge_rise_px is None
    mirrored = extract(make_frame(drawn[:, ::-1], bits=8), target=CHARUCO).features
    assert mirrored.not_found.startswith("the picture is mirrored: ")


def test_a_large_frame_is_searched_small_and_placed_large(picture):
    drawn, pose = picture
    enlarged = cv2.resize(drawn, None, fx=6, fy=6, interpolation=cv2.INTER_CUBIC)
    found = extract(make_frame(np.clip(enlarged, 0, 255), bits=8), target=BIG_BOARD).features
    seen = (np.array(found.fitted_px) + 0.5) / 6 - 0.5
    there = truth(BIG_BOARD, pose, found.indices)
    # eleven pixels are two of the picture that was enlarged: a fifth of the edges as before
    assert min(np.abs(seen - there).max(), np.abs(seen[::-1] - there).max()) < 0.2
    assert found.fitted_window_px == 11


@pytest.mark.parametrize(
    ("target", "said"),
    [
        (BOARD, "the checkerboard of 9 x 6 inner corners was not found"),
        (SQUARES, f"the {SQUARES.name} was not found, but a {BIG_BOARD.name}: count these, not the squares"),
        (CHARUCO, "the ChArUco board of 7 x 5 squares was not found"),
    ],
)
def test_no_board_is_an_answer(target, said, picture):
    drawn, _ = picture
    found = extract(make_frame(drawn, bits=8), target=target)
    assert found.features.not_found == said
    assert found.features.indices == ()
    assert found.statistics


@pytest.mark.parametrize("shape", [(16, 16), (20, 300), (100, 120)])
@pytest.mark.parametrize("target", [BOARD, CHARUCO])
def test_nothing_to_see(shape, target):
    for picture in (np.full(shape, 7.0), np.random.default_rng(1).uniform(0, 4095, shape)):
        found = extract(make_frame(picture, bits=12), target=target, bits=12)
        assert found.features.not_found


def test_windows_keep_clear_of_neighbours(opencv_rows):
    left02 = opencv_rows[1].features
    assert left02.spacing_px == pytest.approx(21.8, abs=0.1)
    assert left02.fitted_window_px == 6
    assert [row.features.fitted_window_px for row in opencv_rows].count(11) == 1


def test_corners_in_a_blurred_board_do_not_follow_its_markers():
    """2 px are clear of markers: so small a window finds no slope in a blurred picture, 3 px do."""
    board = replace(CHARUCO, marker_size_mm=24.0)
    drawn, pose = render(board, 4)
    blurred = cv2.GaussianBlur(drawn, (0, 0), 1.2)
    found = extract(make_frame(blurred, bits=8), target=board).features
    assert found.fitted_window_px == 3
    off = np.array(found.fitted_px) - truth(board, pose, found.indices)
    assert np.sqrt((off**2).sum(axis=1).mean()) < 0.15
