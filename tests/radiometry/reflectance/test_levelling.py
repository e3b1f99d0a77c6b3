"""The light on a level surface: on by default, in the budget, and right as often as it says."""

import dataclasses
import math

import numpy as np
import pytest

from radiometry.findings import InputRejected
from radiometry.frame.multispectral import SunshineIrradiance
from radiometry.reflectance import findings
from radiometry.reflectance import method as reflectance
from radiometry.reflectance import method as reflectance_method
from radiometry.reflectance.sun import TiltParams, find_tilt, level_factor, locate_sun_of, read_clock_s
from radiometry.reflectance.sunshine import measure_light
from tests.radiometry.reflectance.captures import (
    PANEL_R,
    READINGS,
    TABLE,
    change_band,
    flags_of,
    k_of,
    make_band,
    make_header,
    make_record,
    seeded,
    take,
)
from tests.radiometry.reflectance.test_tilt import make_tilt

ROW = take(seeded(), {"green": PANEL_R["green"]})[0]
# At this place and time the sun stands near the zenith angle that the latitude states.
EQUINOX = {"taken_at": "2018-03-20T12:07:00", "longitude_deg": 0.0}
# K at the panel capture, before it drifts.
STEADY = reflectance.Params(drift_half_hour_rel=0.0)
LEANING = {"yaw_deg": 0.0, "pitch_deg": 8.0, "roll_deg": 0.0}
PLACE = {"taken_at": "2018-06-13T11:00:00", "latitude_deg": 50.85, "longitude_deg": 4.35}


def hang(**more):
    return make_header(make_band(*[make_record(**LEANING)] * 5), **(PLACE | more))


def budget_of(fit):
    return {entry.source: entry.u_rel for entry in fit.budget}


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
        band = dataclasses.replace(make_band(), counts=None, irradiance=light)
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
        (
            {"quantity": "spectral", "distrust": "HorizontalIrradiance of Altum 1.0.0"},
            "levelled",
            None,
        ),
    ],
)
def test_the_answer_names_the_surface_of_its_irradiance(stated, basis, ratio):
    light = SunshineIrradiance(irradiance_w_m2_nm=1.0, unit_origin="tag", **LEANING, **stated)
    header = make_header(dataclasses.replace(make_band(), counts=None, irradiance=light), **PLACE)
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
            dataclasses.replace(
                each,
                header=dataclasses.replace(each.header, **place),
            )
            for each in take(
                seeded(seed), {"green": PANEL_R["green"]}, i_ss=light, role=role, minutes=minutes
            )
        ]
        for seed, light, role, minutes in ((1, 4300.0, "panel", 0.0), (2, 1500.0, "field", 5.0))
    )
    (leaning,) = change_band(
        field,
        counts=dataclasses.replace(
            field[0].header.multispectral.counts,
            records=tuple(
                dataclasses.replace(each, **LEANING) for each in field[0].header.multispectral.counts.records
            ),
        ),
    )
    coefficients = [each.coefficient for each in reflectance.fit(panel, READINGS, STEADY).band_fits]
    found = reflectance_method.apply_features(
        leaning.features, header=leaning.header, coefficients=coefficients
    )
    assert "light_changed" in flags_of(found.flags)
    error = found.reflectance.value / PANEL_R["green"] - 1.0
    assert 0.03 < abs(error) < 2 * found.reflectance.standard_uncertainty / found.reflectance.value
    level = measure_light(leaning.header, params=coefficients[0].tilt)
    correction = abs(level.oriented / level.i_ss - 1.0)
    assert found.reflectance.standard_uncertainty > found.reflectance.value * correction / math.sqrt(3)


def test_a_panel_under_a_low_sun_is_less_certain():
    """Sun 50 degrees from the zenith, 2 degrees off level: 4.2 %, not 0.06 %."""
    header = dataclasses.replace(ROW.header, latitude_deg=50.0, **EQUINOX)
    row = dataclasses.replace(ROW, header=header)
    fit = k_of(reflectance.fit([row], READINGS, reflectance.Params()))
    assert budget_of(fit)["panel angle"] == pytest.approx(0.042, abs=0.001)


def test_a_measurement_takes_the_angle_of_the_fit_and_flags_another():
    params = reflectance.Params(incidence_angle_deg=50.0)
    fit = reflectance.fit([ROW], READINGS, params)
    coefficients = [each.coefficient for each in fit.band_fits]

    def measure(**angle):
        return reflectance_method.apply_features(
            ROW.features, header=ROW.header, coefficients=coefficients, **angle
        )

    assert measure().reflectance.value == pytest.approx(PANEL_R["green"])
    assert "incidence_angle_differs" not in flags_of(measure().flags)
    other = measure(incidence_angle_deg=0.0)
    assert other.reflectance.value == pytest.approx(0.64 * PANEL_R["green"], rel=0.01)
    assert "incidence_angle_differs" in flags_of(other.flags)


def test_a_clock_that_was_never_set_is_flagged_when_the_file_is_read():
    unset = dataclasses.replace(ROW.header, taken_at="1970-01-01T00:01:00")
    assert "clock_not_set" in flags_of(findings.check_frame(unset))
    assert "clock_not_set" not in flags_of(findings.check_frame(ROW.header))


def test_the_local_time_of_a_dji_camera_locates_the_sun_in_a_stated_zone_alone():
    told = dataclasses.replace(ROW.header.multispectral, system="dji")
    assert locate_sun_of(ROW.header) is not None
    local = dataclasses.replace(ROW.header, multispectral=told, taken_at="2024-06-13T11:00:00")
    assert locate_sun_of(local) is None
    with pytest.raises(InputRejected, match="clock states no time zone"):
        find_tilt(local, TiltParams())
    in_file = dataclasses.replace(local, taken_at="2024-06-13T11:00:00+02:00")
    stated = dataclasses.replace(local, clock_offset="+02:00")
    assert find_tilt(stated, TiltParams()) == find_tilt(in_file, TiltParams())
    # K of a flight is interpolated on the camera's own clock, whatever is stated after the fit
    assert read_clock_s(stated) == read_clock_s(local)


def _normal(pitch, roll):
    """Upward normal (north, east, up) of a body that faces north."""
    return np.array([-math.sin(pitch) * math.cos(roll), math.sin(roll), math.cos(pitch) * math.cos(roll)])


def _enter(angle):
    """Schlick's form of what a surface of index 1.38 lets in: not the one under test."""
    return 1.0 - (0.38 / 2.38) ** 2 - (1.0 - (0.38 / 2.38) ** 2) * (1.0 - math.cos(angle)) ** 5


def simulate(zenith_deg, noise_rel, *, readings, seed, count):
    """Return by how many expanded uncertainties K errs, of panels and sensors that nobody levelled."""
    random = seeded(seed)
    header = dataclasses.replace(ROW.header, latitude_deg=zenith_deg, **EQUINOX)
    sun = locate_sun_of(header)
    up, azimuth = math.radians(sun.elevation_deg), math.radians(sun.azimuth_deg)
    towards = [math.cos(azimuth) * math.cos(up), math.sin(azimuth) * math.cos(up), math.sin(up)]
    two = math.radians(2.0)
    errors = []
    for _ in range(count):
        direct = 1.0 - min(0.5, max(0.0, random.normal(1 / 6, 0.1)))
        panel = _normal(*random.normal(0.0, two, 2)) @ towards / math.sin(up)
        stated = random.normal(0.0, math.radians(4.0), 2)
        angle = math.acos(_normal(*(stated + random.normal(0.0, two, 2))) @ towards)
        seen = direct * math.cos(angle) / math.sin(up) * _enter(angle) / _enter(0.0) + 1.0 - direct
        values = 43_000.0 * seen * (1.0 + noise_rel * random.standard_normal(readings))
        attitude = dict(zip(("pitch_deg", "roll_deg"), np.degrees(stated), strict=True)) | {"yaw_deg": 0.0}
        true_r = PANEL_R["green"] + 0.002 * random.standard_normal()
        if readings > 1:
            records = tuple(make_record(time_us=n, ch0=round(v), **attitude) for n, v in enumerate(values))
            counts = dataclasses.replace(make_band(gains=TABLE).counts, records=records)
            light, h = {"counts": counts}, 430_000.0
        else:
            stated_light = SunshineIrradiance(
                irradiance_w_m2_nm=values[0], quantity="spectral", unit_origin="tag", **attitude
            )
            light, h = {"counts": None, "irradiance": stated_light}, 43_000.0
        features = dataclasses.replace(ROW.features, i_sq=true_r * h * panel / 1300.0, gradient_rel=0.0)
        row = dataclasses.replace(ROW, header=header, features=features)
        found = k_of(reflectance.fit(change_band([row], **light), READINGS, STEADY)).coefficient
        errors.append((found.reflectance_k - 1300.0) / found.expanded_uncertainty)
    return np.array(errors)


@pytest.mark.parametrize("zenith_deg", [0.0, 50.0])
def test_k_lies_within_its_uncertainty_as_often_as_stated(zenith_deg):
    """Ten readings a file that scatter by 3 %; 150 fits scatter by 1.8 %."""
    errors = simulate(zenith_deg, 0.03, readings=10, seed=5, count=150)
    assert 0.90 < np.mean(np.abs(errors) < 1.0) < 0.995
