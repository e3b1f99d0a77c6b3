"""Histogram and clipping of a region before it is fitted."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radiometry.frame import Frame
from radiometry.frame.statistics import CHANNELS, GREY, name_site

_MOST_BINS = 128
_MOST_CELLS = 48


@dataclass(frozen=True, kw_only=True)
class ChannelCounts:
    """Histogram of one channel.

    Attributes
    ----------
    channel : str
        Name of the channel.
    counts : tuple of int
        Number of samples in each bin.
    """

    channel: str
    counts: tuple[int, ...]


@dataclass(frozen=True, kw_only=True)
class Histogram:
    """Counts in bins that all channels share; bin i begins at first_dn + i step_dn.

    Attributes
    ----------
    first_dn, step_dn : int
        Start of the first bin and width of each [DN].
    channels : tuple of ChannelCounts
        Counts of each channel.
    """

    first_dn: int
    step_dn: int
    channels: tuple[ChannelCounts, ...]


@dataclass(frozen=True, kw_only=True)
class ClippedCell:
    """A cell that contains clipped samples.

    Attributes
    ----------
    row, col : int
        Position in the grid of cells.
    share : float
        Clipped fraction of its pixels that belong to the region, 0 to 1.
    """

    row: int
    col: int
    share: float


@dataclass(frozen=True, kw_only=True)
class Clipping:
    """Clipped parts of a region, in a grid of square cells.

    Attributes
    ----------
    row0_px, col0_px : int
        Corner of the grid in the frame [px].
    cell_px : int
        Side of a cell [px].
    cells : tuple of ClippedCell
        Cells with clipped samples.
    """

    row0_px: int
    col0_px: int
    cell_px: int
    cells: tuple[ClippedCell, ...]


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
    for channel, samples, within, _ in _planes(frame, inside):
        if within.any():
            counted = np.bincount((samples[within].astype(np.int64) - first_dn) // step_dn, minlength=bins)
            counts[channel] = tuple(counted.tolist())
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
        Of the window, (row, col). A pixel of a colour image is clipped if one of its
        planes is.
    """
    clipped = np.zeros_like(inside)
    for _, samples, within, (part, white_dn) in _planes(frame, inside):
        clipped[part] |= within & (samples >= white_dn)
    return clipped


_Part = tuple[slice, slice]
_Plane = tuple[str, NDArray[np.uint16], NDArray[np.bool_], tuple[_Part, float]]


def _planes(frame: Frame, inside: NDArray[np.bool_]) -> Iterator[_Plane]:
    """Yield name, samples, membership, position and white level of each CFA position or plane."""
    white, whole = frame.white_level_dn, (slice(None), slice(None))
    if frame.cfa == "rgb":
        for index, name in enumerate("RGB"):
            yield name, frame.samples_dn[..., index], inside, (whole, white[index % len(white)])
        return
    if frame.cfa == GREY:
        yield GREY, frame.samples_dn, inside, (whole, white[0])
        return
    for index in range(4):
        row, col = divmod(index, 2)
        part = slice((row - frame.row0) % 2, None, 2), slice((col - frame.col0) % 2, None, 2)
        name = name_site(frame.cfa, index)
        yield name, frame.samples_dn[part], inside[part], (part, white[index % len(white)])


def _sum_cells(flags: NDArray[np.bool_], cell_px: int) -> NDArray[np.int64]:
    rows = np.add.reduceat(flags.astype(np.int64), np.arange(0, flags.shape[0], cell_px), axis=0)
    summed: NDArray[np.int64] = np.add.reduceat(rows, np.arange(0, flags.shape[1], cell_px), axis=1)
    return summed
