"""Units, with the source's own numbers."""

import math

import pytest

from radiometry.sharpness.features import Contrasts
from radiometry.sharpness.resolution import convert_resolution, find_resolving_power, unresolved_diameter
from radiometry.sharpness.spectrum import find_crossing


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


def test_the_resolving_power_is_where_a_line_crosses_the_level():
    """Contrast 1 - 2 f is 0.125 at f = 0.4375; five points remain, about 0.4."""
    frequency = tuple(0.05 * k for k in range(1, 11))
    found = find_resolving_power(frequency, curve(*(1 - 2 * f for f in frequency)), contrast=0.125)
    assert found.value == pytest.approx(0.4375)
    x = [f - 0.4 for f in frequency[5:10]]
    at = found.value - 0.4
    expected = 0.01 / 2 * math.sqrt(1 / 5 + at**2 / sum(each**2 for each in x))
    assert found.standard_uncertainty == pytest.approx(expected)


@pytest.mark.parametrize("contrast", [(1.0, 0.9, 0.8), (0.05, 0.04, 0.03)])
def test_a_curve_that_does_not_cross_has_no_resolving_power(contrast):
    assert find_resolving_power((0.1, 0.2, 0.3), curve(*contrast), contrast=0.1) is None


def test_the_first_crossing_counts():
    assert find_crossing([0.0, 0.1, 0.2, 0.3, 0.4], [1.0, 0.6, 0.4, 0.7, 0.1], 0.5) == pytest.approx(0.15)
    assert math.isnan(find_crossing([0.0, 0.1], [1.0, 0.6], 0.5))
