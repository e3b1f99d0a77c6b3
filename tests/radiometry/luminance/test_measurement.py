"""A frame measured: the budget in its two parts, the flags, and intervals that hold the truth."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from radiometry.findings import InputRejected
from radiometry.findings.grouping import advise
from radiometry.findings.shared import SATURATED
from radiometry.frame.exposure import Exposure
from radiometry.frame.grid import Grid
from radiometry.frame.roi import Polygon
from radiometry.luminance import method
from radiometry.luminance.codes import ROI_ELSEWHERE
from radiometry.luminance.measurement import Request, find_mixed_light, find_window, measure
from radiometry.luminance.pixels import SCATTER
from radiometry.luminance.rows import CalibrationConditions, FieldConditions
from radiometry.spectral.mismatch import (
    compute_mismatch,
    fit_colour_remedy,
    read_lamp,
    read_observer,
    read_response,
)
from tests.radiometry.coefficients import COEFFICIENT
from tests.radiometry.frames import frame_of

EXPOSURE = Exposure(exposure_time_s=0.01, f_number=4.0, iso=3200.0)
PER_DN = 16 / (30 * 0.01 * 3200)
CORNERS = ((10.0, 10.0), (90.0, 10.0), (90.0, 58.0), (10.0, 58.0))
ROI = Polygon.from_points(CORNERS)
ELSEWHERE = Polygon.from_points([(0, 0), (20, 0), (20, 20), (0, 20)])


def make_frame(samples):
    return frame_of(samples, clipped=True)


def noisy(signal_dn, *, noise_dn=4.0, seed=1, shape=(64, 96)):
    return np.random.default_rng(seed).normal(256.0 + signal_dn, noise_dn, shape)


def measured(
    frame,
    *,
    exposure=EXPOSURE,
    coefficient=COEFFICIENT,
    calibrated=(ROI,),
    rendered=False,
    repeats=(),
    **asked,
):
    return measure(
        frame,
        Request(**({"polygon": ROI} | asked)),
        exposure=exposure,
        coefficients=(coefficient,),
        calibrated=calibrated,
        rendered=rendered,
        repeats=repeats,
    )


def flags(found):
    return {raised.flag for raised in found.flags}


def test_the_budget_is_the_documented_sum():
    found = measured(make_frame(noisy(1000.0)))
    luminance = found.mean.value
    assert luminance == pytest.approx(1000 * PER_DN, rel=1e-3)
    n = 80 * 48 // 2
    expected = {
        "fit of K": 0.4 / 30 * luminance,
        "meter calibration": 0.01 * luminance,
        "dark signal": 0.5 * PER_DN,
        "exposure time": 0.005 * luminance,
        "f-number": 2 * 0.015 * luminance,
        "ISO setting": 0.0,
        "pixel noise": 4.0 / math.sqrt(n) * PER_DN,
    }
    assert [share.source for share in found.budget] == list(expected)
    for share in found.budget:
        # the noise of a drawn frame scatters by 1 / sqrt(2 n) = 1.6 %
        assert share.standard_uncertainty_cd_m2 == pytest.approx(expected[share.source], rel=0.06)
    assert sum(share.variance_share for share in found.budget) == pytest.approx(1.0)
    assert found.mean.standard_uncertainty == pytest.approx(math.hypot(*expected.values()), rel=1e-3)
    assert found.mean.standard_uncertainty == pytest.approx(
        math.hypot(found.shared_u_cd_m2, found.noise_u_cd_m2)
    )


@pytest.mark.parametrize("off", [(0.0,), (-1.1619, -0.3873, 0.3873, 1.1619)])
def test_a_frame_has_the_scatter_that_its_calibration_measured(off):
    """2 %; of four that differ by as much the mean has half of it, with 1 % of the light expected as well."""
    coefficient = replace(COEFFICIENT, frame_scatter_rel=0.02)
    first, *others = (make_frame(noisy(1000.0 * (1 + 0.02 * each), seed=1)) for each in off)
    found = measured(first, coefficient=coefficient, repeats=others)
    source, expected = "scatter between frames", 0.02
    if others:
        # four degrees of freedom of what is expected, three of what is found
        source, expected = SCATTER, math.sqrt((4 * (0.02**2 + 0.01**2) + 3 * 0.02**2) / 7) / 2
    (share,) = (each for each in found.budget if each.source == source)
    assert share.standard_uncertainty_cd_m2 / found.mean.value == pytest.approx(expected, rel=0.01)


CAMERA = "Hasselblad L2D-20c"


def light_up(lamps, *, luminance=1000.0, noise_dn=2.0):
    """One luminance everywhere, by one lamp on each half, as the camera's pixels see it."""
    halves = []
    for lamp in map(read_lamp, lamps):
        red, green, blue = luminance * (lamp @ read_response(CAMERA)) / (lamp @ read_observer()) * GREEN_OF_A
        halves.append(np.tile([[red, green], [green, blue]], (32, 24)))
    return noisy(0.0, noise_dn=noise_dn) + np.hstack(halves)


# so that the green pixels are right under A
GREEN_OF_A = (read_lamp("A") @ read_observer()) / (read_lamp("A") @ read_response(CAMERA)[:, 1])


def test_lamps_of_two_colours_side_by_side_are_named_with_what_they_do_to_a_ratio():
    known = CalibrationConditions(lamp="A", camera_response=CAMERA, colour=(1.0, 1.0))
    grid = Grid(corners=((0.0, 0.0), (96.0, 0.0), (96.0, 64.0), (0.0, 64.0)), rows=1, columns=2)
    for conditions in (known, None):
        asked = {
            "coefficient": replace(COEFFICIENT, conditions=conditions),
            "grid": grid,
            "conditions": FieldConditions(),
        }
        found = measured(make_frame(light_up(("HP1", "LED-B5"))), **asked)
        (raised,) = (each for each in found.flags if each.flag == "mixed_light")
        stated = float(raised.detail.partition("by ")[2].partition("%")[0]) / 100
        ((sodium, led),) = ([cell.value for cell in line] for line in found.surface.cells)
        f_of = {
            lamp: compute_mismatch(CAMERA, channel="green", calibrated="A", measured=lamp)
            for lamp in ("HP1", "LED-B5")
        }
        # the luminances are equal: what they are shown as is wrong by this
        assert led / sodium == pytest.approx(f_of["HP1"] / f_of["LED-B5"], rel=0.01)
        assert stated >= 0.9 * (led / sodium - 1.0)
        # one lamp, or in a laboratory
        for scene, stating in ((("HP1", "HP1"), {}), (("HP1", "LED-B5"), {"conditions": None})):
            assert "mixed_light" not in flags(measured(make_frame(light_up(scene)), **asked | stating))


def test_cells_are_read_from_their_own_part_of_the_frame(monkeypatch):
    """Each from the whole frame, 2,500 cells of 20 megapixels take two minutes."""
    read = []

    def count(frame, polygon, *, extract=method.extract):
        read.append(frame.samples_dn.size)
        return extract(frame, polygon)

    monkeypatch.setattr(method, "extract", count)
    grid = Grid(corners=((0.0, 0.0), (96.0, 0.0), (96.0, 64.0), (0.0, 64.0)), rows=4, columns=6)
    measured(make_frame(noisy(1000.0)), grid=grid, conditions=FieldConditions())
    # the region twice, and twice all cells, which share no pixel
    assert sum(read) == 4 * 64 * 96


def test_mixed_light_by_hand():
    """B/G of one cell is half of the other's: ln F differs by c ln 2."""
    two = [(0.5, 0.4), (0.5, 0.2)]
    slope = fit_colour_remedy((CAMERA,), channel="green", calibrated=("A",)).blue
    (raised,) = find_mixed_light(two, response=CAMERA, channel="green", u_rel=0.03)
    assert f"wrong by {2.0 ** abs(slope) - 1.0:.0%};" in raised.detail
    for colours, u_rel in ((two, 0.16), (two[:1], 0.03), ([(0.5, 0.4), (0.5, 0.38)], 0.03)):
        assert find_mixed_light(colours, response=CAMERA, channel="green", u_rel=u_rel) == ()


def test_the_trail_of_a_car_is_named_and_a_slope_of_light_is_not():
    """One of a cell's 16 rows at ten times its light is +56 % of its mean; light may double over it."""
    slope = noisy(0.0) + 500.0 * 2.0 ** (np.arange(96) / 16)
    grid = Grid(corners=CORNERS, rows=3, columns=5)
    assert "mixed_surface" not in flags(measured(make_frame(np.minimum(slope, 3900.0)), grid=grid))
    road = noisy(300.0)
    road[20, 10:26] += 2700.0  # one row of the first cell's sixteen, every other pixel of a row is green
    (raised,) = (each for each in measured(make_frame(road), grid=grid).flags if each.flag == "mixed_surface")
    assert raised.detail.startswith("1 of the cells; most in row 1, column 1")
    road[10:58, 66:] += 1500.0
    assert "mixed_surface" in flags(measured(make_frame(road)))


ROAD = np.array([[1.2, 0.9, 0.8, 0.9, 1.1], [1.0, 0.8, 0.6, 0.7, 1.0], [0.7, 0.5, 0.45, 0.5, 0.65]])
GRID = Grid(corners=CORNERS, rows=3, columns=5)


def road_frame(noise_dn=1.0):
    samples = np.full((64, 96), 256.0)
    samples[10:58, 10:90] += np.kron(ROAD, np.ones((16, 16))) / PER_DN
    return make_frame(samples + np.random.default_rng(2).normal(0.0, noise_dn, samples.shape))


def test_the_procedures_road_comes_back_cell_by_cell():
    found = measured(road_frame(), grid=GRID, reflectance=0.1)
    surface = found.surface
    cells = np.array([[cell.value for cell in line] for line in surface.cells])
    assert cells == pytest.approx(ROAD, abs=4 * 1.05 / math.sqrt(128) * PER_DN)
    assert surface.l_av_cd_m2.value == pytest.approx(0.78667, abs=0.005)
    assert surface.u_o.value == pytest.approx(0.57203, abs=0.01)
    assert surface.max_to_min.value == pytest.approx(2.6667, abs=0.04)
    assert [line.value for line in surface.u_l] == pytest.approx([0.8 / 1.2, 0.6, 0.45 / 0.7], abs=0.02)
    assert (surface.cell_model, surface.u_o.unit, surface.l_av_cd_m2.unit) == ("projective", "1", "cd/m2")
    assert surface.illuminance_lx.value == pytest.approx(math.pi * surface.l_av_cd_m2.value / 0.1)
    assert found.illuminance_lx.unit == "lx"
    for part, light in ((found.illuminance_lx, found.mean), (surface.illuminance_lx, surface.l_av_cd_m2)):
        u_rel = math.hypot(0.1, light.standard_uncertainty / light.value)
        assert part.standard_uncertainty / part.value == pytest.approx(u_rel)
    stated = measured(
        road_frame(),
        reflectance=0.1,
        conditions=FieldConditions(reflectance_u_rel=0.0, mains_frequency_hz=0.0),
    )
    alone = stated.mean.standard_uncertainty / stated.mean.value
    assert stated.illuminance_lx.standard_uncertainty / stated.illuminance_lx.value == pytest.approx(alone)


def test_other_models_share_their_errors_too():
    """Power: L = (N / K)^(1 / g): an error of K scales every cell alike, one of g does not."""
    power = replace(
        COEFFICIENT,
        model="power",
        parameter_names=("luminance_k", "exponent"),
        parameters=(30.0, 1.05),
        covariance=((0.16, 0.0), (0.0, 0.0)),
        dark_signal_standard_uncertainty_dn=0.0,
    )
    bent = replace(power, covariance=((0.16, 0.0), (0.0, 0.03**2)))
    alike, unlike = (measured(road_frame(), grid=GRID, coefficient=c).surface for c in (power, bent))
    assert alike.u_o.standard_uncertainty < unlike.u_o.standard_uncertainty / 2
    assert alike.l_av_cd_m2.standard_uncertainty > 0.02


def test_an_iso_that_was_not_calibrated_is_refused_with_those_that_were():
    other = replace(EXPOSURE, iso=100.0)
    with pytest.raises(InputRejected, match="ISO 100; this calibration holds ISO 3200") as refused:
        measured(make_frame(noisy(1000.0)), exposure=other)
    assert refused.value.code == "iso_not_calibrated"


def test_what_every_measurement_from_the_air_must_say():
    found = measured(make_frame(noisy(1000.0)))
    assert flags(found) == {"no_vignetting_correction", "observer_differs"}
    assert found.vignetting == "none"


@pytest.mark.parametrize(
    ("signal", "change", "expected"),
    [
        (1000.0, {"exposure": replace(EXPOSURE, exposure_time_s=0.04)}, "outside_exposure_times"),
        (1000.0, {"exposure": replace(EXPOSURE, f_number=11.0)}, "outside_f_numbers"),
        (50.0, {}, "outside_signals"),
        (3900.0, {}, "saturated"),
        (0.3, {}, "below_detection"),
        (1000.0, {"rendered": True}, "rendered"),
        (1000.0, {"calibrated": (ELSEWHERE,)}, "roi_elsewhere"),
    ],
)
def test_what_else_is_flagged(signal, change, expected):
    found = measured(make_frame(noisy(signal)), **change)
    assert expected in flags(found)


def test_cells_that_cannot_be_trusted_are_counted():
    samples = noisy(1000.0)
    samples[10:26, 10:42] = 4095
    found = measured(make_frame(samples), grid=GRID)
    (raised,) = [r for r in found.flags if r.flag == "saturated" and r.where == "grid"]
    assert raised.detail == "Saturated: 2 of the cells, the first in row 1, column 1."


def test_a_cell_without_a_green_pixel_is_refused():
    fine = Grid(corners=((0.0, 0.0), (6.0, 0.0), (6.0, 6.0), (0.0, 6.0)), rows=6, columns=6)
    with pytest.raises(InputRejected, match="no green pixel"):
        measured(make_frame(noisy(1000.0)), grid=fine)


def test_the_window_holds_region_and_grid():
    far = Grid(corners=((50.0, 2.0), (60.0, 2.0), (60.0, 12.0), (50.0, 12.0)), rows=1, columns=1)
    window = find_window(Request(polygon=ROI, grid=far), height_px=64, width_px=96)
    assert (window.row0, window.col0, window.height, window.width) == (2, 10, 56, 80)
    with pytest.raises(InputRejected, match="leaves the frame"):
        find_window(Request(polygon=ROI, grid=far), height_px=64, width_px=80)


def test_every_flag_of_a_measurement_has_a_remedy_and_the_largest_source_is_named():
    sentences = advise([SATURATED, ROI_ELSEWHERE], budget=[("dark signal", 0.2), ("f-number", 0.8)])
    assert len(sentences) == 3
    assert "quarter of the exposure time" in sentences[0]
    assert "f-number is the largest source" in sentences[-1]
    names = [share.source for share in measured(make_frame(noisy(1000.0))).budget]
    assert all(advise([], budget=[(name, 1.0)]) for name in names)
    assert advise([], budget=[("pixel noise", 0.0)]) == ()


@pytest.mark.parametrize("source", ["spectral mismatch", "flicker", "focus distance", "stray light"])
def test_nothing_is_asked_for_that_was_stated(source):
    """Lamp and light are both A, say: what is left is not for want of a statement."""
    (given,), (lacking,) = (
        advise([], budget=[(source, 1.0)], assumed=assumed) for assumed in ((), ("pixel noise", source))
    )
    assert "tate" not in given
    assert "tate" in lacking


def test_a_blurred_frame_mixes_its_cells_by_as_much_as_the_manual_says():
    """A step of 1000 DN between cells of 40 px, blurred by 4 px: 4 / (40 sqrt(2 pi)) of it, on both sides."""
    step = np.where(np.arange(96) < 48, 500.0, 1500.0) + np.zeros((64, 1)) + 256.0
    grid = Grid(corners=((8.0, 10.0), (88.0, 10.0), (88.0, 58.0), (8.0, 58.0)), rows=1, columns=2)
    blurred = gaussian_filter1d(step, 4.0, axis=1)
    shown = [
        [cell.value / PER_DN for cell in measured(make_frame(each), grid=grid).surface.cells[0]]
        for each in (step, blurred)
    ]
    expected = 1000.0 * 4.0 / (40.0 * math.sqrt(2.0 * math.pi))
    assert np.subtract(*shown[::-1]) == pytest.approx([expected, -expected], rel=0.02)
