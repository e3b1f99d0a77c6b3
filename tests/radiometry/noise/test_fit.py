"""The fit of noise: known sensors are recovered within what the fit says of itself."""

import math

import numpy as np
import pytest

from radiometry.noise import fit as noise
from radiometry.noise.fit import list_coefficients
from simulation.camera import change
from simulation.targets import COUNTING_SENSOR, find_variance_maximum
from tests.radiometry.noise.series import PARAMS, TIMES, agrees, take


@pytest.fixture(scope="module")
def rich():
    """A Bayer sensor at two ISO values, with patterns and dark current, up to white."""
    sensor = change(
        COUNTING_SENSOR,
        height_px=96,
        width_px=96,
        cfa="RGGB",
        prnu_rel=0.01,
        dsnu_e=5.0,
        dark_current_e_s=40.0,
    )
    fast = change(sensor, base_iso=400.0, gain_dn_per_e=2.0)
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
        sensor, transfer = sensors[each.iso].sensor, each.transfer
        gain = sensor.gain_dn_per_e
        read_e = math.hypot(sensor.read_noise_e, math.sqrt(40.0 * 0.02))
        white_e = find_variance_maximum(sensors[each.iso], prnu_rel=0.01)
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
        assert transfer.system_gain_dn_per_e.standard_uncertainty < 0.01 * gain * transfer.birge_ratio


def test_a_straight_sensor_has_a_linearity_error_of_its_noise(rich):
    for each in rich[2].channel_fits:
        assert each.linearity.levels_used >= 5
        assert each.linearity.error_rel.value < 6 * each.linearity.error_rel.standard_uncertainty
        assert each.linearity.lowest_rel < 0.0 < each.linearity.highest_rel


def test_the_coefficient_rows_have_their_names_and_units(rich):
    figures = list_coefficients(rich[2])
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


def test_the_snr_follows_the_photon_transfer(rich):
    sensors, _, fit = rich
    for each in fit.channel_fits:
        sensor = sensors[each.iso].sensor
        for level in each.levels:
            if level.snr is None or level.left_out:
                continue
            electrons = level.light_dn / sensor.gain_dn_per_e
            dark = sensor.read_noise_e**2 + 40.0 * level.exposure_time_s
            noise_e2 = electrons + dark + 1 / 12 / sensor.gain_dn_per_e**2
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
