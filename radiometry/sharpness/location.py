"""Location of an edge: its place on every line, and the polynomial through them."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from radiometry.sharpness.sampling import Plane

Vector = NDArray[np.float64]

_WINDOW_FLOOR = 0.05


@dataclass(frozen=True, kw_only=True)
class Edge:
    """Edge in a plane's own coordinates [px of the sensor].

    Attributes
    ----------
    places_px : ndarray of float64
        Places of its centroids, (line,).
    curve : Polynomial
        Place by line.
    slope : float
        Slope of the straight fit.
    residual_px : float
        Rms of the places about the curve.
    departure_px : float
        Largest distance of a cubic through the places from the straight line.
    """

    places_px: Vector
    curve: Polynomial
    slope: float
    residual_px: float
    departure_px: float


def locate_edge(plane: Plane, *, order: int) -> Edge:
    """Find the edge on each line as the centroid of the windowed derivative, and fit a polynomial [1]_ [2]_.

    Parameters
    ----------
    plane : Plane
        Samples of one channel.
    order : int
        Order of the polynomial, 1 to 5.

    Returns
    -------
    Edge
        Places and curve.

    Notes
    -----
    x_j = sum_k k w_jk d_jk / sum_k w_jk d_jk,  d the difference of neighbours, w a raised cosine that
    reaches to the region's further side, 5 % at least: first about the region's middle, then about the
    first fit.

    References
    ----------
    .. [1] ISO 12233:2023 annex D
    .. [2] P. D. Burns, sfrmat5
    """
    samples = plane.values.shape[1]
    middle = np.full(plane.line_px.size, (samples - 1) / 2.0)
    places = _find_places(plane, middle)
    curve = Polynomial.fit(plane.line_px, places, order)
    middle = np.clip((curve(plane.line_px) - plane.first_px) / plane.pitch_px, 0.0, samples - 1.0)
    places = _find_places(plane, middle)
    curve = Polynomial.fit(plane.line_px, places, order)
    straight = Polynomial.fit(plane.line_px, places, 1)
    cubic = Polynomial.fit(plane.line_px, places, 3)
    return Edge(
        places_px=places,
        curve=curve,
        slope=float(straight.convert().coef[1]),
        residual_px=float(np.sqrt(np.mean((places - curve(plane.line_px)) ** 2))),
        departure_px=float(np.max(np.abs(cubic(plane.line_px) - straight(plane.line_px)))),
    )


def _find_places(plane: Plane, middle: Vector) -> Vector:
    """Return the centroid of every line's difference, the window about `middle` (line,) [samples]."""
    samples = plane.values.shape[1]
    between = np.arange(samples - 1) + 0.5
    reach = np.maximum(middle + 0.5, samples - 0.5 - middle)[:, None]
    phase = np.clip((between - middle[:, None]) / reach, -1.0, 1.0)
    window = _WINDOW_FLOOR + (1.0 - _WINDOW_FLOOR) * 0.5 * (1.0 + np.cos(np.pi * phase))
    weighted = np.diff(plane.values, axis=1) * window
    total = weighted.sum(axis=1)
    total = np.where(total == 0.0, 1.0, total)  # a line without an edge: it spoils the fit, and is seen
    return np.asarray(plane.first_px + plane.pitch_px * (weighted @ between) / total, np.float64)
