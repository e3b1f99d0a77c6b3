"""Reflectance of new frames: regions and maps, with their uncertainty, and what is refused."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radiometry.findings import InputRejected
from radiometry.fitting.curve import coverage_factor
from radiometry.frame.multispectral import Multispectral, RadianceModel, SunshineCounts
from radiometry.reflectance import method as reflectance
from radiometry.reflectance.findings import check_fit
from radiometry.reflectance.fit import compute_k
from radiometry.reflectance.results import Doubt
from simulation.sequoia import BANDS, capture
from tests.radiometry.reflectance.captures import (
    CAMERA,
    NOON,
    PANEL,
    PANEL_R,
    READINGS,
    change_band,
    extract,
    flags_of,
    k_of,
    make_header,
    panel,
    seeded,
    take,
)

SURFACE = {"green": 0.08, "red": 0.05, "red_edge": 0.25, "nir": 0.40}


def calibrate(rows=None, **params):
    rows = rows or [*take(seeded(), PANEL_R), *take(seeded(2), PANEL_R, minutes=20.0)]
    fit = reflectance.fit(rows, READINGS, reflectance.Params(**params))
    return tuple(each.coefficient for each in fit.band_fits)


COEFFICIENTS = calibrate()


def measure(each, coefficients=COEFFICIENTS, **more):
    return reflectance.apply_features(each.features, header=each.header, coefficients=coefficients, **more)


def field(seed=3, surface=SURFACE, **more):
    return take(seeded(seed), surface, **{"role": "field", "minutes": 10.0} | more)


@pytest.mark.parametrize("light", [1500.0, 4300.0, 5500.0])
def test_a_surface_comes_back_whatever_the_light(light):
    """The sunshine sensor takes the change of light out; panel_only does not."""
    for each in field(i_ss=light):
        found = measure(each)
        truth = SURFACE[found.band]
        assert abs(found.reflectance.value - truth) < 3 * found.reflectance.standard_uncertainty
        assert found.reflectance.standard_uncertainty < 0.05 * truth
        assert found.i_ss == pytest.approx(light, rel=0.03)
    alone = calibrate(normalisation="panel_only")
    none = {"sunshine_serial": "OTHER", "counts": None, "sunshine_missing": "none"}
    for each in field(i_ss=light):
        found = measure(change_header(each, none), alone)
        assert found.reflectance.value == pytest.approx(SURFACE[found.band] * light / 4300.0, rel=0.05)
        assert flags_of(found.flags) == {"panel_only"}
        assert found.i_ss is None


def test_effects_add_up_to_the_uncertainty():
    found = measure(field()[0])
    total = math.hypot(*(effect.effect for effect in found.effects))
    assert total == pytest.approx(found.reflectance.standard_uncertainty)
    assert [effect.source for effect in found.effects if not effect.shared] == ["pixel noise"]


def test_k_of_a_reflectance_by_hand():
    """3 % of what is known with 9 degrees of freedom, 4 % of single readings with 1, which count as 2."""
    k, dof = Doubt(0.04**2, 0.03**4 / 9.0, 1.0).scale(0.5).expand(0.025**2)
    assert k * 0.025 == pytest.approx(0.5 * math.hypot(2.2622 * 0.03, 4.3027 * 0.04), rel=1e-4)
    assert coverage_factor(dof) == pytest.approx(k)
    assert Doubt(0.0, 0.0, 2.0).expand(0.05**2) == (pytest.approx(1.95996, rel=1e-5), math.inf)


def test_a_frame_s_single_reading_is_as_unsure_as_the_panel_s():
    """Of one sensor's noise: both together, with the degrees of freedom that the fit found."""
    (row,) = take(seeded(), {"green": PANEL_R["green"]}, gain_indices=(1,))
    k = reflectance.fit([row], READINGS, reflectance.Params()).band_fits[0].coefficient
    (alone,), (several,) = field(surface={"green": 0.3}, gain_indices=(1,)), field(surface={"green": 0.3})
    found, more = (measure(each, [k]) for each in (alone, several))
    assert (k.reading_dof, k.knots[0].single_u_rel) == (1.0, pytest.approx(0.025, rel=0.01))
    assert found.doubt.single == pytest.approx(2 * (0.025 * found.reflectance.value) ** 2, rel=0.01)
    assert more.doubt.single == pytest.approx((0.025 * more.reflectance.value) ** 2, rel=0.01)
    # a version of before: all that its visits have of their own may be single readings
    older = replace(k.knots[0], single_u_rel=None, own_doubt=None)
    told = measure(alone, [replace(k, knots=(older,), reading_dof=None, drift_dof=None)])
    factors = [each.doubt.expand(each.reflectance.standard_uncertainty**2)[0] for each in (told, found, more)]
    assert 3.0 < factors[2] < factors[1] <= factors[0] < 4.3


def test_a_gain_s_error_cancels_at_the_same_gain_and_counts_at_another():
    rows = take(seeded(), PANEL_R, gain_indices=(0,) * 10)
    coefficients = calibrate(rows)
    same = measure(field(gain_indices=(0,) * 10)[0], coefficients)
    other = measure(field()[0], coefficients)
    mixed = measure(field(gain_indices=(0, 1) * 5)[0], coefficients)
    gain = {effect.source: effect.effect for effect in same.effects}["sunshine gain"]
    assert gain == 0.0
    u_rel = math.sqrt(1 / 12) * math.hypot(1 / 114, 1 / 3300)  # 3300 counts, times 0.0345
    for found, expected in ((other, u_rel), (mixed, math.sqrt(2) * u_rel)):
        gain = {effect.source: effect.effect for effect in found.effects}["sunshine gain"]
        assert gain == pytest.approx(expected * found.reflectance.value, rel=1e-3)


def saturate(rows):
    """Ten readings at index 2, where CH0 has stopped and CH1 counts a fifth of it."""
    (found,) = {row.header.multispectral.counts.gains for row in rows}
    record = rows[0].header.multispectral.counts.records[0]
    bright = replace(record, gain_index=2, ch0=65535, ch1=round(12.1 * 430 / 5))
    counts = SunshineCounts(record_bytes=28, cut_short=False, records=(bright,) * 10, gains=found)
    return change_band(rows, counts=counts)


def test_a_saturated_channel_0_is_rescued_by_the_ratio_of_the_panel():
    """The simulated channels are 5 to 1 under the sun and 4 to 1 in the table."""
    (each,) = saturate(field(surface={"green": 0.25}))
    found = measure(each, calibrate(take(seeded(), {"green": PANEL_R["green"]})))
    assert "sunshine_second_channel" in flags_of(found.flags)
    assert found.i_ss == pytest.approx(4300.0, rel=0.02)
    gain = {effect.source: effect.effect for effect in found.effects}["sunshine gain"]
    assert 0.001 < gain / found.reflectance.value < 0.01
    alone = calibrate(saturate(take(seeded(), {"green": PANEL_R["green"]})))
    (panel_too,) = alone
    assert panel_too.gain_u_rel == pytest.approx(0.35, rel=0.01)
    found = measure(each, alone)
    assert {effect.source: effect.effect for effect in found.effects}["sunshine gain"] == 0.0
    assert found.reflectance.value == pytest.approx(0.25, rel=0.02)


def test_the_cosine_of_a_sloping_surface_or_panel_is_divided_out():
    (each, *_) = field()
    level, sloping = measure(each), measure(each, incidence_angle_deg=60.0)
    assert sloping.reflectance.value == pytest.approx(2 * level.reflectance.value)
    with pytest.raises(InputRejected, match="above 60"):
        measure(each, incidence_angle_deg=61.0)
    level, tilted = (calibrate(panel(), incidence_angle_deg=angle)[0].reflectance_k for angle in (0.0, 60.0))
    assert tilted == pytest.approx(level / 2)
    with pytest.raises(InputRejected, match="above 60") as refusal:
        calibrate(panel(), incidence_angle_deg=60.1)
    assert refusal.value.code == "panel_angle_too_large"


def change_header(each, band=None, **changes):
    told = replace(each.header.multispectral, **(band or {}))
    return replace(each, header=replace(each.header, **{"multispectral": told} | changes))


REFUSED = {
    "wrong_camera": ({}, {"serial": "OTHER"}),
    "wrong_sunshine_sensor": ({"sunshine_serial": "OTHER"}, {}),
    "sunshine_missing": ({"counts": None, "sunshine_missing": "none was connected"}, {}),
    "band_not_calibrated": ({"band": "thermal"}, {}),
    "sensor_model_unusable": ({}, {"multispectral": None}),
}


@pytest.mark.parametrize("code", REFUSED)
def test_what_k_does_not_hold_for_is_refused(code):
    band, header = REFUSED[code]
    with pytest.raises(InputRejected) as refusal:
        measure(change_header(field()[0], band, **header))
    assert refusal.value.code == code


def test_serials_are_compared_without_regard_to_case_and_flagged_when_absent():
    (each, *_) = field()
    assert measure(change_header(each, serial=each.header.serial.lower())).flags == ()
    found = measure(change_header(each, {"sunshine_serial": None}, serial=None))
    assert flags_of(found.flags) == {"serial_unknown", "sunshine_serial_unknown"}


def test_another_sensor_model_and_a_time_after_the_last_panel_capture_are_flagged():
    (each, *_) = field()
    assert measure(each).flags == ()
    model = replace(each.header.multispectral.sensor_model, a=3.1e8)
    assert flags_of(measure(change_header(each, {"sensor_model": model})).flags) == {"sensor_model_differs"}
    assert flags_of(measure(field(minutes=25.0)[0]).flags) == {"outside_panel_times"}


def test_saturated_dark_and_impossible_regions_are_flagged():
    (bright,) = field(surface={"green": 1.5})
    assert {"saturated"} <= flags_of(measure(bright).flags)
    (dark,) = field(surface={"green": 0.0})
    found = measure(dark)
    assert {"below_detection"} <= flags_of(found.flags)
    assert abs(found.reflectance.value) < 4 * found.reflectance.standard_uncertainty
    below = replace(dark, features=replace(dark.features, i_sq=-0.01))
    assert measure(below).reflectance.value < 0
    assert {"reflectance_out_of_range", "below_detection"} <= flags_of(measure(below).flags)


def expose(surface, name="green", seed=3):
    return capture(CAMERA, seeded(seed), reflectance={name: surface}, taken_at=NOON)[name]


def map_of(shot, frame=None):
    scale = reflectance.find_scale_of_frame(shot.header, coefficients=COEFFICIENTS)
    return scale, reflectance.scale_pixels(
        frame or shot.frame, header=shot.header, exposure=shot.exposure, factor=scale.factor
    )


def test_the_map_s_mean_is_the_region_s_reflectance():
    shot = expose(0.1)
    scale, found = map_of(shot)
    features = extract(shot.frame, PANEL, header=shot.header, exposure=shot.exposure)
    applied = reflectance.apply_features(features, header=shot.header, coefficients=COEFFICIENTS)
    assert found[40:80, 50:110].mean() == pytest.approx(applied.reflectance.value, rel=1e-6)
    assert (scale.band, found.dtype) == ("green", np.float32)


def test_nothing_is_clipped_and_what_is_saturated_is_unknown():
    surface = np.zeros((120, 160))
    surface[:60] = 0.45
    shot = expose(surface)
    samples = shot.frame.samples_dn.copy()
    samples[0, :7] = 65472
    _, found = map_of(shot, replace(shot.frame, samples_dn=samples))
    assert np.isnan(found[0, :7]).all()
    assert np.count_nonzero(found < 0) > 1000  # half of the black half's noise


@given(st.integers(0, 100), st.integers(0, 140), st.integers(1, 20), st.integers(1, 20))
def test_blocks_make_the_whole_to_the_last_bit(row0, col0, height, width):
    part = replace(
        BLOCK_SHOT.frame,
        samples_dn=BLOCK_SHOT.frame.samples_dn[row0 : row0 + height, col0 : col0 + width],
        row0=row0,
        col0=col0,
    )
    _, block = map_of(BLOCK_SHOT, part)
    np.testing.assert_array_equal(block, BLOCK_MAP[row0 : row0 + height, col0 : col0 + width])


BLOCK_SHOT = expose(0.2)
BLOCK_MAP = map_of(BLOCK_SHOT)[1]


@pytest.mark.parametrize("interpolation", ["linear", "constant"])
def test_a_header_without_a_time_takes_the_mean_and_says_so(interpolation):
    timeless = change_header(field()[0], taken_at=None)
    found = measure(timeless, calibrate(interpolation=interpolation))
    assert flags_of(found.flags) == {"tilt_not_correctable", "outside_panel_times"}


# --- K from panel captures: by hand, from simulated captures of known truth, with its budget


PARAMS = reflectance.Params()


def test_k_by_hand():
    """R = .18, theta = 30 degrees, I_ss = 4300, I_sq = .5 -> 1340.6."""
    k = compute_k(reflectance=0.18, incidence_angle_deg=30.0, i_sq=0.5, i_ss=4300.0)
    assert k == pytest.approx(1340.6, abs=0.05)
    alone = compute_k(reflectance=0.18, incidence_angle_deg=0.0, i_sq=0.5, i_ss=None)
    assert alone == pytest.approx(0.36)


def test_the_budget_adds_up():
    params = reflectance.Params(incidence_angle_deg=30.0, drift_half_hour_rel=0.0, interpolation="constant")
    fit = k_of(reflectance.fit([*panel(), *panel(2, minutes=20.0)], READINGS, params))
    shares = {entry.source: entry.u_rel for entry in fit.budget}
    assert shares["panel reflectance"] == pytest.approx(0.002 / 0.18)
    two_degrees = math.radians(2.0)
    assert shares["panel angle"] == pytest.approx(
        math.hypot(math.tan(math.radians(30)) * two_degrees, two_degrees**2 / 2)
    )
    assert shares["drift"] == pytest.approx(abs(fit.drift_rel) / math.sqrt(12))
    total = math.hypot(*shares.values()) * fit.coefficient.reflectance_k
    assert fit.coefficient.reflectance_k_standard_uncertainty == pytest.approx(total)
    assert sum(entry.variance_share for entry in fit.budget) == pytest.approx(1.0)
    assert fit.coefficient.coverage_factor == pytest.approx(1.96, abs=0.001)


def test_panel_only_leaves_the_sunshine_out():
    rows = change_band(panel(), counts=None, sunshine_missing="no sensor was connected")
    params = reflectance.Params(normalisation="panel_only")
    found = reflectance.fit(rows, READINGS, params)
    fit = k_of(found)
    assert fit.coefficient.reflectance_k == pytest.approx(BANDS["green"].reflectance_k / 4300.0, rel=0.02)
    assert (fit.coefficient.reflectance_k_unit, fit.coefficient.i_ss_range) == ("1", None)
    assert fit.coefficient.sunshine_serial is None
    assert "panel_only" in flags_of(found.flags)
    with pytest.raises(InputRejected, match="no sensor was connected") as refusal:
        reflectance.fit(rows, READINGS, PARAMS)
    assert refusal.value.code == "sunshine_missing"


def radiance_row(**band):
    features = replace(
        panel()[0].features, band="blue", i_sq=0.17028382, i_sq_unit="W/(m2*sr*nm)", gradient_rel=0.0
    )
    model = RadianceModel(a1=1.5e-4, a2=1.2e-7, a3=1.4e-6)
    told = Multispectral(system="micasense", band="blue", band_name="Blue", radiance_model=model, **band)
    header = make_header(told, serial="1777777", taken_at="2017-10-19T20:40:39")
    return replace(panel()[0], frame="blue", header=header, features=features)


def test_a_panel_that_the_camera_recognised_serves_where_nothing_is_stated():
    params = reflectance.Params(normalisation="panel_only")
    row = radiance_row(panel_serial="RP04-1901231-SC", panel_albedo=0.49)
    assert reflectance.missing([row], (), params) == ()
    found = reflectance.fit([row], (), params)
    coefficient = found.band_fits[0].coefficient
    assert (coefficient.panel, coefficient.panel_reflectance) == ("RP04-1901231-SC", 0.49)
    # E = pi L / albedo, R = pi L / E: K = albedo / L
    assert coefficient.reflectance_k == pytest.approx(0.49 / 0.17028382)
    assert coefficient.reflectance_k_unit == "m2*sr*nm/W"
    assert {"panel_from_file", "panel_uncertainty_missing"} <= flags_of(found.flags)
    stated = [
        reflectance.Reading(panel=coefficient.panel, band="blue", reflectance=0.5, standard_uncertainty=0.01)
    ]
    found = reflectance.fit([row], stated, params)
    assert found.band_fits[0].coefficient.panel_reflectance == 0.5
    assert not {"panel_from_file", "panel_uncertainty_missing"} & flags_of(found.flags)


@pytest.mark.parametrize(
    "wrong", [{"reflectance": 0.0}, {"reflectance": 1.3}, {"standard_uncertainty": -0.1}]
)
def test_reflectances_that_cannot_be(wrong):
    with pytest.raises(ValueError, match="cannot be"):
        reflectance.Reading(**{"panel": "P", "band": "red", "reflectance": 0.5} | wrong)


@pytest.mark.parametrize(("k", "flagged"), [(math.pi, False), (2.5, False), (1.45, True), (6.8, True)])
def test_k_in_absolute_units_is_near_pi(k, flagged):
    """A wrong panel, 0.244 for 0.53, and one in the shadow of whoever holds it."""
    fit = k_of(reflectance.fit(panel(), READINGS, PARAMS))
    absolute = replace(fit.coefficient, reflectance_k=k, reflectance_k_unit="sr")
    used = [
        SimpleNamespace(
            features=SimpleNamespace(gradient_rel=0.0),
            panel=SimpleNamespace(from_file=False, age_days=0.0, states_uncertainty=True),
        )
    ]
    found = check_fit(replace(fit, coefficient=absolute), used)
    assert ("implausible_reflectance_k" in flags_of(found)) is flagged
