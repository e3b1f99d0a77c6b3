"""Profiles along lines: the pixels of the map themselves, one pixel apart."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from radiometry.maps.profile import average_trace, trace_line
from radiometry.maps.uncertainty import PixelUncertainty, find_likeness

from radiometry.findings import InputRejected
from radiometry.frame import Frame
from radiometry.luminance.maps import find_measured, sum_signal

PLANE = np.arange(60.0).reshape(5, 12)
UNCERTAINTY = PixelUncertainty(relative=0.03, constant=0.04, pixel=0.1, reference=4.0, likeness=2.0)


def profile(points, plane=PLANE, *, across_px=1, most=1000):
    trace = trace_line(points, height_px=plane.shape[0], width_px=plane.shape[1], across_px=across_px)
    values = np.where(trace.rows >= 0, plane[trace.rows, trace.cols], np.nan)
    return average_trace(trace, values, most=most)


@settings(max_examples=25)
@given(row=st.integers(0, 4), first=st.integers(0, 10), length=st.integers(1, 11))
def test_a_profile_along_a_row_is_the_row_and_of_the_transposed_map_the_column(row, first, length):
    last = min(first + length, 11)
    expected = PLANE[row, first : last + 1]
    found = profile([(first + 0.5, row + 0.5), (last + 0.5, row + 0.5)])
    assert found.values.tolist() == expected.tolist()
    assert found.distance_px.tolist() == list(range(last - first + 1))
    turned = profile([(row + 0.5, first + 0.5), (row + 0.5, last + 0.5)], PLANE.T)
    assert turned.values.tolist() == expected.tolist()
    back = profile([(last + 0.5, row + 0.5), (first + 0.5, row + 0.5)])
    assert back.values.tolist() == expected[::-1].tolist()


def test_a_corner_belongs_to_one_part_and_distances_add_up():
    found = profile([(0.5, 0.5), (3.5, 0.5), (3.5, 0.5), (3.5, 4.5)])
    assert found.values.tolist() == [0, 1, 2, 3, 15, 27, 39, 51]
    assert found.distance_px.tolist() == list(range(8))
    assert found.xy_px[-1].tolist() == [3.5, 4.5]


def test_an_oblique_line_of_5_pixels_has_places_a_pixel_apart():
    found = profile([(0.5, 0.5), (4.5, 3.5)])
    assert np.hypot(*np.diff(found.xy_px, axis=0).T) == pytest.approx(1.0)
    # at 0.5 0.5, 1.3 1.1, 2.1 1.7, 2.9 2.3, 3.7 2.9 and 4.5 3.5
    assert found.values.tolist() == [0, 13, 14, 26, 27, 40]


def test_the_mean_across_the_line_leaves_out_what_is_outside():
    found = profile([(2.5, 0.5), (4.5, 0.5)], across_px=3)
    assert found.values.tolist() == [8, 9, 10]
    assert found.pixels.tolist() == [2, 2, 2]


def test_more_places_than_asked_for_are_averaged_and_a_gap_stays_one():
    plane = PLANE.copy()
    plane[2, 4] = np.nan
    found = profile([(0.5, 2.5), (11.5, 2.5)], plane, most=6)
    assert found.step == 2
    assert found.values[:2].tolist() == [24.5, 26.5]
    assert math.isnan(found.values[2])
    assert found.pixels.tolist() == [2] * 6


def test_pixels_that_count_twice_average_less():
    """A line across a width of 3 at 45 degrees: places share pixels, so noise averages less."""
    found = profile([(1.5, 1.5), (4.0, 4.0)], across_px=3, most=1)
    assert found.step == 4
    assert 4 < found.pixels[0] < 12


@pytest.mark.parametrize(
    ("points", "said"),
    [
        ([(3, 3), (3, 3)], "no length"),
        ([(3, 3), (12.1, 3)], "leaves the map"),
        ([(3, 3), (-0.1, 3)], "12 x 5"),
        ([(3, 3), (math.nan, 3)], "leaves the map"),
        ([(3, 3), (4, 3)] * 26, "more than 50"),
    ],
)
def test_what_is_no_line_of_the_map_is_refused(points, said):
    with pytest.raises(InputRejected, match=said):
        trace_line(points, height_px=5, width_px=12)


def test_the_border_belongs_to_the_last_pixels():
    assert profile([(0, 5), (12, 5)]).values.tolist() == [48, 49, 50, 51, 52, 53, 54, 55, 56, 57, 58, 59, 59]


def test_uncertainty_by_hand():
    """At 4: sqrt(.12^2 + .04^2) shared, .1 own; four times as bright, at most twice; of 8 pixels, half."""
    values = np.array([0.0, 4.0, 16.0])
    assert UNCERTAINTY.common(values) == pytest.approx([0.04, math.hypot(0.12, 0.04), math.hypot(0.48, 0.04)])
    assert UNCERTAINTY.own(values) == pytest.approx([0.1, 0.1, 0.2])
    assert UNCERTAINTY.own(values, 8.0) == pytest.approx([0.05, 0.05, 0.1])
    assert UNCERTAINTY.limit == pytest.approx(2 * math.hypot(0.04, 0.1))
    dark = profile([(0.5, 0.5), (3.5, 0.5)], PLANE / 10).find_dark(UNCERTAINTY)
    assert dark.tolist() == [True, True, True, False]


@pytest.mark.parametrize(("cfa", "channel"), [("RGGB", "green"), ("RGGB", "grey"), ("grey", "grey")])
def test_noise_of_a_mean_is_at_most_the_bound(cfa, channel):
    """Maps of pure noise: the scatter of means over squares against that of single pixels."""
    noise = np.random.default_rng(4).normal(2000.0, 100.0, (512, 512)).round().astype(np.uint16)
    frame = Frame(
        samples_dn=noise,
        black_level_dn=(0.0,) * 4,
        white_level_dn=(4095.0,) * 4,
        cfa=cfa,
        row0=0,
        col0=0,
        height_px=512,
        width_px=512,
    )
    sums, parts = sum_signal(frame, channel=channel)
    single = (sums / parts)[find_measured(frame, channel=channel)].std()
    for side in (2, 4, 8):
        means = (sums / parts).reshape(512 // side, side, 512 // side, side).mean((1, 3))
        bound = single * math.sqrt(min(1.0, find_likeness(cfa, channel) / side**2))
        assert means.std() < 1.03 * bound
        assert means.std() > 0.4 * bound
