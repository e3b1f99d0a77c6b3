"""Readings of a finished map of any quantity: uncertainty of its values, places on the ground, isolines."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from radiometry.fitting.comparison import SUBTRACTED
from radiometry.frame.grid import find_homography, map_plane
from radiometry.frame.opencv import cv2
from radiometry.frame.statistics import GREY
from radiometry.records import Record, about

Array = NDArray[np.float64]
Line = NDArray[np.float64]

COVERAGE: Final = 2.0  # standard uncertainties below which a value is not distinguished from zero

_INDEPENDENT: Final = frozenset({"rgb", GREY})
_BEYOND: Final = 0.5  # of the marked rectangle's sides: how far beyond it the road is taken as the same plane

MOST_LEVELS: Final = 20
MOST_VERTICES: Final = 50_000
_USUAL_LEVELS: Final = 8
TOLERANCE: Final = 0.1  # of a square: how far a line is moved where points are left out of it

_NOISE_SHARE: Final = 0.25
_RING_SQUARES: Final = 2.0


class PixelUncertainty(Record):
    """Uncertainty of values of a map."""

    # standard uncertainty as a share of the value: K, meter, time, f-number; of places, that of each
    relative: float | Array
    # standard uncertainty that is the same in every pixel, in the map's unit: dark signal, stray light
    constant: float
    pixel: float  # noise of a single pixel where the value is `reference`, in the map's unit
    reference: float  # mean of the region in which `pixel` was found
    # variance of the mean of many neighbouring pixels, times their number, over that of one: above 1 where
    # pixels are made of the same raw values
    likeness: float = 1.0

    @property
    def limit(self) -> float:
        """Value that a single pixel must exceed to be distinguished from zero."""
        return COVERAGE * math.hypot(self.constant, self.pixel)

    def common(self, values: Array) -> Array:
        """Compute the part that all pixels share, which no mean reduces."""
        return np.hypot(self.relative * values, self.constant)

    def own(self, values: Array, pixels: Array | float = 1.0) -> Array:
        """Compute an upper bound of the noise of values that are each the mean of some pixels.

        Noise of variance a + b v, with a and b not negative, grows at most as v: beyond the reference u^2 is
        that of the reference times v / reference, below it that of the reference.
        """
        above = np.maximum(1.0, values / self.reference) if self.reference > 0.0 else np.ones_like(values)
        return self.pixel * np.sqrt(above * np.minimum(1.0, self.likeness / pixels))


def find_likeness(cfa: str, channel: str) -> float:
    """Compute how much less a mean of a map's pixels averages than their number says.

    The largest eigenvalue of the pixels' covariance over the variance of one pixel: the variance of an
    equally weighted mean of any n different pixels is at most that variance times it, over n.

    Parameters
    ----------
    cfa : str
        Pattern of the frame: "rgb", "grey", or four letters.
    channel : str
        Signal of the map.

    Returns
    -------
    float
        2 where half of the pixels are means of their green neighbours; 64 / 9 where each is a mean of 3 x 3
        with the weights 1 2 1; else 1.
    """
    if cfa in _INDEPENDENT or len(cfa) != 4:
        return 1.0
    return {"green": 2.0, GREY: (16.0 / 6.0) ** 2}.get(channel, 1.0)


class ValueUncertainty(Record):
    """Uncertainty of a value v: u^2 = (u_rel v)^2 + u_constant^2 + u_pixel^2; the last two in its unit."""

    u_rel: float = about("Of K, meter, time, f-number: the same share in every pixel.")
    u_constant: float = about("Of the dark signal and of stray light: the same in every pixel.")
    u_pixel: float = about(
        "A single pixel's own, as it was found in the measured region; a mean over a square "
        "of n x n pixels has 1/n of it, up to 1.5/n for `green` and 2.7/n for `grey` of a mosaic, whose "
        "pixels share raw values."
    )
    coverage_factor: float | None = about(
        "k for a coverage probability of 95 %, as of the region's mean; else 2."
    )
    effective_dof: float | None = about("Absent if they are without limit.")


def read_uncertainty(result: Mapping[str, Any]) -> ValueUncertainty | None:
    """Split a stored budget: all that is shared scales with the value, but for what is subtracted.

    Parameters
    ----------
    result : mapping
        A stored measurement.

    Returns
    -------
    ValueUncertainty or None
        None of a result without a budget of its pixels, such as an index.
    """
    if "smallest" not in result or "budget" not in result or not result["mean"]["value"]:
        return None
    mean, smallest = result["mean"]["value"], result["smallest"]
    shared = {
        share["source"]: share.get("standard_uncertainty_cd_m2", share.get("standard_uncertainty"))
        for share in result["budget"]
        if share["shared"]
    }
    constant = math.hypot(*(shared.pop(source, 0.0) for source in SUBTRACTED))
    relative = math.hypot(*shared.values()) / abs(mean)
    known = math.hypot(relative * smallest["value"], constant)
    return ValueUncertainty(
        u_rel=relative,
        u_constant=constant,
        u_pixel=math.sqrt(max(0.0, smallest["standard_uncertainty"] ** 2 - known**2)),
        coverage_factor=result.get("coverage_factor"),
        effective_dof=result.get("effective_dof"),
    )


def place_on_road(lanes: Mapping[str, Any], xy_px: Array) -> Array | None:
    """Return (x, y) along and across the lanes from the first marked corner [m].

    Parameters
    ----------
    lanes : mapping
        Lanes as `describe_lanes` returns them.
    xy_px : ndarray of float64
        Places in the picture [px], (n, 2).

    Returns
    -------
    ndarray of float64 or None
        (n, 2); None if a place lies further outside the marked rectangle than half its size, where errors of
        its corners grow fast.
    """
    inverse = np.linalg.inv(find_homography(lanes["marked"]))
    unit = map_plane(np.asarray(inverse, np.float64), xy_px)
    if not np.all(np.abs(unit - 0.5) <= 0.5 + _BEYOND):
        return None
    placed: Array = unit * np.array([lanes["length_m"], lanes["lanes"] * lanes["lane_width_m"]])
    return placed


def place_on_earth(transform: Sequence[float], xy_px: Array) -> Array:
    """Return (longitude, latitude) [deg] by an affine transformation, (n, 2).

    Parameters
    ----------
    transform : sequence of float
        (a, b, c, d, e, f) as GDAL counts them [deg].
    xy_px : ndarray of float64
        Places in the picture [px], (n, 2).
    """
    a, b, c, d, e, f = transform
    x, y = xy_px.T
    return np.column_stack([a + b * x + c * y, d + e * x + f * y])


class Isoline(Record):
    """All lines of one level."""

    level: float  # value along the lines
    # points (x, y) [px] of each line, (n, 2); a closed one ends where it begins, an open one at the border of
    # what is known
    lines: tuple[Line, ...]
    # median slope across the lines, in the map's unit per pixel; None without lines
    slope_per_px: float | None
    rings_left_out: int  # rings around one square, which noise alone draws


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

    Between the centres of four squares the map is taken as bilinear; beside an unknown square no line is
    drawn.

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
