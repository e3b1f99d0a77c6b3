"""Corners of a grid: whether a rectangle can have them, and what their errors do to the cells."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import Raised
from radiometry.frame.grid import Grid
from radiometry.frame.lanes import find_homography
from radiometry.luminance import codes
from radiometry.luminance.surface import lay_lattice

Array = NDArray[np.float64]
Corners = Sequence[tuple[float, float]]

LEAST_CELL_PX = 4.0
"""Width of a cell below which the lens's blur and the rim's half pixels are much of it."""

# of the frame's diagonal: from 17 mm to 215 mm of a 35 mm camera
_FOCAL_LENGTHS = np.geomspace(0.4, 5.0, 60)
# Distortion of an uncorrected lens and a road's crown, beside the corners' own uncertainty.
_ANGLE_DEG, _RATIO_LN = 5.0, math.log(1.1)
_ERRORS = 3.0


def check_grid(grid: Grid, *, height_px: int, width_px: int) -> tuple[Raised, ...]:
    """Return the flags of a grid's corners, before anything is measured.

    Parameters
    ----------
    grid : Grid
        Grid whose corners are those of a convex quadrilateral.
    height_px, width_px : int
        Size of the frame [px].

    Returns
    -------
    tuple of Raised
        Flags `corners_implausible`, `grid_mirrored`, `cells_small`.

    Raises
    ------
    InputRejected
        `grid_invalid`.

    Notes
    -----
    With h1 and h2 the first two columns of the homography from the unit square, about the frame's
    centre, and w = diag(1/f^2, 1/f^2, 1) for the focal length f [px], angle and ratio of the sides are
    [1]_::

        cos angle = h1' w h2 / sqrt(h1' w h1  h2' w h2),   ratio = sqrt(h1' w h1 / h2' w h2)

    The focal length is not known: the one is taken, between 0.4 and 5 times the frame's diagonal, that makes
    the best rectangle of the corners. Corners that are flagged are therefore those of no camera's rectangle,
    by more than 5 degrees or 10 % and three standard uncertainties of the corners; others may still be wrong.

    References
    ----------
    .. [1] Z. Zhang, IEEE Trans. Pattern Anal. 22, 1330 (2000), section 2.3, doi:10.1109/34.888718
    """
    points = lay_lattice(grid)
    flags = _judge_shape(grid, math.hypot(height_px, width_px), (width_px / 2.0, height_px / 2.0))
    if _is_mirrored(grid.corners):
        detail = "Row 1 is on the other side of the surface than the corners' names say."
        flags.append(codes.GRID_MIRRORED.at("grid", detail))
    width = _measure_narrowest(points)
    if width < LEAST_CELL_PX:
        detail = f"The narrowest cell is {width:.1f} px wide."
        flags.append(codes.CELLS_SMALL.at("grid", detail))
    return tuple(flags)


def displace_cells(grid: Grid, values: Array) -> Array:
    """Compute the effect of one standard uncertainty of each corner coordinate on the cells' values.

    Parameters
    ----------
    grid : Grid
        Grid with the uncertainty of its corners.
    values : ndarray of float64
        Values of the cells, (rows, columns).

    Returns
    -------
    ndarray of float64
        Effects in the values' unit, (8, rows, columns); (0, rows, columns) where the uncertainty is not
        stated.

    Notes
    -----
    A corner that moves takes the middle of each cell to another place of the surface, by the homography; the
    value there differs by the gradient of the cells' values.
    """
    if grid.corner_u_px is None:
        return np.zeros((0, *values.shape))
    middles = np.stack(
        [
            np.tile((np.arange(grid.columns) + 0.5) / grid.columns, grid.rows),
            np.repeat((np.arange(grid.rows) + 0.5) / grid.rows, grid.columns),
            np.ones(grid.rows * grid.columns),
        ]
    )
    back: Array = np.linalg.inv(find_homography(grid.corners)).astype(np.float64)
    along, down = (
        np.gradient(values, axis=axis) if values.shape[axis] > 1 else 0.0 * values for axis in (1, 0)
    )
    effects = []
    for moved in _move_corners(grid.corners, grid.corner_u_px):
        u, v, w = back @ find_homography(moved) @ middles
        shift_u, shift_v = (
            size * (there / w - here).reshape(values.shape)
            for size, there, here in zip((grid.columns, grid.rows), (u, v), middles[:2], strict=True)
        )
        effects.append(along * shift_u + down * shift_v)
    return np.array(effects)


def _judge_shape(grid: Grid, diagonal_px: float, centre: tuple[float, float]) -> list[Raised]:
    """Return the flag of corners that no camera sees of a rectangle with these sides."""
    focal_px = _FOCAL_LENGTHS * diagonal_px
    angles, ratios = _compute_shape(grid.corners, focal_px, centre)
    aspect_ln = np.log(ratios / grid.aspect) if grid.aspect else np.zeros_like(ratios)
    misfits = np.maximum(np.abs(angles - 90.0) / _ANGLE_DEG, np.abs(aspect_ln) / _RATIO_LN)
    best = int(misfits.argmin())
    if misfits[best] <= 1.0:
        return []
    u_angle = u_ratio = 0.0
    for moved in _move_corners(grid.corners, grid.corner_u_px or 0.0):
        angle, ratio = _compute_shape(moved, focal_px[best : best + 1], centre)
        u_angle = math.hypot(u_angle, angle[0] - angles[best])
        u_ratio = math.hypot(u_ratio, math.log(ratio[0] / ratios[best]))
    is_skew = abs(angles[best] - 90.0) > _ANGLE_DEG + _ERRORS * u_angle
    if not is_skew and abs(aspect_ln[best]) <= _RATIO_LN + _ERRORS * u_ratio:
        return []
    sides = f", sides of {ratios[best]:.3g} to 1 in place of {grid.aspect:.3g} to 1" if grid.aspect else ""
    detail = f"The most likely shape has corners of {angles[best]:.0f}° in place of 90°{sides}."
    return [codes.CORNERS_IMPLAUSIBLE.at("grid", detail)]


def _compute_shape(corners: Corners, focal_px: Array, centre: tuple[float, float]) -> tuple[Array, Array]:
    """Return the angle [deg] and the ratio of the sides for each focal length."""
    h = find_homography([(x - centre[0], y - centre[1]) for x, y in corners])
    first, second = h[:, 0], h[:, 1]

    def multiply(one: Array, other: Array) -> Array:
        product: Array = float(one[:2] @ other[:2]) / focal_px**2 + float(one[2] * other[2])
        return product

    sizes = multiply(first, first), multiply(second, second)
    cosine = multiply(first, second) / np.sqrt(sizes[0] * sizes[1])
    return np.degrees(np.arccos(cosine)), np.sqrt(sizes[0] / sizes[1])


def _move_corners(corners: Corners, by_px: float) -> list[list[tuple[float, float]]]:
    """Return the corners with each of the eight coordinates moved in turn."""
    moves = np.eye(8).reshape(8, 4, 2) * by_px
    return [[(float(x), float(y)) for x, y in np.array(corners) + move] for move in moves]


def _is_mirrored(corners: Corners) -> bool:
    """Return True for corners that run counterclockwise on the screen."""
    x, y = np.array(corners).T
    return bool(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) < 0.0)


def _measure_narrowest(points: Array) -> float:
    """Compute the width of the narrowest cell: its area over its longest side [px]."""
    across, along = np.diff(points, axis=0), np.diff(points, axis=1)
    longest = np.maximum(
        np.maximum(*(np.linalg.norm(side, axis=-1) for side in (along[:-1], along[1:]))),
        np.maximum(*(np.linalg.norm(side, axis=-1) for side in (across[:, :-1], across[:, 1:]))),
    )
    diagonals = points[1:, 1:] - points[:-1, :-1], points[1:, :-1] - points[:-1, 1:]
    area = 0.5 * np.abs(
        diagonals[0][..., 0] * diagonals[1][..., 1] - diagonals[0][..., 1] * diagonals[1][..., 0]
    )
    return float((area / longest).min())
