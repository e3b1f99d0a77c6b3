"""The weighted nonlinear least-squares fit of a falloff to blocks of one channel."""

import numpy as np
import scipy

from radiometry.vignetting.grid import Plane, average_radial
from radiometry.vignetting.solution import CENTRE, LIGHT, USUAL, Blocks, Matrix, Prior, Solution

_TOLERANCE = 1e-10
_MOST_EVALUATIONS = 200
_LEVEL = slice(0, 6)
"""All parameters but the plane of light."""


def solve_falloff(blocks: Blocks, prior: Prior = USUAL) -> Solution:
    """Fit A (1 + k1 <r^2> + k2 <r^4> + k3 <r^6>) (1 + g_row <a> + g_col <b>) to blocks.

    Parameters
    ----------
    blocks : Blocks
        Light of a channel. A flat with fewer blocks than parameters cannot be fitted:
        the caller counts them.
    prior : Prior, default: USUAL
        What is known of the centre and of the plane of light before.

    Returns
    -------
    Solution
        Parameters and their covariance.

    Notes
    -----
    <> is the mean over a block's own pixels, a and b the distance from the frame's middle over R. With p
    the centre and the gradient, and P the precision of what is known of them::

        minimise sum ((model - light) / u)^2 + (p - p0)' P (p - p0)

    by the method of Levenberg and Marquardt [1]_, here in MINPACK's implementation; where the fit is poor,
    also from a start without a plane. The plane is always fitted. Where the falloff is small, centre and
    plane can replace one another: what is known of the centre then decides, and the errors of both say so.

    References
    ----------
    .. [1] Press et al., Numerical Recipes, 15.5
    """
    model = _Model(blocks)
    found = _minimise(model, model.start(prior.mean), prior)
    if model.chi_squared(found) > model.light.size:
        # a plane may stand for a centre that is far from where the search began: find that one first
        level = _minimise(model, model.start(prior.mean), prior, free=_LEVEL)
        found = min(found, _minimise(model, level, prior), key=model.chi_squared)
    jacobian, residual, fitted = model.jacobian(found), model.residual(found), model.evaluate(found)
    chi_squared, dof = float(residual @ residual), max(1, residual.size - found.size)
    birge_squared = max(1.0, chi_squared / dof)
    information = jacobian.T @ jacobian / birge_squared
    information[4:, 4:] += prior.precision
    information[CENTRE, CENTRE] -= _find_spurious(model, found, information, prior) / birge_squared
    return Solution(
        parameters=found,
        information=information,
        grid=blocks.grid,
        chi_squared=chi_squared,
        dof=dof,
        fitted=fitted,
        residual=np.where(model.counts, blocks.light / fitted - 1.0, 0.0),
    )


def _minimise(model: "_Model", start: Matrix, prior: Prior, free: slice = slice(None)) -> Matrix:
    """Find the parameters from a start, those that are not free staying as they are."""
    values, vectors = np.linalg.eigh(prior.precision)
    known = np.column_stack([np.zeros((4, 4)), (vectors * np.sqrt(np.maximum(values, 0.0))).T])

    def fill(part: Matrix) -> Matrix:
        whole = start.copy()
        whole[free] = part
        return whole

    def residual(part: Matrix) -> Matrix:
        whole = fill(part)
        return np.append(model.residual(whole), known[:, 4:] @ (whole[4:] - prior.mean))

    found = scipy.optimize.least_squares(
        residual,
        start[free],
        jac=lambda part: np.vstack([model.jacobian(fill(part)), known])[:, free],
        method="lm",
        x_scale="jac",
        xtol=_TOLERANCE,
        ftol=_TOLERANCE,
        gtol=_TOLERANCE,
        max_nfev=_MOST_EVALUATIONS,
    )
    return fill(found.x)


def _find_spurious(model: "_Model", p: Matrix, information: Matrix, prior: Prior) -> Matrix:
    """Estimate what the errors of k pretend to say of the centre.

    The centre's own information S(k), after all other parameters, is a quadratic form of the true k. Of
    fitted ones with the covariance C = L L' it is on average larger by the mean of S(k + l) + S(k - l) -
    2 S(k) over the columns l of L, halved and summed. A quadratic form of one error scatters by about its
    mean: twice the mean is taken off, but no more than there is.
    """

    def inform(shift: Matrix) -> Matrix:
        moved = p.copy()
        moved[1:4] += shift
        jacobian = model.jacobian(moved)
        whole = jacobian.T @ jacobian
        whole[LIGHT, LIGHT] += prior.precision[2:, 2:]
        others = np.delete(np.arange(8), np.arange(8)[CENTRE])
        cross = whole[CENTRE, others]
        return np.asarray(
            whole[CENTRE, CENTRE] - cross @ np.linalg.solve(whole[np.ix_(others, others)], cross.T)
        )

    here = inform(np.zeros(3))
    columns = np.linalg.cholesky(np.linalg.inv(information)[1:4, 1:4]).T
    excess = sum(inform(each) + inform(-each) - 2.0 * here for each in columns)
    values, vectors = np.linalg.eigh(here - excess)
    return np.asarray(here - (vectors * np.maximum(values, 0.0)) @ vectors.T)


class _Model:
    """The equation over the blocks that count: parameters A, k1, k2, k3, centre (in R), gradient."""

    def __init__(self, blocks: Blocks) -> None:
        self.blocks = blocks
        self.counts = np.isfinite(blocks.standard_error)
        self.weights = 1.0 / blocks.standard_error[self.counts]
        self.light = blocks.light[self.counts]
        self.plane = np.stack(np.broadcast_arrays(*blocks.places))

    def start(self, known: Matrix) -> Matrix:
        """Fit A and the k linearly about the centre that is known."""
        means, _, _ = self._radial(np.append(np.zeros(4), known))
        design = np.column_stack([np.ones_like(self.light), *(mean[self.counts] for mean in means)])
        scaled = np.linalg.lstsq(design * self.weights[:, None], self.light * self.weights, rcond=None)[0]
        return np.array([scaled[0], *(scaled[1:] / scaled[0]), *known])

    def evaluate(self, p: Matrix) -> Plane:
        """Return the model per block."""
        means, _, _ = self._radial(p)
        return np.asarray(p[0] * (1.0 + np.tensordot(p[1:4], means, 1)) * self._tilt(p))

    def residual(self, p: Matrix) -> Matrix:
        """Return the residuals of the blocks over their errors."""
        return np.asarray((self.evaluate(p)[self.counts] - self.light) * self.weights)

    def chi_squared(self, p: Matrix) -> float:
        """Return the sum of the squares of the residuals."""
        return float(np.sum(self.residual(p) ** 2))

    def jacobian(self, p: Matrix) -> Matrix:
        """Return the derivatives of the residuals by the parameters."""
        means, by_row, by_col = self._radial(p)
        radius = self.blocks.grid.half_diagonal_px
        share, tilt = 1.0 + np.tensordot(p[1:4], means, 1), self._tilt(p)
        by_centre = [np.tensordot(p[1:4], slope, 1) * radius for slope in (by_row, by_col)]
        columns = [share * tilt, *(p[0] * part * tilt for part in (*means, *by_centre))]
        columns += [p[0] * share * direction for direction in self.plane]
        return np.column_stack([column[self.counts] * self.weights for column in columns])

    def _tilt(self, p: Matrix) -> Plane:
        return np.asarray(1.0 + np.tensordot(p[LIGHT], self.plane, 1))

    def _radial(self, p: Matrix) -> tuple[Matrix, Matrix, Matrix]:
        grid = self.blocks.grid
        row, col = grid.middle_px + p[CENTRE] * grid.half_diagonal_px
        return average_radial(
            self.blocks.rows,
            self.blocks.cols,
            centre_row_px=float(row),
            centre_col_px=float(col),
            radius_px=grid.half_diagonal_px,
        )
