"""Centre of a Siemens star."""

import numpy as np
import scipy
from numpy.typing import NDArray

from radiometry.sharpness.sampling import Plane

Matrix = NDArray[np.float64]

_RINGS = 6


def guess_centre(picture: Matrix) -> tuple[float, float]:
    """Estimate the point about which a picture is most nearly symmetric or antisymmetric.

    Parameters
    ----------
    picture : ndarray of float64
        Picture of the star, (row, col).

    Returns
    -------
    tuple of float
        Row and column, as indices.

    Notes
    -----
    A star turned by half a turn is itself (n even) or its negative (n odd), so the picture convolved with
    itself has its largest modulus at twice the centre. Slow changes of light are subtracted before.
    """
    size = max(3, min(picture.shape) // 8)
    fine = picture - scipy.ndimage.uniform_filter(picture, size, mode="nearest")
    shape = (2 * picture.shape[0], 2 * picture.shape[1])
    folded = np.abs(scipy.fft.irfft2(scipy.fft.rfft2(fine, shape) ** 2, shape))
    row, col = np.unravel_index(int(np.argmax(folded)), folded.shape)
    return float(row) / 2.0, float(col) / 2.0


def refine_centre(
    plane: Plane, *, start: tuple[float, float], cycles: int, radius_px: float
) -> tuple[float, float]:
    """Find the centre at which the star's fundamental is strongest, over rings of its outer half.

    Parameters
    ----------
    plane : Plane
        Plane with lines along the rows.
    start : tuple of float
        Row and column within about r / n of the true centre.
    cycles : int
        Cycles n of the star.
    radius_px : float
        Radius of the largest ring that lies entirely in the plane [px].

    Returns
    -------
    tuple of float
        Row and column of the centre.

    Notes
    -----
    P(c) = sum_rings |sum I exp(-i n theta)|^2 / N^2,  theta about c.   A centre that is d off turns the
    phase by n d / r around the ring, and weakens the sum.
    """
    rows = np.broadcast_to(plane.line_px[:, None], plane.values.shape).ravel()
    cols = plane.positions_px.ravel()
    signal = plane.values.ravel()
    near = np.hypot(rows - start[0], cols - start[1]) <= radius_px
    rows, cols, signal = rows[near], cols[near], signal[near]
    ring = np.hypot(rows - start[0], cols - start[1]) / radius_px * 2.0 * _RINGS
    index = np.minimum(ring.astype(np.intp), 2 * _RINGS - 1)
    outer = index >= _RINGS
    rows, cols, signal, index = rows[outer], cols[outer], signal[outer], index[outer] - _RINGS
    count = np.maximum(np.bincount(index, minlength=_RINGS), 1)
    signal = signal - (np.bincount(index, signal, _RINGS) / count)[index]

    def weakness(centre: Matrix) -> float:
        phase = cycles * np.arctan2(rows - centre[0], cols - centre[1])
        real = np.bincount(index, signal * np.cos(phase), _RINGS) / count
        imaginary = np.bincount(index, signal * np.sin(phase), _RINGS) / count
        return -float(np.sum(real**2 + imaginary**2))

    first = np.array(start)
    simplex = np.array([first, first + np.array([0.7, 0.0]), first + np.array([0.0, 0.7])])
    options = {"initial_simplex": simplex, "xatol": 1e-3, "fatol": 0.0, "maxiter": 120}
    found = scipy.optimize.minimize(weakness, first, method="Nelder-Mead", options=options).x
    return float(found[0]), float(found[1])
