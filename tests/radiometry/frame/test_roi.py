"""Polygons: what is refused and with which sentence, and which pixels belong."""

import itertools
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radiometry.findings import InputRejected, shared
from radiometry.frame.roi import Polygon, Window, bounding_window, mask, parse_imagej

FRAME = Window(row0=0, col0=0, height=14, width=14)
TRIANGLE = [(0, 0), (5, 5), (0, 5)]


def in_exact_arithmetic(points, window):
    """Decide every centre by counting the edges at its left, in fractions; the rule written a second way."""
    shift = Fraction(1, 10**8)
    inside = np.zeros((window.height, window.width), bool)
    corners = [(Fraction(x), Fraction(y)) for x, y in points]
    edges = list(zip(corners, corners[1:] + corners[:1], strict=True))
    for row, col in itertools.product(range(window.height), range(window.width)):
        cx = Fraction(2 * (col + window.col0) + 1, 2)
        cy = Fraction(2 * (row + window.row0) + 1, 2)
        crossings = [
            x0 + (cy - y0) * (x1 - x0) / (y1 - y0) for (x0, y0), (x1, y1) in edges if (y0 <= cy) != (y1 <= cy)
        ]
        inside[row, col] = sum(x + shift < cx for x in crossings) % 2
    return inside


eighths = st.integers(0, 8 * 14).map(lambda n: n / 8)
integers = st.integers(0, 14).map(float)


@st.composite
def polygons(draw, coordinate=eighths):
    points = draw(st.lists(st.tuples(coordinate, coordinate), min_size=3, max_size=9, unique=True))
    centre = np.mean(points, axis=0)
    points.sort(key=lambda p: np.arctan2(p[1] - centre[1], p[0] - centre[0]))
    try:
        return Polygon.from_points(points)
    except InputRejected:
        return Polygon.from_points([(1, 1), (draw(st.integers(2, 14)), 3), (4, 12)])


@given(polygons(st.one_of(eighths, integers)), st.integers(-3, 3), st.integers(-3, 3))
def test_mask_is_the_rule_in_exact_arithmetic(polygon, row0, col0):
    window = Window(row0=row0, col0=col0, height=14, width=12)
    np.testing.assert_array_equal(mask(polygon, window), in_exact_arithmetic(polygon.points, window))


def test_imagej_example_of_centres_on_an_edge():
    """The hypotenuse of this triangle runs through five centres: a right edge, so they belong."""
    np.testing.assert_array_equal(
        mask(Polygon.from_points(TRIANGLE), Window(row0=0, col0=0, height=5, width=5)), np.tri(5, dtype=bool)
    )


def test_bounding_window_is_tight():
    polygon = Polygon.from_points([(2, 3), (7, 3), (7, 9), (2, 9)])
    window = bounding_window(polygon, height_px=20, width_px=20)
    assert window == Window(row0=3, col0=2, height=6, width=5)
    assert mask(polygon, window).all()


@pytest.mark.parametrize("point", [(-0.5, 3), (20.01, 3), (3, -1), (3, 10.5)])
def test_a_corner_outside_the_frame_is_named(point):
    polygon = Polygon.from_points([(5, 4), (9, 8), point])
    with pytest.raises(InputRejected, match="leaves the frame") as refusal:
        bounding_window(polygon, height_px=10, width_px=20)
    assert refusal.value.code is shared.ROI_OUTSIDE_FRAME
    assert f"({point[0]:g}, {point[1]:g})" in refusal.value.message


@pytest.mark.parametrize(
    "points",
    [
        [(1.6, 1.6), (2.4, 1.6), (2.4, 2.4), (1.6, 2.4)],  # between four centres
        [(0.6, 0.6), (3.3, 3.0), (3.35, 3.0)],  # a sliver whose window holds centres
    ],
)
def test_a_region_without_a_pixel_centre_is_refused(points):
    with pytest.raises(InputRejected, match="no pixel centre") as refusal:
        bounding_window(Polygon.from_points(points), height_px=10, width_px=10)
    assert refusal.value.code is shared.ROI_EMPTY


@pytest.mark.parametrize(
    ("points", "code", "words"),
    [
        ([(0, 0), (1, 1)], shared.ROI_INVALID, "at least three different points"),
        ([(0, 0), (1, 1), (0, 0), (0, 0)], shared.ROI_INVALID, "encloses no area|at least three|touches"),
        ([(0, 0), (1, 1), (2, 2)], shared.ROI_INVALID, "encloses no area"),
        ([(0, 0), (1, float("nan")), (2, 2)], shared.ROI_INVALID, "Point 2 .* not a finite position"),
        ([(0, 0), (float("inf"), 1), (2, 2)], shared.ROI_INVALID, "Point 2 .* not a finite position"),
        ([(0, 0), (1e7, 1), (2, 2)], shared.ROI_INVALID, "within 1e\\+06 pixels"),
        ([(0, 0), (1, 2, 3), (2, 2)], shared.ROI_INVALID, "Point 2 .* not a pair"),
        ([(i, (i * i) % 7) for i in range(1001)], shared.ROI_INVALID, "more than 1000 points"),
        ([(0, 0), (4, 4), (4, 0), (0, 3)], shared.ROI_SELF_INTERSECTING, "crosses or touches itself"),
        # a bow tie whose halves cancel
        ([(0, 0), (10, 10), (10, 0), (0, 10)], shared.ROI_SELF_INTERSECTING, "cross"),
        ([(0, 0), (4, 0), (4, 4), (2, 0), (0, 4)], shared.ROI_SELF_INTERSECTING, "touches itself"),
        ([(0, 0), (4, 0), (2, 0), (2, 4)], shared.ROI_SELF_INTERSECTING, "touches itself"),
        ([(0, 0), (2, 2), (4, 0), (4, 4), (2, 2), (0, 4)], shared.ROI_SELF_INTERSECTING, "touches itself"),
    ],
)
def test_what_is_no_simple_polygon_is_refused(points, code, words):
    with pytest.raises(InputRejected, match=words) as refusal:
        Polygon.from_points(points)
    assert refusal.value.code is code


def test_a_thousand_points_are_a_polygon():
    angle = np.linspace(0, 2 * np.pi, 1000, endpoint=False)
    polygon = Polygon.from_points(np.c_[50 + 40 * np.cos(angle), 50 + 40 * np.sin(angle)])
    inside = mask(polygon, bounding_window(polygon, height_px=100, width_px=100))
    assert inside.sum() == pytest.approx(np.pi * 40**2, rel=0.01)


@pytest.mark.parametrize("start", range(3))
@pytest.mark.parametrize("step", [1, -1])
def test_one_region_has_one_key(start, step):
    points = [TRIANGLE[(start + step * i) % 3] for i in range(3)]
    same = Polygon.from_points([*points, points[0]])
    assert same == Polygon.from_points(TRIANGLE)
    assert same.sha256 == Polygon.from_points(TRIANGLE).sha256
    assert same.sha256 != Polygon.from_points([(0, 0), (5, 5), (0, 5.25)]).sha256


def test_the_key_is_the_sha256_of_the_text():
    polygon = Polygon.from_points([(-0.0, 0), (0, 2.5), (1e-3, 2)])
    assert polygon.text == "0.0,0.0 0.001,2.0 0.0,2.5"


@pytest.mark.parametrize(
    "text",
    ["makePolygon(0,0,5,5,0,5)", "  makePolygon( 0, 0 , 5.0,5, 0 ,5 ) ;\n", "makePolygon(0,5,5,5,0,0);"],
)
def test_a_pasted_imagej_line_is_read(text):
    assert parse_imagej(text) == Polygon.from_points(TRIANGLE)


def test_a_pasted_rectangle_is_read():
    assert parse_imagej("makeRectangle(2, 3, 10, 4);") == Polygon.from_points(
        [(2, 3), (12, 3), (12, 7), (2, 7)]
    )


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("makeOval(1,2,3,4)", "not an ImageJ call"),
        ("makePolygon(1,2,3,4,5,6) run('x')", "not an ImageJ call"),
        ("", "not an ImageJ call"),
        ("makePolygon(1,2,3,4,5)", "5 numbers: every x needs its y"),
        ("makePolygon(1,2,a,4,5,6)", "not a number: '1,2,a,4,5,6'"),
        ("makePolygon()", "not a number"),
        ("makeRectangle(1,2,3)", "four numbers, not 3"),
        ("makeRectangle(1,2,0,4)", "above zero"),
        ("makeRectangle(1,2,nan,4)", "above zero"),
        ("makeRectangle(1,2,inf,4)", "not a finite position"),
    ],
)
def test_a_bad_imagej_line_is_refused_with_the_reason(text, words):
    with pytest.raises(InputRejected, match=words) as refusal:
        parse_imagej(text)
    assert refusal.value.code is shared.ROI_INVALID


@given(st.integers(1, 4), st.integers(10, 139), st.sampled_from([3, 5, 7]))
def test_rounding_does_not_decide_who_owns_a_centre_on_an_edge(start, stop, steepness):
    """Corners at tenths, which no float holds: the edge x = y / steepness still owns its centres."""
    top, bottom = start / 10, max(stop, steepness * start) / 10
    on_edge = [(top / steepness, top), (bottom / steepness, bottom)]
    owned = mask(Polygon.from_points([*on_edge, (-9.0, bottom), (-9.0, top)]), FRAME)
    for col in range(14):
        row = (steepness * (2 * col + 1) - 1) // 2  # the centre (col + 1/2, row + 1/2) lies on the edge
        if top < row + 0.5 < bottom and row < 14:
            assert owned[row, col]
            assert not owned[row, col + 1 :].any()
