"""Units, with the source's own numbers."""

import math

import numpy as np
import pytest

from radiometry.sharpness.positions import convert_resolution, find_resolving_power, unresolved_diameter
from radiometry.sharpness.profile import find_crossing
from radiometry.sharpness.results import Contrasts


def test_the_printed_lp_mm_are_line_widths_of_another_picture():
    """Equation 3: c/p * 1024 * 2 / 24 = 26.1, so 0.3059 cycles per pixel, and 13.05 line pairs."""
    cycles = 26.1 * 24.0 / (2 * 1024)
    assert cycles == pytest.approx(0.3059, abs=5e-5)
    found = convert_resolution(cycles, picture_height_px=1024, pixel_pitch_um=4.65)
    assert found.lp_per_mm_small_format == pytest.approx(13.05)
    assert found.lw_per_ph / 24.0 == pytest.approx(26.1)
    assert found.lp_per_ph == pytest.approx(313.2)
    assert found.lp_per_mm == pytest.approx(65.777, abs=1e-3)


def test_without_a_pitch_there_are_no_line_pairs_per_millimetre():
    assert convert_resolution(0.25, picture_height_px=1000).lp_per_mm is None
    assert convert_resolution(0.25, picture_height_px=1000).lw_per_ph == 500.0


def test_the_star_s_d_is_a_diameter():
    assert unresolved_diameter(0.5, cycles=48) == pytest.approx(30.56, abs=5e-3)


def curve(*contrast, u=0.01):
    return Contrasts(direction_deg=None, contrast=contrast, contrast_u=(u,) * len(contrast))


# transfer of a blur, and where it falls to a tenth: Gaussian, a circular aperture's, an exponential, a box's
BLURS = {
    "gaussian": (lambda f: np.exp(-2.0 * np.pi**2 * 1.000761**2 * f**2) / 0.989, 0.3421),
    "aperture": (
        lambda f: 2.0 / np.pi * (np.arccos(f / 0.51) - f / 0.51 * np.sqrt(1.0 - (f / 0.51) ** 2)),
        0.80536 * 0.51,
    ),
    "exponential": (lambda f: np.exp(-6.0 * f), math.log(10.0) / 6.0),
    "box": (lambda f: np.sinc(f / 0.51), 0.90796 * 0.51),
}


@pytest.mark.parametrize("shape", BLURS)
@pytest.mark.parametrize(("ratio", "rings"), [(1.4, 6), (1.2, 10), (1.04, 48)])
def test_the_resolving_power_of_a_curved_response_is_within_its_uncertainty(shape, ratio, rings):
    """Rings that lie far apart cost uncertainty; those of a Gaussian blur do not even cost that."""
    response, truth = BLURS[shape]
    frequency = 0.5 / ratio ** np.arange(rings)[::-1]
    found = find_resolving_power(tuple(frequency), curve(*response(frequency), u=1e-4), contrast=0.1)
    assert abs(found.value - truth) < 2.0 * found.standard_uncertainty
    if shape == "gaussian":
        assert found.value == pytest.approx(0.3421, abs=1e-4)


def test_noise_of_the_rings_is_in_the_uncertainty():
    """48 rings, noise of 1 % and 2 %: 2 u holds the truth in nine cases of ten or more."""
    response, truth = BLURS["gaussian"]
    frequency = np.geomspace(0.08, 0.5, 48)
    for u in (0.01, 0.02):
        noisy = response(frequency) + np.random.default_rng(3).normal(0.0, u, (300, 48))
        found = [
            find_resolving_power(tuple(frequency), curve(*np.maximum(each, 0.0), u=u), contrast=0.1)
            for each in noisy
        ]
        assert np.mean([abs(each.value - truth) < 2.0 * each.standard_uncertainty for each in found]) > 0.9


@pytest.mark.parametrize("contrast", [(1.0, 0.9, 0.8), (0.05, 0.04, 0.03)])
def test_a_curve_that_does_not_cross_has_no_resolving_power(contrast):
    assert find_resolving_power((0.1, 0.2, 0.3), curve(*contrast), contrast=0.1) is None


def test_the_first_crossing_counts():
    assert find_crossing([0.0, 0.1, 0.2, 0.3, 0.4], [1.0, 0.6, 0.4, 0.7, 0.1], 0.5) == pytest.approx(0.15)
    assert math.isnan(find_crossing([0.0, 0.1], [1.0, 0.6], 0.5))
