"""Least-squares effects of one or two factors: each level's deviation from the mean, with its uncertainty."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Index = NDArray[np.intp]

_ROUNDING = 1e-13


@dataclass(frozen=True, kw_only=True)
class Factor:
    """Levels of one factor and the variance that they explain beyond the other factor.

    Attributes
    ----------
    deviations : ndarray of float64, shape (k,)
        Of each level from the unweighted mean of all levels [unit of the values].
    contrasts : ndarray of float64, shape (k, p)
        deviations = contrasts @ parameters.
    dof : int
        k - 1.
    f_statistic : float or None
        None where there is no scatter to compare with.
    variance, variance_u : float
        Variance component [unit squared], not below 0, and its uncertainty.
    """

    deviations: Vector
    contrasts: Matrix
    dof: int
    f_statistic: float | None
    f_p_value: float | None
    variance: float
    variance_u: float


@dataclass(frozen=True, kw_only=True)
class Effects:
    """A solved model.

    Attributes
    ----------
    unit_covariance : ndarray of float64, shape (p, p)
        Of the parameters, per unit of ``within_variance``.
    f_statistic : float or None
        Of all factors together; None where there is no scatter to compare with.
    """

    mean: float
    mean_u: float
    factors: tuple[Factor, ...]
    unit_covariance: Matrix
    within_variance: float
    dof: int
    f_statistic: float | None
    f_p_value: float | None

    def standard_errors(self, contrasts: Matrix) -> Vector:
        """Compute the standard error of each contrast.

        Parameters
        ----------
        contrasts : ndarray of float64, shape (k, p)
            One contrast of the parameters per row.
        """
        squares = np.einsum("ip,pq,iq->i", contrasts, self.unit_covariance, contrasts)
        errors: Vector = np.sqrt(np.clip(squares, 0.0, None) * self.within_variance)
        return errors


def are_separable(factors: Sequence[Index]) -> bool:
    """Return True if the effects of all factors can be separated: the levels of two are linked by swaps.

    Parameters
    ----------
    factors : sequence of ndarray of int
        Labels of each factor, shape (N,).
    """
    design = np.hstack([np.ones((len(factors[0]), 1)), *(_code(labels)[0] for labels in factors)])
    return bool(np.linalg.matrix_rank(design) == design.shape[1])


def fit_effects(values: Vector, factors: Sequence[Index]) -> Effects:
    """Fit a model of one or two factors, with their variance components; numbers may be unbalanced.

    Parameters
    ----------
    values : ndarray of float64, shape (N,)
        Observations y.
    factors : sequence of ndarray of int
        Labels 0..k-1 of each factor, shape (N,); every level present, and separable (`are_separable`).

    Returns
    -------
    Effects
        Means, deviations, variances and F tests.

    Notes
    -----
    The model is y = m + a_i (+ b_j) + e with sum a = sum b = 0 and var(e) = within variance. With SS, the sum
    of squares that a factor explains beyond the other, F = (SS / (k - 1)) / MS_e, and its variance component
    is [1]_::

        s_a^2 = (SS - (k - 1) MS_e) / tr(Z' M Z),   M = 1 - X (X'X)^-1 X' of the model without it

    which for one factor is (MS_a - MS_e) / n0 of the analysis of variance, n0 = (N - sum n_i^2 / N) / (k -
    1).

    References
    ----------
    .. [1] S. R. Searle, G. Casella, C. E. McCulloch, Variance Components, Wiley 1992,
           chapters 3 and 5, doi:10.1002/9780470316856
    """
    codes = [_code(labels) for labels in factors]
    ones = np.ones((values.size, 1))
    design = np.hstack([ones, *(columns for columns, _ in codes)])
    offset = float(values.mean())
    centred = values - offset
    unit_covariance = np.linalg.inv(design.T @ design)
    parameters = unit_covariance @ (design.T @ centred)
    residual = centred - design @ parameters
    # what is left of equal numbers is rounding, not scatter
    residual[np.abs(residual) <= _ROUNDING * np.max(np.abs(values))] = 0.0
    rss = float(np.sum(residual**2))
    dof = values.size - design.shape[1]
    within = rss / dof if dof > 0 else 0.0
    solved, start = [], 1
    for number, (columns, levels) in enumerate(codes):
        contrasts = np.zeros((len(levels), design.shape[1]))
        contrasts[:, start : start + columns.shape[1]] = levels
        start += columns.shape[1]
        without = np.hstack([ones, *(other for at, (other, _) in enumerate(codes) if at != number)])
        solved.append(
            _explain(
                centred, factors[number], without, contrasts, parameters, rss=rss, within=within, dof=dof
            )
        )
    f_statistic, f_p_value = _test(float(np.sum(centred**2)) - rss, design.shape[1] - 1, within, dof)
    return Effects(
        mean=offset + float(parameters[0]),
        mean_u=float(np.sqrt(within * unit_covariance[0, 0])),
        factors=tuple(solved),
        unit_covariance=unit_covariance,
        within_variance=within,
        dof=dof,
        f_statistic=f_statistic,
        f_p_value=f_p_value,
    )


def _explain(
    values: Vector,
    labels: Index,
    without: Matrix,
    contrasts: Matrix,
    parameters: Vector,
    *,
    rss: float,
    within: float,
    dof: int,
) -> Factor:
    basis, _ = np.linalg.qr(without)
    levels = len(contrasts)
    indicator = (labels[:, None] == np.arange(levels)).astype(np.float64)
    spread = float(np.sum(indicator**2) - np.sum((basis.T @ indicator) ** 2))
    explained = max(0.0, float(np.sum(values**2) - np.sum((basis.T @ values) ** 2)) - rss)
    between = explained / (levels - 1)
    f_statistic, f_p_value = _test(explained, levels - 1, within, dof)
    noise = within**2 / dof if dof > 0 else 0.0
    scale = (levels - 1) / spread
    return Factor(
        deviations=contrasts @ parameters,
        contrasts=contrasts,
        dof=levels - 1,
        f_statistic=f_statistic,
        f_p_value=f_p_value,
        variance=max(0.0, scale * (between - within)),
        variance_u=scale * float(np.sqrt(2.0 * (between**2 / (levels - 1) + noise))),
    )


def _test(explained: float, levels: int, within: float, dof: int) -> tuple[float | None, float | None]:
    """Return F and the probability of a larger one, for a sum of squares with so many degrees of freedom."""
    if within <= 0.0:
        return None, None
    statistic = max(0.0, explained) / levels / within
    return statistic, float(scipy.special.fdtrc(levels, dof, statistic))


def _code(labels: Index) -> tuple[Matrix, Matrix]:
    """Return the effect-coded columns (N, k - 1), and the levels' contrasts in them (k, k - 1)."""
    levels = int(labels.max()) + 1
    contrasts = np.vstack([np.eye(levels - 1), -np.ones((1, levels - 1))])
    return contrasts[labels], contrasts
