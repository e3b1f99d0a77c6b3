"""The error of the dark level: by hand, through the fit, and against flats whose dark level is wrong."""

import dataclasses
import math

import numpy as np
import pytest

from radiometry.vignetting import fit as vignetting
from radiometry.vignetting.blocks import Grid
from radiometry.vignetting.channels import fit_channel
from radiometry.vignetting.falloff import DarkError
from radiometry.vignetting.light import estimate_dark_drift, estimate_dark_error, merge_dark_errors
from simulation.camera import change
from tests.radiometry.vignetting.flats import NONE, SMALL, dark, exact_blocks, flat

K, CENTRE = (-0.4, 0.1, -0.05), (88.0, 155.0)
GRID = Grid.over(192, 288)


def test_the_error_of_a_mean_of_dark_frames():
    """Means 256, 258, 260: s^2 = 4, of which pixel noise makes 0.1."""
    found = estimate_dark_error([256.0, 258.0, 260.0], [0.1, 0.1, 0.1], span_dn=3839.0)
    assert found.own == pytest.approx(math.sqrt(3.9))
    assert found.shared == pytest.approx(math.sqrt(4.0 / 3.0))


def test_what_one_dark_frame_cannot_show_and_what_a_file_only_states():
    one = estimate_dark_error([256.0], [0.01], span_dn=4000.0)
    assert (one.own, one.shared) == pytest.approx((0.4, math.hypot(0.4, 0.1)))
    assert estimate_dark_error([], [], span_dn=4096.0) == DarkError(shared=1.0, own=0.0)
    alike = estimate_dark_error([256.0, 256.0], [0.5, 0.5], span_dn=4000.0)
    assert (alike.own, alike.shared) == pytest.approx((0.0, 0.5))


def test_what_flats_share_adds_up_and_what_is_their_own_averages():
    errors = [DarkError(shared=0.01, own=0.03), DarkError(shared=0.02, own=0.04)]
    found = merge_dark_errors(errors, [0.5, 0.5])
    assert found.shared == pytest.approx(0.015)
    assert found.own == pytest.approx(0.025)


def offset(blocks, by):
    return dataclasses.replace(blocks, light=blocks.light + by)


def test_a_wrong_dark_level_shrinks_the_curve_and_leaves_the_centre():
    blocks = exact_blocks(GRID, K, CENTRE, error=1e-4)
    found = fit_channel([offset(blocks, 0.02)], f_number=2.0, channel="G1").fit.coefficient
    assert found.k == pytest.approx([k / 1.02 for k in K], rel=1e-5)
    assert found.centre_px == pytest.approx(CENTRE, abs=1e-4)


def test_the_uncertainty_covers_wrong_dark_levels():
    """Noise alone leaves a twentieth of the error."""
    random, u_dark, noise = np.random.default_rng(5), 0.02, 1e-3
    blocks = exact_blocks(GRID, K, CENTRE, error=noise)
    truth = fit_channel([blocks], f_number=2.0, channel="G1").fit.coefficient
    blocks = dataclasses.replace(blocks, dark=DarkError(shared=u_dark))
    pulls = []
    for _ in range(40):
        wrong = noise * random.standard_normal(blocks.light.shape) + u_dark * random.standard_normal()
        found = fit_channel([offset(blocks, wrong)], f_number=2.0, channel="G1").fit
        u = found.coefficient.corner_falloff_standard_uncertainty
        assert u > 5 * truth.corner_falloff_standard_uncertainty
        pulls.append((found.coefficient.corner_falloff - truth.corner_falloff) / u)
    assert abs(np.mean(pulls)) < 3.5 / math.sqrt(40)
    assert abs(np.std(pulls) - 1.0) < 3.5 / math.sqrt(80)


def test_dark_frames_that_wander_are_in_the_uncertainty_of_every_channel():
    """Darks at 250, 256 and 262 DN: s = 6; of their mean 6 / sqrt 3, of the flat's own 6."""
    bright = flat(SMALL, 1, 2.0)
    levels = (250.0, 256.0, 262.0)
    lenses = [change(SMALL, black_level_dn=level) for level in levels]
    wandering = [dark(lens, 10 + n, name=f"dark-{n}") for n, lens in enumerate(lenses)]
    steady = [dark(SMALL, 10 + n, name=f"dark-{n}") for n in range(3)]
    restless, calm = (vignetting.fit([bright, *each], NONE).channel_fits for each in (wandering, steady))
    assert len(restless) == 4
    for one, other in zip(restless, calm, strict=True):
        light_dn = 0.7 * 3839.0 * SMALL.sensor.colours[one.coefficient.channel[0]]
        assert one.dark_u_rel == pytest.approx(math.hypot(6.0, 6.0 / math.sqrt(3.0)) / light_dn, rel=0.03)
        assert other.dark_u_rel < 0.05 * one.dark_u_rel
        added = np.array(one.coefficient.covariance) - np.array(other.coefficient.covariance)
        k = np.array(one.coefficient.k)
        expected = one.dark_u_rel**2 * np.outer(k, k)
        scale = np.sqrt(np.diag(np.array(other.coefficient.covariance)))[:3]
        assert np.abs((added[:3, :3] - expected) / np.outer(scale, scale)).max() < 0.02


def test_the_drift_between_two_times_by_hand():
    """256 at 0.1 s and 260 DN at 0.3 s: 20 DN/s; wander 0.4 DN, so u_b = 0.4 / sqrt(0.02) DN/s."""
    two = ([0.1, 0.3], [256.0, 260.0], [1e-6, 1e-6])
    found = estimate_dark_drift(*two, apart_s=0.5, span_dn=4000.0)
    assert found == pytest.approx(0.5 * math.hypot(20.0, 0.4 / math.sqrt(0.02)))
    assert estimate_dark_drift(*two, apart_s=-0.5, span_dn=4000.0) == found
    assert estimate_dark_drift(*two, apart_s=0.0, span_dn=4000.0) == 0.0
    assert estimate_dark_drift([0.1, 0.1], [256.0, 260.0], [1.0, 1.0], apart_s=0.5, span_dn=4000.0) == 0.0
    assert estimate_dark_drift([], [], [], apart_s=0.5, span_dn=4000.0) == 0.0
    # about the line through (0.1, 256), (0.2, 259), (0.3, 260) lie -1/3, 2/3 and -1/3: s^2 = 2/3
    three = estimate_dark_drift(
        [0.1, 0.2, 0.3], [256.0, 259.0, 260.0], [0.1] * 3, apart_s=0.5, span_dn=4000.0
    )
    assert three == pytest.approx(0.5 * math.hypot(20.0, math.sqrt(2.0 / 3.0 / 0.02)))


def warm(time_s, *, per_s=200.0, seed=1):
    """A dark frame of a sensor whose level grows by so many DN a second."""
    lens = change(SMALL, black_level_dn=256.0 + per_s * time_s)
    return dark(lens, seed, name=f"dark-{time_s}-{seed}", time_s=time_s)


def test_dark_current_between_the_times_at_hand_is_in_the_uncertainty():
    """The flat of 0.01 s has darks of 0.1 s, 18 DN too high, and of 0.4 s."""
    bright = flat(SMALL, 1, 2.0)
    right = [warm(0.01, seed=seed) for seed in (1, 2)]
    long = [warm(0.1, seed=seed) for seed in (1, 2)]
    longer = [warm(0.4, seed=seed) for seed in (1, 2)]
    blind, known = (vignetting.fit([bright, *darks], NONE) for darks in (long, long + longer))
    assert "not in the uncertainty" in blind.flags[0].detail
    assert known.flags[0].detail.endswith("is in the uncertainty, from the times that there are.")
    for before, after in zip(blind.channel_fits, known.channel_fits, strict=True):
        assert after.coefficient.k == before.coefficient.k
        light_dn = 0.7 * 3839.0 * SMALL.sensor.colours[after.coefficient.channel[0]]
        assert after.dark_u_rel == pytest.approx(18.0 / light_dn, rel=0.03)
        assert before.dark_u_rel < 0.1 * after.dark_u_rel
    assert not vignetting.fit([bright, *right, *longer], NONE).flags


def test_dark_frames_of_the_flat_s_own_time_leave_no_drift():
    bright = flat(SMALL, 1, 2.0)
    own = [dark(SMALL, seed, name=f"own-{seed}", time_s=bright.exposure.exposure_time_s) for seed in (1, 2)]
    alone, beside = (vignetting.fit([bright, *darks], NONE) for darks in (own, [*own, warm(5.0)]))
    assert alone.channel_fits == beside.channel_fits
