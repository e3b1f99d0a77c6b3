"""Statistics of a region per channel from an exact histogram, and the signal that a calibration uses."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radiometry.frame import Frame
from radiometry.frame.table import TableRow

GREY = "grey"
CHANNELS = ("R", "G1", "G2", "G", "B", GREY)

_LEVELS = 1 << 16


@dataclass(frozen=True, kw_only=True)
class ChannelStatistics:
    """One channel's raw values in a region; black is not subtracted.

    Attributes
    ----------
    channel : str
        R, G1 (green in a red row), G2 (green in a blue row), B of a mosaic; R, G, B
        of a rendered colour image. `grey` is all samples together and always
        present.
    n : int
        Number of samples.
    min_dn, max_dn : int
        Smallest and largest sample [DN].
    mean_dn : float
        Mean [DN].
    median_dn : float
        Median [DN]; the mean of the two middle samples if n is even.
    std_dn : float
        Sample standard deviation (n - 1) [DN]; 0 for a single sample.
    saturated_share : float
        Fraction of the samples at or above the white level of their own CFA
        position.
    zero_share : float
        Fraction of the samples that are zero.
    black_level_dn : float
        Black level, mean over the samples [DN].
    white_level_dn : float
        Lowest white level of the CFA positions [DN].
    """

    channel: str
    n: int
    min_dn: int
    max_dn: int
    mean_dn: float
    median_dn: float
    std_dn: float
    saturated_share: float
    zero_share: float
    black_level_dn: float
    white_level_dn: float


@dataclass(frozen=True, kw_only=True)
class Signal:
    """Mean raw value of a region in the channel that a calibration uses, black included.

    Attributes
    ----------
    value_dn, standard_uncertainty_dn : float
        Mean and its standard uncertainty [DN].
    saturated_share : float
        Largest saturated fraction of the rows that were used.
    black_level_dn, white_level_dn : float
        Black and white level [DN].
    rounding_dn : float, default: 0.0
        Part of the standard uncertainty that is the error of rounding [DN], which
        repeated frames do not average out.
    skew_dn : float, default: 0.0
        Mean less median [DN].
    """

    value_dn: float
    standard_uncertainty_dn: float
    saturated_share: float
    black_level_dn: float
    white_level_dn: float
    rounding_dn: float = 0.0
    skew_dn: float = 0.0


@dataclass(frozen=True)
class _Site:
    """The samples of one CFA position or colour plane inside the region."""

    histogram: NDArray[np.intp]
    black_level_dn: float
    white_level_dn: float


def compute_statistics(frame: Frame, inside: NDArray[np.bool_]) -> tuple[ChannelStatistics, ...]:
    """Compute the statistics of a region per channel.

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

    Notes
    -----
    All values follow from integer histograms: they are exact, and the same in
    whatever order the samples come. The CFA position of a sample is that in the
    visible area: a window may start with any of the four.
    """
    sites = [site for site in _read_sites(frame, inside) if site[1].histogram.any()]
    everything = _merge([site for _, site in sites])
    if frame.cfa == GREY:
        return (_summarise(GREY, *everything),)
    rows = [
        _summarise(channel, *_merge([site]))
        for channel, site in sorted(sites, key=lambda named: CHANNELS.index(named[0]))
    ]
    return (*rows, _summarise(GREY, *everything))


def state_row(row: TableRow) -> ChannelStatistics:
    """Return the statistics that a row of a table stands for.

    Parameters
    ----------
    row : TableRow
        Statistics as the table states them.

    Returns
    -------
    ChannelStatistics
        Of `grey`. What the table does not state is the worst that it can be: the standard
        deviation and the saturated fraction; the median is the mean.
    """
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
    """Return the rows of which the signal is made.

    Parameters
    ----------
    statistics : sequence of ChannelStatistics
        Rows of a region.
    channel : str
        "green", "grey", or the name of one row.

    Returns
    -------
    list of ChannelStatistics
        The rows of `channel`, or grey if the image has none.
    """
    wanted = ("G1", "G2", "G") if channel == "green" else (channel,)
    rows = [row for row in statistics if row.channel in wanted]
    return rows or [row for row in statistics if row.channel == GREY]


def measure_signal(statistics: Sequence[ChannelStatistics], *, channel: str = "green") -> Signal:
    """Compute the signal of a region: the mean over both greens, or over one channel.

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

    Notes
    -----
    Green is closest to the eye's V(lambda); if the image has no green, grey is
    used. Both greens have equal weight however many samples each has, so that a row
    more or less at the region's rim changes nothing.

    The standard uncertainty per channel is, with s the noise before rounding [2]_::

        u^2 = std^2 / n + exp(-4 pi^2 s^2) / 12        s^2 = max(0, std^2 - 1/12)

    The second term is the error of rounding to whole DN that noise does not average
    out [1]_: 1/12 without noise, nothing from 1 DN of noise on.

    References
    ----------
    .. [1] B. Widrow, I. Kollar, Quantization Noise, Cambridge 2008, chapter 4,
           doi:10.1017/CBO9780511754661
    .. [2] W. F. Sheppard, Proc. London Math. Soc. 29, 353 (1898),
           doi:10.1112/plms/s1-29.1.353
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
    """Compute the variance of a mean of rounded values, as in `measure_signal`.

    Parameters
    ----------
    std_dn : float
        Standard deviation of the values [DN].
    n : int
        Number of values.

    Returns
    -------
    float
        Variance of the mean [DN^2].
    """
    return std_dn**2 / n + rounding_variance(std_dn)


def rounding_variance(std_dn: float) -> float:
    """Compute the variance of the error of rounding that noise does not average out, as in `measure_signal`.

    Parameters
    ----------
    std_dn : float
        Standard deviation of the rounded values [DN].

    Returns
    -------
    float
        Variance [DN^2].
    """
    noise_variance = max(0.0, std_dn**2 - 1 / 12)
    return math.exp(-4 * math.pi**2 * noise_variance) / 12


def _read_sites(frame: Frame, inside: NDArray[np.bool_]) -> list[tuple[str, _Site]]:
    """Return a histogram per plane of a colour image, per CFA position of a mosaic, or one of a grey."""
    black, white = frame.black_level_dn, frame.white_level_dn
    if frame.cfa == "rgb":
        planes = [frame.samples_dn[..., index][inside] for index in range(3)]
        names = ["R", "G", "B"]
    elif frame.cfa == GREY:
        planes, names = [frame.samples_dn[inside]], [GREY]
    else:
        planes, names = [], []
        for index in range(4):
            row, col = divmod(index, 2)
            part = slice((row - frame.row0) % 2, None, 2), slice((col - frame.col0) % 2, None, 2)
            planes.append(frame.samples_dn[part][inside[part]])
            names.append(name_site(frame.cfa, index))
    return [
        (
            name,
            _Site(
                np.bincount(plane, minlength=_LEVELS), black[index % len(black)], white[index % len(white)]
            ),
        )
        for index, (name, plane) in enumerate(zip(names, planes, strict=True))
    ]


def name_site(cfa: str, index: int) -> str:
    """Return the name of a position of the 2 x 2 pattern.

    Parameters
    ----------
    cfa : str
        Four letters of the pattern.
    index : int
        Position in row-major order, 0 to 3.

    Returns
    -------
    str
        R, G1, G2 or B; a green is G1 if its row contains the red.
    """
    if cfa[index] != "G":
        return cfa[index]
    return "G1" if cfa[index ^ 1] == "R" else "G2"


def _merge(sites: Sequence[_Site]) -> tuple[NDArray[np.intp], int, float, float]:
    """Join positions: histogram, samples at or above their own white, mean black, lowest white."""
    counts = [int(site.histogram.sum()) for site in sites]
    saturated = sum(
        int(site.histogram[min(_LEVELS, math.ceil(site.white_level_dn)) :].sum()) for site in sites
    )
    black = math.fsum(count * site.black_level_dn for count, site in zip(counts, sites, strict=True)) / sum(
        counts
    )
    histogram = np.sum([site.histogram for site in sites], axis=0)
    return histogram, saturated, black, min(site.white_level_dn for site in sites)


def _summarise(
    channel: str, histogram: NDArray[np.intp], saturated: int, black_level_dn: float, white_level_dn: float
) -> ChannelStatistics:
    """Compute every statistic from a histogram, in whole numbers up to the last division."""
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
        black_level_dn=black_level_dn,
        white_level_dn=white_level_dn,
    )
