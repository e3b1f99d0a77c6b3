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


def alone(cameras):
    """One camera at the tolerance, the others far from it: all hangs on that one."""
    return [1.0] + [-1.0 / (cameras - 1)] * (cameras - 1)


def opposed(cameras):
    """As many cameras as can be lie at the tolerance."""
    return [float((-1) ** index) for index in range(cameras - cameras % 2)] + [0.0] * (cameras % 2)


@pytest.mark.parametrize(
    ("place", "wrong", "repeats", "repeatability"),
    [
        *((alone, "shared", each, REPEATABILITY / 3) for each in ([2, 2, 2], [3] * 6)),
        *((opposed, "per_camera", each, REPEATABILITY) for each in ([12, 2, 3, 3], [3, 2])),
    ],
)
def test_the_wrong_verdict_is_rare_where_that_is_hardest(place, wrong, repeats, repeatability):
    truths = K * (1 + TOLERANCE * np.array(place(len(repeats))))

    def draw(rng):
        return draw_fleet(rng, truths=truths, repeats=repeats, repeatability=repeatability)

    assert count_outcomes(np.random.default_rng(7), draw)[wrong] <= AT_MOST
