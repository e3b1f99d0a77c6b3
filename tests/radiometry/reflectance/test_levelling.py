"""The light on a level surface: on by default, in the budget, and right as often as it says."""

import math
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radiometry.findings import InputRejected
from radiometry.frame.multispectral import SunshineIrradiance
from radiometry.reflectance import findings
from radiometry.reflectance import method as reflectance
from radiometry.reflectance.sun import (
    SunPosition,
    Tilt,
    TiltParams,
    find_tilt,
    level_factor,
    locate_sun,
    locate_suns_of,
    read_clock_s,
    share_at,
    share_u_at,
    sun_angle_deg,
    transmit,
)
from radiometry.reflectance.sunshine import find_repeated, measure_light, measure_sunshine, see_light
from tests.radiometry.reflectance.captures import (
    PANEL_R,
    READINGS,
    change_band,
    flags_of,
    k_of,
    make_band,
    make_header,
    make_record,
    seeded,
    take,
)
from tests.support import reader
from tests.support.data import data_file

ROW = take(seeded(), {"green": PANEL_R["green"]})[0]
# At this place and time the sun stands near the zenith angle that the latitude states.
EQUINOX = {"taken_at": "2018-03-20T12:07:00", "longitude_deg": 0.0}
# K at the panel capture, before it drifts.
STEADY = reflectance.Params(drift_half_hour_rel=0.0)
LEANING = {"yaw_deg": 0.0, "pitch_deg": 8.0, "roll_deg": 0.0}
PLACE = {"taken_at": "2018-06-13T11:00:00", "latitude_deg": 50.85, "longitude_deg": 4.35}


def hang(**more):
    return make_header(make_band(*[make_record(**LEANING)] * 5), **(PLACE | more))


def test_both_figures_are_in_the_answer():
    found = measure_light(hang(), params=TiltParams())
    assert found.oriented == pytest.approx(4300.0)
    assert found.i_ss / found.oriented == pytest.approx(0.951, abs=0.002)  # it leant towards the sun
    assert 0.01 < found.level_u_rel < 0.03
    assert found.flags == ()


def test_what_hung_askew_and_was_not_levelled_is_flagged_and_less_certain():
    level = measure_light(hang(), params=TiltParams())
    oriented = measure_light(hang(), params=None)
    assert flags_of(oriented.flags) == {"sunshine_tilted"}
    assert oriented.i_ss == oriented.oriented
    assert oriented.level_u_rel > 2 * level.level_u_rel
    lost = measure_light(hang(latitude_deg=None), params=TiltParams())
    assert flags_of(lost.flags) == {"sunshine_tilted", "tilt_not_correctable"}
    unset = measure_light(hang(taken_at="1970-01-01T11:00:00"), params=TiltParams())
    assert unset == lost


def test_light_that_the_file_divides_takes_the_place_of_the_assumed_fraction():
    def measure(**stated):
        light = SunshineIrradiance(
            irradiance_w_m2_nm=1.0, quantity="spectral", unit_origin="tag", **LEANING, **stated
        )
        band = replace(make_band(), counts=None, irradiance=light)
        return measure_light(make_header(band), params=TiltParams())

    sun = {"solar_elevation_deg": 45.0, "solar_azimuth_deg": 0.0}
    assumed = measure(**sun)
    assert assumed.i_ss == pytest.approx(level_factor(53.0, make_tilt()))
    divided = measure(**sun, direct_w_m2_nm=math.sqrt(2.0), scattered_w_m2_nm=1.0)
    assert divided.i_ss == pytest.approx(level_factor(53.0, make_tilt(diffuse_share=0.5)))


@pytest.mark.parametrize(
    ("stated", "basis", "ratio"),
    [
        ({"quantity": "horizontal", "spectral_w_m2_nm": 0.8}, "horizontal", 0.8),
        ({"quantity": "compensated"}, "compensated", 1.0),
        ({"quantity": "spectral"}, "levelled", None),
        ({"quantity": "spectral", "distrust": "HorizontalIrradiance of Altum 1.0.0"}, "levelled", None),
    ],
)
def test_the_answer_names_the_surface_of_its_irradiance(stated, basis, ratio):
    light = SunshineIrradiance(irradiance_w_m2_nm=1.0, unit_origin="tag", **LEANING, **stated)
    header = make_header(replace(make_band(), counts=None, irradiance=light), **PLACE)
    found = measure_light(header, params=TiltParams())
    assert found.basis == basis
    assert ratio is None or (found.i_ss, found.oriented) == (1.0, ratio)
    assert measure_light(header).basis == {"levelled": "oriented"}.get(basis, basis)
    details = [each.detail for each in found.flags if each.flag == "horizontal_irradiance_left_out"]
    assert details == ([f"{stated['distrust']}."] if "distrust" in stated else [])


def test_a_cloud_over_the_flight_is_flagged_and_covered():
    """No direct light is left to level, and the sensor leans 8 degrees towards where the sun was."""
    place = {name: PLACE[name] for name in ("latitude_deg", "longitude_deg")}
    panel, field = (
        [
            replace(each, header=replace(each.header, **place))
            for each in take(
                seeded(seed), {"green": PANEL_R["green"]}, i_ss=light, role=role, minutes=minutes
            )
        ]
        for seed, light, role, minutes in ((1, 4300.0, "panel", 0.0), (2, 1500.0, "field", 5.0))
    )
    (leaning,) = change_band(
        field,
        counts=replace(
            field[0].header.multispectral.counts,
            records=tuple(replace(each, **LEANING) for each in field[0].header.multispectral.counts.records),
        ),
    )
    coefficients = [each.coefficient for each in reflectance.fit(panel, READINGS, STEADY).band_fits]
    found = reflectance.apply_features(leaning.features, header=leaning.header, coefficients=coefficients)
    assert "light_changed" in flags_of(found.flags)
    error = found.reflectance.value / PANEL_R["green"] - 1.0
    assert 0.03 < abs(error) < 2 * found.reflectance.standard_uncertainty / found.reflectance.value
    level = measure_light(leaning.header, params=coefficients[0].tilt)
    correction = abs(level.oriented / level.i_ss - 1.0)
    assert found.reflectance.standard_uncertainty > found.reflectance.value * correction / math.sqrt(3)


def test_a_measurement_takes_the_angle_of_the_fit_and_flags_another():
    params = reflectance.Params(incidence_angle_deg=50.0)
    fit = reflectance.fit([ROW], READINGS, params)
    coefficients = [each.coefficient for each in fit.band_fits]

    def measure(**angle):
        return reflectance.apply_features(ROW.features, header=ROW.header, coefficients=coefficients, **angle)

    assert measure().reflectance.value == pytest.approx(PANEL_R["green"])
    assert "incidence_angle_differs" not in flags_of(measure().flags)
    other = measure(incidence_angle_deg=0.0)
    assert other.reflectance.value == pytest.approx(0.64 * PANEL_R["green"], rel=0.01)
    assert "incidence_angle_differs" in flags_of(other.flags)


def test_a_clock_that_was_never_set_is_flagged_when_the_file_is_read():
    unset = replace(ROW.header, taken_at="1970-01-01T00:01:00")
    assert "clock_not_set" in flags_of(findings.check_frame(unset))
    assert "clock_not_set" not in flags_of(findings.check_frame(ROW.header))


def test_the_local_time_of_a_dji_camera_locates_the_sun_by_each_zone_that_may_be():
    told = replace(ROW.header.multispectral, system="dji")
    assert len(locate_suns_of(ROW.header)) == 1
    local = replace(ROW.header, multispectral=told, taken_at="2024-06-13T11:00:00")
    by_zone = locate_suns_of(local)
    assert len(by_zone) > 1
    in_file = replace(local, taken_at="2024-06-13T11:00:00+02:00")
    stated = replace(local, clock_offset="+02:00")
    assert find_tilt(stated, TiltParams()) == find_tilt(in_file, TiltParams())
    assert find_tilt(stated, TiltParams()).sun in by_zone
    # K of a flight is interpolated on the camera's own clock, whatever is stated after the fit
    assert read_clock_s(stated) == read_clock_s(local)


def test_two_captures_that_lean_alike_share_the_error_of_an_unknown_zone():
    """A real P4 leans 6.0 degrees, as at its next capture 6.7: by itself the zone is worth 4 %."""
    header = reader.read_header(data_file("p4m/DJI_0014.TIF"))
    told, effects = header.multispectral, []
    for pitch_deg, yaw_deg in ((6.0, 89.9), (6.7, 90.0), (6.7, -90.0)):
        light = replace(told.irradiance, pitch_deg=pitch_deg, yaw_deg=yaw_deg)
        band = replace(told, irradiance=light)
        found = measure_light(replace(header, multispectral=band), params=TiltParams())
        assert (found.basis, "zone_unknown" in flags_of(found.flags)) == ("levelled", True)
        effects.append(np.array(found.level_effects))
    panel, alike, opposite = effects
    alone, alike, opposite = (np.linalg.norm(each) for each in (panel, panel - alike, panel - opposite))
    assert 0.03 < alone < opposite
    assert alike < 0.017


def test_a_reading_that_repeats_while_the_aircraft_leans_is_an_earlier_one():
    """A real P4: its next capture leans 18 degrees further, and states the irradiance of the one before."""
    headers = [reader.read_header(data_file(f"p4m/DJI_00{number}.TIF")) for number in (14, 24)]
    features = replace(ROW.features, band="red_edge", gradient_rel=0.0)
    panel, leans = (replace(ROW, frame=h.taken_at, header=h, features=features) for h in headers)
    readings = [reflectance.Reading(panel="P", band="red_edge", reflectance=0.5, standard_uncertainty=0.005)]
    assert "sunshine_stale" not in flags_of(reflectance.fit([panel], readings, reflectance.Params()).flags)
    fitted = reflectance.fit([panel, leans], readings, reflectance.Params())
    assert [bool(point.left_out) for point in fitted.points] == [False, True]
    assert "sunshine_stale" in flags_of(fitted.flags)
    applied = reflectance.apply_features(
        features, header=leans.header, coefficients=[k_of(fitted, "red_edge").coefficient]
    )
    assert "sunshine_stale" in flags_of(applied.flags)
    assert applied.reflectance.value == pytest.approx(0.5, rel=0.003)
    assert applied.reflectance.standard_uncertainty < 0.025


@pytest.mark.parametrize(
    ("turned_deg", "change_rel", "is_earlier"),
    [(5.0, 0.0, True), (5.0, 0.001, False), (12.0, 0.001, True), (12.0, 0.003, False), (2.0, 0.0, False)],
)
def test_light_is_a_repetition_only_where_chance_does_not_explain_it(turned_deg, change_rel, is_earlier):
    told = reader.read_header(data_file("p4m/DJI_0014.TIF")).multispectral
    earlier = see_light(told)
    light = replace(
        told.irradiance,
        relative_irradiance=earlier.value * (1 + change_rel),
        pitch_deg=earlier.pitch_deg + turned_deg,
    )
    now = replace(told, irradiance=light)
    assert bool(find_repeated(now, [earlier])) == is_earlier


def read_once(pitch_deg, value=1.0, **band):
    """Return a panel's row at noon under 50 degrees, with one light reading of a sensor that leans."""
    light = SunshineIrradiance(
        irradiance_w_m2_nm=value,
        quantity="spectral",
        unit_origin="tag",
        yaw_deg=0.0,
        pitch_deg=pitch_deg,
        roll_deg=0.0,
    )
    header = replace(ROW.header, latitude_deg=50.0, **EQUINOX)
    row = replace(ROW, header=header, frame=f"panel-{pitch_deg:g}")
    return change_band([row], counts=None, irradiance=light, **band)[0]


def test_what_attitudes_explain_of_captures_that_lean_otherwise_is_no_noise_of_readings():
    """ln K of two captures differs by 12 %."""
    rows = [read_once(8.0), read_once(-8.0, 1.1)]
    alone = [k_of(reflectance.fit([row], READINGS, STEADY)).coefficient.knots[0] for row in rows]
    a, b = alone
    brighter = rows[1].features.i_sq * b.reflectance_k / a.reflectance_k * math.exp(0.12)
    rows[1] = replace(rows[1], features=replace(rows[1].features, i_sq=brighter, gradient_rel=0.0))
    found = k_of(reflectance.fit(rows, READINGS, STEADY)).coefficient
    (knot,) = found.knots
    effects = np.array([each.level_effects for each in alone])
    assert knot.level_effects == pytest.approx(effects.mean(axis=0))
    assert knot.own_level_u_rel == pytest.approx(math.hypot(a.own_level_u_rel, b.own_level_u_rel) / 2.0)
    own = (a.own_level_u_rel**2 + b.own_level_u_rel**2) / 2.0
    left = 0.12**2 / 2.0 - np.sum((effects[0] - effects[1]) ** 2) / 2.0 - own
    assert found.reading_u_rel == pytest.approx(math.sqrt((0.025**2 + left) / 2.0))


def test_an_older_version_takes_the_diffuse_fraction_of_its_fit():
    """Panel and flight lean alike: blue light is levelled alike, as it was then and as it is now."""
    row = read_once(10.0, wavelength_nm=475.0)
    found = k_of(reflectance.fit([row], READINGS, reflectance.Params())).coefficient
    knots = [replace(knot, level_effects=None, level_u_rel=None) for knot in found.knots]
    older = replace(found, knots=tuple(knots))
    (white,) = change_band([row], wavelength_nm=None)
    seen = [
        reflectance.apply_features(ROW.features, header=each.header, coefficients=[by]).i_ss
        for each, by in ((row, found), (row, older), (white, found))
    ]
    assert seen[1] == seen[2] == pytest.approx(0.98 * seen[0], rel=0.005)


def test_a_panel_levelled_by_a_bubble_costs_less_than_by_eye():
    """Sun 50 degrees from the zenith, 2 degrees off level: 4.2 %, not 0.06 %."""
    row = replace(ROW, header=replace(ROW.header, latitude_deg=50.0, **EQUINOX))
    costs = []
    for level in ("eye", "measured"):
        fit = k_of(reflectance.fit([row], READINGS, reflectance.Params(panel_level=level)))
        costs += [each.u_rel for each in fit.budget if each.source == "panel angle"]
    assert costs == pytest.approx([0.0416, 0.0062], rel=0.03)


# --- Where the sun stands, and what a tilted sensor would have read level


PARAMS = TiltParams()
LEVEL = {"yaw_deg": 0.0, "pitch_deg": 0.0, "roll_deg": 0.0}


def test_sun_of_the_worked_example():
    """NREL/TP-560-34302, appendix A.5: elevation without refraction 39.872046, azimuth 194.340241 degrees."""
    at = datetime(2003, 10, 17, 12, 30, 30, tzinfo=timezone(timedelta(hours=-7)))
    sun = locate_sun(at, latitude_deg=39.742476, longitude_deg=-105.1786)
    assert sun.elevation_deg == pytest.approx(39.872046, abs=0.01)
    assert sun.azimuth_deg == pytest.approx(194.340241, abs=0.01)


@pytest.mark.parametrize(
    ("attitude", "expected_deg"),
    [
        ({**LEVEL, "yaw_deg": 77.0}, 60.0),
        ({**LEVEL, "pitch_deg": -10.0}, 50.0),  # nose down: the normal leans forward, to the north
        ({**LEVEL, "pitch_deg": 10.0}, 70.0),
        ({**LEVEL, "yaw_deg": 90.0, "roll_deg": -10.0}, 50.0),  # facing east, left wing down, to the north
        ({**LEVEL, "yaw_deg": 180.0, "pitch_deg": 10.0}, 50.0),
    ],
)
def test_angle_to_a_sun_in_the_north(attitude, expected_deg):
    sun = SunPosition(elevation_deg=30.0, azimuth_deg=0.0)
    assert sun_angle_deg(sun, **attitude) == pytest.approx(expected_deg, abs=1e-9)


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


def test_without_diffuse_light_and_reflection_it_is_the_cosine():
    tilt = make_tilt(diffuse_share=0.0, refractive_index=1.0)
    assert level_factor(30.0, tilt) == pytest.approx(math.cos(math.radians(45)) / math.cos(math.radians(30)))


@pytest.mark.parametrize(("wavelength_nm", "share"), [(475.0, 0.30), (650.0, 1 / 6), (840.0, 0.10)])
def test_the_diffuse_fraction_falls_with_the_wavelength(wavelength_nm, share):
    """A clear sky, the sun at 45 degrees: the textbook's order of magnitude. Under a cloud it is white."""
    assert share_at(1 / 6, wavelength_nm) == pytest.approx(share, abs=0.015)
    assert share_at(1 / 6, None) == 1 / 6
    assert (share_at(0.0, wavelength_nm), share_at(1.0, wavelength_nm)) == (0.0, 1.0)


@pytest.mark.parametrize(
    ("wavelength_nm", "u"), [(475.0, 0.1103), (650.0, 0.1), (840.0, 0.0815), (None, 0.1)]
)
def test_the_haze_makes_the_diffuse_fraction_uncertain(wavelength_nm, u):
    """By hand: three quarters of 0.2 of the direct light are haze, which changes; a quarter is air."""
    params = TiltParams()
    assert share_u_at(params, wavelength_nm) == pytest.approx(u, abs=5e-5)
    r, steps = (wavelength_nm or 650.0) / 650.0, (-1e-4, 1e-4)
    odds = [0.05 * r**-4 + (0.15 + step) * r**-1.3 for step in steps]
    low, high = (each / (1 + each) for each in odds)
    # 0.1 of the fraction at 650 nm is 0.144 of these odds
    assert share_u_at(params, wavelength_nm) == pytest.approx((high - low) / 2e-4 * 0.144, rel=1e-4)
    assert share_u_at(TiltParams(diffuse_share=1.0), wavelength_nm) == 0.1


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


HEADER = make_header(make_band(), taken_at="2018-06-13T11:00:00", latitude_deg=50.85, longitude_deg=4.35)


def test_the_sun_over_a_frame():
    assert find_tilt(HEADER, None) is None
    tilt = find_tilt(HEADER, PARAMS)
    assert tilt.sun.elevation_deg == pytest.approx(62, abs=1)
    later = replace(HEADER, taken_at="2018-06-13T13:00:00+02:00")
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
        find_tilt(replace(HEADER, **change), PARAMS)
    assert refusal.value.code == "tilt_not_correctable"
