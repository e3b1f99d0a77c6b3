"""Falloff in the terms of other programs: refitted to their equations, with the error that this causes."""

from collections.abc import Sequence

import numpy as np

from radiometry.vignetting.application import evaluate
from radiometry.vignetting.grid import Vector
from radiometry.vignetting.results import Coefficient

_SAMPLES = 129
"""Along each side of the frame: odd, so that the middle is one of them."""


def sample_frame(coefficient: Coefficient) -> tuple[Vector, Vector]:
    """Return rows and columns of a lattice over the pixel centres of a frame, corners included.

    Parameters
    ----------
    coefficient : Coefficient
        Falloff of one f-number and channel.

    Returns
    -------
    tuple of ndarray of float64
        Rows and columns [px].
    """
    rows = np.linspace(0.0, coefficient.height_px - 1.0, _SAMPLES)
    cols = np.linspace(0.0, coefficient.width_px - 1.0, _SAMPLES)
    return rows[:, None], cols[None, :]


def average_share(
    coefficients: Sequence[Coefficient],
    rows: Vector,
    cols: Vector,
    *,
    channels: Sequence[str],
    f_number: float,
) -> Vector:
    """Compute the mean of V over channels at a lattice.

    Parameters
    ----------
    coefficients : sequence of Coefficient
        Coefficients of one version.
    rows, cols : ndarray of float64
        Rows and columns of the lattice [px].
    channels : sequence of str
        Channels whose mean is taken.
    f_number : float
        F-number.

    Returns
    -------
    ndarray of float64
        Mean V, (row, col).

    Raises
    ------
    InputRejected
        `vignetting_not_calibrated` for another channel, or outside the range.
    """
    shares = [
        evaluate(coefficients, rows, cols, channel=channel, f_number=f_number).share for channel in channels
    ]
    return np.asarray(np.mean(shares, axis=0))


def fit_even_powers(squared: Vector, wanted: Vector, *, terms: int) -> tuple[tuple[float, ...], float]:
    """Fit 1 + c1 r^2 + c2 r^4 + ... to values, by least squares of the relative error.

    Parameters
    ----------
    squared : ndarray of float64
        Values of r^2.
    wanted : ndarray of float64
        Values to fit there, > 0.
    terms : int
        Number of coefficients.

    Returns
    -------
    tuple of (tuple of float, float)
        Coefficients, and the largest relative error.
    """
    powers = np.stack([squared.ravel() ** power for power in range(1, terms + 1)], axis=1)
    target = wanted.ravel()
    found = np.linalg.lstsq(powers / target[:, None], 1.0 - 1.0 / target, rcond=None)[0]
    error = float(np.abs((1.0 + powers @ found) / target - 1.0).max())
    return tuple(float(each) for each in found), error
