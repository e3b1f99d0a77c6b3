"""Stacks: means and variances by hand, what drift and copies do, and predicted errors."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from radiometry.frame.exposure import Exposure, Settings
from radiometry.noise.stacks import make_stacks
from simulation.camera import Taken, change
from simulation.targets import COUNTING_SENSOR
from tests.radiometry.frames import frame_of
from tests.radiometry.noise.series import make_row

SENSOR = change(COUNTING_SENSOR, height_px=32, width_px=32, black_level_dn=0.0)


def row(samples, name, *, role="flat", time_s=1.0, **changes):
    picture = frame_of(samples, cfa="grey", black=0.0, white=float(SENSOR.sensor.white_level_dn))
    settings = Settings(exposure_time_s=time_s, f_number=4.0, iso=100.0)
    taken = Taken(
        name=name,
        role=role,
        header=SENSOR.describe(settings),
        exposure=Exposure(**asdict(settings)),
        frame=picture,
    )
    made = make_row(taken)
    return replace(made, **changes)


def noisy(rng, *, mean=1000.0, std=20.0, pattern=0.0, shape=(32, 32)):
    return np.rint(mean + pattern + std * rng.standard_normal(shape))


def test_the_variance_of_a_pair_is_half_that_of_its_difference():
    rng = np.random.default_rng(1)
    a, b = noisy(rng), noisy(rng)
    (stack,) = make_stacks([row(a, "a"), row(b, "b")])
    assert stack.temporal.value_dn2 == pytest.approx(np.var(a - b, ddof=1) / 2)
    assert stack.temporal.u_dn2 == pytest.approx(stack.temporal.value_dn2 * np.sqrt(2 / 1023), rel=0.03)
    assert stack.mean_dn == pytest.approx((a.mean() + b.mean()) / 2)


def test_light_that_changes_between_frames_makes_no_noise():
    rng = np.random.default_rng(2)
    frames = [noisy(rng), noisy(rng), noisy(rng)]
    steady = make_stacks([row(f, str(n)) for n, f in enumerate(frames)])[0]
    moved = make_stacks([row(f + 50 * n, str(n)) for n, f in enumerate(frames)])[0]
    assert moved.temporal.value_dn2 == pytest.approx(steady.temporal.value_dn2)
    assert moved.drift_rel == pytest.approx(100 / moved.mean_dn, rel=0.02)
    assert steady.drift_rel < 0.003


def test_a_pattern_is_no_temporal_noise_and_the_other_way_round():
    rng = np.random.default_rng(3)
    pattern = 15.0 * rng.standard_normal((32, 32))
    frames = [noisy(rng, pattern=pattern) for _ in range(6)]
    (stack,) = make_stacks([row(f, str(n)) for n, f in enumerate(frames)])
    assert stack.temporal.value_dn2 == pytest.approx(400 + 1 / 12, abs=3 * stack.temporal.u_dn2)
    assert stack.pattern.value_dn2 == pytest.approx(np.var(pattern, ddof=1), abs=3 * stack.pattern.u_dn2)


def test_a_slope_and_a_bowl_are_no_pattern_once_detrended():
    rng = np.random.default_rng(4)
    r, c = np.meshgrid(np.linspace(-1, 1, 32), np.linspace(-1, 1, 32), indexing="ij")
    slow = 80 * r - 40 * c - 60 * (r**2 + c**2) + 30 * r * c
    (stack,) = make_stacks([row(noisy(rng, pattern=slow), str(n)) for n in range(4)])
    assert abs(stack.detrended.value_dn2) < 3 * stack.detrended.u_dn2
    # of rows and columns, of which there are 32
    assert stack.pattern.value_dn2 > 4 * stack.pattern.u_dn2


@pytest.mark.parametrize("kind", ["columns", "hot", "rows"])
def test_the_variance_of_a_pattern_scatters_as_it_says(kind):
    """Columns of 20 beside pixels of 20, one bright pixel in 50, or rows that change from frame to frame."""
    errors, claimed = [], []
    for seed in range(25):
        rng = np.random.default_rng(600 + seed)
        pattern, truth = 20.0 * rng.standard_normal((32, 32)), 400.0
        if kind == "columns":
            pattern, truth = pattern + 20.0 * rng.standard_normal((1, 32)), 800.0
        if kind == "hot":
            pattern, truth = pattern + 100.0 * (rng.random((32, 32)) < 0.02), 400.0 + 1e4 * 0.02 * 0.98
        swaying = [20.0 * rng.standard_normal((32, 1)) * (kind == "rows") for _ in range(4)]
        frames = [row(noisy(rng, pattern=pattern + each), str(n)) for n, each in enumerate(swaying)]
        found = make_stacks(frames)[0].pattern
        errors.append(found.value_dn2 - truth)
        claimed.append(found.u_dn2)
    assert np.linalg.norm(errors) / np.linalg.norm(claimed) == pytest.approx(1.0, abs=3.5 / np.sqrt(50))


def test_frames_of_one_setting_share_a_stack_and_no_others():
    rng = np.random.default_rng(6)

    def exposure(**changes):
        return replace(Exposure(exposure_time_s=1.0, f_number=4.0, iso=100.0), **changes)

    def make(name, role, scene=None, **changes):
        return row(noisy(rng), name, role=role, scene=scene, exposure=exposure(**changes))

    rows = [
        make("1", "flat"),
        make("2", "flat"),
        make("3", "light"),
        make("4", "flat", scene="a"),
        make("5", "flat", f_number=8.0),
        make("6", "flat", iso=200.0),
        make("7", "flat", exposure_time_s=2.0),
        make("8", "dark"),
        make("9", "dark", f_number=8.0, scene="cap"),
    ]
    found = sorted(stack.frames for stack in make_stacks(reversed(rows)))
    assert found == [("1", "2"), ("3",), ("4",), ("5",), ("6",), ("7",), ("8", "9")]


def test_a_copy_shows_no_noise_and_is_named():
    rng = np.random.default_rng(7)
    a, b = noisy(rng), noisy(rng)
    (stack,) = make_stacks([row(a, "a"), row(a, "copy"), row(b, "z")])
    assert stack.frames == ("a", "z")
    assert stack.copies == {"copy": "a"}


def test_white_frames_are_equal_and_no_copies():
    white = np.full((32, 32), SENSOR.sensor.white_level_dn)
    (stack,) = make_stacks([row(white, "a"), row(white, "b")])
    assert (stack.frames, stack.copies, stack.clipped) == (("a", "b"), {}, True)


def test_the_step_between_numbers_is_seen():
    rng = np.random.default_rng(8)
    assert make_stacks([row(noisy(rng), "a")])[0].step_dn == 1.0
    coarse = 16 * np.rint(noisy(rng, mean=8000.0, std=200.0) / 16)
    assert make_stacks([row(coarse, "a")])[0].step_dn == 16.0
