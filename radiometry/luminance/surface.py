"""A lit surface seen in perspective: its grid of cells in the image, and its uniformity."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected
from radiometry.frame.grid import MAX_CELLS_A_SIDE, Grid
from radiometry.frame.lanes import find_homography
from radiometry.frame.roi import MAX_COORDINATE_PX, Polygon
from radiometry.luminance import codes

Matrix = NDArray[np.float64]
Lattice = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Cells:
    """Luminances of a grid's cells, and the effect of each source of error on them.

    Attributes
    ----------
    values_cd_m2 : ndarray of float64
        Luminances [cd/m2], (rows, columns).
    noise_cd_m2 : ndarray of float64
        Noise of each cell [cd/m2], (rows, columns), independent between two cells.
    shared_cd_m2 : ndarray of float64
        Effect of one standard uncertainty of m independent sources, each of which
        errs alike in all cells [cd/m2], (m, rows, columns).
    local_cd_m2 : ndarray of float64
        The same of sources that may err alike in all cells, or in each cell on its
        own [cd/m2], (l, rows, columns).
    """

    values_cd_m2: Matrix
    noise_cd_m2: Matrix
    shared_cd_m2: NDArray[np.float64]
    local_cd_m2: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A value with its standard uncertainty.

    Attributes
    ----------
    value, standard_uncertainty : float
        Value and its standard uncertainty, in the same unit.
    """

    value: float
    standard_uncertainty: float


@dataclass(frozen=True, kw_only=True)
class Uniformity:
    """Uniformity of a lit surface; a ratio is None if its denominator is not positive.

    Attributes
    ----------
    average_cd_m2, smallest_cd_m2, largest_cd_m2 : Estimate
        Mean, smallest and largest luminance of the cells [cd/m2].
    u_o : Estimate or None
        Overall uniformity, L_min / L_av.
    u_l : tuple of Estimate or None
        Longitudinal uniformity: for each row of cells, its smallest over its
        largest.
    average_to_min : Estimate or None
        L_av / L_min.
    max_to_min : Estimate or None
        L_max / L_min.
    """

    average_cd_m2: Estimate
    smallest_cd_m2: Estimate
    largest_cd_m2: Estimate
    u_o: Estimate | None
    u_l: tuple[Estimate | None, ...]
    average_to_min: Estimate | None
    max_to_min: Estimate | None


def lay_grid(grid: Grid) -> tuple[tuple[Polygon, ...], ...]:
    """Divide the image of a surface into the images of its equal cells.

    Parameters
    ----------
    grid : Grid
        Corners of the surface, rows and columns.

    Returns
    -------
    tuple of tuple of Polygon
        Cells, row by row of the surface.

    Raises
    ------
    InputRejected
        `grid_invalid` unless the corners are those of a convex quadrilateral.

    Notes
    -----
    A camera maps a plane to a plane by a homography [1]_. With h from the unit
    square to the corners::

        (x, y, 1) ~ h (u, v, 1),   u = column / columns, v = row / rows                                (1)

    Lines stay lines, so each cell is the quadrilateral of its four lattice points.
    Bilinear cells would be equal fractions of the IMAGE's edges: in perspective the
    far cells would cover more of the surface than the near ones, and averages over
    cells would give the far end too little weight. Lens distortion is not
    corrected.

    References
    ----------
    .. [1] R. Hartley, A. Zisserman, Multiple View Geometry in Computer Vision,
           Cambridge 2004, section 2.3, doi:10.1017/CBO9780511811685
    """
    points = lay_lattice(grid)
    return tuple(
        tuple(
            Polygon.from_points(
                [points[row, col], points[row, col + 1], points[row + 1, col + 1], points[row + 1, col]]
            )
            for col in range(grid.columns)
        )
        for row in range(grid.rows)
    )


def outline(grid: Grid) -> Polygon:
    """Return the quadrilateral of the surface itself.

    Parameters
    ----------
    grid : Grid
        Corners of the surface.

    Raises
    ------
    InputRejected
        `grid_invalid`.
    """
    _require_convex(grid.corners)
    return Polygon.from_points(grid.corners)


def lay_lattice(grid: Grid) -> Lattice:
    """Compute the images of the lattice points between the cells of a grid.

    Parameters
    ----------
    grid : Grid
        Corners of the surface, rows and columns.

    Returns
    -------
    ndarray of float64
        Points (x, y) [px], (rows + 1, columns + 1, 2); neighbouring cells share them to the last bit.

    Raises
    ------
    InputRejected
        `grid_invalid`.
    """
    if not (1 <= grid.rows <= MAX_CELLS_A_SIDE and 1 <= grid.columns <= MAX_CELLS_A_SIDE):
        raise InputRejected(
            codes.GRID_INVALID, f"A grid has 1 to {MAX_CELLS_A_SIDE} rows and as many columns of cells."
        )
    _require_convex(grid.corners)
    h = find_homography(grid.corners)
    v, u = np.meshgrid(
        np.arange(grid.rows + 1) / grid.rows, np.arange(grid.columns + 1) / grid.columns, indexing="ij"
    )
    projected = np.stack([u, v, np.ones_like(u)], axis=-1) @ h.T
    points: Lattice = projected[..., :2] / projected[..., 2:]
    # the given corners, free of rounding: a corner on the frame's border must not leave it
    for (row, col), corner in zip(((0, 0), (0, -1), (-1, -1), (-1, 0)), grid.corners, strict=True):
        points[row, col] = corner
    return points


def _require_convex(corners: Sequence[tuple[float, float]]) -> None:
    """Refuse corners that cannot be the image of a rectangle in front of the camera."""
    points = np.array(corners, np.float64)
    if points.shape != (4, 2) or not np.all(np.abs(points) <= MAX_COORDINATE_PX):
        raise InputRejected(codes.GRID_INVALID, "A grid has four corners [x, y] in pixels.")
    edges = np.roll(points, -1, axis=0) - points
    following = np.roll(edges, -1, axis=0)
    turns = edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0]
    if not (np.all(turns > 0) or np.all(turns < 0)):
        raise InputRejected(
            codes.GRID_INVALID,
            "The grid's corners are not those of a surface seen in perspective: give them in order around it "
            "(top-left, top-right, bottom-right, bottom-left), no three on one line.",
        )


def judge_uniformity(cells: Cells) -> Uniformity:
    """Compute average, extremes and their ratios, each with its uncertainty.

    Parameters
    ----------
    cells : Cells
        Luminances of the cells with their errors.

    Returns
    -------
    Uniformity
        Uniformity as in [1]_, applied to the cells' means.

    Notes
    -----
    With g the gradient of a value in the cells' luminances L_i, n_i a cell's noise
    and e_ki the effect of shared source k on it [2]_::

        u^2 = sum_i (g_i n_i)^2 + sum_k (sum_i g_i e_ki)^2
            + sum_l max((sum_i g_i e_li)^2, sum_i (g_i e_li)^2)

    A source that scales all luminances (K, t, f, ISO) has e_ki ~ L_i. A ratio does
    not change with scale, sum_i g_i L_i = 0, so such a source cancels
    automatically. The dark signal, which is subtracted, does not: it has more
    weight in a dark cell. A local source l is one of which it is not known whether all
    cells have its error: flicker, as lamps hang on three phases and a rolling shutter
    exposes rows one after the other. It is taken as what errs more, so that it neither
    averages nor cancels. Of equal cells the first is the smallest or the largest.

    References
    ----------
    .. [1] EN 13201-3:2015 (U_o, U_l)
    .. [2] JCGM 100:2008, 5.1.2, and 5.2.2 for what is shared,
           doi:10.59161/JCGM100-2008E
    """
    values = cells.values_cd_m2
    average_gradient = np.full(values.shape, 1.0 / values.size)
    average, smallest, largest = float(values.mean()), float(values.min()), float(values.max())
    low, high = _only(values, int(values.argmin())), _only(values, int(values.argmax()))
    return Uniformity(
        average_cd_m2=_figure(cells, average, average_gradient),
        smallest_cd_m2=_figure(cells, smallest, low),
        largest_cd_m2=_figure(cells, largest, high),
        u_o=_ratio(cells, (smallest, low), (average, average_gradient)),
        u_l=tuple(_line(cells, row) for row in range(values.shape[0])),
        average_to_min=_ratio(cells, (average, average_gradient), (smallest, low)),
        max_to_min=_ratio(cells, (largest, high), (smallest, low)),
    )


def _line(cells: Cells, row: int) -> Estimate | None:
    values = cells.values_cd_m2
    start, line = row * values.shape[1], values[row]
    low, high = start + int(line.argmin()), start + int(line.argmax())
    return _ratio(cells, (float(line.min()), _only(values, low)), (float(line.max()), _only(values, high)))


def _only(values: Matrix, index: int) -> Matrix:
    """Return the gradient of one cell's own luminance."""
    gradient = np.zeros(values.shape)
    gradient.flat[index] = 1.0
    return gradient


def _ratio(cells: Cells, above: tuple[float, Matrix], below: tuple[float, Matrix]) -> Estimate | None:
    """Compute a quotient: its gradient is (g_above - quotient g_below) / below."""
    if below[0] <= 0.0:
        return None
    quotient = above[0] / below[0]
    return _figure(cells, quotient, (above[1] - quotient * below[1]) / below[0])


def _figure(cells: Cells, value: float, gradient: Matrix) -> Estimate:
    noise = float(np.sum((gradient * cells.noise_cd_m2) ** 2))
    shared = np.einsum("rc,krc->k", gradient, cells.shared_cd_m2)
    alike = np.einsum("rc,krc->k", gradient, cells.local_cd_m2) ** 2
    apart = np.sum((gradient * cells.local_cd_m2) ** 2, axis=(1, 2))
    local = float(np.maximum(alike, apart).sum())
    return Estimate(value=value, standard_uncertainty=math.sqrt(noise + float(shared @ shared) + local))
