"""Single pixels of a region: extremes, percentiles, and the noise of one pixel."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected, shared
from radiometry.frame import Frame
from radiometry.frame.roi import Polygon, Window, mask
from radiometry.frame.statistics import GREY, name_site
from radiometry.luminance.lens import compute_shares, name_channels
from radiometry.luminance.maps import Sums, find_measured, sum_signal
from radiometry.vignetting.lens import Lens, LensShare

PERCENTILES = (5, 10, 90, 95)
_ORDERED = (50, *PERCENTILES)

_THREES_A_BIN = 500
_MOST_BINS = 16
_MOST_PIXELS_FOR_NOISE = 1_000_000
_ROUNDING_VARIANCE = 1 / 12
_OUTLIER_SIGMAS = 5.0
_MAD_TO_SIGMA = 1.4826


@dataclass(frozen=True, kw_only=True)
class PixelSignal:
    """Signal of a single pixel of the region, black included, and that pixel's noise.

    Attributes
    ----------
    value_dn : float
        Signal [DN].
    noise_dn : float
        Standard deviation of its noise [DN].
    share : LensShare or None, default: None
        Relative illumination V at the pixel, if vignetting is corrected.
    """

    value_dn: float
    noise_dn: float
    share: LensShare | None = None


@dataclass(frozen=True, kw_only=True)
class PixelSignals:
    """Order statistics of a region's pixels.

    Attributes
    ----------
    pixels : int
        Number of pixels.
    smallest, largest : PixelSignal
        Extremes.
    median : PixelSignal
        Median; its `noise_dn` is the median's own, not a pixel's: many pixels make
        it.
    percentiles : tuple of PixelSignal
        Percentiles in the order of PERCENTILES.
    """

    pixels: int
    smallest: PixelSignal
    largest: PixelSignal
    median: PixelSignal
    percentiles: tuple[PixelSignal, ...]


@dataclass(frozen=True)
class NoiseCurve:
    """Variance of a pixel's noise at some levels, interpolated between them by straight lines.

    Attributes
    ----------
    levels_dn : ndarray of float64
        Levels [DN], (n,).
    variances_dn2 : ndarray of float64
        Variances at the levels [DN^2], (n,).
    """

    levels_dn: NDArray[np.float64]
    variances_dn2: NDArray[np.float64]

    def at(self, level_dn: float) -> float:
        """Return the standard deviation at a level; beyond the ends it is that of the ends.

        Parameters
        ----------
        level_dn : float
            Level [DN].

        Returns
        -------
        float
            Standard deviation [DN].
        """
        return math.sqrt(float(np.interp(level_dn, self.levels_dn, self.variances_dn2)))


@dataclass(frozen=True)
class Correction:
    """Lens with which a region's pixels are corrected; they are ordered by (N - dark) / V.

    Attributes
    ----------
    lens : Lens
        Relative illumination at the frame's f-number.
    dark_signal_dn : float
        Dark signal [DN].
    """

    lens: Lens
    dark_signal_dn: float


def order_pixels(
    frame: Frame,
    polygon: Polygon,
    *,
    channel: str,
    correction: Correction | None = None,
    signal: tuple[Sums, int] | None = None,
) -> PixelSignals:
    """Compute the extremes, the median and the percentiles of a region's pixels.

    Parameters
    ----------
    frame : Frame
        Window of the mosaic that contains the region.
    polygon : Polygon
        Region.
    channel : str
        "green" or "grey".
    correction : Correction or None, default: None
        Lens and dark signal, if vignetting is corrected.
    signal : tuple[Sums, int] or None, default: None
        Signal of each pixel as from `maps.sum_signal`, if it is not this frame's alone
        but the sum over repeated frames.

    Raises
    ------
    InputRejected
        `roi_empty` if the region contains no measured pixel.

    Notes
    -----
    Only measured pixels count: the green CFA positions for "green"; for "grey" of a
    mosaic each pixel's local mean over the pattern, as in a map. Percentiles
    between two pixels are interpolated in proportion (numpy's "linear"). The
    median's noise is sqrt(pi / 2) times a mean's [1]_. A percentile that lies
    between two corrected pixels has the position of the nearest one.

    References
    ----------
    .. [1] M. G. Kendall, A. Stuart, The Advanced Theory of Statistics 1, section
           10.11
    """
    sums, parts = signal or sum_signal(frame, channel=channel)
    height, width = sums.shape
    inside = mask(polygon, Window(row0=frame.row0, col0=frame.col0, height=height, width=width))
    inside &= find_measured(frame, channel=channel)
    if not inside.any():
        raise InputRejected(
            shared.ROI_EMPTY, f"The region holds no {channel} pixel of the frame: draw it larger."
        )
    noise = estimate_pixel_noise(sums, inside, parts=parts, lag=4 if channel == GREY else 2)
    if correction is None:
        found = _order_raw(sums[inside], parts, noise)
    else:
        found = _order_corrected(frame, sums, inside, parts, noise, correction, channel=channel)
    smallest, largest, median, *percentiles = found
    count = int(np.count_nonzero(inside))
    return PixelSignals(
        pixels=count,
        smallest=smallest,
        largest=largest,
        median=replace(median, noise_dn=median.noise_dn * math.sqrt(math.pi / 2 / count)),
        percentiles=tuple(percentiles),
    )


def _order_raw(values: Sums, parts: int, noise: NoiseCurve) -> list[PixelSignal]:
    """Return the smallest, the largest, the median and the percentiles."""
    low, high = int(values.min()), int(values.max())
    numbers = [low, high, *np.percentile(values, _ORDERED, overwrite_input=True).tolist()]
    return [PixelSignal(value_dn=number / parts, noise_dn=noise.at(number / parts)) for number in numbers]


def _order_corrected(
    frame: Frame,
    sums: Sums,
    inside: NDArray[np.bool_],
    parts: int,
    noise: NoiseCurve,
    correction: Correction,
    *,
    channel: str,
) -> list[PixelSignal]:
    """Return the same of (N - dark) / V, each as the N that a pixel at its place has or would have."""
    rows, cols = np.nonzero(inside)
    raw = sums[inside] / parts
    corrected = (raw - correction.dark_signal_dn) / compute_shares(frame, correction.lens, channel=channel)[
        inside
    ]
    found = []
    for number in (corrected.min(), corrected.max(), *np.percentile(corrected, _ORDERED)):
        nearest = int(np.argmin(np.abs(corrected - number)))
        row, col = int(rows[nearest]), int(cols[nearest])
        share = correction.lens.at(
            row + frame.row0, col + frame.col0, channels=_name_own(frame, row, col, channel=channel)
        )
        found.append(
            PixelSignal(
                value_dn=correction.dark_signal_dn + float(number) * share.value,
                noise_dn=noise.at(float(raw[nearest])),
                share=share,
            )
        )
    return found


def _name_own(frame: Frame, row: int, col: int, *, channel: str) -> tuple[str, ...]:
    """Name the channels that a measured pixel's value is made of: for a green position its own alone."""
    names = name_channels(frame.cfa, channel=channel)
    if frame.cfa in ("rgb", GREY) or channel == GREY:
        return names
    return (name_site(frame.cfa, 2 * ((row + frame.row0) % 2) + (col + frame.col0) % 2),)


def estimate_pixel_noise(
    sums: NDArray[np.unsignedinteger], inside: NDArray[np.bool_], *, parts: int, lag: int
) -> NoiseCurve:
    """Estimate the noise of single pixels from one frame, whatever the scene shows.

    Parameters
    ----------
    sums : ndarray of unsignedinteger
        Signals [DN / parts], (row, col).
    inside : ndarray of bool
        Measured pixels of the region, (row, col).
    parts : int
        Parts of one DN in `sums`.
    lag : int
        Distance of neighbours that share no raw value [px].

    Returns
    -------
    NoiseCurve
        Variance of the noise by level.

    Notes
    -----
    Three neighbours a, b, c of the same CFA position in a line: a - 2 b + c is free
    of the light and of its gradient, and its variance is 6 times a pixel's. Edges
    of the scene are outliers beyond 5 sigma of the median deviation and are
    rejected. Noise grows with the signal: the triples are sorted by their mean into
    bins of equal number. The variance is never less than that of rounding, 1/12
    DN^2, and is that alone for a region without any triple. Temporal noise is
    derived from differences as in [1]_, here of neighbours instead of frames.

    References
    ----------
    .. [1] EMVA Standard 1288, release 4.0, 2021, section 6.5
    """
    step = max(1, math.ceil(sums.size / _MOST_PIXELS_FOR_NOISE))
    threes = [
        _threes(sums[band], inside[band], lag) for band in _bands(sums.shape[0], step=step, rows=4 * lag)
    ]
    levels = np.concatenate([level for level, _ in threes]) / parts
    squares = np.concatenate([square for _, square in threes]) / parts**2
    if not levels.size:
        return NoiseCurve(np.zeros(1), np.full(1, _ROUNDING_VARIANCE))
    order = np.argsort(levels, kind="stable")
    bins = min(max(levels.size // _THREES_A_BIN, 1), _MOST_BINS)
    chosen = np.array_split(order, bins)
    return NoiseCurve(
        np.array([levels[part].mean() for part in chosen]),
        np.array([_variance(squares[part]) for part in chosen]),
    )


def _bands(height: int, *, step: int, rows: int) -> list[slice]:
    """Return every step-th run of rows: enough of a large region."""
    return [slice(top, top + rows) for top in range(0, height, rows * step)]


def _threes(
    sums: NDArray[np.unsignedinteger], inside: NDArray[np.bool_], lag: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute mean and squared second difference of three neighbours along both axes."""
    levels, squares = [], []
    for axis in (0, 1):
        size = sums.shape[axis] - 2 * lag
        if size <= 0:
            continue
        places = [(slice(None),) * axis + (slice(at, at + size),) for at in (0, lag, 2 * lag)]
        chosen = np.logical_and.reduce([inside[place] for place in places])
        a, b, c = (sums[place][chosen].astype(np.float64) for place in places)
        levels.append((a + b + c) / 3)
        squares.append((a - 2 * b + c) ** 2)
    if not levels:
        return np.empty(0), np.empty(0)
    return np.concatenate(levels), np.concatenate(squares)


def _variance(squares: NDArray[np.float64]) -> float:
    """Compute a sixth of the mean square of the second differences that are not outliers."""
    spread = max(_MAD_TO_SIGMA * math.sqrt(float(np.median(squares))), 1.0)
    kept = squares[squares <= (_OUTLIER_SIGMAS * spread) ** 2]
    return max(float(kept.mean()) / 6 if kept.size else 0.0, _ROUNDING_VARIANCE)
