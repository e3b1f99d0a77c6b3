"""Each part of the camera does to a frame what its formula says, and nothing when it is off."""

import math

import numpy as np
import pytest

from radiometry.frame.exposure import Settings
from radiometry.reflectance.sun import SunPosition, Tilt, TiltParams
from simulation.camera import LUMINOUS_EFFICIENCY, Camera, Lamp, Meter, change, compute_mismatch, expose
from simulation.sequoia import SunshineSensor
from simulation.targets import Picture, Surface

SETTINGS = Settings(exposure_time_s=0.01, f_number=4.0, iso=100.0)
QUIET = change(Camera(), cfa="grey", photon_noise=False, white_level_dn=60_000.0, gain_dn_per_e=1.0)


def photograph(camera=QUIET, *, target=None, signal_dn=20_000.0, after_s=0.0, **lamp):
    lit = Lamp(luminance_cd_m2=QUIET.find_luminance(signal_dn, SETTINGS), **lamp)
    target = target or Surface()
    frame = expose(camera, target, lit, SETTINGS, np.random.default_rng(1), after_s=after_s)
    return frame.samples_dn - camera.sensor.black_level_dn


def test_a_camera_without_effects_is_exact():
    assert np.unique(photograph()).tolist() == [20_000.0]


@pytest.mark.parametrize(
    ("changes", "factor"),
    [
        ({"transmission": 0.9}, 0.9),
        ({"f_number_errors": {4.0: 1.1}}, 1 / 1.1**2),
        ({"f_number_errors": {2.8: 1.1}}, 1.0),
        ({"time_errors": {0.01: 1.05}}, 1.05),
        ({"extra_s": 0.001}, 1.1),
        ({"full_well_e": 15_000.0}, 0.75),
        ({"bend_rel": 0.1}, 1 - 0.1 * 20_000 / 59_744),
        ({"white_level_dn": 10_256.0}, 0.5),
    ],
)
def test_the_mean_changes_by_the_factor_of_the_part(changes, factor):
    assert photograph(change(QUIET, **changes)).mean() == pytest.approx(20_000 * factor, abs=1.0)


def test_the_steps_are_those_of_the_sensor():
    samples = photograph(change(QUIET, step_dn=64.0, read_noise_e=100.0)) + 256
    assert np.unique(samples % 64).tolist() == [0.0]


def test_patterns_stay_and_noise_does_not():
    fixed = change(QUIET, prnu_rel=0.01, dsnu_e=30.0)
    np.testing.assert_array_equal(photograph(fixed), photograph(fixed))
    assert not np.array_equal(photograph(fixed), photograph(change(fixed, seed=1)))


def test_stray_light_lifts_the_dark_and_keeps_the_mean():
    halves = np.ones((96, 96))
    halves[:, :48] = 0.0
    clean, veiled = (
        photograph(camera, target=Picture(halves)) for camera in (QUIET, change(QUIET, stray_share=0.02))
    )
    assert veiled[0, 0] == pytest.approx(0.02 * 10_000, abs=1.0)
    assert veiled[0, -1] == pytest.approx(20_000 - 200, abs=1.0)
    assert veiled.mean() == pytest.approx(clean.mean(), abs=1.0)


def test_blur_spreads_a_point_by_its_deviation():
    point = np.zeros((96, 96))
    point[48, 40] = 1.0
    seen = photograph(change(QUIET, blur_px=1.5), target=Picture(point), signal_dn=50_000.0)
    cols = np.arange(96) - 40
    assert seen.sum() == pytest.approx(50_000, rel=0.01)
    assert (seen.sum(axis=0) * cols**2).sum() / seen.sum() == pytest.approx(1.5**2, rel=0.05)


def test_a_lamp_drifts_with_time():
    assert photograph(after_s=60.0, drift_rel_per_s=1e-4).mean() == pytest.approx(20_000 * 1.006, abs=1.0)


def test_a_warm_lamp_is_redder_to_the_camera_and_the_same_to_an_exact_meter():
    colour = change(QUIET, cfa="RGGB")
    at_a, warm = (photograph(colour, temperature_k=kelvin) for kelvin in (2856.0, 2200.0))
    red, blue = warm[0, 0] / at_a[0, 0], warm[1, 1] / at_a[1, 1]
    assert at_a[0, 0] == pytest.approx(0.55 * 20_000, abs=1.0)
    assert red > 1.05
    assert blue < 0.8
    assert red == pytest.approx(compute_mismatch((600.0, 80.0), temperature_k=2200.0), rel=1e-3)
    assert compute_mismatch(LUMINOUS_EFFICIENCY, temperature_k=2200.0) == 1.0


def test_spectral_mismatch_of_two_narrow_detectors_by_hand():
    """Narrow bands at 650 and 555 nm read the ratio of Planck's law at these wavelengths."""

    def planck(wavelength_nm, kelvin):
        return 1.0 / (math.exp(1.438776877e7 / (wavelength_nm * kelvin)) - 1.0)

    red, green = (compute_mismatch((nm, 6.0), temperature_k=2300.0) for nm in (650.0, 555.0))
    expected = planck(650, 2300) / planck(555, 2300) * planck(555, 2856) / planck(650, 2856)
    assert red / green == pytest.approx(expected, rel=2e-3)


def test_a_meter_has_its_scale_and_its_repeatability():
    random = np.random.default_rng(2)
    meter = Meter(scale=1.02, repeatability=0.01)
    readings = [meter.read(100.0, random) for _ in range(2000)]
    assert np.mean(readings) == pytest.approx(102.0, abs=4 * 1.02 / math.sqrt(2000))
    assert np.std(readings) == pytest.approx(1.02, rel=5 / math.sqrt(4000))
    blind = Meter(band=(600.0, 80.0))
    assert blind.read(100.0, random, temperature_k=2200.0) > 105.0


def test_a_tilted_sunshine_sensor_reads_more_towards_the_sun():
    """At an elevation of 45 degrees each degree towards the sun is 1.5 %, of 5/6 direct light."""
    tilt = Tilt(sun=SunPosition(elevation_deg=45.0, azimuth_deg=180.0), params=TiltParams())
    level = SunshineSensor(sunshine_noise_rel=0.0)
    random = np.random.default_rng(1)

    def read(sensor):
        return sensor.count(4300.0, random, gain_indices=(3,)).records[0]

    towards = change(level, tilt=tilt, attitude_deg=(180.0, -1.0, 0.0))
    flat = read(change(level, tilt=tilt)).ch0
    assert flat / read(level).ch0 == pytest.approx(0.993, abs=0.001)  # 5/6 of what the diffuser loses
    assert read(towards).ch0 / flat == pytest.approx(1.015, abs=0.003)
    assert read(towards).pitch_deg == -1.0


def test_a_field_that_no_part_has_is_refused():
    with pytest.raises(TypeError, match="no part of Camera has colour"):
        change(Camera(), colour="red")
