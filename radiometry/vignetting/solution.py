"""Blocks of one channel, the falloff that is fitted to them, and what is known of it before."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radiometry.vignetting.curve import PARAMETERS
from radiometry.vignetting.darkness import KNOWN, DarkError
from radiometry.vignetting.grid import Axis, Grid, Plane

Matrix = NDArray[np.float64]

CENTRE, LIGHT = slice(4, 6), slice(6, 8)
"""Places of the centre and of the plane of light among the parameters of a fit."""

CENTRE_U = 0.1
"""Standard uncertainty of a centre before any fit, in half diagonals; the bodies of the "Four Vision" report
lie up to 0.13 from the middle."""

_HELD_U = 0.05
"""From this standard uncertainty on the flats do not determine a centre, in half diagonals."""

_SIGNIFICANT_CHI_SQUARED = 11.83
"""Two degrees of freedom: what noise exceeds as rarely as three standard errors of one."""


def is_apart(difference: Matrix, covariance: Matrix) -> bool:
    """Return True if a difference of two numbers exceeds its errors, as rarely as three of them by noise.

    Parameters
    ----------
    difference : ndarray of float64
        Difference, (2,).
    covariance : ndarray of float64
        Its covariance, (2, 2).

    Returns
    -------
    bool
        True if chi^2 is above 11.83.
    """
    return bool(difference @ np.linalg.solve(covariance, difference) > _SIGNIFICANT_CHI_SQUARED)


@dataclass(frozen=True)
class Blocks:
    """Light of one channel over the blocks of a grid, (row, col).

    Attributes
    ----------
    grid : Grid
        Grid of blocks.
    rows, cols : Axis
        Rows and columns of the channel in blocks.
    light : ndarray of float64
        Light above dark, in any unit.
    standard_error : ndarray of float64
        Standard error of each, > 0; infinite where it does not count.
    dark : DarkError, default: KNOWN
        Error of the dark level, common to all of them.
    """

    grid: Grid
    rows: Axis
    cols: Axis
    light: Plane
    standard_error: Plane
    dark: DarkError = KNOWN

    @property
    def places(self) -> tuple[Plane, Plane]:
        """Distance of the blocks from the frame's middle, down and to the right [R]."""
        middle, radius = self.grid.middle_px, self.grid.half_diagonal_px
        return (self.rows.means - middle[0])[:, None] / radius, (self.cols.means - middle[1])[None] / radius


@dataclass(frozen=True)
class Prior:
    """Knowledge of centre and plane of light before a fit.

    Attributes
    ----------
    mean : ndarray of float64
        Centre from the frame's middle [R], and gradient of the light per half diagonal; (4,), row first.
    precision : ndarray of float64
        Inverse of its covariance, (4, 4); 0 where nothing is known.
    """

    mean: Matrix
    precision: Matrix

    def replace(self, part: slice, mean: Matrix, covariance: Matrix) -> "Prior":
        """Return the knowledge with another centre or plane.

        Parameters
        ----------
        part : slice
            `CENTRE` or `LIGHT`.
        mean, covariance : ndarray of float64
            Its mean, (2,), and covariance, (2, 2).
        """
        where = slice(part.start - 4, part.stop - 4)
        changed = self.mean.copy(), self.precision.copy()
        changed[0][where], changed[1][where, where] = mean, np.linalg.inv(covariance)
        return Prior(*changed)


UNKNOWN = Prior(np.zeros(4), np.zeros((4, 4)))
USUAL = UNKNOWN.replace(CENTRE, np.zeros(2), CENTRE_U**2 * np.eye(2))
EVEN = USUAL.replace(LIGHT, np.zeros(2), 1e-12 * np.eye(2))
"""Of light without a plane; for comparison only."""


@dataclass(frozen=True)
class Solution:
    """Fitted falloff.

    Attributes
    ----------
    parameters : ndarray of float64
        A, k1, k2, k3, centre from the frame's middle [R], gradient of the light per half diagonal.
    information : ndarray of float64
        Inverse of their covariance, Birge's ratio and what was known before included.
    grid : Grid
        Grid of the blocks.
    chi_squared : float
        Weighted sum of squared residuals of the blocks.
    dof : int
        Degrees of freedom.
    fitted : ndarray of float64
        Model per block.
    residual : ndarray of float64
        (light - fitted) / fitted, 0 where it does not count.
    """

    parameters: Matrix
    information: Matrix
    grid: Grid
    chi_squared: float
    dof: int
    fitted: Plane
    residual: Plane

    @property
    def level(self) -> float:
        """Light A at the centre."""
        return float(self.parameters[0])

    @property
    def k(self) -> tuple[float, float, float]:
        """Coefficients k1, k2, k3."""
        k1, k2, k3 = self.parameters[1:4].tolist()
        return k1, k2, k3

    @property
    def centre_px(self) -> tuple[float, float]:
        """Row and column of the centre [px]."""
        row, col = self.grid.middle_px + self.parameters[CENTRE] * self.grid.half_diagonal_px
        return float(row), float(col)

    @property
    def gradient(self) -> tuple[float, float]:
        """Gradient of the light, (d row, d column) relative per half diagonal."""
        by_row, by_col = self.parameters[LIGHT].tolist()
        return by_row, by_col

    @property
    def gradient_covariance(self) -> Matrix:
        """Covariance of the gradient."""
        return self.find_covariance()[LIGHT, LIGHT]

    @property
    def centre_held(self) -> bool:
        """True if the flats do not determine the centre: what was known before does."""
        return bool(np.sqrt(np.diag(self.find_covariance())[CENTRE]).max() > _HELD_U)

    @property
    def has_gradient(self) -> bool:
        """True if the plane of light exceeds its own errors, as rarely as three of them by noise."""
        return is_apart(self.parameters[LIGHT], self.gradient_covariance)

    def find_covariance(self, *, known: int = 0) -> Matrix:
        """Compute the covariance of all parameters.

        Parameters
        ----------
        known : int, default: 0
            Number of parameters, from the last, that are taken as known exactly.

        Returns
        -------
        ndarray of float64
            Covariance, (8, 8).
        """
        free = 8 - known
        covariance = np.zeros((8, 8))
        covariance[:free, :free] = np.linalg.inv(self.information[:free, :free])
        return covariance

    def find_covariance_of_lens(self, *, known: int = 0) -> Matrix:
        """Compute the covariance of k1, k2, k3, centre row and column [px].

        Parameters
        ----------
        known : int, default: 0
            As in `find_covariance`.

        Returns
        -------
        ndarray of float64
            Covariance, (5, 5).
        """
        scale = np.array([1.0, 1.0, 1.0, self.grid.half_diagonal_px, self.grid.half_diagonal_px])
        part = slice(1, 1 + PARAMETERS)
        return np.asarray(self.find_covariance(known=known)[part, part] * np.outer(scale, scale))
