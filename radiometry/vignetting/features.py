"""Features of a flat or dark frame: every channel averaged over a grid of blocks."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected, shared
from radiometry.fitting.evidence import Extracted, FrameEvidence, Region
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.packing import Packed, pack
from radiometry.frame.roi import Window, mask
from radiometry.frame.statistics import GREY, compute_statistics, name_site
from radiometry.vignetting.grid import Axis, Grid, Site, Vector

Samples = NDArray[np.float32]

_COLOURS = ("R", "G", "B")


@dataclass(frozen=True, kw_only=True)
class ChannelBlocks:
    """One channel in blocks, each array (row, col).

    Attributes
    ----------
    channel : str
        R, G1, G2, B for a mosaic; R, G, B for a rendered image; grey; or the name of a
        multispectral band.
    site : Site
        Pixels of the channel.
    black_level_dn : float
        Black level [DN].
    white_level_dn : float
        White level [DN].
    mean_dn : Packed
        Mean, black included [DN]; 0 where n is 0.
    noise_dn : Packed
        Standard deviation of one pixel without the slope of the light, from differences
        of neighbours [DN].
    n : Packed
        Pixels of a block; 0 for one that is not entirely in the region.
    clipped_share : Packed
        Fraction of pixels at or above the white level.
    """

    channel: str
    site: Site
    black_level_dn: float
    white_level_dn: float
    mean_dn: Packed
    noise_dn: Packed
    n: Packed
    clipped_share: Packed


@dataclass(frozen=True, kw_only=True)
class Features:
    """A frame in blocks, ready for JSON."""

    grid: Grid
    cfa: str
    channels: tuple[ChannelBlocks, ...]


FrameRow = FrameEvidence[Features]


@dataclass(frozen=True)
class _Channel:
    """Pixels of a channel: the plane of the picture, the index of its levels, the site."""

    name: str
    plane: int
    level: int
    site: Site


def extract_features(frame: Frame, regions: Sequence[Region], *, header: FrameHeader) -> Extracted[Features]:
    """Compute the averages of a frame over blocks of at most 1/64 of its long side, per channel.

    Parameters
    ----------
    frame : Frame
        Frame to measure.
    regions : sequence of Region
        Regions to read; a block counts if all of its pixels belong to one of them.
    header : FrameHeader
        Header of the frame.

    Returns
    -------
    Extracted[Features]
        Statistics of the frame, and the blocks.

    Raises
    ------
    InputRejected
        `roi_empty` if no block lies entirely in a region.

    Notes
    -----
    noise^2 = sum d^2 / (2 m) over the m differences d of neighbours of one colour within a block, along
    rows and along columns: for a light that slopes by s per pixel only s^2 / 2 remains.
    """
    height, width = frame.samples_dn.shape[:2]
    window = Window(row0=frame.row0, col0=frame.col0, height=height, width=width)
    inside = np.zeros((height, width), np.bool_)
    for region in regions:
        inside |= mask(region.polygon, window)
    if not inside.any():
        raise InputRejected(shared.ROI_EMPTY, "The region holds no pixel of this window of the frame.")
    grid = Grid.over(frame.height_px, frame.width_px)
    samples, known = _embed(frame, inside)
    band = header.multispectral.band if header.multispectral else GREY
    blocks = [_average(channel, frame, samples, known, grid) for channel in _list_channels(frame.cfa, band)]
    if not any(counts.any() for _, counts in blocks):
        raise InputRejected(
            shared.ROI_EMPTY,
            f"The region holds no whole block of {grid.block_px} x {grid.block_px} pixels: draw it larger, "
            "or leave it out, so that the whole frame counts.",
        )
    features = Features(grid=grid, cfa=frame.cfa, channels=tuple(averaged for averaged, _ in blocks))
    return Extracted(statistics=compute_statistics(frame, inside), features=features)


def _list_channels(cfa: str, band: str) -> list[_Channel]:
    if cfa == "rgb":
        return [
            _Channel(name, plane, plane, Site(row0=0, col0=0, step=1)) for plane, name in enumerate(_COLOURS)
        ]
    if cfa == GREY:
        return [_Channel(band, 0, 0, Site(row0=0, col0=0, step=1))]
    return [
        _Channel(name_site(cfa, index), 0, index, Site(row0=index // 2, col0=index % 2, step=2))
        for index in range(4)
    ]


def _embed(frame: Frame, inside: NDArray[np.bool_]) -> tuple[NDArray[np.uint16], NDArray[np.bool_]]:
    """Return the whole frame as (row, col, plane), zeros where nothing was read, and what is known of it."""
    samples = frame.samples_dn[..., None] if frame.samples_dn.ndim == 2 else frame.samples_dn
    shape = (frame.height_px, frame.width_px)
    if inside.shape == shape:
        return samples, inside
    part = (
        slice(frame.row0, frame.row0 + inside.shape[0]),
        slice(frame.col0, frame.col0 + inside.shape[1]),
    )
    whole = np.zeros((*shape, samples.shape[2]), np.uint16)
    known = np.zeros(shape, np.bool_)
    whole[part], known[part] = samples, inside
    return whole, known


def _average(
    channel: _Channel, frame: Frame, samples: NDArray[np.uint16], known: NDArray[np.bool_], grid: Grid
) -> tuple[ChannelBlocks, NDArray[np.int64]]:
    site = channel.site
    part = (slice(site.row0, None, site.step), slice(site.col0, None, site.step))
    plane, of_region = samples[..., channel.plane][part], known[part]
    black = frame.black_level_dn[channel.level % len(frame.black_level_dn)]
    white = frame.white_level_dn[channel.level % len(frame.white_level_dn)]
    rows, cols = grid.axes(site)
    whole = of_region.all()
    bands = []
    for start, count in zip(rows.starts, rows.counts, strict=True):
        band = slice(start, start + count)
        n = cols.counts * count
        if not whole:
            full = np.add.reduceat(of_region[band].sum(axis=0), cols.starts) == n
            n = np.where(full, n, 0)
        bands.append((n, *_measure_band(plane[band].astype(np.float32), cols, white)))
    n, mean, noise, clipped = (np.stack(rows_of) for rows_of in zip(*bands, strict=True))
    averaged = ChannelBlocks(
        channel=channel.name,
        site=site,
        black_level_dn=black,
        white_level_dn=white,
        mean_dn=pack(np.where(n > 0, mean, 0.0), dtype="<f4"),
        noise_dn=pack(np.where(n > 0, noise, 0.0), dtype="<f4"),
        n=pack(n, dtype="<i4"),
        clipped_share=pack(np.where(n > 0, clipped, 0.0), dtype="<f4"),
    )
    return averaged, n


def _measure_band(samples: Samples, cols: Axis, white_level_dn: float) -> tuple[Vector, Vector, Vector]:
    """Return mean, noise and clipped share of the blocks that lie in one band of rows.

    Samples are whole numbers below 2^16, so that float32 represents them and their differences exactly.
    """
    height = samples.shape[0]
    counts = cols.counts * height
    total = np.add.reduceat(samples.sum(axis=0, dtype=np.float64), cols.starts)
    clipped = np.add.reduceat((samples >= white_level_dn).sum(axis=0), cols.starts)
    down, across = np.diff(samples, axis=0), np.diff(samples, axis=1)
    squares = np.add.reduceat(_sum_squares(down), cols.starts)
    beside = np.append(_sum_squares(across), 0.0)
    beside[cols.starts[1:] - 1] = 0.0  # the neighbour of a block's last column is in the next block
    squares += np.add.reduceat(beside, cols.starts)
    pairs = cols.counts * (height - 1) + (cols.counts - 1) * height
    noise = np.sqrt(squares / np.maximum(2 * pairs, 1))
    return total / counts, noise, clipped / counts


def _sum_squares(differences: Samples) -> Vector:
    return np.asarray(np.square(differences).sum(axis=0, dtype=np.float64))
