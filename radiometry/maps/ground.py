"""Places of a map's pixels on the ground: along the lanes of a road, or in longitude and latitude."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.lanes import find_homography

Array = NDArray[np.float64]

_BEYOND: Final = 0.5
"""Of the marked rectangle's sides: how far beyond it the road is taken as the same plane."""

_WGS84_M, _WGS84_E2 = 6378137.0, 6.69437999014e-3


def place_on_road(lanes: Mapping[str, Any], xy_px: Array) -> Array | None:
    """Return (x, y) along and across the lanes from the first marked corner [m].

    Parameters
    ----------
    lanes : mapping
        Lanes as `describe_lanes` returns them.
    xy_px : ndarray of float64
        Places in the picture [px], (n, 2).

    Returns
    -------
    ndarray of float64 or None
        (n, 2); None if a place lies further outside the marked rectangle than half its size, where errors of
        its corners grow fast.
    """
    inverse = np.linalg.inv(find_homography(lanes["marked"]))
    seen = np.column_stack([xy_px, np.ones(len(xy_px))]) @ inverse.T
    unit = seen[:, :2] / seen[:, 2:]
    if not np.all(np.abs(unit - 0.5) <= 0.5 + _BEYOND):
        return None
    placed: Array = unit * np.array([lanes["length_m"], lanes["lanes"] * lanes["lane_width_m"]])
    return placed


def place_on_earth(transform: Sequence[float], xy_px: Array) -> Array:
    """Return (longitude, latitude) [deg] by an affine transformation, (n, 2).

    Parameters
    ----------
    transform : sequence of float
        (a, b, c, d, e, f) as GDAL counts them [deg].
    xy_px : ndarray of float64
        Places in the picture [px], (n, 2).
    """
    a, b, c, d, e, f = transform
    x, y = xy_px.T
    return np.column_stack([a + b * x + c * y, d + e * x + f * y])


def travel(placed: Array, *, is_in_degrees: bool) -> Array:
    """Return the distance of each place from the first, along all between [m].

    Parameters
    ----------
    placed : ndarray of float64
        (x, y) [m], or (longitude, latitude) [deg] on the ellipsoid WGS 84, (n, 2).
    is_in_degrees : bool
        True for longitude and latitude.
    """
    steps = np.diff(placed, axis=0)
    if is_in_degrees:
        latitude = np.radians(placed[:-1, 1])
        flat = 1.0 - _WGS84_E2 * np.sin(latitude) ** 2
        east = _WGS84_M / np.sqrt(flat) * np.cos(latitude)
        north = _WGS84_M * (1.0 - _WGS84_E2) / flat**1.5
        steps = np.radians(steps) * np.column_stack([east, north])
    return np.concatenate([[0.0], np.cumsum(np.hypot(*steps.T))])
