"""Isolines of a map that is averaged over squares."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, cast

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.opencv import cv2
from radiometry.maps.uncertainty import PixelUncertainty

Array = NDArray[np.float64]
Line = NDArray[np.float64]

MOST_LEVELS: Final = 20
MOST_VERTICES: Final = 50_000
_USUAL_LEVELS: Final = 8
TOLERANCE: Final = 0.1
"""Of a square: how far a line is moved where points are left out of it."""

_NOISE_SHARE: Final = 0.25
_RING_SQUARES: Final = 2.0


@dataclass(frozen=True, kw_only=True)
class Isoline:
    """All lines of one level.

    Attributes
    ----------
    level : float
        Value along the lines.
    lines : tuple of ndarray of float64
        Points (x, y) [px] of each line, (n, 2); a closed one ends where it begins, an open one at the border
        of what is known.
    slope_per_px : float or None
        Median slope across the lines, in the map's unit per pixel; None without lines.
    rings_left_out : int
        Rings around one square, which noise alone draws.
    """

    level: float
    lines: tuple[Line, ...]
    slope_per_px: float | None
    rings_left_out: int


def choose_levels(low: float, high: float, *, logarithmic: bool) -> tuple[float, ...]:
    """Return round levels within limits: 1, 2, 5, 10, ... or evenly spaced, eight at most.

    Parameters
    ----------
    low, high : float
        Limits, of which the lower is above zero if `logarithmic`.
    logarithmic : bool
        True for levels of nearly one ratio.
    """
    if not low < high:
        return ()
    if logarithmic and high / low > 3.0:
        decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
        for steps in ((1, 2, 5), (1, 3), (1,)):
            found = [float(f"{step}e{decade}") for decade in decades for step in steps]
            within = tuple(level for level in found if low < level < high)
            if len(within) <= _USUAL_LEVELS:
                return within
        return within[:: math.ceil(len(within) / _USUAL_LEVELS)]
    rough = (high - low) / _USUAL_LEVELS
    decade = math.floor(math.log10(rough))
    step = next(Step for Step in (1, 2, 5, 10) if Step * 10.0**decade >= rough)
    first, last = (math.floor(end / step / 10.0**decade) for end in (low, high))
    numbers = (n * step for n in range(first, last + 1))
    return tuple(level for n in numbers if low < (level := float(f"{n}e{decade}")) < high)


def choose_step(
    levels: Sequence[float], *, pixels: int, most: int, uncertainty: PixelUncertainty | None
) -> int:
    """Return the side of the squares [px] over which noise is a quarter of the space between levels.

    Parameters
    ----------
    levels : sequence of float
        Levels in ascending order.
    pixels : int
        Pixels of the area.
    most : int
        Largest number of squares.
    uncertainty : PixelUncertainty or None
        Noise of the pixels, if it is known.
    """
    coarse = max(1, math.ceil(math.sqrt(pixels / most)))
    if uncertainty is None or not levels:
        return coarse
    spaces = np.diff(levels) if len(levels) > 1 else np.abs(levels) / 2.0
    values = np.array(levels[: len(spaces)], np.float64)
    wanted = _NOISE_SHARE * np.maximum(spaces, 1e-12)
    sides = uncertainty.own(values) * math.sqrt(uncertainty.likeness) / wanted
    largest = max(coarse, math.isqrt(pixels) // 16)
    return int(min(max(coarse, math.ceil(float(sides.max()) - 1e-9)), largest))


def trace_isolines(
    plane: NDArray[np.floating], levels: Sequence[float], *, step: int, left_px: float, top_px: float
) -> tuple[Isoline, ...]:
    """Trace the lines along which a map has given values.

    Parameters
    ----------
    plane : ndarray of float
        Means over squares, (row, col), at least two each way; NaN where unknown.
    levels : sequence of float
        Values of the lines.
    step : int
        Side of a square [px].
    left_px, top_px : float
        Left upper corner of the first square in the map [px].

    Notes
    -----
    Between the centres of four squares the map is taken as bilinear; beside an unknown square no line is
    drawn.
    """
    import contourpy  # noqa: PLC0415  its library is loaded for this alone

    values = np.ma.masked_invalid(np.asarray(plane, np.float64))
    x = left_px + (np.arange(plane.shape[1]) + 0.5) * step
    y = top_px + (np.arange(plane.shape[0]) + 0.5) * step
    # the centre of four squares decides a saddle either way the map lies
    tracer = contourpy.contour_generator(
        x, y, values, name="serial", line_type=contourpy.LineType.Separate, corner_mask=False
    )
    slopes = np.hypot(*np.gradient(values.filled(np.nan), float(step)))
    found = [(level, cast("list[Line]", tracer.lines(level))) for level in levels]
    return tuple(_draw(lines, level, slopes, (left_px, top_px, step)) for level, lines in found)


def is_ragged(isolines: Sequence[Isoline], uncertainty: PixelUncertainty | None, *, step: int) -> bool:
    """Return True if noise moves the lines of most levels by more than a square, or draws mostly rings.

    Parameters
    ----------
    isolines : sequence of Isoline
        Lines of each level.
    uncertainty : PixelUncertainty or None
        Noise of the pixels, if it is known.
    step : int
        Side of a square [px].
    """
    ragged = 0
    for each in isolines:
        noise = 0.0 if uncertainty is None else float(uncertainty.own(np.array(each.level), float(step**2)))
        is_moved = each.slope_per_px is not None and noise > each.slope_per_px * step
        ragged += is_moved or each.rings_left_out > len(each.lines)
    return 2 * ragged > len(isolines)


def _draw(found: Sequence[Line], level: float, slopes: Array, grid: tuple[float, float, int]) -> Isoline:
    left, top, step = grid
    kept, steep, rings = [], [], 0
    for line in found:
        is_closed = bool(np.array_equal(line[0], line[-1]))
        if is_closed and np.ptp(line, axis=0).max() <= _RING_SQUARES * step * (1.0 - 1e-9):
            rings += 1
            continue
        cols = np.clip(((line[:, 0] - left) / step).astype(np.intp), 0, slopes.shape[1] - 1)
        rows = np.clip(((line[:, 1] - top) / step).astype(np.intp), 0, slopes.shape[0] - 1)
        steep.append(slopes[rows, cols])
        corners = line[: -1 if is_closed else None, None, :].astype(np.float32)
        thinned = cv2.approxPolyDP(corners, TOLERANCE * step, closed=is_closed)[:, 0, :].astype(np.float64)
        kept.append(np.concatenate([thinned, thinned[:1]]) if is_closed else thinned)
    known = np.concatenate(steep) if steep else np.array([np.nan])
    known = known[np.isfinite(known)]
    return Isoline(
        level=level,
        lines=tuple(kept),
        slope_per_px=float(np.median(known)) if known.size else None,
        rings_left_out=rings,
    )
