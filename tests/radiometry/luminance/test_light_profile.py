"""Light profile of a place: its lines by hand, and intervals that hold the truth of simulated nights."""

import dataclasses
import math

import numpy as np
import pytest

from radiometry.frame.exposure import Exposure, Settings
from radiometry.frame.grid import Grid
from radiometry.luminance.corrections import correct_flicker, correct_spectrum
from radiometry.luminance.measurement import Request, measure
from radiometry.luminance.rows import (
    LABELS,
    CalibrationConditions,
    FieldConditions,
    find_modulation,
    list_spectra,
)
from radiometry.spectral.mismatch import list_responses, read_lamp, read_observer, read_response
from store.codec import encode
from tests.radiometry.coefficients import COEFFICIENT
from tests.radiometry.frames import frame_of
from tests.radiometry.luminance.test_corrections import CORNERS, ROI

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
    flash = dataclasses.replace(AT_250, exposure_time_s=1e-6)
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
    whole = dataclasses.replace(AT_250, exposure_time_s=1 / 50)
    assert flicker_of(at=whole, mains_frequency_hz=50.0)[0].u_rel < 1e-12
    assert flicker_of(at=whole)[0].u_rel > 0.04


COLOUR = (1.0, 1.0)


def at_lamp(**known):
    conditions = CalibrationConditions(colour=COLOUR, **known)
    return dataclasses.replace(COEFFICIENT, conditions=conditions)


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
            coefficients=(dataclasses.replace(at_lamp(**known), f_number_u_rel=0.0),),
            calibrated=(ROI,),
        )
        us.append(
            (found.mean.standard_uncertainty / found.mean.value, found.surface.u_o.standard_uncertainty)
        )
    assert np.array(us) == pytest.approx(np.array([[0.327, 0.268], [0.054, 0.027]]), rel=0.02)


V = read_observer()
SPECTRA = {
    kind: [read_lamp(each) / (read_lamp(each) @ V) for each in list_spectra(kind, None)] for kind in LABELS
}
GRID = np.arange(81) * 5.0


def draw_spectrum(random, kind):
    """Draw a lamp of a kind: two of it mixed, with a slope of 3 % in 100 nm."""
    one, other = random.integers(len(SPECTRA[kind]), size=2)
    share = random.uniform(0.0, 0.2)
    slope = 1.0 + random.normal(0.0, 0.03) * (GRID - 180) / 100
    return np.maximum(((1.0 - share) * SPECTRA[kind][one] + share * SPECTRA[kind][other]) * slope, 0.0)


def expose(random, kind, time_s):
    """Integrate the light of a frame that begins at any phase of 50 Hz mains, in 200 steps."""
    low, high = find_modulation(kind, None)
    periods = 100 * time_s * (np.arange(200) + 0.5) / 200 + random.uniform()
    return 1.0 + random.uniform(low, high) * np.mean(np.sin(2 * np.pi * periods))


def draw_night(random, kind, time_s, k_u_rel=0.015):
    """Return (L - truth) / truth of a night after a calibration under LED, and the u that is stated of it."""
    response = read_response(str(random.choice(list_responses())))
    body = np.column_stack([np.interp(GRID - random.normal(0.0, 2.0), GRID, each) for each in response.T])
    greens, colours = [], []
    for z in (draw_spectrum(random, "led"), draw_spectrum(random, kind)):
        red, green, blue = (z @ body) / (z @ V)
        greens.append(green)
        colours.append((red / green, blue / green))
    known = CalibrationConditions(colour=colours[0], lamp_kind="led")
    field = FieldConditions(lamp_kind=kind, mains_frequency_hz=50.0)
    spectrum, _ = correct_spectrum(field, dataclasses.replace(COEFFICIENT, conditions=known), colours[1])
    flicker, _ = correct_flicker(field, dataclasses.replace(AT_250, exposure_time_s=time_s), frames=1)
    shown = greens[1] / greens[0] * expose(random, kind, time_s) * (1.0 + random.normal(0.0, k_u_rel))
    value = shown * spectrum.factor
    return value - 1.0, value * math.hypot(k_u_rel, spectrum.u_rel, flicker.u_rel)


@pytest.mark.parametrize(
    ("kind", "time_s"), [*((kind, 1 / 250) for kind in SPECTRA), ("sodium", 1 / 60), ("led", 1 / 8)]
)
def test_intervals_of_a_kind_hold_the_truth(kind, time_s):
    """500 nights with u(K) of 1.5 %: depth, phase, both lamps, body and K differ from night to night.

    The bounds are 93 to 97 % and twice the standard error of such a share; flicker of one depth has no tails,
    and its interval holds more.
    """
    random = np.random.default_rng(8)
    errors, us = np.array([draw_night(random, kind, time_s) for _ in range(500)]).T
    assert 0.91 <= np.mean(np.abs(errors) <= 1.96 * us) <= 0.985
