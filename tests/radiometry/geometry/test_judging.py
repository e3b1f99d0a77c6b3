"""What the field team is told, and what would make the fit good."""

import dataclasses

import numpy as np
import pytest

from radiometry.geometry.camera import Pose
from radiometry.geometry.results import Params
from radiometry.geometry.verdicts import judge_frames, plan_views
from tests.radiometry.evidence import taken
from tests.radiometry.geometry.boards import BOARD, FREE, SQUARE, simulate, simulate_rows, with_features


def judge(rows, **changes):
    verdicts = judge_frames([taken(row, **{"region": None} | changes) for row in rows], rows)
    return {frame: (each.outcome, [r.code for r in each.reasons]) for frame, each in verdicts.items()}


def test_good_pictures_pass_without_a_region(simulated):
    assert set(map(repr, judge(simulated).values())) == {"('pass', [])"}


@pytest.mark.parametrize(
    ("changes", "outcome", "code"),
    [
        ({"not_found": "the checkerboard was not found"}, "fail", "board_not_found"),
        ({"edge_rise_px": 6.5}, "warn", "board_blurred"),
        ({"board_share": 0.04}, "warn", "board_small"),
    ],
)
def test_what_is_wrong_with_a_picture(changes, outcome, code, simulated):
    rows = [with_features(simulated[0], **changes), *simulated[1:]]
    told = judge(rows)
    assert told[rows[0].frame] == (outcome, [code])
    assert told[rows[1].frame] == ("pass", [])


def test_an_unread_picture_is_pending(simulated):
    row = dataclasses.replace(simulated[0], features=None)
    assert judge([row], state="received", format=None)[row.frame] == ("pending", ["not_read"])
    assert judge([row], state="read")[row.frame] == ("pending", ["not_extracted"])


def test_a_good_set_needs_nothing():
    rows = simulate(seed=13, count=40, noise_px=0.1, camera=SQUARE, tilt_deg=45.0)
    assert plan_views(rows, Params()) == ()
    assert plan_views([], Params()) == ()


def test_advice_names_the_parts_of_the_frame(simulated):
    left = [row for row in simulated if max(col for _, col in row.features.fixed_px) < 480][:4]
    (coverage,) = [each for each in plan_views(left, FREE) if "parts of the frame" in each]
    assert "top right" in coverage
    assert "middle left" not in coverage
    assert f"{len(left)} usable views: add {10 - len(left)} more" in plan_views(left, FREE)


def test_advice_for_flat_and_for_bad_views(simulated):
    flat = [Pose(np.zeros(3), np.array([x, -60.0, 400.0])) for x in (-150.0, -100.0, -50.0)]
    rows = simulate_rows(SQUARE, BOARD, flat, np.random.default_rng(1), noise_px=0.0)
    assert "tilt the board by 20 to 45 degrees, to the left, to the right, up and down" in plan_views(
        rows, FREE
    )
    moved = tuple(
        (row + (number % 2) * 1.5, col) for number, (row, col) in enumerate(simulated[2].features.fixed_px)
    )
    rows = [*simulated[:2], with_features(simulated[2], fixed_px=moved), *simulated[3:]]
    assert any(
        each.startswith("take frame view-002 again, or leave it out: It fits to")
        for each in plan_views(rows, FREE)
    )
