"""Profile of a map along a line."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected, shared
from radiometry.maps.uncertainty import COVERAGE, PixelUncertainty

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

MOST_CORNERS: Final = 50
MOST_WIDTH_PX: Final = 101


@dataclass(frozen=True, kw_only=True)
class Trace:
    """Pixels along a line.

    Attributes
    ----------
    distance_px : ndarray of float64
        Distance of each place from the line's start [px], one pixel apart along each of its parts, (n,).
    xy_px : ndarray of float64
        (x, y) of each place [px], pixel centres at halves, (n, 2).
    rows, cols : ndarray of intp
        Pixels across the line at each place, (n, width); -1 outside the frame.
    """

    distance_px: Array
    xy_px: Array
    rows: Indices
    cols: Indices


@dataclass(frozen=True, kw_only=True)
class Profile:
    """Values along a line; NaN where a pixel of the mean is unknown.

    Attributes
    ----------
    distance_px : ndarray of float64
        Distance from the line's start [px], (n,).
    xy_px : ndarray of float64
        (x, y) [px], (n, 2).
    values : ndarray of float64
        Means of the pixels of each place, (n,).
    pixels : ndarray of float64
        Number of different pixels in each mean, (n,).
    step : int
        Number of places, a pixel apart, in each mean.
    """

    distance_px: Array
    xy_px: Array
    values: Array
    pixels: Array
    step: int

    def find_dark(self, uncertainty: PixelUncertainty) -> NDArray[np.bool_]:
        """Return the places whose values are not distinguished from zero.

        Parameters
        ----------
        uncertainty : PixelUncertainty
            Uncertainty of the map's pixels.
        """
        noise = uncertainty.own(np.zeros_like(self.values), self.pixels)
        return np.asarray(self.values < COVERAGE * np.hypot(noise, uncertainty.constant), np.bool_)


def trace_line(
    points: Sequence[tuple[float, float]], *, height_px: int, width_px: int, across_px: int = 1
) -> Trace:
    """Find the pixels along a line, one pixel apart.

    Parameters
    ----------
    points : sequence of tuple[float, float]
        Corners (x, y) of the line [px], two or more.
    height_px, width_px : int
        Size of the map [px].
    across_px : int, default: 1
        Number of pixels across the line.

    Raises
    ------
    InputRejected
        `line_invalid` for a line without length, with too many corners, or that leaves the map.

    Notes
    -----
    Each place takes the pixel that it lies in, so that a value is one of the map and has its noise: between
    two pixels, an interpolated value would have less.
    """
    parts = [(start, end) for start, end in itertools.pairwise(points) if start != end]
    if not parts:
        raise InputRejected(shared.LINE_INVALID, "The line has no length: give two different points.")
    if len(points) > MOST_CORNERS:
        raise InputRejected(shared.LINE_INVALID, f"The line has more than {MOST_CORNERS} points.")
    for x, y in points:
        if not (0.0 <= x <= width_px and 0.0 <= y <= height_px):
            raise InputRejected(
                shared.LINE_INVALID,
                f"The line leaves the map: ({x:g}, {y:g}) is outside its {width_px} x {height_px} pixels.",
            )
    travelled, placed, sides = 0.0, [], []
    for number, (start, end) in enumerate(parts):
        length = math.dist(start, end)
        # a corner belongs to the part that ends there
        along = np.arange(0 if number == 0 else 1, math.floor(length + 1e-9) + 1.0)
        if number == len(parts) - 1 and not along.size:
            along = np.array([length])
        heading = (np.array(end) - start) / length
        xy = np.array(start) + along[:, None] * heading
        placed.append(np.column_stack([travelled + along, xy]))
        sides.append(np.broadcast_to([-heading[1], heading[0]], xy.shape))
        travelled += length
    found = np.concatenate(placed)
    offsets = np.arange(across_px) - (across_px - 1) / 2.0
    spread = found[:, None, 1:] + offsets[:, None] * np.concatenate(sides)[:, None, :]
    # the frame's own border belongs to its last pixels; rounding must not move a centre line
    cols, rows = (np.floor(spread[..., axis] + 1e-9).astype(np.intp) for axis in (0, 1))
    cols, rows = (
        np.where(cols == width_px, width_px - 1, cols),
        np.where(rows == height_px, height_px - 1, rows),
    )
    outside = (rows < 0) | (rows >= height_px) | (cols < 0) | (cols >= width_px)
    return Trace(
        distance_px=found[:, 0],
        xy_px=found[:, 1:],
        rows=np.where(outside, -1, rows),
        cols=np.where(outside, -1, cols),
    )


def average_trace(trace: Trace, values: Array, *, most: int) -> Profile:
    """Average a trace across the line, and along it where it has more places than asked for.

    Parameters
    ----------
    trace : Trace
        Pixels along the line.
    values : ndarray of float64
        Their values, (n, width); NaN where unknown.
    most : int
        Largest number of places.

    Notes
    -----
    A pixel that several places lie in counts that often. A mean of weights w has the noise of 1 / sum(w^2)
    pixels.
    """
    step = math.ceil(len(values) / most)
    starts = range(0, len(values), step)
    means, pixels, distances, places = [], [], [], []
    for start in starts:
        part = slice(start, start + step)
        inside = trace.rows[part] >= 0
        taken = np.column_stack([trace.rows[part][inside], trace.cols[part][inside]])
        _, counts = np.unique(taken, axis=0, return_counts=True)
        pixels.append(counts.sum() ** 2 / np.sum(counts**2.0))
        means.append(values[part][inside].mean())
        distances.append(trace.distance_px[part].mean())
        places.append(trace.xy_px[part].mean(axis=0))
    return Profile(
        distance_px=np.array(distances),
        xy_px=np.array(places),
        values=np.array(means),
        pixels=np.array(pixels, np.float64),
        step=step,
    )
