"""Exponents of an exposure series: known truth, predicted errors, cuts, and a real Nikon D70."""

import csv
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from radiometry.findings import InputRejected, shared
from radiometry.tools.coverage import View, compute_coverage
from radiometry.tools.exponents import SeriesRow, fit_exponents

WHITE = 16384.0
DARK = {"R": 1.0, "G": 8.0, "B": 2.0}


def row(time_s=0.01, f_number=8.0, iso=200.0, *, signal_dn=None, dark_dn=0.0, **exponents):
    a, b, s = exponents.get("a", 1.0), exponents.get("b", -2.0), exponents.get("s", 1.0)
    signal = 40_000 * time_s**a * f_number**b * iso**s + dark_dn
    return SeriesRow(exposure_time_s=time_s, f_number=f_number, iso=iso, signal_dn=signal_dn or signal)


def read(path):
    with path.open() as lines:
        return [{name: float(value) for name, value in one.items()} for one in csv.DictReader(lines)]


@settings(max_examples=30)
@given(st.floats(0.5, 1.5), st.floats(-3.0, -1.0), st.floats(0.5, 1.5), st.floats(0.0, 60.0))
def test_the_truth_is_recovered(a, b, s, dark_dn):
    settings_of = [
        (time, f, iso) for time in (0.01, 0.02, 0.05) for f in (5.6, 8.0) for iso in (200.0, 400.0)
    ]
    rows = [row(*one, a=a, b=b, s=s, dark_dn=dark_dn) for one in settings_of]
    top = max(one.signal_dn for one in rows) * 1.2
    fit = fit_exponents(rows, dark_dn=dark_dn, white_level_dn=top)
    kept = {name: fit.exponents[name].value for name in fit.exponents}
    expected = {"exposure_time_s": a, "f_number": b, "iso": s}
    assert kept == pytest.approx({name: expected[name] for name in kept}, abs=1e-6)
    assert fit.used + len(fit.left_out) == len(rows)


def test_standard_errors_are_those_of_a_straight_line_of_logarithms():
    random, times = np.random.default_rng(5), np.geomspace(0.001, 0.02, 12)
    signals = 40_000 * times * 200 / 64 * (1 + 0.02 * random.standard_normal(12))
    rows = [row(t, signal_dn=signal) for t, signal in zip(times, signals.tolist(), strict=True)]
    found = fit_exponents(rows, dark_dn=0.0, white_level_dn=WHITE).exponents["exposure_time_s"]
    line = stats.linregress(np.log(times), np.log(signals))
    assert (found.value, found.standard_uncertainty) == pytest.approx((line.slope, line.stderr), rel=1e-6)


def test_what_is_cut_says_why():
    rows = [row(t) for t in (0.004, 0.008, 0.016, 0.032)]
    # 2500 / 0.02 s: 125 DN/ms; 1/256 of white is 64 DN
    dim, bright = row(0.0004), row(0.2)
    fit = fit_exponents([dim, *rows, bright], dark_dn=0.0, white_level_dn=WHITE)
    assert fit.used == 4
    assert [each.row for each in fit.left_out] == [0, 5]
    assert "1/256" in fit.left_out[0].reason
    assert "saturated" in fit.left_out[1].reason


@pytest.mark.parametrize(("share", "used"), [(0.0039, 4), (0.0040, 5), (0.949, 5), (0.951, 4)])
def test_the_cuts_lie_where_they_are_said_to_lie(share, used):
    rows = [row(t) for t in (0.004, 0.008, 0.016, 0.032)]
    edge = row(0.064, signal_dn=100.0 + share * (WHITE - 100.0))
    assert fit_exponents([*rows, edge], dark_dn=100.0, white_level_dn=WHITE).used == used


def test_dark_by_row_takes_the_place_of_the_tables():
    rows = [row(t, dark_dn=500.0 * t / 0.01) for t in (0.004, 0.008, 0.016, 0.032)]
    own = [SeriesRow(**{**vars(one), "dark_dn": 500.0 * one.exposure_time_s / 0.01}) for one in rows]
    found = fit_exponents(own, dark_dn=0.0, white_level_dn=WHITE).exponents["exposure_time_s"]
    assert found.value == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([row(0.01)] * 5, "No setting varies"),
        # 1/60 s, written with more digits and with fewer: 0.2 % apart
        (
            [row(t, signal_dn=2000.0 + n) for n, t in enumerate((1 / 60, 0.0167, 0.01667))],
            "No setting varies",
        ),
        ([row(0.01), row(0.02)], "need at least 3"),
        ([row(0.01 * k, iso=200.0 / k, signal_dn=3000 + k) for k in (1, 2, 4, 8)], "vary only together"),
        ([row(0.01, signal_dn=16384.0)] * 5, "No row can be used. Left out: row 0: saturated"),
    ],
)
def test_what_cannot_be_fitted_is_refused_with_what_to_do(rows, message):
    with pytest.raises(InputRejected, match=message) as refused:
        fit_exponents(rows, dark_dn=0.0, white_level_dn=WHITE)
    assert refused.value.code is shared.FIT_INCOMPLETE


@pytest.mark.parametrize("f_number", [11.0, 16.0])
@pytest.mark.parametrize("channel", ["R", "G", "B"])
def test_a_real_camera_is_linear_in_time(real_data, channel, f_number):
    rows = [
        SeriesRow(
            exposure_time_s=one["exposure_s"], f_number=one["f_number"], iso=200.0, signal_dn=one[channel]
        )
        for one in read(real_data / "nikon-d70" / "exposure_series.csv")
        if one["f_number"] == f_number
    ]
    fit = fit_exponents(rows, dark_dn=DARK[channel], white_level_dn=WHITE)
    assert list(fit.exponents) == ["exposure_time_s"]
    assert 1.00 <= fit.exponents["exposure_time_s"].value <= 1.02
    assert fit.exponents["exposure_time_s"].standard_uncertainty < 0.01
    assert len(fit.left_out) == len(rows) - fit.used > 20


@pytest.mark.parametrize("channel", ["R", "Gr", "Gb", "B"])
def test_a_real_camera_is_linear_in_iso(real_data, channel):
    rows = [
        SeriesRow(exposure_time_s=1 / 250, f_number=2.8, iso=one["iso"], signal_dn=one[channel])
        for one in read(real_data / "nikon-d70" / "iso_series_t1_250_f2.8.csv")
    ]
    fit = fit_exponents(rows, dark_dn=DARK[channel[0]], white_level_dn=WHITE)
    assert 0.98 <= fit.exponents["iso"].value <= 1.04


@pytest.mark.parametrize(("channel", "published"), [("R", 2.02), ("G", 2.04), ("B", 2.10)])
def test_a_real_lens_is_nearly_quadratic(real_data, channel, published):
    rows = [
        SeriesRow(exposure_time_s=1 / 250, f_number=one["f_number"], iso=200.0, signal_dn=one[channel])
        for one in read(real_data / "nikon-d70" / "aperture_series_t1_250.csv")
    ]
    found = fit_exponents(rows, dark_dn=DARK[channel], white_level_dn=WHITE).exponents["f_number"]
    assert -found.value == pytest.approx(published, abs=2 * found.standard_uncertainty)


def test_scatter_that_no_shutter_has_is_flagged():
    random = np.random.default_rng(3)
    times = np.geomspace(0.001, 0.02, 12)
    for scatter, flagged in ((0.02, []), (0.5, ["scatter_implausible"])):
        rows = [row(t, signal_dn=3000 * math.exp(scatter * random.normal())) for t in times]
        found = fit_exponents(rows, dark_dn=0.0, white_level_dn=WHITE)
        assert [each.flag for each in found.flags] == flagged


# --- Coverage: by hand, by the geometry of rays, and at the horizon


LENS = {"focal_length_mm": 9.0, "sensor_width_mm": 6.4, "sensor_height_mm": 4.8, "pixel_pitch_um": 4.65}


def view(**changes):
    return View(**({"height_m": 50.0, "tilt_deg": 0.0} | LENS | changes))


def cast(one, u_mm, v_mm):
    """Where a ray through (u, v) of the sensor meets the ground: by rotating it."""
    tilt, turn = math.radians(one.tilt_deg), math.radians(one.azimuth_deg)
    ray = np.array([u_mm, v_mm, -one.focal_length_mm])  # x right, y ahead, z up
    about_x = np.array([[1, 0, 0], [0, math.cos(tilt), -math.sin(tilt)], [0, math.sin(tilt), math.cos(tilt)]])
    about_z = np.array([[math.cos(turn), math.sin(turn), 0], [-math.sin(turn), math.cos(turn), 0], [0, 0, 1]])
    x, y, z = about_z @ about_x @ ray
    return np.array([x, y]) * one.height_m / -z


@pytest.mark.parametrize(("height_m", "gsd_m"), [(50.0, 0.0258), (300.0, 0.155)])
def test_a_nadir_camera_has_one_ground_sample_distance(height_m, gsd_m):
    seen = compute_coverage(view(height_m=height_m))
    for name in ("near", "centre", "far"):
        assert getattr(seen, f"gsd_{name}_m") == pytest.approx(gsd_m, rel=2e-3)
        assert getattr(seen, f"gsd_{name}_along_m") == pytest.approx(getattr(seen, f"gsd_{name}_m"))
    assert -seen.near_m == pytest.approx(seen.far_m)
    assert seen.far_m == pytest.approx(height_m * 2.4 / 9.0)


def test_the_field_of_view_follows_the_sensor_that_is_given():
    seen = compute_coverage(view())
    assert (seen.horizontal_fov_deg, seen.vertical_fov_deg) == pytest.approx((39.15, 29.86), abs=0.005)
    wide = compute_coverage(view(focal_length_mm=6.0))
    assert (wide.horizontal_fov_deg, wide.vertical_fov_deg) == pytest.approx((56.14, 43.60), abs=0.005)


def test_a_tilted_camera_by_hand():
    seen = compute_coverage(view(tilt_deg=45.0))
    half = math.degrees(math.atan(2.4 / 9.0))
    assert seen.near_m == pytest.approx(50.0 * math.tan(math.radians(45.0 - half)))
    assert seen.far_m == pytest.approx(50.0 * math.tan(math.radians(45.0 + half)))
    assert seen.gsd_centre_m == pytest.approx(50.0 / math.cos(math.radians(45.0)) * 4.65e-3 / 9.0)
    assert seen.gsd_centre_along_m == pytest.approx(seen.gsd_centre_m / math.cos(math.radians(45.0)))
    assert seen.gsd_near_m < seen.gsd_centre_m < seen.gsd_far_m
    assert not seen.horizon_in_view


views = st.builds(
    View,
    height_m=st.floats(1.0, 500.0),
    tilt_deg=st.floats(0.0, 60.0),
    azimuth_deg=st.floats(-360.0, 360.0),
    focal_length_mm=st.floats(8.0, 50.0),
    sensor_width_mm=st.floats(1.0, 6.0),
    sensor_height_mm=st.floats(1.0, 6.0),
    pixel_pitch_um=st.floats(1.0, 10.0),
)


@settings(max_examples=40)
@given(views)
def test_the_corners_are_where_rays_meet_the_ground(one):
    seen = compute_coverage(one)
    u, v = one.sensor_width_mm / 2, one.sensor_height_mm / 2
    rays = [cast(one, *corner) for corner in ((-u, -v), (u, -v), (u, v), (-u, v))]
    np.testing.assert_allclose(np.array(seen.footprint), rays, rtol=1e-9, atol=1e-9 * one.height_m)


@settings(max_examples=40)
@given(views)
def test_a_ground_sample_distance_is_the_way_between_two_rays(one):
    seen = compute_coverage(one)
    pitch, step = one.pixel_pitch_um * 1e-3, 1e-5
    for name, v in (("near", -one.sensor_height_mm / 2), ("centre", 0.0), ("far", one.sensor_height_mm / 2)):
        across = np.linalg.norm(cast(one, step, v) - cast(one, -step, v)) / (2 * step) * pitch
        along = np.linalg.norm(cast(one, 0.0, v + step) - cast(one, 0.0, v - step)) / (2 * step) * pitch
        assert getattr(seen, f"gsd_{name}_m") == pytest.approx(across, rel=1e-6)
        assert getattr(seen, f"gsd_{name}_along_m") == pytest.approx(along, rel=1e-6)


@pytest.mark.parametrize("tilt_deg", [75.0686, 80.0, 89.9])
def test_a_horizon_in_view_has_no_far_edge(tilt_deg):
    seen = compute_coverage(view(tilt_deg=tilt_deg))
    assert seen.horizon_in_view
    assert (seen.far_m, seen.gsd_far_m, seen.gsd_far_along_m, seen.footprint) == (None, None, None, None)
    assert math.isfinite(seen.near_m)
    assert math.isfinite(seen.gsd_centre_m)


def test_just_below_the_horizon_there_is_a_far_edge():
    assert compute_coverage(view(tilt_deg=75.0)).far_m > 10_000.0


@pytest.mark.parametrize("changes", [{"tilt_deg": 89.9999}, {"tilt_deg": -1.0}, {"height_m": 0.0}])
def test_what_cannot_be_is_refused(changes):
    with pytest.raises(ValueError, match="cannot be"):
        view(**changes)
