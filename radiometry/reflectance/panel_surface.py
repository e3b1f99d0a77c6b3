"""Appearance of a panel: a bright and even surface."""

import math

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.opencv import cv2

DARKEST_PANEL = 0.35
"""Of the way from the code's black to its white. Grass, soil and asphalt lie below 0.3."""

MOST_UNEVEN_REL, MOST_TILTED_REL = 0.05, 0.15
"""Of the square's 8 x 8 cells over their mean above black: scatter about a plane, and the plane's range."""

SAMPLES, CELLS = 64, 8
# a plane along the rows, of unit length
_RAMP = np.repeat(np.linspace(-1.0, 1.0, CELLS)[:, None], CELLS, axis=1)
_RAMP /= np.linalg.norm(_RAMP)

Corners = NDArray[np.float64]
Plane = NDArray[np.float32]


def sample_square(plane: Plane, centre: Corners, across: Corners, down: Corners) -> Plane | None:
    """Sample a parallelogram of the image on a grid of 64 x 64; None if it leaves the image."""
    corners = np.array([centre + (a * across + d * down) / 2.0 for a in (-1, 1) for d in (-1, 1)])
    if corners.min() < 0.0 or (corners > plane.shape[::-1]).any():
        return None
    step = np.column_stack([across, down]) / SAMPLES
    # of sample (0, 0), whose number is its centre's, as a pixel's is
    first = centre - (across + down) / 2.0 + step @ (0.5, 0.5) - 0.5
    grid = np.column_stack([step, first])
    size = (SAMPLES, SAMPLES)
    how = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.asarray(cv2.warpAffine(plane, grid, size, flags=how, borderMode=cv2.BORDER_REPLICATE))


def is_even(plane: Plane, square: Corners, *, black_dn: float) -> bool:
    """Return True if a quadrilateral of an image shows one surface, brighter than black.

    Parameters
    ----------
    plane : ndarray of float32
        Image [DN], (row, col).
    square : ndarray of float64
        Its corners (x, y) in order [px], (4, 2).
    black_dn : float
        Black level [DN].
    """
    across = (square[1] - square[0] + square[2] - square[3]) / 2.0
    down = (square[3] - square[0] + square[2] - square[1]) / 2.0
    inner = sample_square(plane, square.mean(axis=0), across, down)
    return inner is not None and measure_unevenness(inner, black_dn, black_dn + 1.0) is not None


def measure_unevenness(inner: Plane, black: float, white: float) -> float | None:
    """Return the relative scatter of a square that is bright and even as a panel; None of another one."""
    side = SAMPLES // CELLS
    cells = inner.reshape(CELLS, side, CELLS, side).mean(axis=(1, 3), dtype=float) - black
    mean = float(cells.mean())
    # light may fall off evenly across it; a shadow's edge or a rim is no plane
    slopes = [float((cells * _RAMP).sum()), float((cells * _RAMP.T).sum())]
    rest = cells - mean - slopes[0] * _RAMP - slopes[1] * _RAMP.T
    tilt = float(np.ptp(slopes[0] * _RAMP + slopes[1] * _RAMP.T))
    bright = mean >= DARKEST_PANEL * (white - black) > 0.0
    uneven = float(rest.std()) / mean if bright else math.inf
    return uneven if uneven <= MOST_UNEVEN_REL and tilt <= MOST_TILTED_REL * mean else None
