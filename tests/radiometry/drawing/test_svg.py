"""Axes: round figures where they belong, and nothing drawn outside its frame."""

import re

import pytest

from radiometry.drawing.chart import Panel, Scale, span


def scale(low, high, *, logarithmic=False):
    return Scale(low=low, high=high, start_px=0.0, end_px=100.0, logarithmic=logarithmic)


@pytest.mark.parametrize(
    ("low", "high", "ticks"),
    [(-4.5, 4.5, [-4, -2, 0, 2, 4]), (0, 92, [0, 20, 40, 60, 80]), (0.0, 1.0, [0, 0.2, 0.4, 0.6, 0.8, 1.0])],
)
def test_even_steps_are_round(low, high, ticks):
    assert scale(low, high).ticks() == pytest.approx(ticks)


def test_a_logarithmic_axis_counts_one_two_five():
    assert scale(0.3, 12.0, logarithmic=True).ticks() == pytest.approx([0.5, 1, 2, 5, 10])


def test_a_logarithmic_axis_gives_equal_ratios_equal_lengths():
    axis = scale(1.0, 100.0, logarithmic=True)
    assert [axis(v) for v in (1.0, 10.0, 100.0)] == pytest.approx([0.0, 50.0, 100.0])


def test_limits_leave_air_and_survive_a_single_value():
    low, high = span([2.0, 4.0])
    assert low < 2.0
    assert high > 4.0
    assert span([3.0])[0] < 3.0 < span([3.0])[1]
    assert span([0.0])[0] < 0.0 < span([0.0])[1]
    assert span([], logarithmic=True)[0] > 0


def test_what_lies_outside_is_not_drawn_and_names_are_text():
    panel = Panel(x=scale(0, 10), y=scale(0, 10), title="<a & b>", x_label="x", y_label="y")
    assert "&lt;script&gt;" in panel.write(5, 5, "<script>")
    # a line is cut at the limits: (5, 20) is beyond them
    assert [float(at) for at in re.findall(r",([\d.]+)", panel.line([(1, 1), (5, 20), (9, 9)], "fit"))] == [
        *(10.0, 100.0, 100.0, 90.0)
    ]
    assert "&lt;a &amp; b&gt;" in "".join(panel.frame())
