"""Figures of many roads with 8 control points, b1 up to 0.3 and patches of 5 and 10 %, against their truth.

ROADS=400 pytest tests/radiometry/road/test_bars.py -s
"""

import os
import sys

import numpy as np
import pytest
from scipy.stats import binom

from tests.radiometry.road.simulated import measure_road

ROADS = int(os.environ.get("ROADS", "15"))


@pytest.fixture(scope="module")
def measured():
    found = np.array([measure_road(seed) for seed in range(1000, 1000 + ROADS)])
    for name, (errors, _, held, accepted) in zip(("E_av", "U_0"), found.transpose(1, 2, 0), strict=True):
        rms, bias = 100 * np.sqrt(np.mean(errors**2)), 100 * errors.mean()
        sys.stdout.write(f"\n{name} of {ROADS} roads: rms {rms:.2f} %, bias {bias:+.2f} %, ")
        sys.stdout.write(
            f"held {100 * held.mean():.1f} %, accepted at the limit {100 * accepted.mean():.1f} %"
        )
    return found


@pytest.mark.parametrize(("at", "rms", "bias"), [(0, 0.025, 0.01), (1, 0.025, 0.01)], ids=["e_av", "u_0"])
def test_errors_are_within_the_bars(measured, at, rms, bias):
    """Of 15 roads, three standard errors beyond: 1 / sqrt(2 n) of the rms, and 1 / sqrt(n) of it."""
    errors = measured[:, at, 0]
    assert np.sqrt(np.mean(errors**2)) < rms * (1.0 + 3.0 / np.sqrt(2 * ROADS))
    assert abs(errors.mean()) < bias + 3.0 * rms / np.sqrt(ROADS)


@pytest.mark.parametrize("at", [0, 1], ids=["e_av", "u_0"])
def test_intervals_hold_the_truth_and_limits_are_guarded(measured, at):
    """93 to 97 % and at most 5 %, beyond which chance alone lies once in 200."""
    held, accepted = measured[:, at, 2:].sum(axis=0)
    assert binom.ppf(0.005, ROADS, 0.93) <= held
    assert accepted <= binom.ppf(0.995, ROADS, 0.05)
