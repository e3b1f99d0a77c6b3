"""What is not photon transfer: linearity, dark current, and what differs from pixel to pixel."""

import dataclasses

import numpy as np
import pytest

from radiometry.findings import shared
from radiometry.frame.packing import pack, unpack
from radiometry.noise import codes as noise_codes
from radiometry.noise import fit as noise
from radiometry.noise.fit import collect_stacks
from radiometry.noise.transfer import list_levels
from simulation.camera import change
from tests.radiometry.noise.series import (
    LIGHT,
    PARAMS,
    SMALL,
    TIMES,
    agrees,
    brightened,
    flags_of,
    only,
    repack,
    take,
)


def bent_error(times, share):
    """The linearity error of a noiseless sensor that loses ``share`` at white, by a plain weighted fit."""
    signal = LIGHT * 0.5 * np.array(times)
    signal = signal * (1 - share * signal / (16383 - 256))
    inside = (signal > 0.05 * 16127) & (signal < 0.95 * 16127)
    t, y = np.array(times)[inside], signal[inside]
    a1, a0 = np.polyfit(t, y, 1, w=1 / y)
    return np.mean(np.abs(y / (a0 + a1 * t) - 1))


@pytest.mark.parametrize("share", [0.02, 0.1])
def test_a_bent_sensor_has_the_linearity_error_of_its_bend(share):
    sensor = change(SMALL, height_px=96, width_px=96, bend_rel=share)
    times = (0.07, 0.15, 0.25, 0.4, 0.55, 0.7, 0.85, 1.0)
    linearity = only(noise.fit(take(sensor, 9, times=times), PARAMS)).linearity
    agrees(linearity.error_rel, bent_error(times, share), errors=4.0)
    assert linearity.error_rel.value > 20 * linearity.error_rel.standard_uncertainty
    assert linearity.levels_used == 8


def test_dark_frames_of_another_time_serve_through_their_line():
    sensor = change(SMALL, height_px=96, width_px=96, dark_current_e_s=200.0)
    fit = noise.fit(take(sensor, 15, times=(*TIMES, 0.9), dark_times=(0.01, 0.5, 2.0)), PARAMS)
    assert shared.DARK_EXPOSURE_DIFFERS not in flags_of(fit)
    linearity = only(fit).linearity
    assert linearity.error_rel.value < 6 * linearity.error_rel.standard_uncertainty
    far = noise.fit(take(sensor, 16, times=(*TIMES, 0.9), dark_times=(0.01,)), PARAMS)
    assert shared.DARK_EXPOSURE_DIFFERS in flags_of(far)


def test_what_dark_current_adds_beyond_the_dark_times_is_in_the_uncertainty():
    """200 e- a second at 0.5 DN/e-: from darks of 0.01 and 0.11 s to 0.9 s it is 79 DN."""
    sensor = change(SMALL, dark_current_e_s=200.0)

    def read(dark_times):
        rows = take(sensor, 15, times=(*TIMES, 0.9), dark_times=dark_times)
        ((_, stacks),) = collect_stacks(rows, PARAMS).items()
        return {level.lit.setting.exposure_time_s: level.light_u_dn for level in list_levels(stacks, PARAMS)}

    near, far, blind = read((0.01, 1.0)), read((0.01, 0.11)), read((0.01,))
    assert far[0.9] == pytest.approx(79.0, rel=0.2)
    assert max(near[0.9], blind[0.9]) < 2.0
    assert far[0.1] == pytest.approx(near[0.1], rel=0.2)


def test_a_compensated_dark_current_is_seen_in_the_noise():
    sensor = change(SMALL, height_px=64, width_px=64, dark_current_e_s=50.0, compensates_dark=True)
    fit = noise.fit(take(sensor, 10, dark_times=(0.02, 1.0, 2.0, 4.0)), PARAMS)
    current = only(fit).dark_current
    agrees(current.from_variance_e_per_s, 50.0)
    agrees(current.dark_current_e_per_s, 0.0)
    assert noise_codes.DARK_CURRENT_COMPENSATED in flags_of(fit)


def test_a_dark_signal_cut_at_zero_is_flagged():
    sensor = change(SMALL, black_level_dn=2.0)
    assert noise_codes.DARK_CLIPPED in flags_of(noise.fit(take(sensor, 11), PARAMS))


def test_the_pattern_of_the_dark_is_no_part_of_the_prnu():
    sensor = change(SMALL, height_px=64, width_px=64, dsnu_e=80.0, prnu_rel=0.005)
    channel = only(noise.fit(take(sensor, 24, frames=4), PARAMS))
    agrees(channel.prnu_rel, 0.005)
    agrees(channel.transfer.dsnu_e, 80.0)
    assert channel.prnu_rel.standard_uncertainty < 0.0005


def test_a_pattern_below_the_noise_is_not_resolved():
    fit = noise.fit(take(SMALL, 12), PARAMS)
    assert noise_codes.PATTERN_NOT_RESOLVED in flags_of(fit)
    assert only(fit).dsnu_dn.standard_uncertainty > 0.0


def test_a_chart_among_the_lit_frames_of_a_noise_campaign_is_off_the_line():
    rows = take(SMALL, 3)
    time_s = sorted({row.exposure.exposure_time_s for row in rows if row.role != "dark"})[3]
    wrong = brightened(rows, 3000, lambda row: row.role != "dark" and row.exposure.exposure_time_s == time_s)
    assert noise_codes.LINEARITY_ERROR_LARGE not in flags_of(noise.fit(rows, PARAMS))
    assert noise_codes.LINEARITY_ERROR_LARGE in flags_of(noise.fit(wrong, PARAMS))


def test_a_target_in_all_lit_frames_of_a_noise_campaign_is_no_prnu():
    def draw(samples, block):
        chart = np.where(np.indices(samples.shape).sum(axis=0) // 4 % 2, 1.0, 0.7)
        drawn = np.rint((unpack(block.samples_dn) - 256) * chart + 256)
        return dataclasses.replace(block, samples_dn=pack(drawn, dtype="<u2"))

    rows = take(SMALL, 3)
    shown = [row if row.role == "dark" else repack(row, draw) for row in rows]
    assert noise_codes.PRNU_LARGE not in flags_of(noise.fit(rows, PARAMS))
    assert noise_codes.PRNU_LARGE in flags_of(noise.fit(shown, PARAMS))
