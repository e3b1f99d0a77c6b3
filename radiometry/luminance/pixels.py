"""Single pixels of a region with their noise, and several frames of one scene as one."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from radiometry.findings import Raised, shared
from radiometry.fitting.sources import EXPECTED_DOF, estimate_variance
from radiometry.frame import Frame, roi, statistics
from radiometry.luminance import codes, maps
from radiometry.records import Record
from radiometry.vignetting.lens import Lens, LensShare

Values = NDArray[np.float64]

PERCENTILES = (5, 10, 90, 95)
_ORDERED = (50, *PERCENTILES)
_THREES_A_BIN = 500
_MOST_BINS = 16
_MOST_PIXELS_FOR_NOISE = 1_000_000
_ROUNDING_VARIANCE = 1 / 12
_OUTLIER_SIGMAS = 5.0
_MAD_TO_SIGMA = 1.4826
SCATTER = "scatter between repeats"
_FLAG_LEVEL = 0.99
_WORTH_NAMING_REL = 0.01


class PixelSignal(Record):
    """Signal of a single pixel of the region, black included, and that pixel's noise."""

    value_dn: float
    noise_dn: float
    share: LensShare | None = None  # V at the pixel, if vignetting is corrected


class PixelSignals(Record):
    """Order statistics of a region's pixels."""

    pixels: int
    smallest: PixelSignal
    largest: PixelSignal
    median: PixelSignal  # its `noise_dn` is the median's own, not a pixel's
    percentiles: tuple[PixelSignal, ...]  # in the order of PERCENTILES


class NoiseCurve(Record, kw_only=False):
    """Variance of a pixel's noise at some levels, interpolated between them by straight lines."""

    levels_dn: NDArray[np.float64]
    variances_dn2: NDArray[np.float64]

    def at(self, level_dn: float) -> float:
        """Return the standard deviation at a level; beyond the ends it is that of the ends."""
        return math.sqrt(float(np.interp(level_dn, self.levels_dn, self.variances_dn2)))


def order_pixels(
    frame: Frame,
    polygon: roi.Polygon,
    *,
    channel: str,
    lens: Lens | None = None,
    dark_signal_dn: float = 0.0,
    signal: tuple[maps.Sums, int] | None = None,
) -> PixelSignals:
    """Compute the extremes, the median and the percentiles of a region's pixels.

    Only measured pixels count: the green CFA positions for "green"; for "grey" of a mosaic each pixel's local
    mean over the pattern, as in a map. Percentiles between two pixels are interpolated in proportion (numpy's
    "linear"). The median's noise is sqrt(pi / 2) times a mean's [1]. A percentile that lies between two
    corrected pixels has the position of the nearest one.

    [1] M. G. Kendall, A. Stuart, The Advanced Theory of Statistics 1, section 10.11
    """
    sums, parts = signal or maps.sum_signal(frame, channel=channel)
    inside = roi.mask(polygon, frame.window) & maps.find_measured(frame, channel=channel)
    if not inside.any():
        raise shared.ROI_EMPTY.reject(f"The region holds no {channel} pixel of the frame: draw it larger.")
    noise = estimate_pixel_noise(sums, inside, parts=parts, lag=4 if channel == statistics.GREY else 2)
    if lens is None:
        values = sums[inside]
        ends = [int(values.min()), int(values.max())]
        ordered = [*ends, *np.percentile(values, _ORDERED, overwrite_input=True).tolist()]
        found = [PixelSignal(value_dn=each / parts, noise_dn=noise.at(each / parts)) for each in ordered]
    else:
        found = _order_corrected(
            frame, sums[inside] / parts, inside, noise, lens, channel=channel, dark_signal_dn=dark_signal_dn
        )
    smallest, largest, median, *percentiles = found
    count = int(np.count_nonzero(inside))
    return PixelSignals(
        pixels=count,
        smallest=smallest,
        largest=largest,
        median=replace(median, noise_dn=median.noise_dn * math.sqrt(math.pi / 2 / count)),
        percentiles=tuple(percentiles),
    )


def _order_corrected(
    frame: Frame,
    raw: NDArray[np.float64],
    inside: NDArray[np.bool_],
    noise: NoiseCurve,
    lens: Lens,
    *,
    channel: str,
    dark_signal_dn: float,
) -> list[PixelSignal]:
    """Return the same of (N - dark) / V, each as the N that a pixel at its place has or would have."""
    rows, cols = np.nonzero(inside)
    corrected = (raw - dark_signal_dn) / maps.compute_shares(frame, lens, channel=channel)[inside]
    found = []
    for number in (corrected.min(), corrected.max(), *np.percentile(corrected, _ORDERED)):
        nearest = int(np.argmin(np.abs(corrected - number)))
        row, col = int(rows[nearest]), int(cols[nearest])
        share = lens.at(
            row + frame.row0, col + frame.col0, channels=_name_own(frame, row, col, channel=channel)
        )
        found.append(
            PixelSignal(
                value_dn=dark_signal_dn + float(number) * share.value,
                noise_dn=noise.at(float(raw[nearest])),
                share=share,
            )
        )
    return found


def _name_own(frame: Frame, row: int, col: int, *, channel: str) -> tuple[str, ...]:
    """Name the channels that a measured pixel's value is made of: for a green position its own alone."""
    names = maps.name_channels(frame.cfa, channel=channel)
    if frame.cfa in ("rgb", statistics.GREY) or channel == statistics.GREY:
        return names
    return (statistics.name_site(frame.cfa, 2 * ((row + frame.row0) % 2) + (col + frame.col0) % 2),)


def estimate_pixel_noise(
    sums: NDArray[np.unsignedinteger], inside: NDArray[np.bool_], *, parts: int, lag: int
) -> NoiseCurve:
    """Estimate the noise of single pixels from one frame, whatever the scene shows.

    Three neighbours a, b, c of the same CFA position in a line: a - 2 b + c is free of the light and of its
    gradient, and its variance is 6 times a pixel's. Edges of the scene are outliers beyond 5 sigma of the
    median deviation and are rejected. Noise grows with the signal: the triples are sorted by their mean into
    bins of equal number. The variance is never less than that of rounding, 1/12 DN^2, and is that alone for a
    region without any triple. Temporal noise is derived from differences as in [1], here of neighbours
    instead of frames.

    [1] EMVA Standard 1288, release 4.0, 2021, section 6.5
    """
    step = max(1, math.ceil(sums.size / _MOST_PIXELS_FOR_NOISE))
    # every step-th run of rows is enough of a large region
    bands = [slice(top, top + 4 * lag) for top in range(0, sums.shape[0], 4 * lag * step)]
    threes = [_threes(sums[band], inside[band], lag) for band in bands]
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


class Scatter(Record):
    """Relative scatter of repeated frames beyond their noise, and its degrees of freedom."""

    rel: float  # of one frame
    dof: float


def average_signals(signals: Sequence[statistics.Signal]) -> statistics.Signal:
    """Average the signals of one region in repeated frames.

    Noise averages, the error of rounding does not: it is the same in frames that are alike. With u_i the
    noise of each frame and r_i the error of rounding in it::

        u^2 = sum(u_i^2) / n^2 + mean(r_i^2)

    For what the frames scatter beyond noise see `evaluate_scatter`.
    """
    rounding = float(np.mean([signal.rounding_dn**2 for signal in signals]))
    noise = float(_list_noise(signals).sum()) / len(signals) ** 2
    return replace(
        signals[0],
        value_dn=float(np.mean([signal.value_dn for signal in signals])),
        standard_uncertainty_dn=math.sqrt(noise + rounding),
        saturated_share=max(signal.saturated_share for signal in signals),
    )


def _list_noise(signals: Sequence[statistics.Signal]) -> Values:
    """Return the variance of each signal's noise."""
    return np.array([signal.standard_uncertainty_dn**2 - signal.rounding_dn**2 for signal in signals])


def add_signal(summed: tuple[maps.Sums, int] | None, signal: tuple[maps.Sums, int]) -> tuple[maps.Sums, int]:
    """Add the signal of each pixel of one more frame."""
    if summed is None:
        return signal
    return summed[0].astype(np.uint32, copy=False) + signal[0], summed[1] + signal[1]


def evaluate_scatter(
    signals: Sequence[statistics.Signal],
    *,
    dark_signal_dn: float,
    expected_rel: float,
    expected_dof: float = EXPECTED_DOF,
    drift_rel: Values | float = 0.0,
) -> Scatter:
    """Evaluate what repeated frames scatter beyond their noise, by what is expected of one.

    With w the mean variance of the noise, s_0^2 = expected^2 + w and s^2 by `estimate_variance`, the scatter
    has the variance s^2 - w.
    """
    steady = (np.array([signal.value_dn for signal in signals]) - dark_signal_dn) / (1.0 + drift_rel)
    level = abs(float(steady.mean())) or 1.0
    noise = float(_list_noise(signals).mean()) / level**2
    squares = float(np.sum((steady - steady.mean()) ** 2)) / level**2
    variance, dof = estimate_variance(
        squares, len(signals) - 1.0, expected=expected_rel**2 + noise, expected_dof=expected_dof
    )
    return Scatter(rel=math.sqrt(max(0.0, variance - noise)), dof=dof)


def add_cells(cells: Sequence[Sequence[statistics.Signal]]) -> list[statistics.Signal]:
    """Return the mean signal of all cells in each of the repeated frames, without rounding."""
    return [
        replace(
            frame[0],
            value_dn=float(np.mean([signal.value_dn for signal in frame])),
            standard_uncertainty_dn=math.sqrt(float(_list_noise(frame).sum())) / len(frame),
            rounding_dn=0.0,
        )
        for frame in zip(*cells, strict=True)
    ]


def flag_scatter(signals: Sequence[statistics.Signal], *, dark_signal_dn: float) -> tuple[Raised, ...]:
    """Return the flag `frames_disagree` if repeated frames differ beyond noise, and by 1 % or more."""
    count = len(signals)
    if count == 1:
        return ()
    values = np.array([signal.value_dn for signal in signals]) - dark_signal_dn
    mean, observed = abs(float(values.mean())), float(values.var(ddof=1))
    noise = float(np.mean([signal.standard_uncertainty_dn**2 for signal in signals]))
    largest_noise = noise * float(scipy.special.chdtri(count - 1, 1.0 - _FLAG_LEVEL)) / (count - 1)
    if observed < max((_WORTH_NAMING_REL * mean) ** 2, largest_noise):
        return ()
    detail = (
        f"The signals above dark of {count} frames go from {values.min():.4g} to {values.max():.4g} DN, "
        f"{(values.max() - values.min()) / (mean or 1.0):.1%} of their mean."
    )
    return (codes.FRAMES_DISAGREE.at("", detail),)
