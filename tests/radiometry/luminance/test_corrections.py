"""Errors of the field: by hand, and intervals that hold the truth where the field contains them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from radiometry.frame.exposure import Exposure, Settings
from radiometry.frame.grid import Grid
from radiometry.frame.roi import Polygon
from radiometry.luminance.corrections import (
    compute_flicker,
    correct_flicker,
    correct_focus,
    correct_spectrum,
    correct_stray_light,
)
from radiometry.luminance.fit import compute_risk, decide
from radiometry.luminance.maps import compute_map, find_map_scale
from radiometry.luminance.measurement import Request, find_window, measure
from radiometry.luminance.rows import CalibrationConditions, FieldConditions
from radiometry.spectral import mismatch
from store.codec import encode
from tests.radiometry.coefficients import COEFFICIENT
from tests.radiometry.frames import frame_of

LAB = CalibrationConditions(
    lamp="A",
    camera_response="Hasselblad L2D-20c",
    colour=(0.5, 0.4),
    focus_distance_m=1.0,
    focal_length_mm=15.0,
)
KNOWN = replace(COEFFICIENT, conditions=LAB)
SETTINGS = Settings(exposure_time_s=0.02, f_number=4.0, iso=3200.0)


def flagged(raised):
    return [each.flag for each in raised]


@pytest.mark.parametrize(
    ("time_s", "percent"), [(1 / 8, 2.5), (1 / 60, 16.5), (1 / 125, 23.4), (1 / 50, 0.0), (1 / 25, 0.0)]
)
def test_flicker_of_50_hz_mains_by_hand(time_s, percent):
    assert 100 * compute_flicker(time_s, mains_frequency_hz=50) == pytest.approx(percent, abs=0.05)


def test_flicker_is_a_line_and_flagged_where_the_mains_is_assumed():
    settings = replace(SETTINGS, exposure_time_s=1 / 125)
    stated = FieldConditions(mains_frequency_hz=50.0, flicker_modulation=0.5)
    line, raised = correct_flicker(stated, settings, frames=4)
    assert line.u_rel == pytest.approx(0.5 * 0.2339 / math.sqrt(2) / 2, rel=0.02)
    assert not raised
    long = replace(SETTINGS, exposure_time_s=2.0)
    assert not correct_flicker(FieldConditions(), long, frames=1)[1]
    assert not correct_flicker(FieldConditions(flicker_modulation=0.0), SETTINGS, frames=1)[1]


def test_focus_by_hand():
    """(1 + 15 / 985)^2 is 3.07 % at 1 m, (1 + 15 / 1985)^2 1.52 % at 2 m."""
    line = correct_focus(FieldConditions(distance_m=2.0), KNOWN)
    assert line.factor == pytest.approx(1.01517 / 1.03069, rel=1e-5)
    assert line.u_rel == pytest.approx(0.25 * (1 - line.factor))
    assert correct_focus(FieldConditions(distance_m=1.0), KNOWN).factor == 1.0
    left = correct_focus(FieldConditions(distance_m=2.0, lens_focus="unchanged"), KNOWN)
    assert (left.factor, left.u_rel, left.assumed) == (1.0, 0.0, None)
    # of unknown distances the largest effect, from the calibration's 1 m to far away
    for coefficient in (KNOWN, COEFFICIENT):
        line = correct_focus(FieldConditions(), coefficient)
        assert line.factor == 1.0
        assert line.u_rel == pytest.approx(0.0307 / math.sqrt(3), rel=0.04)


def test_stray_light_by_hand():
    line, raised = correct_stray_light(FieldConditions(glare_share=0.02), 5.0)
    assert (line.offset_cd_m2, line.u_cd_m2) == (pytest.approx(0.1), pytest.approx(0.1 * 0.5 / math.sqrt(3)))
    assert not raised
    for mean, u in ((None, 0.0), (5.0, 0.04 * 5.0 * math.sqrt((1 + 1 / 12) / 3))):
        line, raised = correct_stray_light(FieldConditions(), mean)
        assert (line.offset_cd_m2, line.u_cd_m2) == (0.0, pytest.approx(u))
        assert [(each.flag, each.where) for each in raised] == [("stray_light_unknown", "min")]


def test_spectrum_is_corrected_as_far_as_it_is_known():
    pair = {"channel": "green", "calibrated": "A"}
    # both known
    line, raised = correct_spectrum(FieldConditions(light_source="HP1"), KNOWN, None)
    assert line.factor == pytest.approx(
        mismatch.compute_mismatch(LAB.camera_response, **pair, measured="HP1")
    )
    assert line.u_rel == mismatch.estimate_u_rel(LAB.camera_response, **pair, measured="HP1")
    assert not raised
    # the same lamp needs no response
    bare = replace(COEFFICIENT, conditions=CalibrationConditions(lamp="cie a"))
    line, raised = correct_spectrum(FieldConditions(light_source="A"), bare, None)
    assert (line.factor, line.u_rel, raised) == (1.0, 0.02, ())
    # only the colour of the region
    remedy = mismatch.fit_colour_remedy((LAB.camera_response,), channel="green", calibrated=("A",))
    line, raised = correct_spectrum(FieldConditions(), KNOWN, (0.4, 0.8))
    assert line.factor == pytest.approx(remedy.predict(0.8, 2.0))
    assert line.u_rel == remedy.u_rel
    assert not raised
    # a colour that no lamp has, and nothing at all
    for coefficient, colour in ((KNOWN, (50.0, 0.4)), (KNOWN, None), (COEFFICIENT, (0.4, 0.8))):
        line, raised = correct_spectrum(FieldConditions(), coefficient, colour)
        assert (line.factor, line.u_rel) == (1.0, 0.1)
        assert flagged(raised) == ["spectral_mismatch_unknown"]
    line, raised = correct_spectrum(FieldConditions(spectral_mismatch_u_rel=0.03), COEFFICIENT, None)
    assert (line.u_rel, raised) == (0.03, ())


EXPOSURE = Exposure(exposure_time_s=0.01, f_number=4.0, iso=3200.0)
CORNERS = ((8.0, 8.0), (40.0, 8.0), (40.0, 40.0), (8.0, 40.0))
ROI = Polygon.from_points(CORNERS)
PER_DN = 16 / (30 * 0.01 * 3200)


def test_mean_cells_and_map_contain_the_same_corrections():
    samples = np.full((64, 96), 256.0 + 1000.0)
    samples[8:40, 8:24] = 256.0 + 200.0
    conditions = FieldConditions(light_source="HP1", distance_m=2.0, glare_share=0.05)
    request = Request(polygon=ROI, grid=Grid(corners=CORNERS, rows=1, columns=2), conditions=conditions)
    window = find_window(request, height_px=64, width_px=96)
    assert (window.height, window.width) == (64, 96)
    frame = frame_of(samples, clipped=True)
    found = measure(frame, request, exposure=EXPOSURE, coefficients=(KNOWN,), calibrated=(ROI,))
    by_source = {each.source: each for each in found.corrections}
    factor = by_source["spectral mismatch"].factor * by_source["focus distance"].factor
    # glare by hand: 5 % of the whole frame's mean, which is not yet corrected by the factor
    glare = 0.05 * (1000 - 800 * 32 * 16 / (64 * 96)) * PER_DN
    assert by_source["stray light"].offset_cd_m2 == pytest.approx(glare, rel=0.01)
    dark, bright = (dn * PER_DN * factor - glare for dn in (200.0, 1000.0))
    cells = [cell.value for cell in found.surface.cells[0]]
    assert cells == pytest.approx([dark, bright], rel=2e-3)
    assert found.surface.u_o.value == pytest.approx(2 * dark / (dark + bright), rel=3e-3)
    scale = find_map_scale((KNOWN,), EXPOSURE, corrections=found.corrections)
    values = compute_map(frame, scale)
    assert values[9:39, 9:22].mean() == pytest.approx(dark, rel=2e-3)
    assert values[50:, 50:].mean() == pytest.approx(bright, rel=2e-3)
    assert found.mean.standard_uncertainty == pytest.approx(
        math.hypot(*(share.standard_uncertainty_cd_m2 for share in found.budget))
    )
    # a factor cancels in a ratio, glare does not
    u = {share.source: share.standard_uncertainty_cd_m2 for share in found.budget}
    assert found.surface.u_o.standard_uncertainty > u["stray light"] / bright / 4


def test_decision_rules_by_hand():
    """Two-sided 95 % of Student's t is 1.960 for infinite degrees of freedom and 2.776 for 4."""
    inf, simple, guarded, shared = math.inf, "simple", "guarded", "shared_risk"
    for residual, u, dof, accepting in (
        (0.03, 0.019, inf, {None, simple, guarded, shared}),
        (0.03, 0.022, inf, {None, simple, guarded}),  # 1.645 u = 3.6 %, U = 4.3 %
        (0.03, 0.022, 4, {None, simple}),  # t_95 = 2.132
        (0.05, 0.019, inf, {guarded}),
        (0.03, inf, inf, {None, simple}),
    ):
        stated = {"residual_rel": residual, "u_rel": u, "dof": dof, "tolerance_rel": 0.04}
        assert {rule for rule in (None, simple, guarded, shared) if decide(rule, **stated)} == accepting
    # one, and two and a half standard uncertainties; two of four degrees of freedom
    assert compute_risk(u_rel=0.04, dof=inf, tolerance_rel=0.04) == pytest.approx(0.3173, abs=1e-4)
    assert compute_risk(u_rel=0.016, dof=inf, tolerance_rel=0.04) == pytest.approx(0.0124, abs=1e-4)
    assert compute_risk(u_rel=0.02, dof=4, tolerance_rel=0.04) == pytest.approx(0.1161, abs=1e-4)
    assert compute_risk(u_rel=0.0, dof=inf, tolerance_rel=0.04) == 0.0


# --- Light profile of a place: its lines by hand, and intervals that hold the truth of simulated nights


AT_250 = Settings(exposure_time_s=1 / 250, f_number=4.0, iso=3200.0)


def flicker_of(*, at=AT_250, **stated):
    return correct_flicker(FieldConditions(**stated), at, frames=1)


def test_flicker_of_a_kind_by_hand():
    """LED on 50 Hz: sin(0.4 pi) / (0.4 pi) = 0.7568; E[m^2] = 0.01 / 3 over 0 to 0.1; 1/2 over the phase.

    The 95 % quantile of so small errors is 2 % more than 1.96 times that.
    """
    line, raised = flicker_of(lamp_kind="led", mains_frequency_hz=50.0)
    assert line.u_rel == pytest.approx(0.7568 * math.sqrt(0.01 / 3 / 2), rel=0.03)
    assert (line.assumed, raised) == (None, ())
    assert line.values == {
        "mains_frequency_hz": 50.0,
        "modulation": [0.0, 0.1],
        "exposure_share": pytest.approx(0.7568, abs=1e-4),
        "lamp_kind": "led",
    }
    assert all(each in line.basis for each in ("50 Hz", "steady driver", "0 to 0.1", "75.7%"))
    # of one depth, m h = 0.1: L / L_shown = 1 / (1 + 0.1 cos phase)
    phases = np.linspace(0.0, 2 * math.pi, 100_000, endpoint=False)
    at_tenth = flicker_of(mains_frequency_hz=50.0, flicker_modulation=0.1 / 0.75683)[0].u_rel
    assert at_tenth == pytest.approx(np.sqrt(np.mean((1 / (1 + 0.1 * np.cos(phases)) - 1) ** 2)), rel=1e-4)
    # of a kind over its depths: 95 % of the skewed errors stay below 1.96 u, also where it may be any depth
    for kind, low in (("sodium", 0.5), ("metal_halide", 0.0)):
        depths = np.linspace(low, 1.0, 1001)[:, None]
        errors = np.abs(1 / (1 + 0.75683 * depths * np.cos(phases[::100])) - 1)
        line, _ = flicker_of(lamp_kind=kind, mains_frequency_hz=50.0)
        assert line.u_rel == pytest.approx(np.quantile(errors, 0.95) / 1.96, rel=0.01)
        assert line.u_rel > np.sqrt(np.mean(errors**2))
    # a moment of light that goes out altogether
    flash = replace(AT_250, exposure_time_s=1e-6)
    assert 1.0 < flicker_of(at=flash, lamp_kind="sodium", mains_frequency_hz=50.0)[0].u_rel < 10.0


def test_mains_alone_changes_the_flicker_line():
    """Unstated, the larger of 50 and 60 Hz counts and is flagged; stated, the factor is that of the mains."""
    unknown, raised = flicker_of()
    assert [each.flag for each in raised] == ["flicker_unknown"]
    lines = {hz: flicker_of(mains_frequency_hz=hz) for hz in (50.0, 60.0, 0.0)}
    assert not any(flags for _, flags in lines.values())
    assert len({unknown.basis, *(line.basis for line, _ in lines.values())}) == 4
    assert unknown.values["mains_frequency_hz"] == [50.0, 60.0]
    sharp = {hz: abs(math.sin(2 * math.pi * hz / 250)) / (2 * math.pi * hz / 250) for hz in (50.0, 60.0)}
    for hz, share in sharp.items():
        assert lines[hz][0].u_rel == pytest.approx(share / math.sqrt(6))
    assert unknown.u_rel == max(line.u_rel for line, _ in lines.values())
    # direct current, and a whole number of half periods
    assert (lines[0.0][0].u_rel, lines[0.0][0].basis) == (0.0, "direct current")
    whole = replace(AT_250, exposure_time_s=1 / 50)
    assert flicker_of(at=whole, mains_frequency_hz=50.0)[0].u_rel < 1e-12
    assert flicker_of(at=whole)[0].u_rel > 0.04


COLOUR = (1.0, 1.0)


def at_lamp(**known):
    conditions = CalibrationConditions(colour=COLOUR, **known)
    return replace(COEFFICIENT, conditions=conditions)


def test_spectrum_of_kinds_says_what_it_assumed():
    led, colour = FieldConditions(lamp_kind="led"), COLOUR
    line, raised = correct_spectrum(led, at_lamp(lamp_kind="led"), colour)
    assert (line.factor, raised) == (pytest.approx(1.0, abs=0.01), ())
    assert 0.02 < line.u_rel < 0.04
    assert line.values == {
        "cameras": 4.0, "calibrated": "led", "measured": "led", "red_to_green": 1.0, "blue_to_green": 1.0,
    }  # fmt: skip
    assert encode(line)["values"] == line.values  # of the types that the document states, or it warns
    known, _ = correct_spectrum(led, at_lamp(lamp_kind="led", camera_response="Hasselblad L2D-20c"), colour)
    assert known.u_rel < line.u_rel
    # without a colour nothing tells a warm LED from a cold one; a spectrum goes before a kind
    wide, _ = correct_spectrum(led, at_lamp(lamp_kind="led"), None)
    assert wide.u_rel > 0.1
    exact, _ = correct_spectrum(
        FieldConditions(lamp_kind="led", light_source="HP1"), at_lamp(lamp="HP1", lamp_kind="led"), colour
    )
    assert (exact.factor, exact.u_rel) == (1.0, 0.02)
    # one end alone is not enough
    for field, coefficient in ((led, at_lamp()), (FieldConditions(), at_lamp(lamp_kind="led"))):
        line, raised = correct_spectrum(field, coefficient, colour)
        assert (line.u_rel, [each.flag for each in raised]) == (0.1, ["spectral_mismatch_unknown"])


def test_profile_replaces_any_depth_and_ten_percent():
    """LED on 50 Hz at 1/250 s, an even scene, K to 1.7 % at a calibrated aperture, distances not stated."""
    exposure = Exposure(exposure_time_s=1 / 250, f_number=4.0, iso=3200.0)
    noise = np.random.default_rng(1).normal(0.0, 4.0, (64, 96))
    us = []
    for stated, known in (({}, {}), ({"lamp_kind": "led", "mains_frequency_hz": 50.0}, {"lamp_kind": "led"})):
        found = measure(
            frame_of(1256.0 + noise, clipped=True),
            Request(
                polygon=ROI,
                grid=Grid(corners=CORNERS, rows=2, columns=2),
                conditions=FieldConditions(**stated),
            ),
            exposure=exposure,
            coefficients=(replace(at_lamp(**known), f_number_u_rel=0.0),),
            calibrated=(ROI,),
        )
        us.append(
            (found.mean.standard_uncertainty / found.mean.value, found.surface.u_o.standard_uncertainty)
        )
    assert np.array(us) == pytest.approx(np.array([[0.327, 0.268], [0.054, 0.027]]), rel=0.02)
