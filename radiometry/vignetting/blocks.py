"""Frames of a campaign in blocks: the grid, and the mean, noise and clipped share of each channel over it."""

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import shared
from radiometry.fitting.evidence import Extracted, FrameEvidence, Region
from radiometry.frame import Frame, FrameHeader, packing, roi, statistics
from radiometry.records import Record

Vector = NDArray[np.float64]
Plane = NDArray[np.float64]
Planes = NDArray[np.float64]

MOST_BLOCKS = 64
LEAST_BLOCK_PX = 8


class Site(Record):
    """Pixels of one channel: every `step`-th row from `row0` on, and column from `col0` on."""

    row0: int  # First row and column [px]
    col0: int  # First row and column [px]
    step: int  # Distance of neighbouring pixels of the channel [px]


class Axis(Record):
    """Positions of a channel's pixels along rows or columns, and the start of each block of them."""

    positions: Vector  # Position of each pixel [px]
    starts: NDArray[np.intp]  # Index of the first position of each block

    @property
    def counts(self) -> NDArray[np.intp]:
        """Number of positions of each block."""
        return np.diff(np.append(self.starts, self.positions.size))

    @property
    def means(self) -> Vector:
        """Mean position of each block [px]."""
        return self.mean_of(self.positions)

    def mean_of(self, values: Vector) -> Vector:
        """Average values at the positions over each block."""
        return np.asarray(np.add.reduceat(values, self.starts) / self.counts)


class Grid(Record):
    """Square blocks of `block_px` pixels a side over a frame; those at the far borders may be cut."""

    height_px: int
    width_px: int
    #: Side of a block [px]; even, so that every block consists of whole 2 x 2 patterns of a mosaic
    block_px: int

    @classmethod
    def over(cls, height_px: int, width_px: int) -> "Grid":
        """Return the finest grid with at most 64 blocks on the long side, none smaller than 8 pixels."""
        block_px = 2 * math.ceil(max(height_px, width_px) / (2 * MOST_BLOCKS))
        return cls(height_px=height_px, width_px=width_px, block_px=max(LEAST_BLOCK_PX, block_px))

    @property
    def half_diagonal_px(self) -> float:
        """R = sqrt(height^2 + width^2) / 2 [px]."""
        return math.hypot(self.height_px, self.width_px) / 2.0

    @property
    def middle_px(self) -> tuple[float, float]:
        """The row and column of the frame's middle; the centre of pixel (0, 0) is at (0, 0)."""
        return (self.height_px - 1) / 2.0, (self.width_px - 1) / 2.0

    def axes(self, site: Site) -> tuple[Axis, Axis]:
        """Return a channel's rows and columns in blocks; a block at the border that has none is left out."""
        return (
            _cut(site.row0, site.step, self.height_px, self.block_px),
            _cut(site.col0, site.step, self.width_px, self.block_px),
        )


def _cut(first: int, step: int, size_px: int, block_px: int) -> Axis:
    positions = np.arange(first, size_px, step)
    _, starts = np.unique(positions // block_px, return_index=True)
    return Axis(positions=positions.astype(np.float64), starts=starts)


class Radial:
    """Averages of r^2, r^4 ... and their slopes over the pixels of each block; exact, not at its centre.

    r^2 = a^2 + b^2, a = (row - centre_row) / R, b = (col - centre_col) / R. Rows and columns of a block are
    independent, so that e.g. <r^4> = <a^4> + 2 <a^2> <b^2> + <b^4>: moments along each axis are enough.
    """

    def __init__(
        self,
        rows: Axis,
        cols: Axis,
        *,
        centre_row_px: float,
        centre_col_px: float,
        radius_px: float,
        terms: int = 3,
    ) -> None:
        self._a = _moments(rows, centre_row_px, radius_px, 2 * terms)
        self._b = _moments(cols, centre_col_px, radius_px, 2 * terms)
        self._radius_px, self._powers = radius_px, range(1, terms + 1)

    @cached_property
    def means(self) -> Planes:
        return np.stack([_expand(self._a[::2], self._b[::2], power) for power in self._powers])

    @cached_property
    def slopes(self) -> tuple[Planes, Planes]:
        """Derivatives of the means by the centre's row and column [1/px]."""
        by_row = [2.0 * n * _expand(self._a[1::2], self._b[::2], n - 1) for n in self._powers]
        by_col = [2.0 * n * _expand(self._a[::2], self._b[1::2], n - 1) for n in self._powers]
        return np.stack(by_row) / -self._radius_px, np.stack(by_col) / -self._radius_px


def _expand(a: Sequence[Vector], b: Sequence[Vector], power: int) -> Plane:
    """Return (a^2 + b^2)^power from the moments of each axis, times a or b where they begin with it."""
    expanded = a[0][:, None] * b[power]
    for n in range(1, power + 1):
        part = a[n][:, None] * b[power - n]
        part *= math.comb(power, n)
        expanded += part
    return expanded


def _moments(axis: Axis, centre_px: float, radius_px: float, most: int) -> list[Vector]:
    powers = np.vander((axis.positions - centre_px) / radius_px, most + 1, increasing=True)
    return list(np.add.reduceat(powers, axis.starts).T / axis.counts)


Samples = NDArray[np.float32]

_COLOURS = ("R", "G", "B")


class ChannelBlocks(Record):
    """One channel in blocks, each array (row, col)."""

    # R, G1, G2, B for a mosaic; R, G, B for a rendered image; grey; or the name of a multispectral band
    channel: str
    site: Site  # Pixels of the channel
    black_level_dn: float
    white_level_dn: float
    mean_dn: packing.Packed  # Mean, black included [DN]; 0 where n is 0
    # Standard deviation of one pixel without the slope of the light, from differences of neighbours [DN]
    noise_dn: packing.Packed
    n: packing.Packed  # Pixels of a block; 0 for one that is not entirely in the region
    clipped_share: packing.Packed  # Fraction of pixels at or above the white level


class Features(Record):
    """A frame in blocks, ready for JSON."""

    grid: Grid
    cfa: str
    channels: tuple[ChannelBlocks, ...]


FrameRow = FrameEvidence[Features]


class Channel(Record, kw_only=False):
    """Pixels of a channel: the plane of the picture, the index of its levels, the site."""

    name: str
    plane: int
    level: int
    site: Site


def extract_features(frame: Frame, regions: Sequence[Region], *, header: FrameHeader) -> Extracted[Features]:
    """Compute the averages of a frame over blocks of at most 1/64 of its long side, per channel.

    noise^2 = sum d^2 / (2 m) over the m differences d of neighbours of one colour within a block, along
    rows and along columns: for a light that slopes by s per pixel only s^2 / 2 remains.
    """
    masks = [roi.mask(region.polygon, frame.window) for region in regions]
    inside = roi.require_pixels(np.logical_or.reduce(masks))
    grid = Grid.over(frame.height_px, frame.width_px)
    samples, known = _embed(frame, inside)
    band = header.multispectral.band if header.multispectral else statistics.GREY
    blocks = [
        _average_blocks(channel, frame, samples, known, grid) for channel in list_channels(frame.cfa, band)
    ]
    if not any(counts.any() for _, counts in blocks):
        raise shared.ROI_EMPTY.reject(
            f"The region holds no whole block of {grid.block_px} x {grid.block_px} pixels: draw it larger, "
            "or leave it out, so that the whole frame counts."
        )
    features = Features(grid=grid, cfa=frame.cfa, channels=tuple(averaged for averaged, _ in blocks))
    return Extracted(statistics=statistics.compute_statistics(frame, inside), features=features)


def list_channels(cfa: str, band: str) -> list[Channel]:
    if cfa == "rgb":
        return [
            Channel(name, plane, plane, Site(row0=0, col0=0, step=1)) for plane, name in enumerate(_COLOURS)
        ]
    if cfa == statistics.GREY:
        return [Channel(band, 0, 0, Site(row0=0, col0=0, step=1))]
    return [
        Channel(statistics.name_site(cfa, index), 0, index, Site(row0=index // 2, col0=index % 2, step=2))
        for index in range(4)
    ]


def _embed(frame: Frame, inside: NDArray[np.bool_]) -> tuple[NDArray[np.uint16], NDArray[np.bool_]]:
    """Return the whole frame as (row, col, plane), zeros where nothing was read, and what is known of it."""
    samples = frame.samples_dn[..., None] if frame.samples_dn.ndim == 2 else frame.samples_dn
    shape = (frame.height_px, frame.width_px)
    if inside.shape == shape:
        return samples, inside
    part = (slice(frame.row0, frame.row0 + inside.shape[0]), slice(frame.col0, frame.col0 + inside.shape[1]))
    whole = np.zeros((*shape, samples.shape[2]), np.uint16)
    known = np.zeros(shape, np.bool_)
    whole[part], known[part] = samples, inside
    return whole, known


def _average_blocks(
    channel: Channel, frame: Frame, samples: NDArray[np.uint16], known: NDArray[np.bool_], grid: Grid
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
        mean_dn=packing.pack(np.where(n > 0, mean, 0.0), dtype="<f4"),
        noise_dn=packing.pack(np.where(n > 0, noise, 0.0), dtype="<f4"),
        n=packing.pack(n, dtype="<i4"),
        clipped_share=packing.pack(np.where(n > 0, clipped, 0.0), dtype="<f4"),
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
