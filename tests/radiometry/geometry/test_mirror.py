"""A picture that a viewer has mirrored or turned is found by the principal point alone."""

import dataclasses

import numpy as np
import pytest

from radiometry.geometry import method as geometry
from radiometry.geometry.mirror import TURNS
from simulation.boards import View, draw_poses, set_up
from tests.radiometry.geometry.boards import (
    CHARUCO,
    SQUARE,
    errors,
    extract,
    make_frame,
    raised,
    simulate,
    values,
    with_features,
)

PARAMS = geometry.Params()


def turn(row, words):
    """The corners as they lie in the turned picture."""
    size = np.array([row.features.height_px - 1, row.features.width_px - 1])
    seen = np.array(row.features.fixed_px)
    turned = tuple(map(tuple, np.where(TURNS[words], size - seen, seen).tolist()))
    return with_features(row, fixed_px=turned, fitted_px=turned)


@pytest.mark.parametrize("words", TURNS)
def test_one_turned_view_of_six_is_left_out_with_the_reason(words):
    rows = list(simulate(seed=21, count=6, noise_px=0.1, camera=SQUARE))
    others = geometry.fit(rows[:2] + rows[3:], PARAMS)
    rows[2] = turn(rows[2], words)
    fit = geometry.fit(rows, PARAMS)
    left_out = {each.frame: each.left_out for each in fit.points if not each.used}
    assert left_out == {"view-002": f"it is {words} against the other pictures"}
    told = {each.where: each.detail for each in fit.flags if each.flag == "view_mirrored"}
    assert told == {"frame view-002": f"It was left out: it is {words} against the other pictures."}
    assert values(fit) == values(others)
    # with the view the principal point would be off by many times its uncertainty
    assert abs(values(fit)["cx_px"] - SQUARE.cx_px) < 4 * errors(fit)["cx_px"]


def test_opencv_s_own_pictures_with_one_mirrored(opencv_rows):
    rows = list(opencv_rows)
    assert "view_mirrored" not in raised(geometry.fit(rows, PARAMS))
    rows[4] = turn(rows[4], "mirrored left to right")
    fit = geometry.fit(rows, PARAMS)
    assert [each.frame for each in fit.points if not each.used] == [rows[4].frame]


def test_a_centred_principal_point_makes_no_view_look_turned():
    centred = dataclasses.replace(SQUARE, cx_px=319.5, cy_px=239.5, p1=0.0, p2=0.0)
    for seed in range(6):
        rows = simulate(seed=seed, count=6, noise_px=0.1, camera=centred)
        assert "view_mirrored" not in raised(geometry.fit(rows, PARAMS))


def test_a_mirrored_charuco_board_says_so():
    random = np.random.default_rng(4)
    (pose,) = draw_poses(SQUARE, CHARUCO, random, count=1)
    studio = set_up(SQUARE, dark_dn=20.0, bright_dn=220.0, noise_dn=1.0)
    drawn = studio.photograph(View(board=CHARUCO, pose=pose), random).samples_dn.astype(float)
    found = extract(make_frame(drawn[:, ::-1], bits=8), target=CHARUCO).features
    assert found.not_found.startswith("the picture is mirrored: ")
