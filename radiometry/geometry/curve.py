"""Radial distortion against the distance from the principal point, in pixels and micrometres."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.geometry.camera import PARAMETERS, CameraModel
from radiometry.geometry.results import CurvePoint

POINTS: Final = 21
_SEARCHED: Final = 2000
# An ideal radius is looked for up to twice the picture's own: barrel distortion draws in at most that.
_SEARCH_BEYOND: Final = 2.0


def find_farthest_radius_px(camera: CameraModel) -> float:
    """Return the distance from the principal point to the frame's farthest corner pixel.

    Returns
    -------
    float
        Distance [px].
    """
    rows = max(camera.cy_px, camera.height_px - 1 - camera.cy_px)
    cols = max(camera.cx_px, camera.width_px - 1 - camera.cx_px)
    return float(np.hypot(rows, cols))


def compute_curve(
    camera: CameraModel,
    covariance: NDArray[np.float64],
    *,
    pixel_pitch_um: float | None,
    covered_radius_px: float,
) -> tuple[CurvePoint, ...]:
    """Compute the distortion from the principal point to the frame's farthest corner.

    Parameters
    ----------
    camera : CameraModel
        Camera model.
    covariance : ndarray of float64
        Covariance of PARAMETERS, (9, 9).
    pixel_pitch_um : float or None
        Distance of neighbouring pixels [um]; None if unknown.
    covered_radius_px : float
        Distance from the principal point to the outermost corner that was used [px].

    Notes
    -----
    d(R) = R (k1 s^2 + k2 s^4 + k3 s^6),   s = R / f,   f = (fx + fy) / 2

    R is the ideal radius [px], R + d the radius in the picture; u(d)^2 = g^T C g with g the derivatives of
    d in fx, fy, k1, k2, k3 at fixed R. Where the model turns back before it reaches the corner, the curve
    ends there.
    """
    ideal = np.linspace(0.0, find_ideal_corner_px(camera), POINTS)
    distortion = distort_radially(camera, ideal)
    uncertain = _propagate(camera, covariance, ideal)
    pitch = pixel_pitch_um
    return tuple(
        CurvePoint(
            radius_px=float(radius + moved),
            ideal_radius_px=float(radius),
            distortion_px=float(moved),
            standard_uncertainty_px=float(u),
            distortion_um=None if pitch is None else float(moved * pitch),
            standard_uncertainty_um=None if pitch is None else float(u * pitch),
            extrapolated=bool(radius + moved > covered_radius_px),
        )
        for radius, moved, u in zip(ideal, distortion, uncertain, strict=True)
    )


def distort_radially(camera: CameraModel, ideal_px: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute how far a place at an ideal radius is moved outwards [px].

    Parameters
    ----------
    camera : CameraModel
        Camera model.
    ideal_px : ndarray of float64
        Ideal radii [px].

    Returns
    -------
    ndarray of float64
        Distortion [px].
    """
    s2 = (ideal_px / _focal_px(camera)) ** 2
    return np.asarray(ideal_px * s2 * (camera.k1 + s2 * (camera.k2 + s2 * camera.k3)), np.float64)


def find_turning_radius_px(camera: CameraModel) -> float | None:
    """Find the radius in the picture at which the model turns back.

    Returns
    -------
    float or None
        Radius [px]; None if it does not turn back up to the corner.

    Notes
    -----
    Beyond it two directions share a place. This occurs with no camera, only with a polynomial that no data
    constrain there.
    """
    ideal = np.linspace(0.0, _SEARCH_BEYOND * find_farthest_radius_px(camera), _SEARCHED)
    shown = ideal + distort_radially(camera, ideal)
    falls = np.flatnonzero(np.diff(shown) <= 0.0)
    if not len(falls) or shown[falls[0]] >= find_farthest_radius_px(camera):
        return None
    return float(shown[falls[0]])


def find_ideal_corner_px(camera: CameraModel) -> float:
    """Return the ideal radius of what the frame's farthest corner shows, or of where the model turns back.

    Returns
    -------
    float
        Ideal radius [px].
    """
    farthest = find_farthest_radius_px(camera)
    ideal = np.linspace(0.0, _SEARCH_BEYOND * farthest, _SEARCHED)
    shown = ideal + distort_radially(camera, ideal)
    falls = np.flatnonzero(np.diff(shown) <= 0.0)
    rising = slice(0, falls[0] + 1 if len(falls) else len(ideal))
    return float(np.interp(farthest, shown[rising], ideal[rising]))


def _focal_px(camera: CameraModel) -> float:
    return (camera.fx_px + camera.fy_px) / 2.0


def _propagate(
    camera: CameraModel, covariance: NDArray[np.float64], ideal_px: NDArray[np.float64]
) -> NDArray[np.float64]:
    f = _focal_px(camera)
    s2 = (ideal_px / f) ** 2
    slopes = np.zeros((len(ideal_px), len(PARAMETERS)))
    for power, name in enumerate(("k1", "k2", "k3"), start=1):
        slopes[:, PARAMETERS.index(name)] = ideal_px * s2**power
    of_f = -ideal_px / f * s2 * (2.0 * camera.k1 + s2 * (4.0 * camera.k2 + s2 * 6.0 * camera.k3))
    slopes[:, PARAMETERS.index("fx_px")] = slopes[:, PARAMETERS.index("fy_px")] = of_f / 2.0
    variance = np.einsum("ni,ij,nj->n", slopes, covariance, slopes)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)), np.float64)
