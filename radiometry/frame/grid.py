"""Grids of cells over a frame, and lanes of a road."""

import math
from collections.abc import Sequence
from typing import Any, Final

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

    def move_corners(self) -> list[Matrix]:
        """Return the corners with each of the eight marked coordinates moved by its standard uncertainty."""
        marked = np.array(self.corners, np.float64)
        if self.marked_share is not None:
            marked = _stretch(marked, self.marked_share)
        moved = [marked + move for move in np.eye(8).reshape(8, 4, 2) * (self.corner_u_px or 0.0)]
        return (
            moved if self.marked_share is None else [_stretch(each, 1 / self.marked_share) for each in moved]
        )


POINTS_ACROSS: Final = 3  # Points across each lane (EN 13201-3)
_FEWEST_ALONG, _WIDEST_M = 10, 3.0
_UNIT_SQUARE: Final = ((0, 0), (1, 0), (1, 1), (0, 1))


class LaneGrid(Record):
    """Lanes between two luminaires, seen in perspective."""

    #: Image (x, y) [px] of a rectangle as wide as all lanes, its first side along them
    corners: tuple[tuple[float, float], ...]
    lanes: int
    lane_width_m: float  #: Width of a lane and spacing of the luminaires [m]
    spacing_m: float
    length_m: float  #: Length of the rectangle along the lanes [m]; the field begins at its first corner
    corner_u_px: float  #: Standard uncertainty of each coordinate of a corner [px]

    @property
    def columns(self) -> int:
        """Number of points along: 10 up to 30 m, beyond that the fewest that are at most 3 m apart."""
        return max(_FEWEST_ALONG, math.ceil(self.spacing_m / _WIDEST_M - 1e-9))


def find_homography(corners: Sequence[tuple[float, float]] | Matrix) -> Matrix:
    """Solve for the homography with h[2, 2] = 1 from the unit square to the corners in the same order.

    Parameters
    ----------
    corners : sequence of tuple[float, float]
        Images of (0, 0), (1, 0), (1, 1) and (0, 1).
    """
    rows, right = [], []
    for (u, v), (x, y) in zip(_UNIT_SQUARE, corners, strict=True):
        rows += [[u, v, 1, 0, 0, 0, -x * u, -x * v], [0, 0, 0, u, v, 1, -y * u, -y * v]]
        right += [x, y]
    solved = np.linalg.solve(np.array(rows, np.float64), np.array(right, np.float64))
    return np.append(solved, 1.0).reshape(3, 3)


def lay_lanes(lanes: LaneGrid) -> Grid:
    """Return the grid of the field between two luminaires, three rows of cells a lane.

    The points of EN 13201-3 are D = S / N apart along a lane and a third of its width across, the outermost
    half of that from the field's edges: they are the centres of the cells.

    [1] EN 13201-3:2015, Road lighting, Part 3: Calculation of performance, field of calculation of luminance.

    Parameters
    ----------
    lanes : LaneGrid
        Lanes and the marked rectangle.
    """
    corners, share = np.array(lanes.corners, np.float64), None
    if lanes.spacing_m != lanes.length_m:
        try:
            corners = _stretch(corners, lanes.spacing_m / lanes.length_m)
            share = lanes.length_m / lanes.spacing_m
        except np.linalg.LinAlgError:  # three on one line: the grid is refused for that
            pass
    plain = tuple((float(x), float(y)) for x, y in corners)
    return Grid(
        corners=plain,
        rows=POINTS_ACROSS * lanes.lanes,
        columns=lanes.columns,
        aspect=lanes.spacing_m / (lanes.lanes * lanes.lane_width_m),
        corner_u_px=lanes.corner_u_px,
        marked_share=share,
    )


def describe_lanes(lanes: LaneGrid) -> dict[str, Any]:
    """Return the geometry of a field, ready for JSON: its points on the road, and how well they are known.

    Parameters
    ----------
    lanes : LaneGrid
        Lanes and the marked rectangle, whose corners are those of a convex quadrilateral.

    Returns
    -------
    dict
        ``points_m``: (x, y) along and across from the first corner, row by row; ``along_m``, ``across_m``:
        their distances; ``point_u_m``: largest standard uncertainty of a point's place on the road, from that
        of the corners alone.
    """
    rows, columns = POINTS_ACROSS * lanes.lanes, lanes.columns
    along, across = lanes.spacing_m / columns, lanes.lane_width_m / POINTS_ACROSS
    y, x = np.meshgrid((np.arange(rows) + 0.5) * across, (np.arange(columns) + 0.5) * along, indexing="ij")
    points = np.stack([x, y], axis=-1)
    size = np.array([lanes.length_m, lanes.lanes * lanes.lane_width_m])
    seen = _project(find_homography(lanes.corners), points.reshape(-1, 2) / size)
    variance = np.zeros(len(seen))
    for corner in range(4):
        for axis in range(2):
            moved = np.array(lanes.corners, np.float64)
            moved[corner, axis] += lanes.corner_u_px
            inverse: Matrix = np.linalg.inv(find_homography(moved)).astype(np.float64)
            back = _project(inverse, seen) * size
            variance += np.sum((back - points.reshape(-1, 2)) ** 2, axis=1)
    stated = ("lanes", "lane_width_m", "spacing_m", "length_m", "corner_u_px")
    return {
        **{name: getattr(lanes, name) for name in stated},
        "marked": [list(corner) for corner in lanes.corners],
        "along_m": along,
        "across_m": across,
        "points_m": np.round(points, 6).tolist(),
        "point_u_m": float(np.sqrt(variance.max())),
    }


def _project(h: Matrix, points: Matrix) -> Matrix:
    projected = np.column_stack([points, np.ones(len(points))]) @ h.T
    return projected[:, :2] / projected[:, 2:]


def _stretch(corners: Matrix, by: float) -> Matrix:
    """Return the image of a rectangle ``by`` times as long from its first side on."""
    far = _project(find_homography(corners), np.array([(by, 0.0), (by, 1.0)]))
    return np.stack([corners[0], far[0], far[1], corners[3]])
