"""Charts of what rarely happens: one point, ten thousand, one value, none on the axis, and long names."""

import math
import re
from datetime import UTC, datetime
from itertools import pairwise

import pytest

from radiometry.drawing.chart import Panel, Scale, draw_figure, place_figure, span
from radiometry.drawing.figure import Axis, Figure, Mark, Series

BOX = (60.0, 10.0, 560.0, 210.0)
X, Y = Axis(label="x"), Axis(label="y")


def mark(x, y, **more):
    return Mark(x=x, y=y, name="a", **more)


def draw(figure, box=BOX):
    panel = place_figure(figure, box)
    parts, _ = draw_figure(
        figure, Panel(x=panel.x, y=panel.y, title="", x_label="", y_label=""), in_print=False
    )
    return "".join(parts)


def places(drawn, css="point"):
    found = re.findall(rf'class="{css} [^"]*"[^>]*translate\(([-\d.]+) ([-\d.]+)\)', drawn)
    return [(float(x), float(y)) for x, y in found]


def polylines(drawn, css="line s0"):
    found = re.findall(rf'<polyline class="{css}"[^>]* points="([^"]*)"', drawn)
    return [[tuple(map(float, point.split(","))) for point in points.split()] for points in found]


@pytest.mark.parametrize("logarithmic", [False, True])
@pytest.mark.parametrize(
    "ys", [[3.0], [3.0] * 50, [0.0], [0.0, 0.0], [-2.0, -2.0], [1e-12], [4e8, 4e8 + 1.0]]
)
def test_one_value_lies_in_the_middle_and_its_axis_has_texts(ys, logarithmic):
    axis = Axis(label="y", logarithmic=logarithmic)
    figure = Figure(x=X, y=axis, series=(Series(marks=tuple(mark(1.0, y) for y in ys)),))
    drawn = draw(figure)
    assert "nan" not in drawn
    assert "inf" not in drawn
    texts = re.findall(r'class="end"[^>]*>([^<]*)<', drawn)
    assert len(set(texts)) == len(texts) >= 1
    if logarithmic and min(ys) <= 0.0:
        assert places(drawn) == []
    else:
        assert {round(x) for x, _ in places(drawn)} == {310}
        assert min(y for _, y in places(drawn)) > 10.0


def test_texts_of_a_narrow_axis_do_not_touch():
    marks = tuple(mark(x, 1.0) for x in (40.0, 3000.0))
    axis = Axis(label="signal", logarithmic=True)
    drawn = draw(Figure(x=axis, y=Y, series=(Series(marks=marks),)), (60.0, 10.0, 250.0, 150.0))
    found = re.findall(r'class="mid" x="([\d.]+)" y="\d[^>]*>(\d+)<', drawn)
    ends = [(float(x) - 4.0 * len(text), float(x) + 4.0 * len(text)) for x, text in found]
    assert len(ends) >= 3
    assert all(end < start for (_, end), (start, _) in pairwise(ends))


def test_what_has_no_place_on_a_logarithmic_axis_breaks_the_line_and_is_not_drawn():
    points = [(1.0, 1.0), (10.0, 10.0), (20.0, 0.0), (30.0, -5.0), (40.0, 40.0), (100.0, 100.0)]
    bars = [mark(x, y, low=y - 20.0, high=y + 20.0) for x, y in points]
    log = Axis(label="", logarithmic=True)
    drawn = draw(Figure(x=log, y=log, series=(Series(marks=tuple(bars), line=tuple(points)),)))
    assert len(places(drawn)) == 4
    assert [len(run) for run in polylines(drawn)] == [2, 2]
    # an interval down to below zero ends at the foot of the axis
    assert len(polylines(drawn, "line bar s0")) >= 4
    assert all(10.0 <= y <= 210.0 for run in polylines(drawn, "line bar s0") for _, y in run)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_intervals_without_ends_leave_the_others_where_they_were(bad):
    good = [mark(0.0, 1.0, low=0.0, high=2.0), mark(2.0, 3.0, low=2.0, high=4.0)]
    broken = [mark(1.0, 2.0, low=bad, high=bad), mark(1.0, bad), mark(bad, 2.0)]
    band = ((0.0, 0.5, 1.5), (1.0, bad, bad), (2.0, 2.5, 3.5))

    def figure(marks):
        return Figure(x=X, y=Y, series=(Series(marks=tuple(marks), swath=band),))

    drawn = draw(figure([*good, *broken]))
    assert "nan" not in drawn.replace("</text>nan", "")
    assert places(drawn) == [*places(draw(figure(good))), places(draw(figure([*good, mark(1.0, 2.0)])))[2]]
    assert len(polylines(drawn, "line bar s0")) == 2


def test_a_line_leaves_the_axes_where_it_crosses_them_and_comes_back():
    axis = Axis(label="", ticks=((0.0, "0"), (10.0, "10")), include=(0.0, 10.0))
    figure = Figure(x=axis, y=axis, series=(Series(model=((0.0, 5.0), (5.0, 15.0), (10.0, 5.0))),))
    # y is 10 at 2.5 and at 7.5
    assert polylines(draw(figure)) == [[(60.0, 110.0), (185.0, 10.0)], [(435.0, 10.0), (560.0, 110.0)]]


def test_ten_thousand_points_are_a_small_picture_that_hides_no_excluded_one():
    marks = [
        mark(float(n), float(n % 7), left_out="too bright" if n == 5003 else "", frame_id=f"frm_{n}")
        for n in range(10_000)
    ]
    figure = Figure(x=X, y=Y, series=(Series(marks=tuple(marks)),))
    drawn = draw(figure)
    assert len(drawn) < 1_200_000
    assert drawn.count("point out") == 1
    # every pixel column has some
    assert len({round(x) for x, _ in places(drawn)}) > 440


def test_twenty_series_differ_in_colour_dashes_or_symbol():
    lines = tuple(Series(name=f"{n}", line=((0.0, n), (1.0, n)), marks=(mark(0.5, n),)) for n in range(20))
    drawn = draw(Figure(x=X, y=Y, series=lines))
    looks = re.findall(r'class="line (s\d)"( stroke-dasharray="[^"]*")? points', drawn)
    assert len(set(looks)) == len(looks) == 20
    shapes = re.findall(r'class="point (s\d)" data[^>]*d="([^"]*)"', drawn)
    assert len(set(shapes)) == len(shapes) == 20
    # a click on the legend hides its own alone
    assert re.findall(r'class="series" data-series="(\d+)"', drawn) == [str(n) for n in range(20)]


def test_long_names_are_shortened_in_their_middle_and_leave_room():
    names = [f"DJI Zenmuse with a very long name, serial number 0K8TF1A00{n}" for n in range(3)]
    ticks = tuple((-float(n), name) for n, name in enumerate(names))
    series = Series(name=names[0] * 3, marks=(mark(1.0, 0.0),))
    figure = Figure(
        x=X, y=Axis(label="", ticks=ticks, include=(0.6, -2.6)), series=(series, Series(name="b"))
    )
    drawn = draw(figure, (150.0, 10.0, 370.0, 110.0))
    texts = re.findall(r'class="end"[^>]*>([^<]*)<', drawn)
    assert len(set(texts)) == 3
    assert all(
        "…" in text and text.endswith(f"A00{n}") and 7 * len(text) < 150 for n, text in enumerate(texts)
    )
    legend = re.findall(r'class="legend"[^>]*>.*?<text[^>]*>([^<]*)<', drawn)
    assert 7 * len(legend[0]) < 220


@pytest.mark.parametrize(
    ("first", "last", "texts"),
    [
        # the night in which Europe's clocks are put forward: an hour is an hour, in UTC
        ("2026-03-28T22:00", "2026-03-29T04:00", ["22:00", "03-29", "02:00", "04:00"]),
        ("2025-11-20T00:00", "2026-02-10T00:00", ["2025-12", "2026-01", "2026-02"]),
        ("1969-12-31T00:00", "1970-01-02T00:00", ["12-31", "12:00", "01-01", "12:00", "01-02"]),
    ],
)
def test_times_are_drawn_in_utc(first, last, texts):
    ends = [datetime.fromisoformat(each).replace(tzinfo=UTC).timestamp() for each in (first, last)]
    figure = Figure(
        x=Axis(label="", is_time=True), y=Y, series=(Series(marks=tuple(mark(at, 1.0) for at in ends)),)
    )
    found = re.findall(r'class="mid"[^>]*>([\d:-]+)<', draw(figure))
    assert [text for text in found if text in texts] == texts


# --- Axes: round figures where they belong, and nothing drawn outside its frame


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
