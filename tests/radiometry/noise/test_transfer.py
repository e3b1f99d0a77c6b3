"""Photon transfer: gain, read noise and saturation, and how well they are known."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtri

from radiometry.findings import InputRejected, shared
from radiometry.frame.packing import pack, unpack
from radiometry.noise import codes as noise_codes
from radiometry.noise import fit as noise
from radiometry.noise import stacks as noise_stacks
from radiometry.noise.fit import collect_stacks, list_coefficients
from radiometry.noise.stacks import count_changes, estimate_rounded_noise, make_stacks
from radiometry.noise.transfer import find_saturation, fit_gain, list_levels
from simulation.camera import change
from simulation.targets import find_variance_maximum
from tests.radiometry.noise.series import (
    LIGHT,
    PARAMS,
    SMALL,
    TIMES,
    agrees,
    brightened,
    flags_of,
    make_row,
    only,
    repack,
    shoot,
    take,
)


def test_figures_scatter_as_they_say():
    """Twenty-five sensors of known gain: no tolerance but the predicted one."""
    pulls, full_well_e = [], find_variance_maximum(SMALL)
    for seed in range(25):
        transfer = only(noise.fit(take(SMALL, seed, times=TIMES[1:]), PARAMS)).transfer
        gain, read = transfer.system_gain_dn_per_e, transfer.read_noise_e
        threshold, full = transfer.sensitivity_threshold_e, transfer.full_well_e
        truths = ((gain, 0.5), (read, 6.0), (threshold, math.sqrt(36.0 + 1 / 3) + 0.5), (full, full_well_e))
        pulls.append([(found.value - true) / found.standard_uncertainty for found, true in truths])
    pulls = np.array(pulls)
    assert np.abs(pulls.mean(axis=0)).max() < 3.5 / math.sqrt(25)
    # Birge's ratio enlarges u(K) by a tenth on the average, and never makes it smaller
    assert np.all(pulls.std(axis=0) < 1.0 + 3.5 / math.sqrt(50))
    assert np.all(pulls.std(axis=0)[:3] > 0.9 - 3.5 / math.sqrt(50))


def test_a_dark_stack_moves_the_gain_as_its_covariance_says():
    sensor = change(SMALL, read_noise_e=20.0)
    stacks = make_stacks(take(sensor, 25, times=(0.002, 0.005, 0.01), dark_times=(0.002, 0.01)))

    def fit(shift_dn2):
        moved = [
            replace(stack, temporal=replace(stack.temporal, value_dn2=stack.temporal.value_dn2 + shift_dn2))
            if stack.setting.role == "dark" and stack.setting.exposure_time_s == 0.002
            else stack
            for stack in stacks
        ]
        levels = list_levels(moved, PARAMS)
        saturation = find_saturation(levels, white_signal_dn=16127.0)
        return fit_gain(levels, saturation, range_share=0.7)

    transfer = fit(0.0)
    dark = transfer.levels[0].dark
    slope = (fit(0.01).gain_dn_per_e - fit(-0.01).gain_dn_per_e) / 0.02
    assert dark.setting.exposure_time_s == 0.002
    assert slope < 0.0
    # the weights follow the noise too, a little
    assert transfer.covariance_with(dark) == pytest.approx(slope * dark.temporal.u_dn2**2, rel=0.05)


def shift_left(samples, block):
    """Numbers of a sensor of fewer bits as a larger container holds them: in steps of sixteen."""
    return replace(
        block,
        samples_dn=pack(16 * samples, dtype="<u2"),
        black_level_dn=16 * block.black_level_dn,
        white_level_dn=16 * block.white_level_dn,
    )


@pytest.mark.parametrize("read_noise_e", [20.0, 3.0])
def test_numbers_in_steps_of_sixteen_are_the_same_electrons(read_noise_e):
    sensor = change(SMALL, gain_dn_per_e=0.1, read_noise_e=read_noise_e, white_level_dn=4095.0)
    rows = take(sensor, 5, times=(*TIMES, 1.5), dark_times=(0.02, 1.0))
    plain, steps = (
        {figure.name: figure for figure in list_coefficients(noise.fit(each, PARAMS))}
        for each in (rows, [repack(row, shift_left) for row in rows])
    )
    for name, figure in plain.items():
        factor = 16.0 if "dn" in name else 1.0
        assert steps[name].value == pytest.approx(factor * figure.value, rel=1e-9)
        expected = factor * figure.standard_uncertainty
        assert steps[name].standard_uncertainty == pytest.approx(expected, rel=1e-6)


def test_noise_below_rounding_is_measured_by_its_changes():
    """0.15 steps; the limit of 0.40 with an uncertainty of 0.11 would miss it."""
    quiet = change(SMALL, gain_dn_per_e=0.3, read_noise_e=0.5, dsnu_e=0.5)
    fit = noise.fit(take(quiet, 6, light=2 * LIGHT), PARAMS)
    channel = only(fit)
    assert noise_codes.READ_NOISE_BELOW_ROUNDING in flags_of(fit)
    agrees(channel.read_noise_dn, 0.15, errors=3.0)
    assert channel.read_noise_dn.standard_uncertainty < 0.04
    agrees(channel.transfer.read_noise_e, 0.5, errors=3.0)
    agrees(channel.transfer.system_gain_dn_per_e, 0.3)


@pytest.mark.parametrize(("noise_steps", "spread"), [(0.3, 0.0), (0.15, 0.9), (0.3, 0.9)])
def test_noise_below_rounding_is_within_its_interval(noise_steps, spread):
    random, inside = np.random.default_rng(4), 0
    runs = 8 if spread > 0.5 else 3
    for _ in range(runs):
        levels = 256.2 + spread * random.standard_normal((48, 48))
        images = np.round(levels + noise_steps * random.standard_normal((2, 48, 48)))
        value, u = estimate_rounded_noise(count_changes(images), u_rel=1.0, spread=spread)
        inside += abs(value - noise_steps) < 2.0 * u
        assert u < 0.05
    assert inside >= 0.7 * runs


def test_few_changes_widen_the_interval_and_ordinary_noise_is_not_counted(monkeypatch):
    """0.15 steps in the middle of a number change 7 of 4096, and at times only 2."""
    few, ends = np.diag([0, 4094, 0]), []
    few[0, 1] = few[1, 2] = 1
    for factor in (noise_stacks._FEW_CHANGES, 0.0):
        monkeypatch.setattr(noise_stacks, "_FEW_CHANGES", factor)
        noise_steps, u = estimate_rounded_noise(few, u_rel=1.0, spread=0.0)
        ends.append(noise_steps + 1.96 * u)
    assert ends[0] > 0.15 > ends[1]
    for read_noise_e in (2.0, 10.0):
        camera = change(SMALL, gain_dn_per_e=1.0, read_noise_e=read_noise_e)
        assert all(stack.changes is None for stack in make_stacks(take(camera, 3, times=())))


def test_noise_that_rows_share_is_in_the_uncertainty():
    """Rows of 8 e beside pixels of 4 e; pixels alone would state a third of the scatter."""
    banded = change(SMALL, read_noise_e=4.0, row_noise_e=8.0)
    pulls = []
    for seed in range(20):
        fit = only(noise.fit(take(banded, seed, times=(0.05, 0.2, 0.45)), PARAMS))
        pulls.append(
            (fit.transfer.read_noise_e.value - math.hypot(4.0, 8.0))
            / fit.transfer.read_noise_e.standard_uncertainty
        )
        assert fit.effective_dof["read_noise_e"] < 200
    assert abs(np.std(pulls) - 1.0) < 3.5 / math.sqrt(40)


def end_by_logarithm(light, softness_dn):
    return 10_000.0 - softness_dn * np.logaddexp(0.0, (10_000.0 - light) / softness_dn)


def end_by_parabola(light, softness_dn):
    """A form that the fit does not have: line and plateau are joined within the softness."""
    joined = 10_000.0 - (10_000.0 + softness_dn - np.minimum(light, 10_000.0 + softness_dn)) ** 2 / (
        4.0 * softness_dn
    )
    return np.where(light < 10_000.0 - softness_dn, light, joined)


@pytest.mark.parametrize(
    ("end", "softness_dn"),
    [
        *((end_by_logarithm, each) for each in (1.0, 200.0, 500.0)),
        *((end_by_parabola, each) for each in (500.0, 1500.0)),
    ],
)
def test_the_softness_of_a_full_well_lowers_its_maximum(end, softness_dn):
    """A sharp end of 10 000 DN has it at 9 785; levels are 1 500 DN apart."""
    light = np.linspace(100.0, 12_000.0, 2000)
    spread = light[:, None] + np.sqrt(0.5 * light)[:, None] * ndtri((np.arange(200) + 0.5) / 200)
    seen = end(spread, softness_dn)
    truth = float(seen.mean(axis=1)[np.argmax(seen.var(axis=1))])

    def saturate(samples, block):
        changed = np.rint(block.black_level_dn + end(samples - block.black_level_dn, softness_dn))
        return replace(block, samples_dn=pack(changed, dtype="<u2"))

    sensor = change(SMALL, gain_dn_per_e=0.5)
    rows = take(sensor, 7, times=tuple(0.1 * n for n in range(1, 11)))
    fit = noise.fit([repack(row, saturate) for row in rows], PARAMS)
    assert noise_codes.FULL_WELL_NOT_REACHED not in flags_of(fit)
    found = only(fit).transfer
    agrees(found.saturation_dn, truth, errors=2.0)
    assert found.saturation_origin == "variance_maximum"
    assert found.saturation_dn.standard_uncertainty < 400.0


def test_the_variance_of_the_worked_example_falls_before_white():
    """docs/noise.md prints it."""
    sensor = change(SMALL, gain_dn_per_e=0.5, read_noise_e=4.0, black_level_dn=256.0, white_level_dn=16383.0)
    full_well_e = find_variance_maximum(sensor)
    assert full_well_e == pytest.approx(31_700.0, abs=10.0)
    assert math.sqrt(full_well_e) == pytest.approx(178.0, abs=0.1)
    assert 20.0 * math.log10(full_well_e / (math.sqrt(4.08) / 0.5 + 0.5)) == pytest.approx(76.9, abs=0.05)


def test_a_sensor_that_nobody_saturated_says_so():
    fit = noise.fit(take(SMALL, 8, times=TIMES[:5]), PARAMS)
    assert only(fit).transfer.saturation_origin == "white_level_assumed"
    assert noise_codes.FULL_WELL_NOT_REACHED in flags_of(fit)
    assert shared.FEW_POINTS in flags_of(fit)


def test_light_that_brings_no_noise_has_no_gain():
    """Rendered and smoothed pictures: signal without shot noise."""
    rng = np.random.default_rng(19)

    def smooth(one):
        level = 1e4 * one.exposure.exposure_time_s if one.role == "flat" else 0.0
        samples = 256 + level + (2 if level else 9) * rng.standard_normal((32, 32))
        return replace(one, frame=replace(one.frame, samples_dn=samples.astype(np.uint16)))

    taken = shoot(SMALL, 19, times=(0.2, 0.3, 0.4, 0.5), dark_times=(0.1,))
    rows = [make_row(smooth(one)) for one in taken]
    with pytest.raises(InputRejected, match="noise grows with its signal") as refused:
        noise.fit(rows, PARAMS)
    assert refused.value.code is shared.FIT_FAILED


def test_an_iso_without_levels_still_has_its_dark_figures():
    rows = take(SMALL, 20) + take(change(SMALL, base_iso=800.0), 21, times=(0.1,))
    fit = noise.fit(rows, PARAMS)
    poor = fit.channel_fits[1]
    assert (poor.iso, poor.transfer) == (800.0, None)
    assert poor.read_noise_dn.value == pytest.approx(3.0, abs=4 * poor.read_noise_dn.standard_uncertainty)
    assert (noise_codes.NO_PHOTON_TRANSFER, "iso 800 grey") in {(r.flag, r.where) for r in fit.flags}
    assert {f.name for f in list_coefficients(fit) if f.iso == 800.0} == {"read_noise_dn", "dsnu_dn"}


# --- What is not photon transfer: linearity, dark current, and what differs from pixel to pixel


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
        return replace(block, samples_dn=pack(drawn, dtype="<u2"))

    rows = take(SMALL, 3)
    shown = [row if row.role == "dark" else repack(row, draw) for row in rows]
    assert noise_codes.PRNU_LARGE not in flags_of(noise.fit(rows, PARAMS))
    assert noise_codes.PRNU_LARGE in flags_of(noise.fit(shown, PARAMS))
