"""Relative illumination of the lens as the file states it, and its correction."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray

from radiometry.findings import InputRejected
from radiometry.frame.multispectral import RadialVignetting, VignettingPolynomial
from radiometry.frame.roi import Window
from radiometry.reflectance import codes

Plane = NDArray[np.float64]

_DARKEST_SHARE, _BRIGHTEST_SHARE = 0.05, 2.0


@dataclass(frozen=True, kw_only=True)
class FrameSize:
    """Size of the whole visible area.

    Attributes
    ----------
    height_px, width_px : int
        Height and width [px].
    """

    height_px: int
    width_px: int


def evaluate_polynomial(lens: VignettingPolynomial, window: Window, *, size: FrameSize) -> Plane:
    """Compute V(x/W, y/H) = sum c_n (x/W)^i_n (y/H)^j_n in a window.

    Parameters
    ----------
    lens : VignettingPolynomial
        Polynomial of the lens.
    window : Window
        Window of the frame.
    size : FrameSize
        Size of the whole frame.

    Returns
    -------
    Plane
        Relative illumination V, (row, col).

    Raises
    ------
    InputRejected
        `sensor_model_unusable` if V leaves 5 % to 200 %, so that it is not a lens's
        polynomial.

    Notes
    -----
    x is a pixel's column and y its row, counted from 0; W and H are the whole
    frame's.
    """
    highest = np.max(np.array(lens.exponents), axis=0)
    terms = np.zeros(highest + 1)
    for (power_x, power_y), coefficient in zip(lens.exponents, lens.coefficients, strict=True):
        terms[power_x, power_y] += coefficient
    x = np.arange(window.col0, window.col0 + window.width) / size.width_px
    y = np.arange(window.row0, window.row0 + window.height) / size.height_px
    of_each_row = np.asarray(polynomial.polyval(y, terms.T), np.float64)  # (power of x, row)
    return _require_lens(_sum_powers(x, of_each_row[:, :, None], (window.height, window.width)))


def evaluate_radial(lens: RadialVignetting, window: Window) -> Plane:
    """Compute 1 + k0 r + k1 r^2 + ... in a window; r [px] from the lens's centre.

    Parameters
    ----------
    lens : RadialVignetting
        Polynomial of the lens.
    window : Window
        Window of the frame.

    Returns
    -------
    Plane
        The polynomial, (row, col).

    Raises
    ------
    InputRejected
        `sensor_model_unusable` as in `evaluate_polynomial`.
    """
    x = np.arange(window.col0, window.col0 + window.width) - lens.centre_x_px
    y = np.arange(window.row0, window.row0 + window.height) - lens.centre_y_px
    radius = np.hypot(y[:, None], x[None, :])
    return _require_lens(_sum_powers(radius, np.array([1.0, *lens.coefficients]), radius.shape))


def _sum_powers(base: Plane, coefficients: Plane, shape: tuple[int, ...]) -> Plane:
    """Compute c_0 + c_1 base + c_2 base^2 + ... by Horner's rule, in one plane.

    The values equal those of numpy's polyval to the last bit; polyval makes two new
    planes for each term and is three times slower on a million pixels.
    """
    total = np.broadcast_to(coefficients[-1], shape).copy()
    for coefficient in coefficients[-2::-1]:
        total *= base
        total += coefficient
    return total


def correct_vignetting(light: Plane, share: Plane) -> Plane:
    """Correct a signal above black for vignetting: (p - B) / V.

    Parameters
    ----------
    light : Plane
        Signal above black, (row, col).
    share : Plane
        Relative illumination V, (row, col).

    Returns
    -------
    Plane
        Corrected signal, (row, col).

    Notes
    -----
    Black does not come through the lens, so it must be subtracted BEFORE this
    division. p / V - B is too large by B (1/V - 1): in the top left corner of a
    real capture 4 % (green) to 19 % (red edge) of the signal.
    """
    return light / share


def _require_lens(share: Plane) -> Plane:
    darkest, brightest = float(share.min()), float(share.max())
    if not (darkest >= _DARKEST_SHARE and brightest <= _BRIGHTEST_SHARE):
        raise InputRejected(
            codes.SENSOR_MODEL_UNUSABLE,
            f"The file's vignetting polynomial gives shares of light of {darkest:.3g} to {brightest:.3g} in "
            "this region: it is not a lens's. Use the camera's original file.",
        )
    return share
