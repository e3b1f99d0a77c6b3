"""Regions of interest: simple polygons in image pixels, and the pixels that belong to them."""

import hashlib
import itertools
import math
import re
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import shared
from radiometry.records import Record

MAX_POINTS = 1000
MAX_COORDINATE_PX = 1e6

_MACRO = re.compile(r"\s*(makePolygon|makeRectangle)\s*\(([^()]*)\)\s*(?:;\s*)?", re.ASCII)

# ImageJ moves every crossing right by this much, so that rounding never decides who owns a centre on an edge.
_EDGE_SHIFT_PX = 1e-8


class Polygon(Record, kw_only=False):
    """A simple polygon: x right, y down [px], origin at the visible area's top-left corner.

    Pixel (row, col) has its centre at (x, y) = (col + 0.5, row + 0.5). Polygons are made by
    `Polygon.from_points` or `parse_imagej`, which refuse what is not a simple polygon.
    """

    #: Corners (x, y) [px], from the smallest (x, y) and clockwise on the screen, in whichever order they were
    #: given: one region has one text and one key
    points: tuple[tuple[float, float], ...]

    @classmethod
    def from_points(cls, points: Iterable[Sequence[float]]) -> "Polygon":
        """Check corners (x, y) [px] and put them in canonical order; the closing one may be repeated."""
        corners = _finite_points(points)
        area_px = _signed_area_px(np.array(corners))
        if np.linalg.matrix_rank(np.array(corners) - corners[0]) < 2:
            raise shared.ROI_INVALID.reject("The polygon encloses no area: its points lie on one line.")
        _refuse_self_intersection(np.array(corners))
        if area_px < 0.0:
            corners.reverse()
        first = corners.index(min(corners))
        return cls(tuple(corners[first:] + corners[:first]))

    @property
    def text(self) -> str:
        """The points as `x,y` separated by blanks, each number in its shortest exact form."""
        return " ".join(f"{x!r},{y!r}" for x, y in self.points)

    @property
    def sha256(self) -> str:
        """Key of the region: equal for every way of writing the same corners."""
        return hashlib.sha256(self.text.encode()).hexdigest()


class Window(Record):
    """A rectangle of whole pixels in the visible area."""

    row0: int  #: First row and column [px]
    col0: int
    height: int  #: Number of rows and columns [px]
    width: int


def require_pixels(inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the pixels of a region, which must have some."""
    if not inside.any():
        raise shared.ROI_EMPTY.reject("The region holds no pixel of this window of the frame.")
    return inside


def parse_imagej(text: str) -> Polygon:
    """Read a recorded ImageJ macro call.

    Parameters
    ----------
    text : str
        `makePolygon(x1,y1,x2,y2,...)` or `makeRectangle(x,y,width,height)`.

    Raises
    ------
    InputRejected
        `roi_invalid` or `roi_self_intersecting`.
    """
    call = _MACRO.fullmatch(text)
    if call is None:
        raise shared.ROI_INVALID.reject(
            "The region is not an ImageJ call: paste a line such as makePolygon(10,10,90,10,90,60) "
            "or makeRectangle(10,10,80,50)."
        )
    name, arguments = call.groups()
    try:
        numbers = [float(word) for word in arguments.split(",")]
    except ValueError:
        raise shared.ROI_INVALID.reject(
            f"{name} holds something that is not a number: {arguments.strip()[:80]!r}."
        ) from None
    if name == "makeRectangle":
        return _rectangle(numbers)
    if len(numbers) % 2:
        raise shared.ROI_INVALID.reject(f"makePolygon holds {len(numbers)} numbers: every x needs its y.")
    return Polygon.from_points(zip(numbers[::2], numbers[1::2], strict=True))


def bounding_window(polygon: Polygon, *, height_px: int, width_px: int) -> Window:
    """Return the smallest window that contains every pixel of a polygon.

    Parameters
    ----------
    polygon : Polygon
        Region in the frame.
    height_px, width_px : int
        Size of the frame [px].

    Raises
    ------
    InputRejected
        `roi_outside_frame` if a corner is outside the frame, `roi_empty` if no pixel centre lies inside.
    """
    for x, y in polygon.points:
        if not (0.0 <= x <= width_px and 0.0 <= y <= height_px):
            raise shared.ROI_OUTSIDE_FRAME.reject(
                f"The polygon leaves the frame: its point ({x:g}, {y:g}) is outside the "
                f"{width_px} x {height_px} pixels of the image."
            )
    xs, ys = zip(*polygon.points, strict=True)
    row0, row1 = math.ceil(min(ys) - 0.5), math.ceil(max(ys) - 0.5)
    col0, col1 = (math.floor(x + 0.5 + _EDGE_SHIFT_PX) for x in (min(xs), max(xs)))
    window = Window(row0=row0, col0=col0, height=row1 - row0, width=min(col1, width_px) - col0)
    if min(window.height, window.width) < 1 or not _toggles(polygon, window)[1::2].any():
        raise shared.ROI_EMPTY.reject(
            "The polygon holds no pixel centre: draw it larger than a pixel each way."
        )
    return window


def mask(polygon: Polygon, window: Window) -> NDArray[np.bool_]:
    """Return the pixels of a window that belong to a polygon.

    A pixel belongs to the polygon if its centre does (even-odd rule along each row). Of centres exactly on an
    edge, those on a right or upper edge belong and those on a left or lower edge do not. This is ImageJ's
    rule [1], so polygons that share an edge share no pixel and miss none.

    [1] ImageJ, ij.process.PolygonFiller

    Parameters
    ----------
    polygon : Polygon
        Region in the frame.
    window : Window
        Window that contains the region.

    Returns
    -------
    ndarray of bool
        True for the pixels of the region, (row, col) with the window's height and width.
    """
    runs = _toggles(polygon, window)
    inside = np.arange(runs.size) % 2 == 1
    return np.repeat(inside, runs).reshape(window.height, window.width)


def _toggles(polygon: Polygon, window: Window) -> NDArray[np.intp]:
    """Return the lengths [px] of the runs outside, inside, outside, ... of the window read row by row."""
    height, width = window.height, window.width
    x0, y0, x1, y1 = _edges_downwards(polygon)
    first = np.clip(np.ceil(y0 - 0.5) - window.row0, 0, height).astype(np.intp)
    last = np.clip(np.ceil(y1 - 0.5) - window.row0, 0, height).astype(np.intp)
    rows_per_edge = last - first
    edge = np.repeat(np.arange(x0.size), rows_per_edge)
    row = np.arange(edge.size) - np.repeat(np.cumsum(rows_per_edge) - rows_per_edge - first, rows_per_edge)
    centre_y = row + (window.row0 + 0.5)
    slope = (x1 - x0) / np.where(y1 > y0, y1 - y0, 1.0)
    crossing_x = x0[edge] + (centre_y - y0[edge]) * slope[edge]
    col = np.floor(crossing_x + (0.5 + _EDGE_SHIFT_PX)) - window.col0
    position = np.sort(row * width + np.clip(col, 0, width).astype(np.intp))
    return np.diff(position, prepend=0, append=height * width)


def _edges_downwards(polygon: Polygon) -> tuple[NDArray[np.float64], ...]:
    """Return x0, y0, x1, y1 of every edge with y0 <= y1: both owners compute the same crossings."""
    start = np.array(polygon.points)
    stop = np.roll(start, -1, axis=0)
    upward = start[:, 1] > stop[:, 1]
    start[upward], stop[upward] = stop[upward], start[upward]
    return start[:, 0], start[:, 1], stop[:, 0], stop[:, 1]


def _rectangle(numbers: list[float]) -> Polygon:
    if len(numbers) != 4:
        raise shared.ROI_INVALID.reject(
            f"makeRectangle takes x, y, width and height: four numbers, not {len(numbers)}."
        )
    x, y, width, height = numbers
    if not (width > 0 and height > 0):
        raise shared.ROI_INVALID.reject("makeRectangle needs a width and a height above zero.")
    return Polygon.from_points([(x, y), (x + width, y), (x + width, y + height), (x, y + height)])


def _finite_points(points: Iterable[Sequence[float]]) -> list[tuple[float, float]]:
    """Check number, shape and size of the points; drop a point that repeats the one before it."""
    corners: list[tuple[float, float]] = []
    for number, point in enumerate(itertools.islice(points, MAX_POINTS + 1), start=1):
        if len(point) != 2:
            raise shared.ROI_INVALID.reject(f"Point {number} of the polygon is not a pair (x, y).")
        x, y = float(point[0]) + 0.0, float(point[1]) + 0.0  # adding zero turns -0.0 into 0.0
        if not (abs(x) <= MAX_COORDINATE_PX and abs(y) <= MAX_COORDINATE_PX):
            raise shared.ROI_INVALID.reject(
                f"Point {number} of the polygon, ({x:g}, {y:g}), is not a finite position within "
                f"{MAX_COORDINATE_PX:g} pixels."
            )
        if number > MAX_POINTS:
            raise shared.ROI_INVALID.reject(f"The polygon has more than {MAX_POINTS} points.")
        if not corners or corners[-1] != (x, y):
            corners.append((x, y))
    if len(corners) > 1 and corners[-1] == corners[0]:
        corners.pop()
    if len(corners) < 3:
        raise shared.ROI_INVALID.reject(
            f"A polygon needs at least three different points; this one has {len(corners)}."
        )
    return corners


def _signed_area_px(corners: NDArray[np.float64]) -> float:
    """Compute the shoelace area about the first corner: positive if clockwise on the screen."""
    x, y = (corners - corners[0]).T
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def _refuse_self_intersection(corners: NDArray[np.float64]) -> None:
    """Refuse crossing edges, and corners that lie on an edge of which they are not an end.

    The sign side[i, k] states on which side of edge i corner k lies.
    """
    start, stop = corners, np.roll(corners, -1, axis=0)
    run = (stop - start)[:, None, :]
    offset = corners[None, :, :] - start[:, None, :]
    side = np.sign(run[..., 0] * offset[..., 1] - run[..., 1] * offset[..., 0])
    split = side * np.roll(side, -1, axis=1) < 0  # edge j's ends lie on both sides of edge i
    along = np.sum(run * offset, axis=2)
    touch = (side == 0) & (along >= 0) & (along <= np.sum(run * run, axis=2))
    index = np.arange(len(corners))
    touch[index, index] = False
    touch[index, (index + 1) % len(corners)] = False
    found = np.argwhere((split & split.T) | touch)
    if found.size:
        x, y = corners[found[0][0]]
        raise shared.ROI_SELF_INTERSECTING.reject(
            f"The polygon crosses or touches itself at the edge that starts at ({x:g}, {y:g}): "
            "draw its corners in order around the area."
        )
