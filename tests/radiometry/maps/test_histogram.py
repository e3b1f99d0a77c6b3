"""Histograms of areas: every pixel is counted once, in a bin or with its reason."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from radiometry.maps.histogram import ValueCounts, make_histogram

FLOATS = st.floats(-(2.0**9), 2.0**9, width=16) | st.just(math.nan)


def count(*parts):
    counted = ValueCounts()
    for part in parts:
        counted.add(np.array(part, np.float32))
    return counted


@settings(max_examples=8)
@given(values=arrays(np.float32, st.integers(1, 40), elements=FLOATS), logarithmic=st.booleans())
def test_counts_sum_to_the_pixels_and_percentiles_are_those_of_the_sorted_values(values, logarithmic):
    counted = count(values[:7], values[7:])
    found = make_histogram(counted, limit=None, logarithmic=logarithmic, bins=5)
    assert found.counts.sum() + found.below + found.above + found.too_dark + found.unknown == values.size
    assert found.pixels == values.size
    known = np.sort(values[~np.isnan(values)]).astype(float)
    listed, counts = counted.list_values()
    assert np.repeat(listed, counts).tolist() == known.tolist()
    for each in found.percentiles:
        place = max(1, math.ceil(each.percent / 100 * values.size - 1e-9)) - 1
        expected = known[place] if place < known.size else None
        assert each.value == expected
        assert each.rank == ("unknown" if expected is None else "value")


def test_bins_by_hand():
    found = make_histogram(
        count([0.01, 1, 1.5, 10, 99, 100, 1000, math.nan]),
        limit=0.1,
        logarithmic=True,
        bins=2,
        ends=(1.0, 100.0),
    )
    assert found.edges == pytest.approx([1, 10, 100])
    assert found.counts.tolist() == [2, 3]
    assert (found.too_dark, found.below, found.above, found.unknown) == (1, 0, 1, 1)
    assert found.mean == pytest.approx((0.01 + 1 + 1.5 + 10 + 99 + 100 + 1000) / 7, rel=1e-4)


def test_percentiles_that_are_dark_or_saturated_have_no_value():
    found = make_histogram(
        count([0.0, 0.0, 1.0, 2.0, 3.0, *[math.nan] * 5]), limit=0.5, logarithmic=True, bins=3
    )
    ranks = {each.percent: (each.rank, each.value) for each in found.percentiles}
    assert ranks[10] == ("too_dark", None)
    assert ranks[25] == ("value", 1.0)
    assert ranks[50] == ("value", 3.0)
    assert ranks[75] == ("unknown", None)


@pytest.mark.parametrize("values", [[], [math.nan], [5.0], [0.0, 0.0], [-1.0]])
@pytest.mark.parametrize("logarithmic", [True, False])
def test_an_area_without_any_range_has_bins_all_the_same(values, logarithmic):
    found = make_histogram(count(values), limit=None, logarithmic=logarithmic, bins=4)
    assert np.all(np.diff(found.edges) > 0)
    assert found.counts.sum() + found.below + found.above + found.unknown == len(values)


def test_a_linear_axis_ends_where_the_lamps_begin():
    found = make_histogram(count([*np.linspace(0, 2, 999), 5000.0]), limit=None, logarithmic=False, bins=10)
    assert found.edges[0] == 0.0
    assert found.edges[-1] == pytest.approx(2.0, rel=0.01)
    assert found.above >= 1
