"""Where the sun stands, and what a tilted sensor would have read level."""

import dataclasses
import math
from datetime import UTC, datetime, timedelta, timezone

import pytest
from hypothesis import given
from hypothesis import strategies as st

from radiometry.findings import InputRejected
from radiometry.frame.multispectral import Multispectral, SunshineIrradiance
from radiometry.reflectance.sun import (
    SunPosition,
    Tilt,
    TiltParams,
    find_tilt,
    level_factor,
    locate_sun,
    read_clock_s,
    sun_angle_deg,
    transmit,
)
from radiometry.reflectance.sunshine import measure_sunshine
from tests.radiometry.reflectance.captures import make_band, make_header, make_record

PARAMS = TiltParams()
LEVEL = {"yaw_deg": 0.0, "pitch_deg": 0.0, "roll_deg": 0.0}


def test_sun_of_the_worked_example():
    """NREL/TP-560-34302, appendix A.5: elevation without refraction 39.872046, azimuth 194.340241 degrees."""
    at = datetime(2003, 10, 17, 12, 30, 30, tzinfo=timezone(timedelta(hours=-7)))
    sun = locate_sun(at, latitude_deg=39.742476, longitude_deg=-105.1786)
    assert sun.elevation_deg == pytest.approx(39.872046, abs=0.01)
    assert sun.azimuth_deg == pytest.approx(194.340241, abs=0.01)


@pytest.mark.parametrize(
    ("at", "declination_deg"),
    [(datetime(2018, 6, 21, 12, tzinfo=UTC), 23.43), (datetime(2018, 12, 21, 12, tzinfo=UTC), -23.43)],
)
def test_at_the_pole_the_sun_stands_as_high_as_its_declination(at, declination_deg):
    assert locate_sun(at, latitude_deg=90.0, longitude_deg=0.0).elevation_deg == pytest.approx(
        declination_deg, abs=0.02
    )


def test_the_sun_rises_in_the_east():
    morning, evening = (
        locate_sun(datetime(2018, 3, 20, hour, tzinfo=UTC), latitude_deg=50.0, longitude_deg=0.0)
        for hour in (8, 16)
    )
    assert 90 < morning.azimuth_deg < 180 < evening.azimuth_deg < 270


@pytest.mark.parametrize(
    ("attitude", "expected_deg"),
    [
        (LEVEL, 60.0),
        ({**LEVEL, "pitch_deg": -10.0}, 50.0),  # nose down: the normal leans forward, to the north
        ({**LEVEL, "pitch_deg": 10.0}, 70.0),
        ({**LEVEL, "yaw_deg": 90.0, "roll_deg": -10.0}, 50.0),  # facing east, left wing down, to the north
        ({**LEVEL, "yaw_deg": 180.0, "pitch_deg": 10.0}, 50.0),
    ],
)
def test_angle_to_a_sun_in_the_north(attitude, expected_deg):
    sun = SunPosition(elevation_deg=30.0, azimuth_deg=0.0)
    assert sun_angle_deg(sun, **attitude) == pytest.approx(expected_deg, abs=1e-9)


@given(st.floats(-180, 180), st.floats(0, 360), st.floats(0, 90))
def test_a_level_sensor_sees_the_zenith_angle_whatever_its_yaw(yaw_deg, azimuth_deg, elevation_deg):
    sun = SunPosition(elevation_deg=elevation_deg, azimuth_deg=azimuth_deg)
    # acos loses half the digits near zero
    assert sun_angle_deg(sun, **{**LEVEL, "yaw_deg": yaw_deg}) == pytest.approx(90 - elevation_deg, abs=1e-5)


def test_transmission_by_fresnel():
    """At Brewster's angle only one polarisation is reflected: R_s = ((n^2 - 1)/(n^2 + 1))^2."""
    brewster_deg = math.degrees(math.atan(1.5))
    normal = 1 - (0.5 / 2.5) ** 2
    assert transmit(0.0, refractive_index=1.5) == 1.0
    expected = (1 - 0.5 * ((1.5**2 - 1) / (1.5**2 + 1)) ** 2) / normal
    assert transmit(brewster_deg, refractive_index=1.5) == pytest.approx(expected, rel=1e-12)
    assert transmit(90.0, refractive_index=1.5) == pytest.approx(0.0, abs=1e-12)


def make_tilt(elevation_deg=45.0, **params):
    sun = SunPosition(elevation_deg=elevation_deg, azimuth_deg=0.0)
    return Tilt(sun=sun, params=TiltParams(**params))


def test_a_degree_towards_a_sun_of_45_degrees_is_one_and_a_half_per_cent():
    tilt = make_tilt()
    assert level_factor(45.0, tilt) / level_factor(44.0, tilt) - 1 == pytest.approx(0.015, abs=0.001)


def test_without_diffuse_light_and_reflection_it_is_the_cosine():
    tilt = make_tilt(diffuse_share=0.0, refractive_index=1.0)
    assert level_factor(30.0, tilt) == pytest.approx(math.cos(math.radians(45)) / math.cos(math.radians(30)))


def test_under_a_cloud_the_tilt_does_not_matter():
    assert level_factor(20.0, make_tilt(diffuse_share=1.0)) == 1.0


@given(st.floats(10, 90), st.floats(0, 1), st.floats(1.0, 2.0))
def test_a_level_sensor_is_corrected_for_its_diffuser_alone(elevation_deg, share, index):
    tilt = make_tilt(elevation_deg, diffuse_share=share, refractive_index=index)
    entered = (1.0 - share) * transmit(90.0 - elevation_deg, refractive_index=index) + share
    assert level_factor(90.0 - elevation_deg, tilt) == pytest.approx(1.0 / entered, rel=1e-12)


def test_readings_are_levelled_one_by_one():
    towards = make_record(yaw_deg=0.0, pitch_deg=-10.0, roll_deg=0.0)
    away = make_record(yaw_deg=0.0, pitch_deg=10.0, roll_deg=0.0)
    tilt = make_tilt()
    found = measure_sunshine(make_band(towards, away), tilt=tilt)
    expected = 4300.0 * (level_factor(35.0, tilt) + level_factor(55.0, tilt)) / 2
    assert found.i_ss == pytest.approx(expected)


def test_a_sensor_turned_away_from_the_sun_is_left_out():
    upside = make_record(yaw_deg=0.0, pitch_deg=0.0, roll_deg=100.0)
    level = make_record(yaw_deg=0.0, pitch_deg=0.0, roll_deg=0.0)
    found = measure_sunshine(make_band(upside, level), tilt=make_tilt())
    assert found.left_out == ("turned away from the sun",)


def test_without_an_attitude_there_is_no_correction():
    with pytest.raises(InputRejected, match="how the sensor hung") as refusal:
        measure_sunshine(make_band(make_record()), tilt=make_tilt())
    assert refusal.value.code == "tilt_not_correctable"


def test_what_the_camera_made_level_is_not_levelled_again():
    def measure(quantity):
        light = SunshineIrradiance(
            irradiance_w_m2_nm=1.0,
            quantity=quantity,
            unit_origin="tag",
            yaw_deg=0.0,
            pitch_deg=-10.0,
            roll_deg=0.0,
        )
        band = Multispectral(system="micasense", band="blue", band_name="Blue", irradiance=light)
        return measure_sunshine(band, tilt=make_tilt()).i_ss

    assert measure("horizontal") == 1.0
    assert measure("spectral") == pytest.approx(level_factor(35.0, make_tilt()), rel=1e-12)


HEADER = make_header(make_band(), taken_at="2018-06-13T11:00:00", latitude_deg=50.85, longitude_deg=4.35)


def test_the_sun_over_a_frame():
    assert find_tilt(HEADER, None) is None
    tilt = find_tilt(HEADER, PARAMS)
    assert tilt.sun.elevation_deg == pytest.approx(62, abs=1)
    later = dataclasses.replace(HEADER, taken_at="2018-06-13T13:00:00+02:00")
    assert find_tilt(later, PARAMS) == tilt
    assert read_clock_s(HEADER) == datetime(2018, 6, 13, 11, tzinfo=UTC).timestamp()


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"taken_at": None}, "no GPS fix"),
        ({"latitude_deg": None}, "no GPS fix"),
        ({"taken_at": "2018-06-13T04:30:00"}, "under 10"),
    ],
)
def test_what_keeps_the_sun_from_being_known(change, match):
    with pytest.raises(InputRejected, match=match) as refusal:
        find_tilt(dataclasses.replace(HEADER, **change), PARAMS)
    assert refusal.value.code == "tilt_not_correctable"


@pytest.mark.parametrize(
    "wrong", [{"diffuse_share": 1.1}, {"diffuse_share": math.nan}, {"refractive_index": 0.9}]
)
def test_parameters_that_cannot_be(wrong):
    with pytest.raises(ValueError, match="must lie between"):
        TiltParams(**wrong)
