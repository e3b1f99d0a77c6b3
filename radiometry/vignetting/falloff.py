"""The curve V(r), and its weighted nonlinear least-squares fit to the blocks of one channel."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from radiometry.records import Record
from radiometry.vignetting.blocks import Axis, Grid, Plane, Radial, Vector

Matrix = NDArray[np.float64]

FEWEST_TERMS, MOST_TERMS = 3, 5  # Of V, in r^2, r^4 ...

_RADII = 512


def evaluate_curve(squared: Matrix, k: Sequence[float]) -> Matrix:
    """Compute V where r^2 is known, from k1, k2 ..."""
    return np.asarray(np.polynomial.polynomial.polyval(squared, [1.0, *k]))


def evaluate_slopes(
    row_px: Matrix, col_px: Matrix, k: Sequence[float], *, centre_px: tuple[float, float], radius_px: float
) -> tuple[Matrix, Matrix]:
    """Compute V and its derivatives by k1, k2 ..., centre row and centre column.

    dV/dk_n = r^2n;  dV/dcentre_row = -(2 a / R) (k1 + 2 k2 r^2 + ...), a = (row - centre_row) / R
    """
    a, b = (row_px - centre_px[0]) / radius_px, (col_px - centre_px[1]) / radius_px
    squared = a**2 + b**2
    by_square = np.polynomial.polynomial.polyval(squared, [n * each for n, each in enumerate(k, 1)])
    by_centre = [-2.0 * by_square * each / radius_px for each in (a, b)]
    slopes = np.stack([*(squared**n for n in range(1, len(k) + 1)), *by_centre])
    return evaluate_curve(squared, k), slopes


def list_corners(height_px: int, width_px: int) -> list[tuple[float, float]]:
    """Return the frame's four corners [px]: half a pixel outside the centres of the outermost pixels."""
    return [(row, col) for row in (-0.5, height_px - 0.5) for col in (-0.5, width_px - 0.5)]


def find_farthest_corner(
    height_px: int, width_px: int, *, centre_px: tuple[float, float]
) -> tuple[float, float]:
    """Return the corner (row, col) farthest from the centre; of equally far ones the first."""
    return max(list_corners(height_px, width_px), key=lambda corner: math.dist(corner, centre_px))


def propagate(slopes: Matrix, covariance: Matrix) -> Matrix:
    """Compute the standard uncertainty that follows from that of the parameters: sqrt(J C J')."""
    variance = np.einsum("i...,ij,j...->...", slopes, covariance, slopes)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def sample_radii(farthest: float) -> Vector:
    """Return radii from the centre to the farthest corner at which the whole curve is checked."""
    return np.linspace(0.0, farthest, _RADII)


def find_largest_rise(shares: Vector) -> tuple[float, int, int]:
    """Return the largest outward increase of V, with the indices from which and to which it extends."""
    lowest = np.minimum.accumulate(shares)
    top = int(np.argmax(shares - lowest))
    bottom = int(np.argmin(shares[: top + 1]))
    return float(shares[top] - shares[bottom]), bottom, top


# Places of the centre and of the plane of light among the parameters of a fit
CENTRE, LIGHT = slice(-4, -2), slice(-2, None)

# Standard uncertainty of a centre before any fit, in half diagonals; the bodies of the "Four Vision" report
# lie up to 0.13 from the middle
CENTRE_U = 0.1

_HELD_U = 0.05  # From this standard uncertainty on the flats do not determine a centre, in half diagonals

# Two degrees of freedom: what noise exceeds as rarely as three standard errors of one
_SIGNIFICANT_CHI_SQUARED = 11.83


def is_apart(difference: Matrix, covariance: Matrix) -> bool:
    """Return True if a difference of two numbers exceeds its errors, as rarely as three of them by noise."""
    return bool(difference @ np.linalg.solve(covariance, difference) > _SIGNIFICANT_CHI_SQUARED)


class DarkError(Record):
    """Standard uncertainties of the dark level, in the unit of the light."""

    # Uncertainty of the subtracted level, one and the same for all flats with these dark frames
    shared: float = 0.0
    own: float = 0.0  # Uncertainty by which the dark level of a single frame departs from it
    dof: float = math.inf  # Degrees of freedom of both


KNOWN = DarkError()


class Blocks(Record, kw_only=False):
    """Light of one channel over the blocks of a grid, (row, col)."""

    grid: Grid  # Grid of blocks
    rows: Axis  # Rows and columns of the channel in blocks
    cols: Axis  # Rows and columns of the channel in blocks
    light: Plane  # Light above dark, in any unit
    standard_error: Plane  # Standard error of each, > 0; infinite where it does not count
    dark: DarkError = KNOWN  # Error of the dark level, common to all of them

    @property
    def places(self) -> tuple[Plane, Plane]:
        """Distance of the blocks from the frame's middle, down and to the right [R]."""
        middle, radius = self.grid.middle_px, self.grid.half_diagonal_px
        return (self.rows.means - middle[0])[:, None] / radius, (self.cols.means - middle[1])[None] / radius


class Prior(Record, kw_only=False):
    """Knowledge of centre and plane of light before a fit."""

    # Centre from the frame's middle [R], and gradient of the light per half diagonal; (4,), row first
    mean: Matrix
    precision: Matrix  # Inverse of its covariance, (4, 4); 0 where nothing is known

    def replace(self, part: slice, mean: Matrix, covariance: Matrix) -> "Prior":
        """Return the knowledge with another centre or plane."""
        changed = self.mean.copy(), self.precision.copy()
        changed[0][part], changed[1][part, part] = mean, np.linalg.inv(covariance)
        return Prior(*changed)


UNKNOWN = Prior(np.zeros(4), np.zeros((4, 4)))
USUAL = UNKNOWN.replace(CENTRE, np.zeros(2), CENTRE_U**2 * np.eye(2))
EVEN = USUAL.replace(LIGHT, np.zeros(2), 1e-12 * np.eye(2))  # Of light without a plane; for comparison only


class Solution(Record, kw_only=False):
    """Fitted falloff."""

    # A, k1, k2 ..., centre from the frame's middle [R], gradient of the light per half diagonal
    parameters: Matrix
    information: Matrix  # Inverse of their covariance, Birge's ratio and what was known before included
    grid: Grid  # Grid of the blocks
    chi_squared: float  # Weighted sum of squared residuals of the blocks
    dof: int  # Degrees of freedom
    fitted: Plane  # Model per block
    residual: Plane  # (light - fitted) / fitted, 0 where it does not count
    further: "Solution | None" = None  # With one term more, where the terms were chosen
    before: "Solution | None" = None  # With one term less

    @property
    def level(self) -> float:
        """Light A at the centre."""
        return float(self.parameters[0])

    @property
    def k(self) -> tuple[float, ...]:
        return tuple(self.parameters[_CURVE].tolist())

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
        free = self.parameters.size - known
        covariance = np.zeros_like(self.information)
        covariance[:free, :free] = np.linalg.inv(self.information[:free, :free])
        return covariance

    def find_left(self, radii: Vector) -> Vector:
        """Return what V may lack at radii: what a further term changes, or a part of the last one's."""
        further = np.zeros_like(radii) if self.further is None else self.further.find_change(self, radii)
        last = np.zeros_like(radii) if self.before is None else self.find_change(self.before, radii)
        return np.maximum(further, _LEFT * last)

    def find_change(self, less: "Solution", radii: Vector) -> Vector:
        """Return by how much V differs at radii from that of fewer terms, beyond what the noise explains."""
        change = evaluate_curve(radii**2, self.k) - evaluate_curve(radii**2, less.k)
        noise = np.maximum(0.0, self.find_variance(radii) - less.find_variance(radii))
        return np.asarray(np.sqrt(np.maximum(0.0, change**2 - noise)))

    def find_variance(self, radii: Vector) -> Vector:
        """Return the variance of V at radii from that of k1, k2 ..."""
        powers = np.vander(radii**2, len(self.k) + 1, increasing=True)[:, 1:]
        return np.asarray(np.einsum("ri,ij,rj->r", powers, self.find_covariance()[_CURVE, _CURVE], powers))

    def find_covariance_of_lens(self, *, known: int = 0) -> Matrix:
        """Compute the covariance of k1, k2 ..., centre row and column [px]."""
        scale = np.append(np.ones(len(self.k)), [self.grid.half_diagonal_px] * 2)
        return np.asarray(self.find_covariance(known=known)[1:-2, 1:-2] * np.outer(scale, scale))


_TOLERANCE = 1e-10
_MOST_EVALUATIONS = 200
# Of what the last term changed at the corner, what still lacks: 0.10 to 0.15 for cos^4 to 42 degrees and for
# rims that take 25 % within a tenth of R
_LEFT = 0.12
_CURVE = slice(1, -4)  # k1, k2 ... among the parameters of a fit
_LEVEL = slice(0, -2)  # All parameters but the plane of light
# Of AICc: by so much a further term has to fit better, so that one fit in a hundred has a term for nothing
_EVIDENCE = 5.0
_BLOCKS_PER_PARAMETER = 3
_CALM = 0.01  # Of chi^2 a block: less says that there is no noise, and nothing of further terms


def solve_falloff(blocks: Blocks, prior: Prior = USUAL, *, terms: int | None = None) -> Solution:
    """Fit A (1 + k1 <r^2> + k2 <r^4> + ...) (1 + g_row <a> + g_col <b>) to blocks.

    <> is the mean over a block's own pixels, a and b the distance from the frame's middle over R. With p
    the centre and the gradient, and P the precision of what is known of them::

        minimise S + (p - p0)' P (p - p0),    S = sum ((model - light) / u)^2

    by the method of Levenberg and Marquardt [1], here in MINPACK's implementation; where the fit is poor,
    also from a start without a plane. The plane is always fitted. Where the falloff is small, centre and
    plane can replace one another: what is known of the centre then decides, and the errors of both say so.

    Terms that are not given are chosen, three to five, by AICc = n ln(S / n) + 2 q n / (n - q - 1) [2],
    n blocks and q parameters; the solution has beside it those with one more and less.

    [1] Press et al., Numerical Recipes, 15.5
    [2] K. P. Burnham, D. R. Anderson, Model Selection and Multimodel Inference, 2nd ed., 2.4
    """
    if terms is not None:
        return _conclude(_Model(blocks, terms), _search(_Model(blocks, terms), prior), prior)
    counted = int(np.isfinite(blocks.standard_error).sum())
    most = min(MOST_TERMS, counted // _BLOCKS_PER_PARAMETER - 6)
    if most < FEWEST_TERMS:
        return solve_falloff(blocks, prior, terms=FEWEST_TERMS)
    models = [_Model(blocks, count) for count in range(FEWEST_TERMS, most + 2)]
    found = [_search(model, prior) for model in models]
    scores = [model.find_aicc(p) + _EVIDENCE * model.terms for model, p in zip(models, found, strict=True)]
    best = int(np.argmin(scores[:-1]))
    solution, further = (_conclude(models[place], found[place], prior) for place in (best, best + 1))
    before = _conclude(models[best - 1], found[best - 1], prior) if best else None
    return replace(solution, further=further, before=before)


def _search(model: "_Model", prior: Prior) -> Matrix:
    found = _minimise(model, model.start(prior.mean), prior)
    if model.chi_squared(found) > model.light.size:
        # a plane may stand for a centre that is far from where the search began: find that one first
        level = _minimise(model, model.start(prior.mean), prior, free=_LEVEL)
        found = min(found, _minimise(model, level, prior), key=model.chi_squared)
    return found


def _conclude(model: "_Model", found: Matrix, prior: Prior) -> Solution:
    jacobian, residual, fitted = model.jacobian(found), model.residual(found), model.evaluate(found)
    chi_squared, dof = float(residual @ residual), max(1, residual.size - found.size)
    birge_squared = max(1.0, chi_squared / dof)
    information = jacobian.T @ jacobian / birge_squared
    information[-4:, -4:] += prior.precision
    information[CENTRE, CENTRE] -= _find_spurious(model, found, information, prior) / birge_squared
    return Solution(
        parameters=found,
        information=information,
        grid=model.blocks.grid,
        chi_squared=chi_squared,
        dof=dof,
        fitted=fitted,
        residual=np.where(model.counts, model.blocks.light / fitted - 1.0, 0.0),
    )


def _minimise(model: "_Model", start: Matrix, prior: Prior, free: slice = slice(None)) -> Matrix:
    """Find the parameters from a start, those that are not free staying as they are."""
    values, vectors = np.linalg.eigh(prior.precision)
    root = (vectors * np.sqrt(np.maximum(values, 0.0))).T
    known = np.column_stack([np.zeros((4, start.size - 4)), root])

    def fill(part: Matrix) -> Matrix:
        whole = start.copy()
        whole[free] = part
        return whole

    def residual(part: Matrix) -> Matrix:
        whole = fill(part)
        return np.append(model.residual(whole), root @ (whole[-4:] - prior.mean))

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
        moved[_CURVE] += shift
        jacobian = model.jacobian(moved)
        whole = jacobian.T @ jacobian
        whole[LIGHT, LIGHT] += prior.precision[2:, 2:]
        places = np.arange(p.size)
        others = np.delete(places, places[CENTRE])
        cross = whole[CENTRE, others]
        return np.asarray(
            whole[CENTRE, CENTRE] - cross @ np.linalg.solve(whole[np.ix_(others, others)], cross.T)
        )

    here = inform(np.zeros_like(p[_CURVE]))
    columns = np.linalg.cholesky(np.linalg.inv(information)[_CURVE, _CURVE]).T
    excess = sum(inform(each) + inform(-each) - 2.0 * here for each in columns)
    values, vectors = np.linalg.eigh(here - excess)
    return np.asarray(here - (vectors * np.maximum(values, 0.0)) @ vectors.T)


class _Model:
    """The equation over the blocks that count: parameters A, k1, k2 ..., centre (in R), gradient."""

    def __init__(self, blocks: Blocks, terms: int) -> None:
        self.blocks, self.terms = blocks, terms
        self.counts = np.isfinite(blocks.standard_error)
        self.weights = 1.0 / blocks.standard_error[self.counts]
        self.light = blocks.light[self.counts]
        self.plane = np.stack(np.broadcast_arrays(*blocks.places))
        self._averaged: tuple[bytes, Radial] | None = None

    def start(self, known: Matrix) -> Matrix:
        means = self._average(known).means
        design = np.column_stack([np.ones_like(self.light), *(mean[self.counts] for mean in means)])
        scaled = np.linalg.lstsq(design * self.weights[:, None], self.light * self.weights, rcond=None)[0]
        return np.array([scaled[0], *(scaled[1:] / scaled[0]), *known])

    def evaluate(self, p: Matrix) -> Plane:
        share = 1.0 + np.tensordot(p[_CURVE], self._average(p).means, 1)
        return np.asarray(p[0] * share * self._tilt(p))

    def residual(self, p: Matrix) -> Matrix:
        return np.asarray((self.evaluate(p)[self.counts] - self.light) * self.weights)

    def chi_squared(self, p: Matrix) -> float:
        return float(np.sum(self.residual(p) ** 2))

    def find_aicc(self, p: Matrix) -> float:
        n, free = self.light.size, p.size
        share = max(self.chi_squared(p) / n, _CALM)
        return n * math.log(share) + 2.0 * free * n / (n - free - 1)

    def jacobian(self, p: Matrix) -> Matrix:
        means, slopes = self._average(p).means, self._average(p).slopes
        radius = self.blocks.grid.half_diagonal_px
        share, tilt = 1.0 + np.tensordot(p[_CURVE], means, 1), self._tilt(p)
        by_centre = [np.tensordot(p[_CURVE], slope, 1) * radius for slope in slopes]
        columns = [share * tilt, *(p[0] * part * tilt for part in (*means, *by_centre))]
        columns += [p[0] * share * direction for direction in self.plane]
        return np.column_stack([column[self.counts] * self.weights for column in columns])

    def _tilt(self, p: Matrix) -> Plane:
        return np.asarray(1.0 + np.tensordot(p[LIGHT], self.plane, 1))

    def _average(self, p: Matrix) -> Radial:
        """Return the averages for a centre; the search asks for each several times, one after the other."""
        centre = p[CENTRE].tobytes()
        if self._averaged is None or self._averaged[0] != centre:
            grid = self.blocks.grid
            row, col = grid.middle_px + p[CENTRE] * grid.half_diagonal_px
            radial = Radial(
                self.blocks.rows,
                self.blocks.cols,
                centre_row_px=float(row),
                centre_col_px=float(col),
                radius_px=grid.half_diagonal_px,
                terms=self.terms,
            )
            self._averaged = centre, radial
        return self._averaged[1]
