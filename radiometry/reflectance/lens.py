"""Relative illumination of the lens as the file states it, and its correction."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray

from radiometry.findings import InputRejected
from radiometry.frame.multispectral import Multispectral, RadialVignetting, VignettingPolynomial
from radiometry.frame.roi import Window
from radiometry.reflectance import codes

Plane = NDArray[np.float64]

_DARKEST_SHARE, _BRIGHTEST_SHARE = 0.05, 2.0
_PROBES = 33


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
    return _require_lens(_evaluate(lens, *_pixels(window), size=size))


def evaluate_band(band: Multispectral, window: Window, *, size: FrameSize) -> Plane:
    """Compute the relative illumination V of a band in a window, in whichever form its file states it.

    Returns
    -------
    Plane
        Relative illumination V, (row, col).

    Raises
    ------
    InputRejected
        `sensor_model_unusable` if the file states none, or one that is not a lens's.
    """
    return _require_lens(_illuminate(band, *_pixels(window), size=size))


def require_lens(band: Multispectral, *, size: FrameSize) -> None:
    """Refuse a relative illumination that is not a lens's somewhere in the frame.

    Parameters
    ----------
    band : Multispectral
        Metadata of the band.
    size : FrameSize
        Size of the whole frame; 33 x 33 pixels of it, with its corners, are probed.

    Raises
    ------
    InputRejected
        `sensor_model_unusable`.
    """
    x, y = (np.linspace(0.0, length - 1.0, _PROBES) for length in (size.width_px, size.height_px))
    _require_lens(_illuminate(band, x, y, size=size))


def _pixels(window: Window) -> tuple[Plane, Plane]:
    x = np.arange(window.col0, window.col0 + window.width, dtype=np.float64)
    return x, np.arange(window.row0, window.row0 + window.height, dtype=np.float64)


def _illuminate(band: Multispectral, x: Plane, y: Plane, *, size: FrameSize) -> Plane:
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        if band.vignetting_polynomial is not None:
            return _evaluate(band.vignetting_polynomial, x, y, size=size)
        if band.radial_vignetting is not None:
            return _evaluate_radial(band.radial_vignetting, x, y)
        if band.radial_gain is not None:
            return 1.0 / _evaluate_radial(band.radial_gain, x, y)
    raise InputRejected(
        codes.SENSOR_MODEL_UNUSABLE,
        f"The file of band {band.band_name} has no readable vignetting polynomial. Use the camera's original "
        "file and its newest firmware.",
    )


def _evaluate(lens: VignettingPolynomial, x: Plane, y: Plane, *, size: FrameSize) -> Plane:
    highest = np.max(np.array(lens.exponents), axis=0)
    terms = np.zeros(highest + 1)
    for (power_x, power_y), coefficient in zip(lens.exponents, lens.coefficients, strict=True):
        terms[power_x, power_y] += coefficient
    of_each_row = np.asarray(polynomial.polyval(y / size.height_px, terms.T), np.float64)  # (power of x, row)
    return _sum_powers(x / size.width_px, of_each_row[:, :, None], (len(y), len(x)))


def _evaluate_radial(lens: RadialVignetting, x: Plane, y: Plane) -> Plane:
    radius = np.hypot((y - lens.centre_y_px)[:, None], (x - lens.centre_x_px)[None, :])
    return _sum_powers(radius, np.array([1.0, *lens.coefficients]), radius.shape)


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
            f"The file's vignetting polynomial gives a relative illumination of {darkest:.3g} to "
            f"{brightest:.3g}: it is not a lens's. Use the camera's original file.",
        )
    return share
