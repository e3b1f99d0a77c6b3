"""Reflectance of new frames: regions and maps, with their uncertainty, and what is refused."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radiometry.findings import InputRejected
from radiometry.frame.multispectral import SunshineCounts
from radiometry.reflectance import method as reflectance
from radiometry.reflectance import method as reflectance_method
from radiometry.reflectance.sun import TiltParams
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
    make_header,
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
    return reflectance_method.apply_features(
        each.features, header=each.header, coefficients=coefficients, **more
    )


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
    for each in field(i_ss=light):
        found = measure(each, alone)
        assert found.reflectance.value == pytest.approx(SURFACE[found.band] * light / 4300.0, rel=0.05)
        assert flags_of(found.flags) == {"panel_only"}
        assert found.i_ss is None


def test_the_stated_uncertainty_is_the_error_s():
    """Forty pairs of panel and surface: errors of R against the budget without panel and angle."""
    errors, stated = [], []
    for seed in range(40):
        rows = take(seeded(2 * seed), {"red_edge": PANEL_R["red_edge"]})
        exact_level = TiltParams(attitude_u_deg=0.0, diffuse_share_u=0.0)
        params = {"incidence_angle_u_deg": 0.0, "tilt": exact_level, "drift_half_hour_rel": 0.0}
        exact = [dataclasses.replace(each, standard_uncertainty=0.0) for each in READINGS]
        fit = reflectance.fit(rows, exact, reflectance.Params(**params))
        (each,) = field(2 * seed + 1, {"red_edge": 0.25})
        found = measure(each, [fit.band_fits[0].coefficient])
        errors.append(found.reflectance.value - 0.25)
        stated.append(found.reflectance.standard_uncertainty)
    rms, expected = np.sqrt(np.mean(np.square(errors))), np.sqrt(np.mean(np.square(stated)))
    assert 0.6 * expected < rms < 1.4 * expected  # the rms of 40 scatters by 11 %


def test_effects_add_up_to_the_uncertainty():
    found = measure(field()[0])
    total = math.hypot(*(effect.effect for effect in found.effects))
    assert total == pytest.approx(found.reflectance.standard_uncertainty)
    assert [effect.source for effect in found.effects if not effect.shared] == ["pixel noise"]


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
    bright = dataclasses.replace(record, gain_index=2, ch0=65535, ch1=round(12.1 * 430 / 5))
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


def test_the_cosine_of_a_sloping_surface_is_divided_out():
    (each, *_) = field()
    level, sloping = measure(each), measure(each, incidence_angle_deg=60.0)
    assert sloping.reflectance.value == pytest.approx(2 * level.reflectance.value)
    with pytest.raises(InputRejected, match="above 60"):
        measure(each, incidence_angle_deg=61.0)


def change_header(each, band=None, **changes):
    told = dataclasses.replace(each.header.multispectral, **(band or {}))
    return dataclasses.replace(each, header=dataclasses.replace(each.header, multispectral=told, **changes))


REFUSED = {
    "wrong_camera": ({}, {"serial": "OTHER"}),
    "wrong_sunshine_sensor": ({"sunshine_serial": "OTHER"}, {}),
    "sunshine_missing": ({"counts": None, "sunshine_missing": "none was connected"}, {}),
    "band_not_calibrated": ({"band": "thermal"}, {}),
}


@pytest.mark.parametrize("code", REFUSED)
def test_what_k_does_not_hold_for_is_refused(code):
    band, header = REFUSED[code]
    with pytest.raises(InputRejected) as refusal:
        measure(change_header(field()[0], band, **header))
    assert refusal.value.code == code


def test_panel_only_asks_for_no_sunshine_sensor():
    coefficients = calibrate(normalisation="panel_only")
    each = change_header(field()[0], {"sunshine_serial": "OTHER", "counts": None, "sunshine_missing": "none"})
    assert measure(each, coefficients).reflectance.value == pytest.approx(0.08, rel=0.05)


def test_a_file_of_another_kind_is_refused():
    each = dataclasses.replace(field()[0], header=make_header(None))
    with pytest.raises(InputRejected) as refusal:
        measure(each)
    assert refusal.value.code == "sensor_model_unusable"


def test_serials_are_compared_without_regard_to_case_and_flagged_when_absent():
    (each, *_) = field()
    assert measure(change_header(each, serial=each.header.serial.lower())).flags == ()
    found = measure(change_header(each, {"sunshine_serial": None}, serial=None))
    assert flags_of(found.flags) == {"serial_unknown", "sunshine_serial_unknown"}


def test_another_sensor_model_is_flagged():
    (each, *_) = field()
    model = dataclasses.replace(each.header.multispectral.sensor_model, a=3.1e8)
    assert flags_of(measure(change_header(each, {"sensor_model": model})).flags) == {"sensor_model_differs"}


def test_a_frame_after_the_last_panel_capture_is_flagged():
    assert measure(field()[0]).flags == ()
    late = measure(field(minutes=25.0)[0])
    assert flags_of(late.flags) == {"outside_panel_times"}


def test_k_follows_the_time_when_asked_to():
    drifted = {**BANDS, "green": dataclasses.replace(BANDS["green"], reflectance_k=1430.0)}
    later = dataclasses.replace(CAMERA, bands=drifted)
    rows = [*take(seeded(), PANEL_R), *take(seeded(2), PANEL_R, minutes=20.0, camera=later)]
    linear = calibrate(rows, interpolation="linear")
    ks = [measure(field(minutes=minutes)[0], linear).reflectance_k for minutes in (0.1, 10.0, 19.9)]
    assert ks == pytest.approx([1300.0, 1365.0, 1430.0], rel=0.02)
    constant = measure(field(minutes=1.0)[0], calibrate(rows, interpolation="constant"))
    assert constant.reflectance_k == pytest.approx(1365.0, rel=0.02)


def test_saturated_dark_and_impossible_regions_are_flagged():
    (bright,) = field(surface={"green": 1.5})
    assert {"saturated"} <= flags_of(measure(bright).flags)
    (dark,) = field(surface={"green": 0.0})
    found = measure(dark)
    assert {"below_detection"} <= flags_of(found.flags)
    assert abs(found.reflectance.value) < 4 * found.reflectance.standard_uncertainty
    below = dataclasses.replace(dark, features=dataclasses.replace(dark.features, i_sq=-0.01))
    assert measure(below).reflectance.value < 0
    assert {"reflectance_out_of_range", "below_detection"} <= flags_of(measure(below).flags)


def expose(surface, name="green", seed=3):
    return capture(CAMERA, seeded(seed), reflectance={name: surface}, taken_at=NOON)[name]


def map_of(shot, frame=None):
    scale = reflectance_method.find_scale_of_frame(shot.header, coefficients=COEFFICIENTS)
    return scale, reflectance_method.scale_pixels(
        frame or shot.frame, header=shot.header, exposure=shot.exposure, factor=scale.factor
    )


def test_the_map_gives_the_surface_within_its_uncertainty():
    """A ramp from 2 % to 20 %, in all corners of the lens."""
    rows, cols = np.mgrid[:120, :160]
    truth = 0.02 + 0.18 * (rows + cols) / 278
    scale, found = map_of(expose(truth))
    assert found.dtype == np.float32
    for part in (
        np.s_[:30, :40],
        np.s_[-30:, :40],
        np.s_[:30, -40:],
        np.s_[-30:, -40:],
        np.s_[45:75, 60:100],
    ):
        error = found[part].mean() / truth[part].mean() - 1
        noise = found[part].std() / truth[part].mean() / np.sqrt(1200)
        assert abs(error) < 3 * math.hypot(scale.u_rel, noise)


def test_the_map_s_mean_is_the_region_s_reflectance():
    shot = expose(0.1)
    scale, found = map_of(shot)
    features = extract(shot.frame, PANEL, header=shot.header, exposure=shot.exposure)
    applied = reflectance_method.apply_features(features, header=shot.header, coefficients=COEFFICIENTS)
    assert found[40:80, 50:110].mean() == pytest.approx(applied.reflectance.value, rel=1e-6)
    assert scale.band == "green"


def test_nothing_is_clipped_and_what_is_saturated_is_unknown():
    surface = np.zeros((120, 160))
    surface[:60] = 0.45
    shot = expose(surface)
    samples = shot.frame.samples_dn.copy()
    samples[0, :7] = 65472
    _, found = map_of(shot, dataclasses.replace(shot.frame, samples_dn=samples))
    assert np.isnan(found[0, :7]).all()
    assert np.count_nonzero(found < 0) > 1000  # half of the black half's noise


@given(st.integers(0, 100), st.integers(0, 140), st.integers(1, 20), st.integers(1, 20))
def test_blocks_make_the_whole_to_the_last_bit(row0, col0, height, width):
    part = dataclasses.replace(
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
