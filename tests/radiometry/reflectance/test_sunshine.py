"""The sunshine sensor's readings: gains, validity, choice, spread, and the mistakes not to make."""

import math
from dataclasses import replace

import numpy as np
import pytest

from radiometry.findings import InputRejected
from radiometry.frame.multispectral import GainMeasurement, Multispectral, SunshineIrradiance
from radiometry.reflectance.sunshine import compare_channels, list_readings, measure_gains, measure_sunshine
from tests.radiometry.reflectance.captures import TABLE, flags_of, make_band, make_record


def test_relative_gains_of_the_procedure_s_table_carry_the_rounding_of_their_counts():
    gains = measure_gains(TABLE)
    assert sorted(gains) == [0, 1, 2]  # index 3 is saturated in CH0
    assert [gains[index].value for index in range(3)] == pytest.approx([0.03333, 1.0, 12.0909], abs=5e-5)
    assert gains[0].u_rel == pytest.approx(math.sqrt(1 / 12) * math.hypot(1 / 11, 1 / 330))
    assert gains[0].u_rel == pytest.approx(0.0263, abs=5e-5)
    assert gains[1].u_rel == 0.0
    slow = tuple(replace(row, integration_time_s=0.3) if row.gain_index == 2 else row for row in TABLE)
    assert measure_gains(slow)[2].value == pytest.approx(2 * 3990 / 330)


def test_a_gain_saturated_in_one_channel_is_usable_in_the_other():
    gains = measure_gains(TABLE, channel="ch1")
    assert sorted(gains) == [0, 1, 2, 3]
    assert gains[3].value == pytest.approx(38630 / 84)
    assert gains[3].value / gains[2].value == pytest.approx(25.65, abs=5e-3)


@pytest.mark.parametrize(
    "reference",
    [
        (),
        (GainMeasurement(gain_index=1, integration_time_s=0.6, ch0=0, ch1=0),),
        (GainMeasurement(gain_index=1, integration_time_s=0.6, ch0=65535, ch1=0),),
        (GainMeasurement(gain_index=1, integration_time_s=0.0, ch0=330, ch1=84),),
    ],
)
def test_without_a_reference_only_the_reference_has_a_gain(reference):
    gains = measure_gains((*TABLE[:1], *TABLE[2:], *reference))
    assert {index: gain.value for index, gain in gains.items()} == {1: 1.0}


def test_readings_are_brought_to_index_one():
    """5200 counts at index 2 are 430.08 at index 1, and not those of a division by the index."""
    counts = make_band(*(make_record(ch0=ch0, gain_index=n) for n, ch0 in enumerate((14, 430, 5200)))).counts
    zero, one, two = (reading.i_ss for reading in list_readings(counts))
    assert (zero, one) == pytest.approx((14 / (11 / 330 * 0.1), 4300.0))
    assert two * 0.1 == pytest.approx(430.08, abs=5e-3)


INVALID = {
    "saturated count": replace(make_record(ch0=65535), ch1=65535),
    "unknown gain": make_record(gain_index=7),
    "no light": make_record(ch0=0),
    "no integration time": make_record(integration_time_s=0.0),
}


@pytest.mark.parametrize("reason", INVALID)
def test_an_invalid_reading_is_left_out_by_name_and_none_but_such_is_an_error(reason):
    found = measure_sunshine(make_band(make_record(), INVALID[reason], make_record()))
    assert (found.readings, found.left_out) == (2, (reason,))
    assert found.i_ss == pytest.approx(4300.0)
    assert flags_of(found.flags) == {"sunshine_readings_left_out"}
    with pytest.raises(InputRejected, match=reason) as refusal:
        measure_sunshine(make_band(INVALID[reason], INVALID[reason]))
    assert refusal.value.code == "sunshine_missing"
    assert "panel_only" in refusal.value.message


def test_a_counter_stops_earlier_in_its_shortest_time():
    """36863 in 100 ms is the limit of a TSL2591, whose gains a Sequoia's table shows."""
    short, long = make_record(ch0=36863), make_record(ch0=36863, integration_time_s=0.6)
    found = list_readings(make_band(short, long, make_record(ch0=36862)).counts)
    assert [reading.left_out for reading in found] == ["saturated count", "", ""]


# Both channels of a real Sequoia's red edge: its table, and its ten readings under the sun.
REAL_TABLE = tuple(
    GainMeasurement(gain_index=index, integration_time_s=0.6, ch0=ch0, ch1=ch1)
    for index, ch0, ch1 in ((0, 8, 3), (1, 195, 79), (2, 3262, 1280), (3, 65535, 32727))
)
FIVES = (5, 5, 5, 5, 5, 5, 5, 6, 5, 6)
REAL = make_band(*(replace(make_record(ch0=n), ch1=2) for n in FIVES), gains=REAL_TABLE)
STOPPED = replace(make_record(ch0=65535, gain_index=3), ch1=860)
BRIGHT = make_band(*[STOPPED] * 10, gains=REAL_TABLE)


def test_channel_1_takes_the_place_of_a_saturated_channel_0():
    """860 counts at index 3 are 2.08 at index 1, times 2.6 of the panel's frames, 2.47 of the table."""
    ratio = compare_channels([REAL])
    assert ratio.value == pytest.approx(52 / 20)
    assert ratio.u_rel == pytest.approx(math.sqrt(1 / 12) * math.hypot(1 / 5.2, 1 / 2))
    for stated, times, u_rel in ((ratio, 2.6, ratio.u_rel), (None, 195 / 79, 0.35)):
        found = measure_sunshine(BRIGHT, ratio=stated)
        assert found.i_ss == pytest.approx(860 / (32727 / 79) / 0.1 * times)
        assert flags_of(found.flags) >= {"sunshine_second_channel"}
        assert found.gain_u_rel == pytest.approx(u_rel, rel=0.01)
        assert found.gain_indices == (-4,)
    assert compare_channels([BRIGHT]) is None


def test_channel_1_is_not_asked_where_channel_0_counts():
    found = measure_sunshine(make_band(STOPPED, make_record(ch0=430), gains=REAL_TABLE))
    assert (found.readings, found.gain_indices) == (1, (1,))
    assert "sunshine_second_channel" not in flags_of(found.flags)


def test_no_readings_at_all_are_told_with_the_file_s_reason():
    lacking = Multispectral(
        system="sequoia", band="nir", band_name="NIR", sunshine_missing="the file has no IrradianceList"
    )
    for band, reason in ((lacking, "has no IrradianceList"), (make_band(), "the list is empty")):
        with pytest.raises(InputRejected, match=reason):
            measure_sunshine(band)


SERIES = tuple(make_record(time_us=200_000 * n, ch0=400 + 10 * n) for n in range(5))


@pytest.mark.parametrize(("choice", "expected"), [("mean", 4200.0), ("last", 4400.0), ("nearest", 4300.0)])
def test_which_reading_is_taken(choice, expected):
    found = measure_sunshine(make_band(*SERIES, exposed_at_us=690_000), choice=choice)
    assert found.i_ss == pytest.approx(expected)
    assert found.spread_rel == pytest.approx(np.std([40, 41, 42, 43, 44], ddof=1) / 42)
    assert (found.readings, found.choice) == (5, choice)
    assert found.flags == ()


def test_nearest_without_a_time_is_the_last_and_flagged():
    found = measure_sunshine(make_band(*SERIES), choice="nearest")
    assert found.i_ss == pytest.approx(4400.0)
    assert flags_of(found.flags) == {"sunshine_time_unknown"}


def test_a_single_reading_says_that_its_scatter_is_unknown():
    found = measure_sunshine(make_band(make_record()))
    assert found.spread_rel is None
    assert flags_of(found.flags) == {"sunshine_single_reading"}
    rounding = math.sqrt(1 / 12) / 430
    assert found.standard_uncertainty / found.i_ss == pytest.approx(math.hypot(0.025, rounding))


def test_equal_counts_keep_the_whole_rounding_error_and_noise_across_the_steps_averages_it_out():
    """Ten times 14 counts are no better known than once: 2.06 %."""
    found = measure_sunshine(make_band(*[make_record(ch0=14)] * 10))
    assert found.spread_rel == 0.0
    assert found.standard_uncertainty / found.i_ss == pytest.approx(0.02062, abs=1e-5)
    counts = [430 + step for step in (-3, 2, 0, 3, -1, 1, -2, 0, 2, -2)]
    found = measure_sunshine(make_band(*[make_record(ch0=count) for count in counts]))
    expected = np.std(counts, ddof=1) / np.mean(counts) / math.sqrt(10)
    assert found.standard_uncertainty / found.i_ss == pytest.approx(expected, rel=1e-3)


def test_old_records_take_the_usual_gain_and_time_and_say_so():
    old = replace(make_record(ch0=620), gain_index=None, integration_time_s=None)
    band = make_band(old, old)
    band = replace(band, counts=replace(band.counts, record_bytes=24))
    found = measure_sunshine(band)
    assert found.i_ss == pytest.approx(6200.0)
    assert flags_of(found.flags) == {"sunshine_gain_assumed"}
    assert "24 bytes" in found.flags[0].detail


def test_without_a_table_readings_at_the_reference_are_used_and_others_not():
    found = measure_sunshine(make_band(make_record(), make_record(gain_index=2, ch0=5200), gains=()))
    assert (found.i_ss, found.readings) == (pytest.approx(4300.0), 1)
    assert found.left_out == ("unknown gain",)
    assert "sunshine_gain_table_missing" in flags_of(found.flags)


def test_readings_at_several_gains_are_one_light():
    found = measure_sunshine(make_band(make_record(ch0=430), make_record(ch0=5200, gain_index=2)))
    assert found.gain_indices == (1, 2)
    assert found.gain_u_rel == measure_gains(TABLE)[2].u_rel
    assert found.spread_rel < 0.001


def test_twice_the_time_for_the_same_counts_is_half_the_light():
    short, long = (measure_sunshine(make_band(make_record(integration_time_s=t))) for t in (0.1, 0.2))
    assert (short.i_ss, long.i_ss) == pytest.approx((4300.0, 2150.0))
    assert long.standard_uncertainty == pytest.approx(short.standard_uncertainty / 2)


@pytest.mark.parametrize(("origin", "flags"), [("tag", set()), ("dls1", {"sunshine_scale_assumed"})])
def test_a_light_sensor_s_irradiance_is_taken_as_it_is(origin, flags):
    light = SunshineIrradiance(irradiance_w_m2_nm=1.08, quantity="spectral", unit_origin=origin)
    band = Multispectral(system="micasense", band="blue", band_name="Blue", irradiance=light)
    found = measure_sunshine(band, where="frame 1")
    assert (found.i_ss, found.unit, found.spread_rel) == (1.08, "W/(m2*nm)", None)
    assert flags_of(found.flags) == flags | {"sunshine_single_reading"}
    assert {raised.where for raised in found.flags} == {"frame 1"}
