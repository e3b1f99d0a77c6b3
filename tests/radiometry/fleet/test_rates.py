"""Simulated fleets: the verdict is right in 95 % of 200 or more; where that is hardest, wrong in 5 % at most.

Which truths count, with a repeatability of a quarter of the tolerance:
  shared      3 to 7 cameras of 4 to 8 repeats; every one lies within a quarter of the tolerance of their mean
  per_camera  as many; some camera lies off it by 2.5 times the tolerance or more
  cannot_tell nobody can know: fewer than 3 degrees of freedom, wherever the cameras lie
Between the first two cannot_tell is a right answer, too. What may not be more often than alpha is shared of a
fleet beyond the tolerance, or per_camera of one within it: tested where it is hardest, just at the tolerance.
"""

from collections import Counter

import numpy as np
import pytest

from radiometry.fleet.verdict import judge_fleet
from tests.radiometry.fleet.fleets import draw_fleet

FLEETS = 200
TOLERANCE = 0.04
K = 33.0
REPEATABILITY = TOLERANCE / 4 * K
# 5 % of 200, and three standard deviations of that count: 10 + 3 sqrt(200 0.05 0.95)
AT_MOST = 19


def count_outcomes(rng, draw):
    outcomes = Counter()
    for _ in range(FLEETS):
        rows = draw(rng)
        cameras = sorted({row.source.camera for row in rows})
        verdict = judge_fleet(rows, method="luminance", cameras=cameras, tolerance=TOLERANCE)
        assert verdict.outcome == verdict.parameters[0].outcome
        outcomes[verdict.outcome] += 1
    return outcomes


def sizes(rng):
    cameras = int(rng.integers(3, 8))
    return cameras, [int(number) for number in rng.integers(4, 9, cameras)]


def shift(rng, cameras, largest):
    """Shares by which the cameras lie off their mean, the largest as said."""
    off = rng.standard_normal(cameras)
    off -= off.mean()
    return off * largest / np.abs(off).max()


def draw_shared(rng):
    cameras, repeats = sizes(rng)
    off = shift(rng, cameras, TOLERANCE / 4 * rng.uniform())
    return draw_fleet(rng, truths=K * (1 + off), repeats=repeats, repeatability=REPEATABILITY)


def draw_different(rng):
    cameras, repeats = sizes(rng)
    off = shift(rng, cameras, TOLERANCE * rng.uniform(2.5, 10))
    return draw_fleet(rng, truths=K * (1 + off), repeats=repeats, repeatability=REPEATABILITY)


def draw_too_few(rng):
    cameras = int(rng.integers(2, 8))
    again = [2] * int(rng.integers(0, 3)) + [1] * cameras
    off = shift(rng, cameras, TOLERANCE * rng.uniform(0, 10))
    return draw_fleet(rng, truths=K * (1 + off), repeats=again[:cameras], repeatability=REPEATABILITY)


@pytest.mark.parametrize(
    ("draw", "right"),
    [(draw_shared, "shared"), (draw_different, "per_camera"), (draw_too_few, "cannot_tell")],
)
def test_the_verdict_is_right_in_95_of_100_fleets(draw, right):
    outcomes = count_outcomes(np.random.default_rng(20260501), draw)
    assert outcomes[right] >= 0.95 * FLEETS, outcomes


@pytest.mark.parametrize("repeats", [[2, 2, 2], [12, 2, 3, 3], [3] * 6])
def test_shared_is_hardly_said_of_a_fleet_whose_camera_lies_at_the_tolerance(repeats):
    """The hardest truth: one camera there, the others far from it, so that all hangs on that one."""
    others = len(repeats) - 1
    off = np.array([TOLERANCE] + [-TOLERANCE / others] * others)

    def draw(rng):
        return draw_fleet(rng, truths=K * (1 + off), repeats=repeats, repeatability=REPEATABILITY / 3)

    assert count_outcomes(np.random.default_rng(7), draw)["shared"] <= AT_MOST


@pytest.mark.parametrize("repeats", [[2, 2, 2], [12, 2, 3, 3], [3, 2]])
def test_per_camera_is_hardly_said_of_a_fleet_within_the_tolerance(repeats):
    """The hardest truth: as many cameras as can be lie at the tolerance."""
    off = TOLERANCE * np.array([(-1) ** index for index in range(len(repeats))], dtype=float)
    if len(repeats) % 2:
        off[-1] = 0.0

    def draw(rng):
        return draw_fleet(rng, truths=K * (1 + off), repeats=repeats, repeatability=REPEATABILITY)

    assert count_outcomes(np.random.default_rng(8), draw)["per_camera"] <= AT_MOST
