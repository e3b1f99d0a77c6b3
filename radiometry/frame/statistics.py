"""Statistics of the raw values of a region, and their histogram."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from radiometry.frame import Frame, TableRow
from radiometry.records import Record, about

GREY = "grey"
CHANNELS = ("R", "G1", "G2", "G", "B", GREY)

_LEVELS = 1 << 16


class ChannelStatistics(Record):
    """One channel's raw values in a region; black is not subtracted."""

    channel: str = about(
        "R, G1 (green in a red row), G2 (green in a blue row), B of a mosaic; R, G, B of a rendered "
        "colour image. `grey` is all samples together and always present."
    )
    n: int = about("Number of samples.")
    min_dn: int = about("Smallest and largest sample [DN].")
    max_dn: int = about("Smallest and largest sample [DN].")
    mean_dn: float = about("Mean [DN].")
    median_dn: float = about("Median [DN]; the mean of the two middle samples if n is even.")
    std_dn: float = about("Sample standard deviation (n - 1) [DN]; 0 for a single sample.")
    saturated_share: float = about(
        "Fraction of the samples at or above the white level of their own CFA position."
    )
    zero_share: float = about("Fraction of the samples that are zero.")
    black_level_dn: float = about("Black level, mean over the samples [DN].")
    white_level_dn: float = about("Lowest white level of the CFA positions [DN].")


class Signal(Record):
    """Mean raw value of a region in the channel that a calibration uses, black included."""

    value_dn: float  # Mean and its standard uncertainty [DN]
    standard_uncertainty_dn: float
    saturated_share: float  # Largest saturated fraction of the rows that were used
    black_level_dn: float  # Black and white level [DN]
    white_level_dn: float
    # Part of the standard uncertainty that is the error of rounding [DN], which repeated frames do not
    # average out
    rounding_dn: float = 0.0
    skew_dn: float = 0.0  # Mean less median [DN]


class Part(Record, kw_only=False):
    """The samples of one CFA position or colour plane in a window."""

    channel: str
    at: tuple[slice | int, ...]  # of the samples
    rows: slice  # of the window's pixels
    cols: slice
    black_level_dn: float
    white_level_dn: float


def list_parts(frame: Frame) -> list[Part]:
    """List the planes of a colour image, the CFA positions of a mosaic, or the one of a grey image."""
    black, white, every = frame.black_level_dn, frame.white_level_dn, slice(None)
    if frame.cfa == GREY:
        return [Part(GREY, (every, every), every, every, black[0], white[0])]
    found = []
    for index in range(3 if frame.cfa == "rgb" else 4):
        levels = black[index % len(black)], white[index % len(white)]
        if frame.cfa == "rgb":
            found.append(Part("RGB"[index], (every, every, index), every, every, *levels))
        else:
            row, col = divmod(index, 2)
            rows, cols = slice((row - frame.row0) % 2, None, 2), slice((col - frame.col0) % 2, None, 2)
            found.append(Part(name_site(frame.cfa, index), (rows, cols), rows, cols, *levels))
    return found


def compute_statistics(frame: Frame, inside: NDArray[np.bool_]) -> tuple[ChannelStatistics, ...]:
    """Compute the statistics of a region per channel.

    All values follow from integer histograms: they are exact, and the same in whatever order the samples
    come. The CFA position of a sample is that in the visible area: a window may start with any of the four.

    Parameters
    ----------
    frame : Frame
        Window of the mosaic, (row, col) or (row, col, 3).
    inside : ndarray of bool
        Pixels of the region in the same window, at least one, (row, col).

    Returns
    -------
    tuple of ChannelStatistics
        One row per channel that the region touches, then `grey`.
    """
    counted = [
        (each, np.bincount(frame.samples_dn[each.at][inside[each.rows, each.cols]], minlength=_LEVELS))
        for each in list_parts(frame)
    ]
    parts = [(part, histogram) for part, histogram in counted if histogram.any()]
    everything = _summarise(GREY, parts)
    if frame.cfa == GREY:
        return (everything,)
    parts.sort(key=lambda each: CHANNELS.index(each[0].channel))
    return (*(_summarise(part.channel, [(part, histogram)]) for part, histogram in parts), everything)


def state_row(row: TableRow) -> ChannelStatistics:
    return ChannelStatistics(
        channel=GREY,
        n=row.pixels,
        min_dn=math.floor(row.min_dn),
        max_dn=math.ceil(row.max_dn),
        mean_dn=row.mean_dn,
        median_dn=row.mean_dn,
        std_dn=row.widest_std_dn,
        saturated_share=row.saturated_share,
        zero_share=0.0,
        black_level_dn=row.black_level_dn or 0.0,
        white_level_dn=row.white_level_dn,
    )


def select_rows(statistics: Sequence[ChannelStatistics], *, channel: str) -> list[ChannelStatistics]:
    """Return the rows of which the signal is made."""
    wanted = ("G1", "G2", "G") if channel == "green" else (channel,)
    rows = [row for row in statistics if row.channel in wanted]
    return rows or [row for row in statistics if row.channel == GREY]


def measure_signal(statistics: Sequence[ChannelStatistics], *, channel: str = "green") -> Signal:
    """Compute the signal of a region: the mean over both greens, or over one channel.

    Green is closest to the eye's V(lambda); if the image has no green, grey is used. Both greens have equal
    weight however many samples each has, so that a row more or less at the region's rim changes nothing.

    The standard uncertainty per channel is, with s the noise before rounding [2]::

        u^2 = std^2 / n + exp(-4 pi^2 s^2) / 12        s^2 = max(0, std^2 - 1/12)

    The second term is the error of rounding to whole DN that noise does not average
    out [1]: 1/12 without noise, nothing from 1 DN of noise on.

    [1] B. Widrow, I. Kollar, Quantization Noise, Cambridge 2008, chapter 4, doi:10.1017/CBO9780511754661
    [2] W. F. Sheppard, Proc. London Math. Soc. 29, 353 (1898), doi:10.1112/plms/s1-29.1.353

    Parameters
    ----------
    statistics : sequence of ChannelStatistics
        Rows of a region.
    channel : str, default: "green"
        "green", "grey", or the name of one row.

    Returns
    -------
    Signal
        Mean and its standard uncertainty.
    """
    rows = select_rows(statistics, channel=channel)
    count = len(rows)
    variance = sum(mean_variance(row.std_dn, row.n) for row in rows) / count**2
    rounding = sum(rounding_variance(row.std_dn) for row in rows) / count**2
    return Signal(
        value_dn=sum(row.mean_dn for row in rows) / count,
        standard_uncertainty_dn=math.sqrt(variance),
        saturated_share=max(row.saturated_share for row in rows),
        black_level_dn=sum(row.black_level_dn for row in rows) / count,
        white_level_dn=min(row.white_level_dn for row in rows),
        rounding_dn=math.sqrt(rounding),
        skew_dn=sum(row.mean_dn - row.median_dn for row in rows) / count,
    )


def mean_variance(std_dn: float, n: int) -> float:
    """Compute the variance of a mean of rounded values, as in `measure_signal`."""
    return std_dn**2 / n + rounding_variance(std_dn)


def rounding_variance(std_dn: float) -> float:
    """Compute the variance of rounding that noise does not average out, as in `measure_signal`."""
    noise_variance = max(0.0, std_dn**2 - 1 / 12)
    return math.exp(-4 * math.pi**2 * noise_variance) / 12


def name_site(cfa: str, index: int) -> str:
    """Return the name of a position of the 2 x 2 pattern."""
    if cfa[index] != "G":
        return cfa[index]
    return "G1" if cfa[index ^ 1] == "R" else "G2"


def _summarise(channel: str, parts: Sequence[tuple[Part, NDArray[np.intp]]]) -> ChannelStatistics:
    """Compute every statistic from the parts' histograms, in whole numbers up to the last division."""
    sizes = [int(each.sum()) for _, each in parts]
    saturated = sum(int(each[min(_LEVELS, math.ceil(part.white_level_dn)) :].sum()) for part, each in parts)
    black = math.fsum(size * part.black_level_dn for size, (part, _) in zip(sizes, parts, strict=True))
    histogram = np.sum([each for _, each in parts], axis=0)
    values = np.flatnonzero(histogram)
    counts = histogram[values]
    n = int(counts.sum())
    total = int(counts @ values)
    squares = int(counts @ (values * values))
    below = np.cumsum(counts)
    low, high = values[np.searchsorted(below, [(n - 1) // 2, n // 2], side="right")]
    return ChannelStatistics(
        channel=channel,
        n=n,
        min_dn=int(values[0]),
        max_dn=int(values[-1]),
        mean_dn=total / n,
        median_dn=(int(low) + int(high)) / 2,
        std_dn=math.sqrt((n * squares - total * total) / (n * (n - 1))) if n > 1 else 0.0,
        saturated_share=saturated / n,
        zero_share=int(histogram[0]) / n,
        black_level_dn=black / n,
        white_level_dn=min(part.white_level_dn for part, _ in parts),
    )


_MOST_BINS = 128
_MOST_CELLS = 48


class ChannelCounts(Record):
    """Histogram of one channel."""

    channel: str
    counts: tuple[int, ...]  # Number of samples in each bin


class Histogram(Record):
    """Counts in bins that all channels share; bin i begins at first_dn + i step_dn."""

    first_dn: int  # Start of the first bin and width of each [DN]
    step_dn: int
    channels: tuple[ChannelCounts, ...]


class ClippedCell(Record):
    """A cell that contains clipped samples."""

    row: int  # Position in the grid of cells
    col: int
    share: float  # Clipped fraction of its pixels that belong to the region, 0 to 1


class Clipping(Record):
    """Clipped parts of a region, in a grid of square cells."""

    row0_px: int  # Corner of the grid in the frame [px]
    col0_px: int
    cell_px: int  # Side of a cell [px]
    cells: tuple[ClippedCell, ...]  # Cells with clipped samples


def count_histogram(frame: Frame, inside: NDArray[np.bool_]) -> Histogram:
    """Count a region's raw values per channel, in at most 128 bins of whole DN.

    Parameters
    ----------
    frame : Frame
        Window of the mosaic, (row, col) or (row, col, 3).
    inside : ndarray of bool
        Pixels of the region in the same window, at least one, (row, col).

    Returns
    -------
    Histogram
        Counts of the channels that the region touches, in the order of `CHANNELS`;
        grey only for a grey image.
    """
    values = frame.samples_dn[inside]
    first_dn, last_dn = int(values.min()), int(values.max())
    step_dn = max(1, math.ceil((last_dn - first_dn + 1) / _MOST_BINS))
    bins = (last_dn - first_dn) // step_dn + 1
    counts = {}
    for each in list_parts(frame):
        samples = frame.samples_dn[each.at][inside[each.rows, each.cols]]
        if samples.size:
            counted = np.bincount((samples.astype(np.int64) - first_dn) // step_dn, minlength=bins)
            counts[each.channel] = tuple(counted.tolist())
    ordered = sorted(counts, key=CHANNELS.index)
    return Histogram(
        first_dn=first_dn,
        step_dn=step_dn,
        channels=tuple(ChannelCounts(channel=name, counts=counts[name]) for name in ordered),
    )


def map_clipping(frame: Frame, inside: NDArray[np.bool_]) -> Clipping:
    """Find the cells of a region in which a sample reaches the white level of its own CFA position.

    Parameters
    ----------
    frame : Frame
        Window of the mosaic, (row, col) or (row, col, 3).
    inside : ndarray of bool
        Pixels of the region in the same window, at least one, (row, col).

    Returns
    -------
    Clipping
        At most 48 cells along the longer side of the window. A pixel of a colour
        image is clipped if one of its planes is.
    """
    height, width = inside.shape
    cell_px = max(1, math.ceil(max(height, width) / _MOST_CELLS))
    clipped = find_clipped(frame, inside)
    hits, members = _sum_cells(clipped, cell_px), _sum_cells(inside, cell_px)
    rows, cols = np.nonzero(hits)
    return Clipping(
        row0_px=frame.row0,
        col0_px=frame.col0,
        cell_px=cell_px,
        cells=tuple(
            ClippedCell(row=int(row), col=int(col), share=float(hits[row, col] / members[row, col]))
            for row, col in zip(rows, cols, strict=True)
        ),
    )


def find_clipped(frame: Frame, inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which pixels of a region reach the white level of their own CFA position.

    Parameters
    ----------
    frame : Frame
        Window of the mosaic, (row, col) or (row, col, 3).
    inside : ndarray of bool
        Pixels of the region in the same window, (row, col).

    Returns
    -------
    ndarray of bool
        Of the window, (row, col). A pixel of a colour image is clipped if one of its planes is.
    """
    clipped = np.zeros_like(inside)
    for each in list_parts(frame):
        place = each.rows, each.cols
        clipped[place] |= inside[place] & (frame.samples_dn[each.at] >= each.white_level_dn)
    return clipped


def _sum_cells(flags: NDArray[np.bool_], cell_px: int) -> NDArray[np.int64]:
    rows = np.add.reduceat(flags.astype(np.int64), np.arange(0, flags.shape[0], cell_px), axis=0)
    summed: NDArray[np.int64] = np.add.reduceat(rows, np.arange(0, flags.shape[1], cell_px), axis=1)
    return summed
