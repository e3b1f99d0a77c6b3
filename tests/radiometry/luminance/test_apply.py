"""From a coefficient back to a luminance, and what a frame gives to the fit."""

import math
from dataclasses import replace

import numpy as np
import pytest

from radiometry.findings import InputRejected, shared
from radiometry.frame.exposure import Exposure
from radiometry.frame.roi import Polygon, Window
from radiometry.luminance import application, codes
from radiometry.luminance import method as luminance
from radiometry.luminance.rows import Params, Reading
from radiometry.luminance.scenes import Change, check_reading_times, follow_lamp
from simulation.camera import Lamp, change, expose
from simulation.luminance import X5S
from simulation.targets import Surface
from tests.radiometry.campaigns import draw
from tests.radiometry.coefficients import apply_coefficient
from tests.radiometry.luminance.exact import DARK, DARKS, LIGHTS, PARAMS, READINGS, K, fit, light, statistics


def apply(mean_dn, *, exposure=None, model="proportional", **changes):
    coefficients = [f.coefficient for f in fit(params=replace(PARAMS, model=model)).iso_fits]
    exposure = exposure or Exposure(exposure_time_s=0.1, f_number=8.0, iso=3200.0)
    return apply_coefficient(
        statistics(mean_dn, **changes), exposure=exposure, coefficients=coefficients
    ), coefficients[0]


def test_apply_by_hand():
    """At a calibrated f-number its error is in K; of three times' errors K has a third each."""
    applied, coefficient = apply(DARK + 300.0)
    assert applied.luminance_cd_m2.value == pytest.approx(300.0 * 64 / (K * 0.1 * 3200))
    u_n = math.sqrt(20.0**2 / 10000)
    expected = math.sqrt(
        0.015**2
        + 0.01**2 / 3
        + 0.005**2 * ((1 - 1 / 3) ** 2 + 2 / 9)
        + (PARAMS.lamp_drift_u_rel / 2) ** 2
        + (u_n**2 + coefficient.at(0.1).dark_signal_standard_uncertainty_dn ** 2) / 300.0**2
    )
    u_rel = applied.luminance_cd_m2.standard_uncertainty / applied.luminance_cd_m2.value
    assert u_rel == pytest.approx(expected, rel=2e-3)
    assert applied.luminance_cd_m2.unit == "cd/m2"
    assert applied.flags == ()


def test_an_f_number_that_was_not_calibrated_has_its_whole_error():
    """At another f-number and another time K's own errors come first, then those of the frame's settings."""
    applied, coefficient = apply(
        DARK + 300.0, exposure=Exposure(exposure_time_s=0.5, f_number=11.0, iso=3200.0)
    )
    u_rel = applied.luminance_cd_m2.standard_uncertainty / applied.luminance_cd_m2.value
    expected = math.hypot(coefficient.luminance_k_standard_uncertainty / K, 2 * 0.015, 0.005)
    assert u_rel == pytest.approx(expected, rel=2e-3)
    assert {raised.flag for raised in applied.flags} == {"f_number_not_calibrated", "outside_exposure_times"}


def test_the_error_of_an_f_number_is_corrected_and_an_older_version_measures_as_before():
    """Frames at f/8 have 3 % more light. Without K per f-number L is wrong by it."""
    rows = [light(r.scene, 8.0, k=1.03 * K) if r.exposure.f_number == 8.0 else r for r in LIGHTS]
    coefficient = fit((*rows, *DARKS)).iso_fits[0].coefficient
    old = replace(coefficient, errors=None, apertures=None)
    exposure = Exposure(exposure_time_s=0.1, f_number=8.0, iso=3200.0)
    found, before = (
        apply_coefficient(statistics(DARK + 300.0), exposure=exposure, coefficients=[each])
        for each in (coefficient, old)
    )
    truth = 300.0 * 64 / (1.03 * K * 0.1 * 3200)
    assert found.luminance_cd_m2.value == pytest.approx(truth, rel=3e-3)
    assert before.luminance_cd_m2.value == pytest.approx(truth * 1.03 ** (2 / 3), rel=3e-3)
    assert before.luminance_cd_m2.standard_uncertainty / truth == pytest.approx(
        math.hypot(coefficient.luminance_k_standard_uncertainty / K, 0.03, 0.005), rel=0.02
    )
    aperture = next(each for each in coefficient.apertures if each.f_number == 8.0)
    assert application.luminance_per_dn(coefficient, exposure) * 300.0 == pytest.approx(
        found.luminance_cd_m2.value, rel=1e-12
    )
    assert aperture.luminance_k == pytest.approx(1.03 * K, rel=3e-3)
    assert application.luminance_per_dn(old, exposure) == pytest.approx(
        64 / (coefficient.luminance_k * 0.1 * 3200), rel=1e-12
    )


@pytest.mark.parametrize("model", ["affine", "power"])
def test_other_models_apply_to_the_same_luminance(model):
    applied, _ = apply(DARK + 300.0, model=model)
    assert applied.luminance_cd_m2.value == pytest.approx(300.0 * 64 / (K * 0.1 * 3200), rel=1e-6)
    assert 0.015 < applied.luminance_cd_m2.standard_uncertainty / applied.luminance_cd_m2.value < 0.1


def test_a_signal_below_dark_is_not_clipped():
    applied, _ = apply(DARK - 3.0)
    assert applied.luminance_cd_m2.value == pytest.approx(-3.0 * 64 / (K * 0.1 * 3200))
    assert [f.flag for f in applied.flags] == ["outside_signals", "below_detection"]


def test_a_model_without_an_answer_is_refused():
    with pytest.raises(InputRejected, match="no luminance for a signal of -3 DN") as refusal:
        apply(DARK - 3.0, model="power")
    assert refusal.value.code is shared.FIT_FAILED
    # a map needs one scale
    _, bent = apply(DARK + 300.0, model="affine")
    with pytest.raises(InputRejected, match="this one is affine"):
        application.luminance_per_dn(bent, LIGHTS[0].exposure)


@pytest.mark.parametrize(
    ("changes", "flag"),
    [
        ({"exposure_time_s": 0.3}, codes.OUTSIDE_EXPOSURE_TIMES),
        ({"f_number": 4.0}, codes.OUTSIDE_F_NUMBERS),
        ({"f_number": 22.0}, codes.OUTSIDE_F_NUMBERS),
        ({}, "saturated"),
    ],
)
def test_what_was_not_calibrated_is_flagged(changes, flag):
    exposure = Exposure(**{"exposure_time_s": 0.1, "f_number": 8.0, "iso": 3200.0, **changes})
    found, _ = apply(DARK + 300.0, exposure=exposure, saturated=0.0 if changes else 0.5)
    assert [f.flag for f in found.flags] == [flag]


def test_extract_measures_the_region_in_a_window():
    camera = change(X5S, height_px=80, width_px=90)
    settings = LIGHTS[0].exposure.on_basis("nominal")
    window = Window(row0=11, col0=20, height=30, width=40)
    lamp = Lamp(luminance_cd_m2=0.05)
    frame = expose(camera, Surface(), lamp, settings, np.random.default_rng(1), window=window)
    polygon = Polygon.from_points([(25, 15), (50, 18), (45, 38)])
    rows = luminance.extract(frame, polygon)
    assert [row.channel for row in rows] == ["R", "G1", "G2", "B", "grey"]
    assert rows[-1].n == pytest.approx(0.5 * abs(25 * 23 - 20 * 3), abs=30)
    with pytest.raises(InputRejected) as refusal:
        luminance.extract(frame, Polygon.from_points([(0, 0), (9, 0), (9, 9)]))
    assert refusal.value.code is shared.ROI_EMPTY


# --- A lamp that drifts between readings and frames


DAY = "2026-03-02T"


def read(scene, value, clock, quantity="luminance"):
    return Reading(scene=scene, quantity=quantity, value=value, taken_at=f"{DAY}{clock}+00:00")


def timed(rows, *, zone="", hour=10):
    return [replace(row, taken_at=f"{DAY}{hour:02d}:{10 * n:02d}:00{zone}") for n, row in enumerate(rows)]


@pytest.mark.parametrize(("zone", "hour"), [("+00:00", 10), ("+02:00", 12), ("", 10), ("", 21), ("", 3)])
def test_rate_of_two_readings(zone, hour):
    """A scene of 20 minutes; before and after it 5 and 5.1 cd/m2, each to 0.1 %: +2 % in 20 minutes."""
    rows = timed(LIGHTS[3:6], zone=zone, hour=hour)
    readings = [read("middle", 5.0, "10:00:00"), read("middle", 5.1, "10:20:00")]
    params = replace(PARAMS, meter_repeatability_rel=0.001)
    changes = [follow_lamp(rows, readings, params)[row.frame] for row in rows]
    assert [change.ratio for change in changes] == pytest.approx([0.9901, 1.0, 1.0099], abs=2e-4)
    # u(r T) = 0.1 % sqrt(2); half of it at either end
    assert [change.u_rel for change in changes] == pytest.approx([-0.0007, 0.0, 0.0007], rel=0.02)
    assert {change.label for change in changes} == {"middle"}


def test_illuminance_shows_the_drift_of_a_single_luminance_reading():
    rows = timed(LIGHTS[3:6])
    readings = [
        read("middle", 5.0, "10:00:00"),
        read("middle", 100.0, "10:00:00", "illuminance"),
        read("middle", 102.0, "10:20:00", "illuminance"),
    ]
    params = replace(PARAMS, meter_repeatability_rel=0.001)
    found = follow_lamp(rows, readings, params)
    assert [found[row.frame].ratio for row in rows] == pytest.approx([1.0, 1.01, 1.02], abs=3e-4)


def test_without_times_the_drift_is_a_doubt_common_to_all_scenes():
    """Half of a scene between reading and frame; with times, from 0 to the whole of it."""
    assert set(follow_lamp(LIGHTS, READINGS, PARAMS).values()) == {Change(level_u_rel=0.006)}
    rows = timed(LIGHTS[3:6])
    found = follow_lamp(rows, [read("middle", 5.0, "10:00:00")], PARAMS)
    assert [found[row.frame] for row in rows] == [Change(u_rel=u) for u in (0.0, 0.006, 0.012)]
    years_ago = [replace(row, taken_at=row.taken_at.replace("2026", "2015")) for row in rows]
    found = follow_lamp(years_ago, [read("middle", 5.0, "10:00:00")], PARAMS)
    assert [found[row.frame] for row in rows] == [
        Change(u_rel=pytest.approx(u), level_u_rel=0.008) for u in (-0.004, 0.0, 0.004)
    ]


@pytest.mark.parametrize(
    ("zone", "year", "clock", "detail"),
    [
        ("+00:00", "2026", "11:15:00", None),
        ("+00:00", "2026", "12:00:00", "1.7 h"),
        ("", "2026", "17:02:00", None),  # a clock seven hours behind, or a reading seven hours late
        ("+00:00", "2025", "10:00:00", "365 days"),
        ("", "2025", "10:00:00", "364 days"),
    ],
)
def test_a_reading_far_from_its_frames_is_told(zone, year, clock, detail):
    rows = [
        replace(row, taken_at=row.taken_at.replace("2026", year)) for row in timed(LIGHTS[3:6], zone=zone)
    ]
    readings = [read("middle", 5.0, "10:00:00" if zone else clock), read("middle", 5.0, clock)]
    found = check_reading_times(rows, readings)
    assert [(each.where, each.detail.split()[-6:-4]) for each in found] == (
        [("scene middle", detail.split())] if detail else []
    )


def test_iso_values_taken_in_turn_lie_apart_from_the_reading():
    """Frames at 0, 10 | 20, 30 min, a reading 10 min before or after: rms of 15 and 35 min from 5 min."""
    rows = [
        light("middle", 5.6, iso=iso, name=f"{iso:g}-{n}", taken_at=f"{DAY}10:{minute:02d}:00")
        for iso, minutes in ((3200.0, (0, 10)), (6400.0, (20, 30)))
        for n, minute in enumerate(minutes)
    ]
    found = [follow_lamp(rows, READINGS, PARAMS)[row.frame] for row in rows]
    per_minute = 0.012 / 40.0
    assert [each.u_rel for each in found] == pytest.approx([5 * s * per_minute for s in (-1, 1, -1, 1)])
    distance = math.sqrt((15.0**2 + 35.0**2) / 2.0)
    assert [each.level_u_rel for each in found] == pytest.approx([distance * per_minute] * 4)


def test_frames_show_by_their_own_times_how_steady_the_lamp_was():
    """Readings without times: a steady lamp lowers its line of the budget, one that drifts raises it."""

    def budget(drift, *, burst=False):
        drawn = draw(5, drift_rel=drift, timed=True)
        at_once = {"taken_at": DAY + "10:00:00"} if burst else {}
        rows = [replace(row, **at_once) for row in drawn.rows]
        readings = [replace(each, taken_at=None) for each in drawn.readings]
        lines = fit(rows, readings, Params(meter_repeatability_rel=0.01)).iso_fits[0].budget
        return next(line.u_rel for line in lines if line.source == "lamp drift")

    assert budget(0.0, burst=True) == pytest.approx(0.006)
    assert budget(0.0) < 0.0055
    assert budget(0.04) > 0.009
