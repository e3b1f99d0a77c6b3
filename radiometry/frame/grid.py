"""Grids of cells over a frame, and homographies of planes."""

import itertools
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.records import Record, later

MAX_CELLS_A_SIDE: Final = 50

Matrix = NDArray[np.float64]


class Grid(Record):
    """Equal cells of a rectangular surface, given by the image of its corners."""

    #: (x, y) of the surface's top-left, top-right, bottom-right and bottom-left corner [px], in the
    #: orientation of the surface, whichever way it lies in the image
    corners: tuple[tuple[float, float], ...]
    rows: int  #: Number of cells along the surface's sides
    columns: int
    #: Length of the surface along its rows over that along its columns; None if it is not stated
    aspect: float | None = later()
    #: Standard uncertainty of each coordinate of a marked corner [px]; None of older measurements, which do
    #: not contain it
    corner_u_px: float | None = later()
    #: Length of the rectangle whose corners were marked, from the first side on, over the surface's; None if
    #: it is the surface
    marked_share: float | None = later()

    def find_middles(self) -> Matrix:
        """Return the image (x, y) of each cell's middle, (rows, columns, 2)."""
        return self._project(np.arange(0.5, self.rows), np.arange(0.5, self.columns))

    def outline_cells(self, sides: tuple[float, float] | None = None) -> list[list[list[float]]]:
        """Return each cell's closed outline, row by row: in the image, or with its sides on the surface."""
        down, along = np.arange(self.rows + 1.0), np.arange(self.columns + 1.0)
        if sides is None:
            lattice = self._project(down, along)
        else:
            lattice = np.stack(np.meshgrid(along * sides[0], down * sides[1]), axis=-1)
        ring = [(0, 0), (0, 1), (1, 1), (1, 0), (0, 0)]
        cells = itertools.product(range(self.rows), range(self.columns))
        return [[lattice[row + r, col + c].tolist() for r, c in ring] for row, col in cells]

    def _project(self, down: Matrix, along: Matrix) -> Matrix:
        """Return the images (x, y) of lattice lines, counted in cells."""
        lattice = np.stack(np.meshgrid(along / self.columns, down / self.rows), axis=-1)
        return map_plane(find_homography(self.corners), lattice)

    def move_corners(self) -> list[Matrix]:
        """Return the corners with each of the eight marked coordinates moved by its standard uncertainty."""
        marked = np.array(self.corners, np.float64)
        if self.marked_share is not None:
            marked = stretch_corners(marked, self.marked_share)
        moved = [marked + move for move in np.eye(8).reshape(8, 4, 2) * (self.corner_u_px or 0.0)]
        back = 1 / self.marked_share if self.marked_share is not None else None
        return moved if back is None else [stretch_corners(each, back) for each in moved]


_UNIT_SQUARE: Final = ((0, 0), (1, 0), (1, 1), (0, 1))


def find_homography(corners: Sequence[tuple[float, float]] | Matrix) -> Matrix:
    """Solve for the homography with h[2, 2] = 1 from the unit square to the corners in the same order."""
    rows, right = [], []
    for (u, v), (x, y) in zip(_UNIT_SQUARE, corners, strict=True):
        rows += [[u, v, 1, 0, 0, 0, -x * u, -x * v], [0, 0, 0, u, v, 1, -y * u, -y * v]]
        right += [x, y]
    solved = np.linalg.solve(np.array(rows, np.float64), np.array(right, np.float64))
    return np.append(solved, 1.0).reshape(3, 3)


def map_plane(h: Matrix, places: Matrix) -> Matrix:
    """Map places (..., 2) of a plane by a homography."""
    x, y = places[..., 0], places[..., 1]
    projected = np.stack([x, y, np.ones_like(x)], axis=-1) @ h.T
    mapped: Matrix = projected[..., :2] / projected[..., 2:]
    return mapped


def stretch_corners(corners: Matrix, by: float) -> Matrix:
    """Return the image of a rectangle ``by`` times as long from its first side on."""
    far = map_plane(find_homography(corners), np.array([(by, 0.0), (by, 1.0)]))
    return np.stack([corners[0], far[0], far[1], corners[3]])
