"""Profile of an edge, four samples to a pixel, and the lengths that are read off it."""

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

Vector = NDArray[np.float64]

BINS_PER_PIXEL = 4
_ROUNDS = 3
_NEAR_PX = 6.0
_SMOOTHED = 1.1
_FINER = 16


@dataclass(frozen=True, kw_only=True)
class Sums:
    """Samples gathered in bins of a quarter pixel by their distance from the edge.

    Attributes
    ----------
    count, total : ndarray of float64
        Number of samples and sum of their values, (bin,).
    offset, square : ndarray of float64
        Sum of their places within the bin, from -1/2 to 1/2, and of its square, (bin,).
    """

    count: Vector
    total: Vector
    offset: Vector
    square: Vector

    def without(self, part: "Sums") -> "Sums":
        """Return the sums of what remains when a part is subtracted.

        Parameters
        ----------
        part : Sums
            Sums of the part.
        """
        return Sums(
            count=self.count - part.count,
            total=self.total - part.total,
            offset=self.offset - part.offset,
            square=self.square - part.square,
        )


@dataclass(frozen=True, kw_only=True)
class Profile:
    """Edge spread function at points, rising.

    Attributes
    ----------
    distance_px : ndarray of float64
        Distance from the edge, normal to it [px], (bin,).
    signal : ndarray of float64
        Signal, (bin,).
    step_px : float
        Step between the points, normal to the edge [px].
    low_px, high_px : float
        Range that every line reaches [px].
    """

    distance_px: Vector
    signal: Vector
    step_px: float
    low_px: float
    high_px: float


@dataclass(frozen=True, kw_only=True)
class Lengths:
    """Lengths of a profile; NaN where one does not exist."""

    rise_px: float
    lsf_fwhm_px: float
    overshoot: float
    undershoot: float


def gather(distance_px: Vector, values: Vector, *, bins: int) -> Sums:
    """Return samples sorted into bins.

    Parameters
    ----------
    distance_px : ndarray of float64
        Distances along the line [px], the edge in the middle of all bins.
    values : ndarray of float64
        Values of the samples.
    bins : int
        Number of bins.

    Returns
    -------
    Sums
        Sums of each bin.
    """
    place = distance_px * BINS_PER_PIXEL + bins // 2
    index = np.floor(place).astype(np.intp)
    inside = (index >= 0) & (index < bins)
    index, offset, values = index[inside], (place - index - 0.5)[inside], values[inside]
    return Sums(
        count=np.bincount(index, minlength=bins).astype(np.float64),
        total=np.bincount(index, values, bins).astype(np.float64),
        offset=np.bincount(index, offset, bins).astype(np.float64),
        square=np.bincount(index, offset * offset, bins).astype(np.float64),
    )


def form_profile(sums: Sums, *, slope: float, low_px: float, high_px: float) -> Profile:
    """Compute the edge spread function at the middle of every bin.

    Parameters
    ----------
    sums : Sums
        Sums of each bin.
    slope : float
        Slope of the edge, which converts distances along the line into those normal to
        it.
    low_px, high_px : float
        Range along the line that every line reaches [px].

    Notes
    -----
    A bin's mean is not the value at its middle: mean = e + m1 e' + m2 e'' / 2, with m1, m2 the moments of
    the places that its samples really have. Both terms are subtracted, e', e'' from the profile itself, in
    bins. Evenly filled bins have m1 = 0, m2 = 1/12, and what is removed is their own aperture, sinc(f / 4)
    in the MTF, which is 1 % of MTF50 for a blur of half a pixel. Empty bins are bridged by a line.
    """
    bins = np.arange(sums.count.size)
    filled = sums.count > 0
    counts = np.maximum(sums.count, 1.0)
    mean = np.interp(bins, bins[filled], sums.total[filled] / sums.count[filled])
    first = np.where(filled, sums.offset / counts, 0.0)
    second = np.where(filled, sums.square / counts, 1.0 / 12.0)
    signal = mean
    for _ in range(_ROUNDS):
        curvature = np.zeros_like(mean)
        curvature[1:-1] = signal[2:] - 2.0 * signal[1:-1] + signal[:-2]
        signal = mean - first * np.gradient(signal) - 0.5 * second * curvature
    normal = math.cos(math.atan(slope))
    step_px = normal / BINS_PER_PIXEL
    if signal[-1] < signal[0]:
        signal = signal[::-1]
        low_px, high_px = -high_px, -low_px
    return Profile(
        distance_px=np.asarray((bins - bins.size // 2 + 0.5) * step_px, np.float64),
        signal=signal,
        step_px=step_px,
        low_px=low_px * normal,
        high_px=high_px * normal,
    )


def measure_lengths(profile: Profile) -> Lengths:
    """Read the 10-90 % rise, the line spread's full width at half maximum, and overshoots off a profile.

    Notes
    -----
    Dark and bright are the means over the outer half of either side. Between the points the profile is a
    cubic spline. Overshoots are searched within 6 px; noise alone makes them a little more than 0.
    """
    distance, signal = profile.distance_px, profile.signal
    valid = (distance >= profile.low_px) & (distance <= profile.high_px)
    dark = float(signal[valid & (distance <= profile.low_px / 2.0)].mean())
    bright = float(signal[valid & (distance >= profile.high_px / 2.0)].mean())
    relative = (signal[valid] - dark) / (bright - dark)
    spline = scipy.interpolate.CubicSpline(distance[valid], relative)
    middle = _nearest(_find_crossings(spline, 0.5), 0.0)
    ten = _last_below(_find_crossings(spline, 0.1), middle)
    ninety = -_last_below(-_find_crossings(spline, 0.9), -middle)
    near = np.abs(distance[valid]) <= _NEAR_PX
    rise_px = ninety - ten
    return Lengths(
        rise_px=rise_px,
        lsf_fwhm_px=_measure_width(distance[valid], relative, middle=middle, rise_px=rise_px),
        overshoot=max(0.0, float(relative[near].max()) - 1.0),
        undershoot=max(0.0, -float(relative[near].min())),
    )


def _measure_width(distance_px: Vector, relative: Vector, *, middle: float, rise_px: float) -> float:
    """Compute the full width at half maximum of the line spread function, whose peak lies near the edge.

    The derivative is that of a local sextic over a tenth more than the 10-90 % rise, seven points at least:
    if it is shorter, noise makes the peak; if it is longer, the peak is flattened. A Gaussian comes out 0.4
    % too wide.
    """
    step_px = float(distance_px[1] - distance_px[0])
    if not (math.isfinite(rise_px) and 0.0 < rise_px <= distance_px.size * step_px / 3.0):
        return math.nan
    points = max(7, 2 * round(_SMOOTHED * rise_px / step_px / 2.0) + 1)
    derivative = scipy.signal.savgol_filter(relative, points, 6, deriv=1, delta=step_px)
    spread = scipy.interpolate.CubicSpline(distance_px, derivative)
    fine = np.linspace(max(spread.x[0], middle - _NEAR_PX), min(spread.x[-1], middle + _NEAR_PX), 1201)
    peak = float(fine[np.argmax(spread(fine))])
    crossings = _find_crossings(spread, float(spread(peak)) / 2.0)
    return -_last_below(-crossings, -peak) - _last_below(crossings, peak)


def _find_crossings(curve: "scipy.interpolate.CubicSpline", level: float) -> Vector:
    """Return the places where a spline crosses a level, by lines over a sixteenth of its own steps."""
    place = np.linspace(curve.x[0], curve.x[-1], _FINER * (curve.x.size - 1) + 1)
    above = curve(place) - level
    index = np.flatnonzero((above[:-1] < 0.0) != (above[1:] < 0.0))
    share = above[index] / (above[index] - above[index + 1])
    return np.asarray(place[index] + share * (place[1] - place[0]), np.float64)


def _nearest(roots: Vector, place: float) -> float:
    return float(roots[np.argmin(np.abs(roots - place))]) if roots.size else math.nan


def _last_below(roots: Vector, place: float) -> float:
    below = roots[roots <= place]
    return float(below.max()) if below.size else math.nan
