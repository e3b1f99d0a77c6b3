"""A falloff in other programs' terms: fitted anew to their equations, with the error that this costs."""

from collections.abc import Sequence

import numpy as np

from radiometry.findings import InputRejected, shared
from radiometry.vignetting.application import evaluate
from radiometry.vignetting.grid import Vector
from radiometry.vignetting.results import Coefficient

_SAMPLES = 129
"""Along each side of the frame: odd, so that the middle is one of them."""


def sample_frame(coefficient: Coefficient) -> tuple[Vector, Vector]:
    """Give rows and columns of a lattice over the pixel centres of a frame, corners included."""
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
    """Give the mean of V over channels at a lattice, (row, col).

    Raises InputRejected(vignetting_not_calibrated)
    """
    if not channels:
        raise InputRejected(
            shared.VIGNETTING_NOT_CALIBRATED,
            "No channel is left to export: name one or more that the calibration has.",
        )
    shares = [
        evaluate(coefficients, rows, cols, channel=channel, f_number=f_number).share for channel in channels
    ]
    return np.asarray(np.mean(shares, axis=0))


def fit_even_powers(squared: Vector, wanted: Vector, *, terms: int) -> tuple[tuple[float, ...], float]:
    """Fit 1 + c1 r^2 + c2 r^4 + ... to values, by least squares of the relative error.

    Takes
      squared : r^2; wanted : the values there, > 0
    Returns the coefficients, and the largest relative error
    """
    powers = np.stack([squared.ravel() ** power for power in range(1, terms + 1)], axis=1)
    target = wanted.ravel()
    found = np.linalg.lstsq(powers / target[:, None], 1.0 - 1.0 / target, rcond=None)[0]
    error = float(np.abs((1.0 + powers @ found) / target - 1.0).max())
    return tuple(float(each) for each in found), error
