"""V between f-numbers and over regions, against figures worked out by hand; a frame that it corrects."""

import dataclasses
import math

import numpy as np
import pytest

from radiometry.findings import InputRejected
from radiometry.frame.roi import Polygon, Window, mask
from radiometry.vignetting import fit as vignetting
from radiometry.vignetting import lens as vignetting_lens
from radiometry.vignetting.falloff import evaluate_slopes
from radiometry.vignetting.lens import require_format
from simulation.camera import change, take
from simulation.targets import FALLOFFS, plan_flat
from tests.radiometry.vignetting.flats import NONE, SMALL, coefficient, dark, flat

AT_2 = coefficient()
AT_4 = coefficient(f_number=4.0, k1=-0.1, k2=0.0)
PAIR = (AT_2, AT_4)
# 150 px to the right of the centre: r^2 = 0.36
PLACE = np.array(100.0), np.array(350.0)
V_2, V_4 = 1 - 0.4 * 0.36 + 0.1 * 0.36**2, 1 - 0.1 * 0.36


def evaluate(coefficients=PAIR, *, f_number, channel="G1", place=PLACE):
    return vignetting_lens.evaluate(coefficients, *place, channel=channel, f_number=f_number)


def test_v_and_its_uncertainty_at_a_calibrated_f_number():
    found = evaluate(f_number=2.0)
    assert float(found.share) == pytest.approx(V_2, rel=1e-12)
    # variances of 1e-4 on k1, k2, k3 and both coordinates; dV/dcol = -(2 b / R)(k1 + 2 k2 r^2), b = 0.6
    by_col = 2 * 0.6 / 250 * (0.4 - 0.2 * 0.36)
    expected = 1e-2 * math.sqrt(0.36**2 + 0.36**4 + 0.36**6 + by_col**2)
    assert float(found.standard_uncertainty) == pytest.approx(expected, rel=1e-9)
    assert float(found.gain) == pytest.approx(1 / V_2)


def test_slopes_are_those_of_v_for_each_parameter():
    place, k, centre = (np.array(130.0), np.array(350.0)), (-0.4, 0.1, -0.05), (100.0, 200.0)

    def share(parameters):
        return evaluate_slopes(*place, parameters[:3], centre_px=tuple(parameters[3:]), radius_px=250.0)[0]

    _, slopes = evaluate_slopes(*place, k, centre_px=centre, radius_px=250.0)
    for index in range(5):
        up, down = np.array([*k, *centre]), np.array([*k, *centre])
        up[index] += 1e-4
        down[index] -= 1e-4
        assert float(slopes[index]) == pytest.approx(float(share(up) - share(down)) / 2e-4, rel=1e-6)


def test_misfit_adds_to_the_uncertainty():
    rough = dataclasses.replace(AT_2, model_u_rel=0.02)
    plain, added = (evaluate((each,), f_number=2.0).standard_uncertainty for each in (AT_2, rough))
    assert float(added) == pytest.approx(math.hypot(plain, 0.02 * V_2))


def test_between_f_numbers_v_is_linear_in_stops():
    half = evaluate(f_number=2.0 * math.sqrt(2.0))
    assert float(half.share) == pytest.approx((V_2 + V_4) / 2, rel=1e-12)
    ends = [float(evaluate(f_number=f).standard_uncertainty) for f in (2.0, 4.0)]
    between = (V_4 - V_2) / (2 * math.sqrt(3))
    assert float(half.standard_uncertainty) == pytest.approx(math.hypot(ends[0] / 2, ends[1] / 2, between))
    third = evaluate(f_number=2.0 * 2 ** (1 / 4))
    assert float(third.share) == pytest.approx(0.75 * V_2 + 0.25 * V_4, rel=1e-12)


@pytest.mark.parametrize("f_number", [1.99, 4.01])
def test_outside_the_range_is_refused(f_number):
    with pytest.raises(InputRejected, match=r"outside the calibrated range, f/2 to f/4") as refusal:
        evaluate(f_number=f_number)
    assert refusal.value.code == "vignetting_not_calibrated"


def test_an_unknown_channel_and_another_size_are_refused():
    with pytest.raises(InputRejected, match="no channel B; it has G1"):
        evaluate(f_number=2.0, channel="B")
    require_format(PAIR, height_px=300, width_px=400)
    with pytest.raises(InputRejected, match=r"The frame is 300 x 400 pixels, .* with 400 x 300"):
        require_format(PAIR, height_px=400, width_px=300)


def test_a_signal_s_channels():
    channels = [dataclasses.replace(AT_2, channel=name) for name in ("R", "G1", "G2", "B")]
    assert vignetting_lens.select_channels(channels, signal="green") == ("G1", "G2")
    assert vignetting_lens.select_channels(channels, signal="grey") == ("R", "G1", "G2", "B")
    band = [dataclasses.replace(AT_2, channel="red_edge")]
    assert vignetting_lens.select_channels(band, signal="green") == ("red_edge",)


@pytest.mark.parametrize("cfa", ["grey", "rgb", "GRBG"])
def test_a_correction_made_in_bands_is_one_over_v_everywhere(cfa):
    """Taller than a band, and between two f-numbers."""
    names = {"grey": ("grey",), "rgb": ("R", "G", "B"), "GRBG": ("G1", "R", "B", "G2")}[cfa]
    pair = [
        dataclasses.replace(each, channel=name, k1=each.k1 * (1 + 0.1 * number))
        for number, name in enumerate(names)
        for each in PAIR
    ]
    gains = vignetting_lens.compute_correction(pair, cfa=cfa, f_number=3.0)
    rows, cols = np.mgrid[:300, :400].astype(float)
    for number, name in enumerate(names):
        expected = vignetting_lens.evaluate(pair, rows, cols, channel=name, f_number=3.0).gain
        site = (slice(number // 2, None, 2), slice(number % 2, None, 2)) if cfa == "GRBG" else ()
        found = gains[..., number] if cfa == "rgb" else gains
        np.testing.assert_allclose(found[site], expected[site], rtol=3e-7)


def test_mean_over_a_region_is_that_of_its_pixels():
    polygon = Polygon.from_points([(40, 20), (340, 10), (380, 290), (60, 280)])
    other = [dataclasses.replace(each, channel="G2", k1=each.k1 - 0.05) for each in PAIR]
    found = vignetting_lens.average_over_polygon(
        (*PAIR, *other), polygon, channels=("G1", "G2"), f_number=2.5
    )
    inside = mask(polygon, Window(row0=0, col0=0, height=300, width=400))
    rows, cols = (each.astype(float) for each in np.nonzero(inside))
    means = [
        vignetting_lens.evaluate((*PAIR, *other), rows, cols, channel=channel, f_number=2.5).share.mean()
        for channel in ("G1", "G2")
    ]
    assert found.value == pytest.approx(np.mean(means), rel=1e-12)
    assert found.unit == "1"


def test_uncertainty_of_a_mean_does_not_average_out():
    """All pixels share the parameters' errors: a region's u is that of a place, not over sqrt(n)."""
    tiny = Polygon.from_points([(350, 100), (351, 100), (351, 101), (350, 101)])
    alone = vignetting_lens.average_over_polygon(PAIR, tiny, channels=("G1",), f_number=2.0)
    here = evaluate(f_number=2.0)
    assert alone.value == pytest.approx(float(here.share))
    assert alone.standard_uncertainty == pytest.approx(float(here.standard_uncertainty))
    around = Polygon.from_points([(330, 80), (371, 80), (371, 121), (330, 121)])
    wide = vignetting_lens.average_over_polygon(PAIR, around, channels=("G1",), f_number=2.0)
    assert wide.standard_uncertainty == pytest.approx(alone.standard_uncertainty, rel=0.05)
    twin = dataclasses.replace(AT_2, channel="G2")
    both = vignetting_lens.average_over_polygon((AT_2, twin), tiny, channels=("G1", "G2"), f_number=2.0)
    assert both.standard_uncertainty == pytest.approx(alone.standard_uncertainty / math.sqrt(2))
    half = vignetting_lens.average_over_polygon(PAIR, tiny, channels=("G1",), f_number=2.0 * math.sqrt(2.0))
    assert half.standard_uncertainty == pytest.approx(
        float(evaluate(f_number=2.0 * math.sqrt(2.0)).standard_uncertainty)
    )


def test_a_correction_makes_another_flat_even():
    lens = change(SMALL, falloffs={1.4: FALLOFFS[1.4]})
    fit = vignetting.fit([flat(lens, 1), *(dark(lens, n, name=f"d{n}") for n in (2, 3))], NONE)
    gains = vignetting_lens.compute_correction(fit.coefficients, cfa="RGGB", f_number=1.4)
    assert (gains.dtype, gains.shape) == (np.float32, (192, 288))
    shot = take(lens, plan_flat(lens, f_number=1.4), np.random.default_rng(9)).frame
    even = (shot.samples_dn - 256.0) * gains
    green = even[0::2, 1::2]
    blocks = green.reshape(12, 8, 12, 12).mean(axis=(1, 3))
    # 96 pixels of 2690 DN and fewer, at 0.25 DN an electron, through gains of up to 2.5
    noise = np.sqrt(2690 * 0.25 * 2.5 / 96) / 2690
    assert np.abs(blocks / blocks.mean() - 1).max() < 5 * noise
    uneven = (shot.samples_dn - 256.0)[0::2, 1::2].reshape(12, 8, 12, 12).mean(axis=(1, 3))
    assert uneven.min() < 0.55 * uneven.max()


def test_each_site_is_corrected_with_its_own_curve():
    red = dataclasses.replace(AT_2, channel="R", k1=-0.2)
    all_of = [red, AT_2, *(dataclasses.replace(AT_2, channel=name) for name in ("G2", "B"))]
    gains = vignetting_lens.compute_correction(all_of, cfa="GRBG", f_number=2.0)
    at_red = vignetting_lens.evaluate([red], np.array(200.0), np.array(301.0), channel="R", f_number=2.0)
    assert gains[200, 301] == pytest.approx(float(at_red.gain), rel=1e-6)
    assert gains[201, 301] != pytest.approx(float(at_red.gain), rel=1e-3)
    grey = vignetting_lens.compute_correction(
        [dataclasses.replace(AT_2, channel="nir")], cfa="grey", f_number=2.0
    )
    assert grey[100, 350] == pytest.approx(1 / V_2, rel=1e-6)
