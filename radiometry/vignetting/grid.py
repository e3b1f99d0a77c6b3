"""The blocks over which a frame is averaged, and the mean of a polynomial over each of them."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Plane = NDArray[np.float64]

MOST_BLOCKS = 64
LEAST_BLOCK_PX = 8


@dataclass(frozen=True, kw_only=True)
class Site:
    """Pixels of one channel: every `step`-th row from `row0` on, and column from `col0` on.

    Attributes
    ----------
    row0, col0 : int
        First row and column [px].
    step : int
        Distance of neighbouring pixels of the channel [px].
    """

    row0: int
    col0: int
    step: int


@dataclass(frozen=True, kw_only=True)
class Axis:
    """Positions of a channel's pixels along rows or columns, and the start of each block of them.

    Attributes
    ----------
    positions : ndarray of float64
        Position of each pixel [px].
    starts : ndarray of intp
        Index of the first position of each block.
    """

    positions: Vector
    starts: NDArray[np.intp]

    @property
    def counts(self) -> NDArray[np.intp]:
        """Number of positions of each block."""
        return np.diff(np.append(self.starts, self.positions.size))

    @property
    def means(self) -> Vector:
        """Mean position of each block [px]."""
        return self.mean_of(self.positions)

    def mean_of(self, values: Vector) -> Vector:
        """Average values at the positions over each block.

        Parameters
        ----------
        values : ndarray of float64
            Value at each position.

        Returns
        -------
        ndarray of float64
            Mean of each block.
        """
        return np.asarray(np.add.reduceat(values, self.starts) / self.counts)


@dataclass(frozen=True, kw_only=True)
class Grid:
    """Square blocks of `block_px` pixels a side over a frame; those at the far borders may be cut.

    Attributes
    ----------
    height_px, width_px : int
        Size of the frame [px].
    block_px : int
        Side of a block [px]; even, so that every block consists of whole 2 x 2 patterns
        of a mosaic.
    """

    height_px: int
    width_px: int
    block_px: int

    @classmethod
    def over(cls, height_px: int, width_px: int) -> "Grid":
        """Return the finest grid with at most 64 blocks on the long side, none smaller than 8 pixels.

        Parameters
        ----------
        height_px, width_px : int
            Size of the frame [px].
        """
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
        """Return a channel's rows and columns in blocks; a block at the border that has none is left out.

        Parameters
        ----------
        site : Site
            Pixels of the channel.

        Returns
        -------
        tuple of Axis
            Rows and columns.
        """
        return (
            _cut(site.row0, site.step, self.height_px, self.block_px),
            _cut(site.col0, site.step, self.width_px, self.block_px),
        )


def _cut(first: int, step: int, size_px: int, block_px: int) -> Axis:
    positions = np.arange(first, size_px, step)
    _, starts = np.unique(positions // block_px, return_index=True)
    return Axis(positions=positions.astype(np.float64), starts=starts)


def average_radial(
    rows: Axis, cols: Axis, *, centre_row_px: float, centre_col_px: float, radius_px: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Average r^2, r^4, r^6 and their slopes over the pixels of each block; exact, not at its centre.

    Parameters
    ----------
    rows, cols : Axis
        Rows and columns of the channel in blocks.
    centre_row_px, centre_col_px : float
        Row and column of the centre [px].
    radius_px : float
        Radius R at which r = 1 [px].

    Returns
    -------
    tuple of ndarray of float64
        Means, (3, row, col); their derivatives by centre_row [1/px]; their derivatives
        by centre_col [1/px].

    Notes
    -----
    r^2 = a^2 + b^2, a = (row - centre_row) / R, b = (col - centre_col) / R. Rows and columns of a block are
    independent, so that e.g. <r^4> = <a^4> + 2 <a^2> <b^2> + <b^4>: moments along each axis are enough.
    """
    a = _moments(rows, centre_row_px, radius_px)
    b = _moments(cols, centre_col_px, radius_px)
    means = np.stack(
        [
            _outer(a[2], b[0]) + _outer(a[0], b[2]),
            _outer(a[4], b[0]) + 2.0 * _outer(a[2], b[2]) + _outer(a[0], b[4]),
            _outer(a[6], b[0]) + 3.0 * _outer(a[4], b[2]) + 3.0 * _outer(a[2], b[4]) + _outer(a[0], b[6]),
        ]
    )
    return means, _slopes(a, b) / -radius_px, _slopes(b, a).transpose(0, 2, 1) / -radius_px


def _slopes(a: list[Vector], b: list[Vector]) -> NDArray[np.float64]:
    """Average d r^2n / d a = 2 n a r^(2n-2) for n = 1, 2, 3; (3, along a, along b)."""
    return np.stack(
        [
            2.0 * _outer(a[1], b[0]),
            4.0 * (_outer(a[3], b[0]) + _outer(a[1], b[2])),
            6.0 * (_outer(a[5], b[0]) + 2.0 * _outer(a[3], b[2]) + _outer(a[1], b[4])),
        ]
    )


def _moments(axis: Axis, centre_px: float, radius_px: float) -> list[Vector]:
    scaled = (axis.positions - centre_px) / radius_px
    powers = np.ones((7, scaled.size))
    for power in range(1, 7):
        np.multiply(powers[power - 1], scaled, out=powers[power])
    return list(np.add.reduceat(powers, axis.starts, axis=1) / axis.counts)


def _outer(a: Vector, b: Vector) -> Plane:
    return np.asarray(np.multiply.outer(a, b))
