"""The fit of noise: known sensors are recovered within what the fit says of itself."""

import dataclasses
import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

from radiometry.errors import Code, InputRejected
from radiometry.evidence import Exclusion
from radiometry.flags import Flag
from radiometry.methods import noise
from radiometry.noise.levels import list_levels
from radiometry.noise.simulation import SimulatedSensor, expose, make_row, shoot
from radiometry.noise.stacks import make_stacks
from radiometry.noise.transfer import find_saturation, fit_gain
from radiometry.packing import pack, unpack

PARAMS = noise.Params()
TIMES = (0.02, 0.05, 0.1, 0.2, 0.3, 0.45, 0.6)
LIGHT = 30_000.0
SMALL = SimulatedSensor(rows=32, cols=32, read_noise_e=6.0)


def take(sensor, seed, *, times=TIMES, dark_times=(0.02,), light=LIGHT, frames=2):
    rng = np.random.default_rng(seed)
    return shoot(sensor, rng, light_e_per_s=light, times_s=times, dark_times_s=dark_times, frames=frames)


def only(fit):
    (channel,) = fit.channel_fits
    return channel


def flags_of(fit):
    return {raised.flag for raised in fit.flags}


def agrees(quantity, truth, *, errors=3.5):
    assert quantity.value == pytest.approx(truth, abs=errors * quantity.standard_uncertainty)


@pytest.fixture(scope="module")
def rich():
    """A Bayer sensor at two ISO values, with patterns and dark current, up to white."""
    sensor = SimulatedSensor(
        rows=96, cols=96, cfa="RGGB", prnu_rel=0.01, dsnu_e=5.0, dark_current_e_per_s=40.0
    )
    fast = dataclasses.replace(sensor, iso=400.0, system_gain_dn_per_e=2.0)
    rows = take(sensor, 1, times=(*TIMES, 0.8, 1.0, 2.0), dark_times=(0.02, 1.0, 4.0), frames=3)
    rows += take(
        fast, 2, times=(0.01, 0.02, 0.05, 0.1, 0.15, 0.2, 0.4, 0.6), dark_times=(0.02, 1.0, 4.0), frames=4
    )
    return {100.0: sensor, 400.0: fast}, rows, noise.fit(rows, PARAMS)


def test_every_channel_of_every_iso_is_recovered(rich):
    sensors, _, fit = rich
    names = [(each.iso, each.channel) for each in fit.channel_fits]
    assert names == [(iso, channel) for iso in (100.0, 400.0) for channel in ("B", "G1", "G2", "R")]
    for each in fit.channel_fits:
        sensor, transfer = sensors[each.iso], each.transfer
        gain = sensor.system_gain_dn_per_e
        read_e = math.hypot(sensor.read_noise_e, math.sqrt(40.0 * 0.02))
        white_e = (sensor.white_level_dn - sensor.black_level_dn) / gain
        agrees(transfer.system_gain_dn_per_e, gain)
        agrees(transfer.read_noise_e, read_e)
        agrees(each.read_noise_dn, read_e * gain)
        agrees(transfer.full_well_e, white_e)
        agrees(transfer.snr_max, math.sqrt(white_e))
        threshold = math.sqrt(read_e**2 + 1 / 12 / gain**2) + 0.5
        agrees(transfer.sensitivity_threshold_e, threshold)
        agrees(transfer.dynamic_range_db, 20 * math.log10(white_e / threshold))
        agrees(transfer.dynamic_range_stops, math.log2(white_e / threshold))
        agrees(each.dark_current.dark_current_dn_per_s, 40.0 * gain)
        agrees(each.dark_current.dark_current_e_per_s, 40.0)
        agrees(each.dark_current.from_variance_e_per_s, 40.0)
        agrees(each.dsnu_dn, 5.0 * gain)
        agrees(transfer.dsnu_e, 5.0)
        agrees(each.prnu_rel, 0.01)
        assert transfer.saturation_origin == "white_level"
        assert transfer.system_gain_dn_per_e.standard_uncertainty < 0.01 * gain


def test_a_straight_sensor_has_a_linearity_error_of_its_noise(rich):
    for each in rich[2].channel_fits:
        assert each.linearity.levels_used >= 5
        assert each.linearity.error_rel.value < 6 * each.linearity.error_rel.standard_uncertainty
        assert each.linearity.lowest_rel < 0.0 < each.linearity.highest_rel


def test_the_coefficient_rows_have_their_names_and_units(rich):
    figures = noise.list_figures(rich[2])
    first = [figure for figure in figures if (figure.iso, figure.channel) == (100.0, "R")]
    assert {figure.name: figure.unit for figure in first} == {
        "system_gain_dn_per_e": "DN/e-",
        "read_noise_e": "e-",
        "read_noise_dn": "DN",
        "full_well_e": "e-",
        "linearity_error_rel": "1",
        "snr_max": "1",
        "dynamic_range_db": "dB",
        "dynamic_range_stops": "stop",
        "dark_current_e_per_s": "e-/s",
        "dark_current_dn_per_s": "DN/s",
        "dsnu_e": "e-",
        "dsnu_dn": "DN",
        "prnu_rel": "1",
    }
    assert len(figures) == 8 * 13
    assert all(figure.standard_uncertainty > 0.0 for figure in figures)


def test_the_answer_does_not_depend_on_the_order(rich):
    _, rows, fit = rich
    shuffled = list(rows)
    np.random.default_rng(9).shuffle(shuffled)
    assert noise.fit(shuffled, PARAMS) == fit


def test_the_fit_survives_json(rich):
    adapter = TypeAdapter(noise.Fit)
    text = json.dumps(adapter.dump_python(rich[2], mode="json"), allow_nan=False)
    assert adapter.validate_python(json.loads(text)) == rich[2]


def test_the_snr_follows_the_photon_transfer(rich):
    sensors, _, fit = rich
    for each in fit.channel_fits:
        sensor = sensors[each.iso]
        for level in each.levels:
            if level.snr is None or level.left_out:
                continue
            electrons = level.light_dn / sensor.system_gain_dn_per_e
            dark = sensor.read_noise_e**2 + 40.0 * level.exposure_time_s
            noise_e2 = electrons + dark + 1 / 12 / sensor.system_gain_dn_per_e**2
            expected = electrons / math.sqrt(noise_e2)
            assert level.snr == pytest.approx(expected, abs=4 * level.snr_standard_uncertainty)


def test_every_frame_is_accounted_for(rich):
    _, rows, fit = rich
    assert {(point.frame, point.channel) for point in fit.points} == {
        (row.frame, block.channel) for row in rows for block in row.features.blocks
    }
    white = [point for point in fit.points if point.exposure_time_s == 2.0 and point.channel == "G1"]
    assert all("at white" in point.left_out and not point.used for point in white)
    assert all(point.used for point in fit.points if point.role == "dark")


def test_figures_scatter_as_they_say():
    """Fifty sensors of known gain: no tolerance but the predicted one."""
    pulls = []
    for seed in range(50):
        transfer = only(noise.fit(take(SMALL, seed, times=TIMES[1:]), PARAMS)).transfer
        gain, read = transfer.system_gain_dn_per_e, transfer.read_noise_e
        threshold, full = transfer.sensitivity_threshold_e, transfer.full_well_e
        truths = (
            (gain, 0.5),
            (read, 6.0),
            (threshold, math.sqrt(36.0 + 1 / 3) + 0.5),
            (full, (16383 - 256) / 0.5),
        )
        pulls.append([(found.value - true) / found.standard_uncertainty for found, true in truths])
    pulls = np.array(pulls)
    assert np.abs(pulls.mean(axis=0)).max() < 3.5 / math.sqrt(50)
    # Birge's ratio enlarges u(K) by a tenth on the average, and never makes it smaller
    assert np.all(pulls.std(axis=0) < 1.0 + 3.5 / math.sqrt(100))
    assert np.all(pulls.std(axis=0)[:3] > 0.9 - 3.5 / math.sqrt(100))


def test_faint_levels_share_the_error_of_their_dark_frames():
    """Where light adds less noise than the dark has, its error is in every level, and in the read noise."""
    sensor = dataclasses.replace(SMALL, read_noise_e=20.0, rows=48, cols=48)
    times = (0.002, 0.004, 0.006, 0.008, 0.010)
    pulls = []
    for seed in range(40):
        transfer = only(noise.fit(take(sensor, seed, times=times), PARAMS)).transfer
        found = ((transfer.system_gain_dn_per_e, 0.5), (transfer.read_noise_e, 20.0))
        pulls.append([(each.value - true) / each.standard_uncertainty for each, true in found])
    assert np.abs(np.mean(pulls, axis=0)).max() < 3.5 / math.sqrt(40)
    assert np.abs(np.std(pulls, axis=0) - 1.0).max() < 3.5 / math.sqrt(80)


def test_a_dark_stack_moves_the_gain_as_its_covariance_says():
    sensor = dataclasses.replace(SMALL, read_noise_e=20.0)
    stacks = make_stacks(take(sensor, 25, times=(0.002, 0.005, 0.01), dark_times=(0.002, 0.01)))

    def fit(shift_dn2):
        moved = [
            dataclasses.replace(
                stack,
                temporal=dataclasses.replace(stack.temporal, value_dn2=stack.temporal.value_dn2 + shift_dn2),
            )
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


@settings(max_examples=20)
@given(st.floats(0.2, 3.0), st.floats(2.0, 12.0), st.integers(0, 10_000))
def test_any_gain_is_recovered(gain, read_noise_e, seed):
    sensor = dataclasses.replace(SMALL, system_gain_dn_per_e=gain, read_noise_e=read_noise_e)
    rows = take(sensor, seed, times=[0.9 * t * 0.5 / max(gain, 0.5) for t in TIMES], dark_times=(0.01,))
    transfer = only(noise.fit(rows, PARAMS)).transfer
    agrees(transfer.system_gain_dn_per_e, gain, errors=5.0)
    agrees(transfer.read_noise_e, read_noise_e, errors=5.0)


def test_transposed_frames_have_the_same_noise():
    sensor = dataclasses.replace(SMALL, prnu_rel=0.01)
    rng = np.random.default_rng(4)
    frames = [
        (role, time, n, expose(sensor, rng, light_e_per_s=light, exposure_time_s=time))
        for role, times, light in (("flat", TIMES, LIGHT), ("dark", (0.02,), 0.0))
        for time in times
        for n in range(2)
    ]

    def fit(turn):
        rows = [
            make_row(
                sensor,
                dataclasses.replace(shot, samples_dn=turn(shot.samples_dn)),
                name=f"{role}-{time}-{n}",
                role=role,
                exposure_time_s=time,
            )
            for role, time, n, shot in frames
        ]
        return noise.list_figures(noise.fit(rows, PARAMS))

    for one, other in zip(fit(np.asarray), fit(np.transpose), strict=True):
        assert one.value == pytest.approx(other.value, rel=1e-9)


def repack(row, change):
    """The same frame with its block changed."""
    (block,) = row.features.blocks
    changed = change(unpack(block.samples_dn), block)
    return dataclasses.replace(row, features=noise.Features(blocks=(changed,)))


def shift_left(samples, block):
    """Numbers of a sensor of fewer bits as a larger container holds them: in steps of sixteen."""
    return dataclasses.replace(
        block,
        samples_dn=pack(16 * samples, dtype="<u2"),
        black_level_dn=16 * block.black_level_dn,
        white_level_dn=16 * block.white_level_dn,
    )


@pytest.mark.parametrize("read_noise_e", [20.0, 3.0])
def test_numbers_in_steps_of_sixteen_are_the_same_electrons(read_noise_e):
    sensor = dataclasses.replace(
        SMALL, system_gain_dn_per_e=0.1, read_noise_e=read_noise_e, white_level_dn=4095.0
    )
    rows = take(sensor, 5, times=(*TIMES, 1.5), dark_times=(0.02, 1.0))
    plain, steps = (
        {figure.name: figure for figure in noise.list_figures(noise.fit(each, PARAMS))}
        for each in (rows, [repack(row, shift_left) for row in rows])
    )
    for name, figure in plain.items():
        factor = 16.0 if "dn" in name else 1.0
        assert steps[name].value == pytest.approx(factor * figure.value, rel=1e-9)
        expected = factor * figure.standard_uncertainty
        assert steps[name].standard_uncertainty == pytest.approx(expected, rel=1e-6)


def test_noise_below_rounding_is_a_limit():
    quiet = dataclasses.replace(SMALL, system_gain_dn_per_e=0.05, read_noise_e=2.0)
    fit = noise.fit(take(quiet, 6, light=10 * LIGHT), PARAMS)
    channel = only(fit)
    assert Flag.READ_NOISE_BELOW_ROUNDING in flags_of(fit)
    assert channel.read_noise_dn.value == pytest.approx(0.396, abs=0.001)
    assert channel.transfer.read_noise_e.value > 2.0
    agrees(channel.transfer.system_gain_dn_per_e, 0.05)


def test_a_full_well_below_white_is_where_the_variance_falls():
    sensor = dataclasses.replace(SMALL, full_well_e=20_000.0)
    times = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.65, 0.7, 0.8)
    fit = noise.fit(take(sensor, 7, times=times), PARAMS)
    transfer = only(fit).transfer
    assert transfer.saturation_origin == "variance_maximum"
    agrees(transfer.full_well_e, 20_000.0, errors=2.0)
    assert Flag.FULL_WELL_NOT_REACHED not in flags_of(fit)


def test_a_sensor_that_nobody_saturated_says_so():
    fit = noise.fit(take(SMALL, 8, times=TIMES[:5]), PARAMS)
    assert only(fit).transfer.saturation_origin == "white_level_assumed"
    assert Flag.FULL_WELL_NOT_REACHED in flags_of(fit)
    assert Flag.FEW_POINTS in flags_of(fit)


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
    sensor = dataclasses.replace(SMALL, rows=96, cols=96, bend_rel=share)
    times = (0.07, 0.15, 0.25, 0.4, 0.55, 0.7, 0.85, 1.0)
    linearity = only(noise.fit(take(sensor, 9, times=times), PARAMS)).linearity
    agrees(linearity.error_rel, bent_error(times, share), errors=4.0)
    assert linearity.error_rel.value > 20 * linearity.error_rel.standard_uncertainty
    assert linearity.levels_used == 8


def test_a_compensated_dark_current_is_seen_in_the_noise():
    sensor = dataclasses.replace(SMALL, rows=64, cols=64, dark_current_e_per_s=50.0, compensates_dark=True)
    fit = noise.fit(take(sensor, 10, dark_times=(0.02, 1.0, 2.0, 4.0)), PARAMS)
    current = only(fit).dark_current
    agrees(current.from_variance_e_per_s, 50.0)
    agrees(current.dark_current_e_per_s, 0.0)
    assert Flag.DARK_CURRENT_COMPENSATED in flags_of(fit)


def test_a_dark_signal_cut_at_zero_is_flagged():
    sensor = dataclasses.replace(SMALL, black_level_dn=2.0)
    assert Flag.DARK_CLIPPED in flags_of(noise.fit(take(sensor, 11), PARAMS))


def test_the_pattern_of_the_dark_is_no_part_of_the_prnu():
    sensor = dataclasses.replace(SMALL, rows=64, cols=64, dsnu_e=80.0, prnu_rel=0.005)
    channel = only(noise.fit(take(sensor, 24, frames=4), PARAMS))
    agrees(channel.prnu_rel, 0.005)
    agrees(channel.transfer.dsnu_e, 80.0)
    assert channel.prnu_rel.standard_uncertainty < 0.0005


def test_a_pattern_below_the_noise_is_not_resolved():
    fit = noise.fit(take(SMALL, 12), PARAMS)
    assert Flag.PATTERN_NOT_RESOLVED in flags_of(fit)
    assert only(fit).dsnu_dn.standard_uncertainty > 0.0


def dim(rows, name, factor):
    """The same campaign with the light of one frame changed."""

    def scale(samples, block):
        return dataclasses.replace(
            block, samples_dn=pack(np.rint((samples - 256) * factor + 256), dtype="<u2")
        )

    return [repack(row, scale) if row.frame == name else row for row in rows]


@pytest.mark.parametrize(("factor", "used"), [(0.97, True), (0.8, False)])
def test_light_that_drifts_is_flagged_or_left_out(factor, used):
    fit = noise.fit(dim(take(SMALL, 13), "flat-100-0.3-1", factor), PARAMS)
    assert Flag.PAIR_LIGHT_DRIFT in flags_of(fit)
    agrees(only(fit).transfer.system_gain_dn_per_e, 0.5)
    (level,) = [level for level in only(fit).levels if level.exposure_time_s == 0.3]
    assert (level.left_out == "") is used
    assert used or "the light changed by 22" in level.left_out


def test_an_excluded_frame_breaks_its_pair():
    exclusion = Exclusion(frame="flat-100-0.1-0", reason="a hand in the picture", by="A. Meier")
    fit = noise.fit(take(SMALL, 14), noise.Params(exclude=(exclusion,)))
    points = {point.frame: point for point in fit.points}
    assert points["flat-100-0.1-0"].left_out == "excluded by A. Meier: a hand in the picture"
    assert points["flat-100-0.1-1"].used  # the linearity takes a mean without a pair
    (level,) = [level for level in only(fit).levels if level.exposure_time_s == 0.1]
    assert "without a pair" in level.left_out


def test_dark_frames_of_another_time_serve_through_their_line():
    sensor = dataclasses.replace(SMALL, rows=96, cols=96, dark_current_e_per_s=200.0)
    fit = noise.fit(take(sensor, 15, times=(*TIMES, 0.9), dark_times=(0.01, 0.5, 2.0)), PARAMS)
    assert Flag.DARK_EXPOSURE_DIFFERS not in flags_of(fit)
    linearity = only(fit).linearity
    assert linearity.error_rel.value < 6 * linearity.error_rel.standard_uncertainty
    far = noise.fit(take(sensor, 16, times=(*TIMES, 0.9), dark_times=(0.01,)), PARAMS)
    assert Flag.DARK_EXPOSURE_DIFFERS in flags_of(far)


@pytest.mark.parametrize(
    ("keep", "message"),
    [
        (lambda row: row.role == "flat", "ISO 100 has no pair of dark frames"),
        (lambda row: not row.frame.startswith("dark-100-0.02-1"), "ISO 100 has no pair of dark frames"),
        (
            lambda row: row.role == "dark" or row.exposure.exposure_time_s < 0.1,
            "ISO 100 grey has pairs of frames at 2 light levels below white: at least 3",
        ),
        (lambda _: False, "no frame: take pairs of dark and of evenly lit frames"),
    ],
)
def test_what_is_missing_is_named_and_keeps_the_fit_from_starting(keep, message):
    rows = [row for row in take(SMALL, 17) if keep(row)]
    assert noise.missing(rows, PARAMS)[0].startswith(message)
    with pytest.raises(InputRejected, match="The fit cannot start") as refused:
        noise.fit(rows, PARAMS)
    assert refused.value.code is Code.FIT_INCOMPLETE


def test_what_waits_is_named():
    rows = [dataclasses.replace(row, features=None) for row in take(SMALL, 18)[:1]]
    assert noise.missing(rows, PARAMS, unread=("x",)) == (
        "x not read yet",
        "flat-100-0.02-0 not extracted yet",
    )


def test_light_that_brings_no_noise_has_no_gain():
    """Rendered and smoothed pictures: signal without shot noise."""
    rng = np.random.default_rng(19)
    rows = [
        make_row(
            SMALL,
            dataclasses.replace(
                expose(SMALL, rng, light_e_per_s=0.0, exposure_time_s=time),
                samples_dn=np.asarray(
                    256 + level + (9 if not level else 2) * rng.standard_normal((32, 32)), np.uint16
                ),
            ),
            name=f"{time}-{n}",
            role="flat" if level else "dark",
            exposure_time_s=time,
        )
        for time, level in ((0.1, 0), (0.2, 2000), (0.3, 3000), (0.4, 4000), (0.5, 5000))
        for n in range(2)
    ]
    with pytest.raises(InputRejected, match="noise grows with its signal") as refused:
        noise.fit(rows, PARAMS)
    assert refused.value.code is Code.FIT_FAILED


def test_an_iso_without_levels_still_has_its_dark_figures():
    rows = take(SMALL, 20) + take(dataclasses.replace(SMALL, iso=800.0), 21, times=(0.1,))
    fit = noise.fit(rows, PARAMS)
    poor = fit.channel_fits[1]
    assert (poor.iso, poor.transfer) == (800.0, None)
    assert poor.read_noise_dn.value == pytest.approx(3.0, abs=4 * poor.read_noise_dn.standard_uncertainty)
    assert (Flag.NO_PHOTON_TRANSFER, "iso 800 grey") in {(r.flag, r.where) for r in fit.flags}
    assert {f.name for f in noise.list_figures(fit) if f.iso == 800.0} == {"read_noise_dn", "dsnu_dn"}


def test_a_plan_names_what_would_make_the_fit_good():
    few = noise.plan(take(SMALL, 22, times=TIMES[:4]), PARAMS)
    assert few == (
        "ISO 100 grey has 4 usable levels: add 5 more up to white",
        "ISO 100 grey was never saturated: add a pair that reaches white",
        "ISO 100 grey has no four exposure times of one scene and f-number: no linearity error",
        "ISO 100 has dark frames of one exposure time: add some of a much longer one for the dark current",
        "ISO 100: add dark frames of one setting up to 16 for the DSNU",
        "ISO 100: add frames about half of white of one setting up to 16 for the PRNU",
    )
    lights = [row for row in take(SMALL, 23) if row.role == "flat"]
    assert noise.plan(lights, PARAMS)[0].startswith("ISO 100 has no pair of dark frames: add two")


@pytest.mark.parametrize(
    "changes",
    [{"gain_range_share": 0.0}, {"linearity_range_share": (0.9, 0.1)}, {"largest_drift_rel": math.nan}],
)
def test_parameters_that_cannot_be_are_refused(changes):
    with pytest.raises(ValueError, match="cannot be"):
        noise.Params(**changes)
