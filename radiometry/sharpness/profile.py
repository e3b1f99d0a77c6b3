"""An edge: its place on every line, its profile, four samples to a pixel, and the MTF of it."""

import math
from collections.abc import Sequence

import numpy as np
import scipy
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from radiometry.records import Record
from radiometry.sharpness.results import CURVE_STEP_CYCLES_PER_PIXEL
from radiometry.sharpness.sampling import Plane

Vector = NDArray[np.float64]

_WINDOW_FLOOR = 0.05


class Edge(Record):
    """Edge in a plane's own coordinates [px of the sensor]."""

    places_px: Vector  # Places of its centroids, (line,)
    curve: Polynomial  # Place by line
    slope: float  # Slope of the straight fit
    residual_px: float  # Rms of the places about the curve
    departure_px: float  # Largest distance of a cubic through the places from the straight line


def locate_edge(plane: Plane, *, order: int) -> Edge:
    """Find the edge on each line as the centroid of the windowed derivative, and fit a polynomial [1] [2].

    x_j = sum_k k w_jk d_jk / sum_k w_jk d_jk,  d the difference of neighbours, w a raised cosine that reaches
    to the region's further side, 5 % at least: first about the region's middle, then about the first fit.

    [1] ISO 12233:2023 annex D
    [2] P. D. Burns, sfrmat5
    """
    samples = plane.values.shape[1]
    middle = np.full(plane.line_px.size, (samples - 1) / 2.0)
    places = _find_places(plane, middle)
    curve = Polynomial.fit(plane.line_px, places, order)
    middle = np.clip((curve(plane.line_px) - plane.first_px) / plane.pitch_px, 0.0, samples - 1.0)
    places = _find_places(plane, middle)
    curve = Polynomial.fit(plane.line_px, places, order)
    straight = Polynomial.fit(plane.line_px, places, 1)
    cubic = Polynomial.fit(plane.line_px, places, 3)
    return Edge(
        places_px=places,
        curve=curve,
        slope=float(straight.convert().coef[1]),
        residual_px=float(np.sqrt(np.mean((places - curve(plane.line_px)) ** 2))),
        departure_px=float(np.max(np.abs(cubic(plane.line_px) - straight(plane.line_px)))),
    )


def _find_places(plane: Plane, middle: Vector) -> Vector:
    """Return the centroid of every line's difference, the window about `middle` (line,) [samples]."""
    samples = plane.values.shape[1]
    between = np.arange(samples - 1) + 0.5
    reach = np.maximum(middle + 0.5, samples - 0.5 - middle)[:, None]
    phase = np.clip((between - middle[:, None]) / reach, -1.0, 1.0)
    window = _WINDOW_FLOOR + (1.0 - _WINDOW_FLOOR) * 0.5 * (1.0 + np.cos(np.pi * phase))
    weighted = np.diff(plane.values, axis=1) * window
    total = weighted.sum(axis=1)
    total = np.where(total == 0.0, 1.0, total)  # a line without an edge: it spoils the fit, and is seen
    return np.asarray(plane.first_px + plane.pitch_px * (weighted @ between) / total, np.float64)


BINS_PER_PIXEL = 4
_ROUNDS = 3
_NEAR_PX = 6.0
_SMOOTHED = 1.1
_FINER = 16


class Sums(Record):
    """Samples gathered in bins of a quarter pixel by their distance from the edge."""

    count: Vector  # Number of samples and sum of their values, (bin,)
    total: Vector
    offset: Vector  # Sum of their places within the bin, from -1/2 to 1/2, and of its square, (bin,)
    square: Vector

    def without(self, part: "Sums") -> "Sums":
        """Return the sums of what remains when a part is subtracted."""
        return Sums(
            count=self.count - part.count,
            total=self.total - part.total,
            offset=self.offset - part.offset,
            square=self.square - part.square,
        )


class Profile(Record):
    """Edge spread function at points, rising."""

    distance_px: Vector  # Distance from the edge, normal to it [px], (bin,)
    signal: Vector  # Signal, (bin,)
    step_px: float  # Step between the points, normal to the edge [px]
    low_px: float  # Range that every line reaches [px]
    high_px: float


class Lengths(Record):
    """Lengths of a profile; NaN where one does not exist."""

    rise_px: float
    lsf_fwhm_px: float
    overshoot: float
    undershoot: float


def gather(distance_px: Vector, values: Vector, *, bins: int) -> Sums:
    """Return samples sorted into bins."""
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


NYQUIST_CYCLES_PER_PIXEL = 0.5


def list_frequencies() -> Vector:
    """Return the frequencies of every stored response: 0, 0.01, ..., 1 cycles per pixel."""
    return np.linspace(0.0, 1.0, round(1.0 / CURVE_STEP_CYCLES_PER_PIXEL) + 1)


def compute_mtfs(profiles: Sequence[Profile], *, frequency: Vector) -> Vector:
    """Compute the normalised Fourier modulus of the windowed line spread function of each profile.

    After [1] and [2]::

        LSF_k = (e_{k+1} - e_{k-1}) / 2,   v_k = (1 + cos(2 pi k / n)) / 2 (Tukey, alpha 1, about the edge)
        MTF(f) = D(f) |sum_k w_k LSF_k exp(-2 pi i f x_k)| / |sum_k w_k LSF_k|,   w = 1 - (1 - v)^3
        D(f) = a / sin(a), a = 2 pi f h

    The standard's window v averages the spectrum S over neighbouring frequencies, v * S. Two steps of the
    iteration S <- S + (v * S_0 - v * S) undo this; they amount to the window w, which is flat to the sixth
    order about the edge. D undoes the difference over two steps h. There is no factor for the bins' aperture:
    `form_profile` has already removed it, which sfrmat5 does not.

    [1] ISO 12233:2023 annex D
    [2] P. D. Burns, sfrmat5
    """
    first = profiles[0]
    signals = np.array([profile.signal for profile in profiles])
    spread = np.zeros_like(signals)
    spread[:, 1:-1] = (signals[:, 2:] - signals[:, :-2]) / 2.0
    length = first.distance_px.size * first.step_px
    spread *= 1.0 - np.sin(np.pi * first.distance_px / length) ** 6
    waves = np.exp(-2j * np.pi * np.outer(first.distance_px, frequency))
    modulus = np.abs(spread @ waves) / np.abs(spread.sum(axis=1))[:, None]
    return np.asarray(modulus / np.sinc(2.0 * frequency * first.step_px), np.float64)


def find_crossing(
    frequency: Sequence[float] | Vector, response: Sequence[float] | Vector, level: float
) -> float:
    """Find the first frequency at which a response falls below a level, between points by a line."""
    below = np.flatnonzero(np.asarray(response) < level)
    if not below.size or below[0] == 0:
        return math.nan
    high = int(below[0])
    low = high - 1
    share = (response[low] - level) / (response[low] - response[high])
    return float(frequency[low] + share * (frequency[high] - frequency[low]))
