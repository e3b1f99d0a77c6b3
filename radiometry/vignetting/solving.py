"""The weighted nonlinear least-squares fit of a falloff to blocks of one channel."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from radiometry.vignetting.curve import PARAMETERS
from radiometry.vignetting.darkness import KNOWN, DarkError
from radiometry.vignetting.grid import Axis, Grid, Plane, average_radial

Matrix = NDArray[np.float64]

_FARTHEST = 1.0
"""How far from the frame's middle a centre is believed, in half diagonals: at a corner."""

_LOST_CENTRE = 0.25
"""Standard error of a centre, in half diagonals, from which on the flat does not hold it."""

_TOLERANCE = 1e-10
_MOST_EVALUATIONS = 200
_SIGNIFICANT_CHI_SQUARED = 11.83
"""Two degrees of freedom: what noise exceeds as rarely as three standard errors of one."""


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


@dataclass(frozen=True)
class Solution:
    """Fitted falloff.

    Attributes
    ----------
    level : float
        Light A at the centre.
    k : tuple of float
        Coefficients k1, k2, k3.
    centre_px : tuple of float
        Row and column of the centre [px].
    covariance : ndarray of float64
        Covariance of k1, k2, k3, centre row and column, Birge's ratio included.
    gradient : tuple of float
        Gradient of the light, (d row, d column) relative per half diagonal; 0 where it
        was not fitted.
    gradient_covariance : ndarray of float64
        Covariance of the gradient.
    centre_held : bool
        True if the flat does not determine the centre, which is then the frame's
        middle.
    chi_squared : float
        Weighted sum of squared residuals.
    dof : int
        Degrees of freedom.
    fitted : ndarray of float64
        Model per block.
    residual : ndarray of float64
        (light - fitted) / fitted, 0 where it does not count.
    """

    level: float
    k: tuple[float, float, float]
    centre_px: tuple[float, float]
    covariance: Matrix
    gradient: tuple[float, float]
    gradient_covariance: Matrix
    centre_held: bool
    chi_squared: float
    dof: int
    fitted: Plane
    residual: Plane


_FALLOFF_CHI_SQUARED = 14.16
"""The same of three degrees of freedom."""


def is_gradient_significant(plain: Solution, tilted: Solution) -> bool:
    """Return True if a plane in the light explains the blocks better, by a likelihood ratio.

    Parameters
    ----------
    plain : Solution
        Fit without a plane.
    tilted : Solution
        Fit with a plane.

    Returns
    -------
    bool
        True if chi^2 falls by more than 11.8, times chi^2 / dof where that exceeds 1.

    Notes
    -----
    The plane over its own error would not suffice: where little falloff is left, centre and plane can
    replace one another, along a bent valley.
    """
    birge_squared = max(1.0, tilted.chi_squared / tilted.dof)
    return plain.chi_squared - tilted.chi_squared > _SIGNIFICANT_CHI_SQUARED * birge_squared


def solve_falloff(blocks: Blocks, *, with_gradient: bool) -> Solution:
    """Fit A (1 + k1 <r^2> + k2 <r^4> + k3 <r^6>) (1 + g_row <a> + g_col <b>) to blocks.

    Parameters
    ----------
    blocks : Blocks
        Light of a channel. A flat with fewer blocks than parameters cannot be fitted:
        the caller counts them.
    with_gradient : bool
        True to fit g_row and g_col, the plane in the light.

    Returns
    -------
    Solution
        Parameters and their covariance.

    Notes
    -----
    <> is the mean over a block's own pixels, a and b the distance from the frame's middle over R. The fit
    is that of Levenberg and Marquardt [1]_, here in MINPACK's implementation.

    Where the flat does not determine the centre, the centre is held at the frame's middle with the variance
    of a position anywhere in the frame. This is so if about the middle there is no falloff beyond noise, if
    the centre's error is above a quarter of R, or if it lies beyond the corners.

    References
    ----------
    .. [1] Press et al., Numerical Recipes, 15.5
    """
    held = _solve(blocks, with_gradient=with_gradient, held=True)
    if held is None:
        raise ValueError("the blocks do not determine a falloff")
    if not _has_falloff(held):
        return held
    free = _solve(blocks, with_gradient=with_gradient, held=False)
    return held if free is None or _is_lost(free, blocks.grid) else free


def _has_falloff(held: Solution) -> bool:
    """Return True if k1, k2, k3 together exceed their errors."""
    k = np.array(held.k)
    return bool(k @ np.linalg.solve(held.covariance[:3, :3], k) > _FALLOFF_CHI_SQUARED)


def _is_lost(solution: Solution, grid: Grid) -> bool:
    errors = np.sqrt(np.diag(solution.covariance)[3:])
    away = math.dist(solution.centre_px, grid.middle_px)
    return bool(errors.max() > _LOST_CENTRE * grid.half_diagonal_px) or (
        away > _FARTHEST * grid.half_diagonal_px
    )


def _solve(blocks: Blocks, *, with_gradient: bool, held: bool) -> Solution | None:
    """Fit with the centre free or held; None where the matrix of the equations is singular."""
    model = _Model(blocks)
    free = np.array([True] * 4 + [not held] * 2 + [with_gradient] * 2)
    start = model.start()

    def full(part: Matrix) -> Matrix:
        parameters = start.copy()
        parameters[free] = part
        return parameters

    found = least_squares(
        lambda part: model.residual(full(part)),
        start[free],
        jac=lambda part: model.jacobian(full(part))[:, free],
        method="lm",
        x_scale="jac",
        xtol=_TOLERANCE,
        ftol=_TOLERANCE,
        gtol=_TOLERANCE,
        max_nfev=_MOST_EVALUATIONS,
    )
    try:
        covariance = np.linalg.inv(found.jac.T @ found.jac)
    except np.linalg.LinAlgError:
        return None
    whole = np.zeros((8, 8))
    whole[np.ix_(free, free)] = covariance
    return model.conclude(full(found.x), whole, held=held, free=int(free.sum()))


class _Model:
    """The equation over the blocks that count: parameters A, k1, k2, k3, centre (in R), gradient."""

    def __init__(self, blocks: Blocks) -> None:
        self.blocks = blocks
        self.counts = np.isfinite(blocks.standard_error)
        self.weights = 1.0 / blocks.standard_error[self.counts]
        self.light = blocks.light[self.counts]
        middle, radius = blocks.grid.middle_px, blocks.grid.half_diagonal_px
        a, b = (blocks.rows.means - middle[0]) / radius, (blocks.cols.means - middle[1]) / radius
        self.plane = np.stack([*np.broadcast_arrays(a[:, None], b[None, :])])

    def start(self) -> Matrix:
        """Fit A and the k linearly about the middle."""
        means, _, _ = self._radial(np.zeros(8))
        design = np.column_stack([np.ones_like(self.light), *(mean[self.counts] for mean in means)])
        scaled = np.linalg.lstsq(design * self.weights[:, None], self.light * self.weights, rcond=None)[0]
        return np.array([scaled[0], *(scaled[1:] / scaled[0]), 0.0, 0.0, 0.0, 0.0])

    def evaluate(self, p: Matrix) -> Plane:
        """Compute the model per block.

        Parameters
        ----------
        p : ndarray of float64
            Parameters.

        Returns
        -------
        ndarray of float64
            Model per block.
        """
        means, _, _ = self._radial(p)
        return np.asarray(p[0] * (1.0 + np.tensordot(p[1:4], means, 1)) * self._tilt(p))

    def residual(self, p: Matrix) -> Matrix:
        """Compute the residuals that are minimised.

        Parameters
        ----------
        p : ndarray of float64
            Parameters.

        Returns
        -------
        ndarray of float64
            Residuals.
        """
        return np.asarray((self.evaluate(p)[self.counts] - self.light) * self.weights)

    def jacobian(self, p: Matrix) -> Matrix:
        """Compute the derivatives of the residuals by the parameters.

        Parameters
        ----------
        p : ndarray of float64
            Parameters.

        Returns
        -------
        ndarray of float64
            Derivatives.
        """
        means, by_row, by_col = self._radial(p)
        radius = self.blocks.grid.half_diagonal_px
        share, tilt = 1.0 + np.tensordot(p[1:4], means, 1), self._tilt(p)
        by_centre = [np.tensordot(p[1:4], slope, 1) * radius for slope in (by_row, by_col)]
        columns = [share * tilt, *(p[0] * part * tilt for part in (*means, *by_centre))]
        columns += [p[0] * share * direction for direction in self.plane]
        return np.column_stack([column[self.counts] * self.weights for column in columns])

    def conclude(self, p: Matrix, covariance: Matrix, *, held: bool, free: int) -> Solution:
        """Return the solution in pixels, with the covariance scaled by Birge's ratio.

        Parameters
        ----------
        p : ndarray of float64
            Parameters.
        covariance : ndarray of float64
            Covariance of the parameters.
        held : bool
            True if the centre was held.
        free : int
            Number of free parameters.

        Returns
        -------
        Solution
            Solution.
        """
        grid = self.blocks.grid
        chi_squared = float(np.sum(self.residual(p) ** 2))
        dof = max(1, self.light.size - free)
        covariance = covariance * max(1.0, chi_squared / dof)
        of_lens = covariance[1 : 1 + PARAMETERS, 1 : 1 + PARAMETERS].copy()
        of_lens[3:] *= grid.half_diagonal_px
        of_lens[:, 3:] *= grid.half_diagonal_px
        if held:
            of_lens[3, 3], of_lens[4, 4] = grid.height_px**2 / 12.0, grid.width_px**2 / 12.0
        fitted = self.evaluate(p)
        residual = np.where(self.counts, self.blocks.light / fitted - 1.0, 0.0)
        return Solution(
            level=float(p[0]),
            k=(float(p[1]), float(p[2]), float(p[3])),
            centre_px=self._centre_px(p),
            covariance=of_lens,
            gradient=(float(p[6]), float(p[7])),
            gradient_covariance=covariance[6:, 6:],
            centre_held=held,
            chi_squared=chi_squared,
            dof=dof,
            fitted=fitted,
            residual=residual,
        )

    def _tilt(self, p: Matrix) -> Plane:
        return np.asarray(1.0 + np.tensordot(p[6:8], self.plane, 1))

    def _centre_px(self, p: Matrix) -> tuple[float, float]:
        middle, radius = self.blocks.grid.middle_px, self.blocks.grid.half_diagonal_px
        return float(middle[0] + p[4] * radius), float(middle[1] + p[5] * radius)

    def _radial(self, p: Matrix) -> tuple[Matrix, Matrix, Matrix]:
        row, col = self._centre_px(p)
        return average_radial(
            self.blocks.rows,
            self.blocks.cols,
            centre_row_px=row,
            centre_col_px=col,
            radius_px=self.blocks.grid.half_diagonal_px,
        )
