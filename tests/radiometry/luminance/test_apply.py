"""From a coefficient back to a luminance, and what a frame gives to the fit."""

import dataclasses
import math

import numpy as np
import pytest

from radiometry.findings import InputRejected, shared
from radiometry.frame.exposure import Exposure
from radiometry.frame.roi import Polygon, Window
from radiometry.luminance import application, codes
from radiometry.luminance import method as luminance
from simulation.camera import Lamp, change, expose
from simulation.luminance import X5S
from simulation.targets import Surface
from tests.radiometry.coefficients import apply_coefficient
from tests.radiometry.luminance.exact import DARK, DARKS, LIGHTS, PARAMS, K, fit, light, statistics


def apply(mean_dn, *, exposure=None, model="proportional", **changes):
    coefficients = [f.coefficient for f in fit(params=dataclasses.replace(PARAMS, model=model)).iso_fits]
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
    old = dataclasses.replace(coefficient, errors=None, apertures=None)
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


@pytest.mark.parametrize(
    ("changes", "flag"),
    [
        ({"exposure_time_s": 0.3}, codes.OUTSIDE_EXPOSURE_TIMES),
        ({"f_number": 4.0}, codes.OUTSIDE_F_NUMBERS),
        ({"f_number": 22.0}, codes.OUTSIDE_F_NUMBERS),
    ],
)
def test_what_was_not_calibrated_is_flagged(changes, flag):
    exposure = Exposure(**{"exposure_time_s": 0.1, "f_number": 8.0, "iso": 3200.0, **changes})
    assert [f.flag for f in apply(DARK + 300.0, exposure=exposure)[0].flags] == [flag]


def test_a_saturated_measurement_is_flagged():
    assert [f.flag for f in apply(DARK + 1000.0, saturated=0.5)[0].flags] == ["saturated"]


def test_an_unknown_iso_is_refused():
    with pytest.raises(InputRejected, match="taken at ISO 1600; this calibration holds ISO 3200") as refusal:
        apply(500.0, exposure=Exposure(exposure_time_s=0.1, f_number=8.0, iso=1600.0))
    assert refusal.value.code is codes.ISO_NOT_CALIBRATED


def test_the_map_scale_agrees_with_apply():
    applied, coefficient = apply(DARK + 300.0)
    exposure = Exposure(exposure_time_s=0.1, f_number=8.0, iso=3200.0)
    assert 300.0 * application.luminance_per_dn(coefficient, exposure) == pytest.approx(
        applied.luminance_cd_m2.value
    )
    _, bent = apply(DARK + 300.0, model="affine")
    with pytest.raises(InputRejected, match="this one is affine"):
        application.luminance_per_dn(bent, exposure)


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
