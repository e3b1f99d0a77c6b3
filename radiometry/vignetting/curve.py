"""The curve V(r) = 1 + k1 r^2 + k2 r^4 + k3 r^6, its slopes, and what follows from it at the corners."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from radiometry.vignetting.grid import Vector

Array = NDArray[np.float64]

PARAMETERS = 5
"""k1, k2, k3, centre row, centre column: the order of every covariance."""

_RADII = 512


def evaluate_curve(squared: Array, k: Sequence[float]) -> Array:
    """Compute V where r^2 is known.

    Parameters
    ----------
    squared : ndarray of float64
        Values of r^2.
    k : sequence of float
        Coefficients k1, k2, k3.

    Returns
    -------
    ndarray of float64
        V, in the shape of `squared`.
    """
    k1, k2, k3 = k
    return np.asarray(1.0 + squared * (k1 + squared * (k2 + squared * k3)))


def evaluate_slopes(
    row_px: Array, col_px: Array, k: Sequence[float], *, centre_px: tuple[float, float], radius_px: float
) -> tuple[Array, Array]:
    """Compute V and its derivatives by k1, k2, k3, centre row and centre column.

    Parameters
    ----------
    row_px, col_px : ndarray of float64
        Rows and columns [px], in any shapes that broadcast together.
    k : sequence of float
        Coefficients k1, k2, k3.
    centre_px : tuple of float
        Row and column of the centre [px].
    radius_px : float
        Radius R at which r = 1 [px].

    Returns
    -------
    tuple of ndarray of float64
        V of that shape, and derivatives of shape (5, ...).

    Notes
    -----
    dV/dk_n = r^2n;  dV/dcentre_row = -(2 a / R) (k1 + 2 k2 r^2 + 3 k3 r^4), a = (row - centre_row) / R
    """
    a, b = (row_px - centre_px[0]) / radius_px, (col_px - centre_px[1]) / radius_px
    squared = a**2 + b**2
    by_square = k[0] + squared * (2.0 * k[1] + squared * 3.0 * k[2])
    slopes = np.stack(
        [squared, squared**2, squared**3, -2.0 * a * by_square / radius_px, -2.0 * b * by_square / radius_px]
    )
    return evaluate_curve(squared, k), slopes


def list_corners(height_px: int, width_px: int) -> list[tuple[float, float]]:
    """Return the frame's four corners [px]: half a pixel outside the centres of the outermost pixels.

    Parameters
    ----------
    height_px, width_px : int
        Size of the frame [px].

    Returns
    -------
    list of tuple of float
        Row and column of each corner [px].
    """
    return [(row, col) for row in (-0.5, height_px - 0.5) for col in (-0.5, width_px - 0.5)]


def find_farthest_corner(
    height_px: int, width_px: int, *, centre_px: tuple[float, float]
) -> tuple[float, float]:
    """Return the corner that is farthest from the centre; of equally far ones the first by row, then column.

    Parameters
    ----------
    height_px, width_px : int
        Size of the frame [px].
    centre_px : tuple of float
        Row and column of the centre [px].

    Returns
    -------
    tuple of float
        Row and column of the corner [px].
    """
    return max(list_corners(height_px, width_px), key=lambda corner: math.dist(corner, centre_px))


def propagate(slopes: Array, covariance: Array) -> Array:
    """Compute the standard uncertainty that follows from that of the parameters: sqrt(J C J').

    Parameters
    ----------
    slopes : ndarray of float64
        Derivatives J, (5, ...).
    covariance : ndarray of float64
        Covariance C of the parameters, (5, 5).

    Returns
    -------
    ndarray of float64
        Standard uncertainty, (...).
    """
    variance = np.einsum("i...,ij,j...->...", slopes, covariance, slopes)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def sample_radii(farthest: float) -> Vector:
    """Return radii from the centre to the farthest corner at which the whole curve is checked."""
    return np.linspace(0.0, farthest, _RADII)


def find_largest_rise(shares: Vector) -> tuple[float, int, int]:
    """Return the largest outward increase of V, with the indices from which and to which it extends.

    Returns
    -------
    tuple of (float, int, int)
        Increase and indices; (0, 0, 0) if V increases nowhere.
    """
    lowest = np.minimum.accumulate(shares)
    top = int(np.argmax(shares - lowest))
    bottom = int(np.argmin(shares[: top + 1]))
    return float(shares[top] - shares[bottom]), bottom, top
