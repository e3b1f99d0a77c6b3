"""Sources of error of a linear problem: each point's own errors, and errors that points share."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Labels = NDArray[np.intp]

_MOST_DENSE = 20_000


@dataclass(frozen=True, kw_only=True)
class Component:
    """One source of error and its part of the covariance, V_j = variance * Z_j Z_j'.

    Attributes
    ----------
    source : str
        Name of the source.
    kind : str
        "A" (evaluated from scatter) or "B" (evaluated by other means).
    sensitivity : ndarray of float64
        Change s of the response per unit of the error, (n,).
    variance : float or None
        Variance v_j; None if it is to be estimated from the scatter.
    labels : ndarray of intp or None, default: None
        Index of each point's group, (n,), from `index_labels`: points of one group
        share one error. None if each point has its own.
    dof : float, default: math.inf
        Degrees of freedom of a given variance.
    common : bool, default: False
        True if all points have the same error, so that their scatter does not test
        it.
    """

    source: str
    kind: str
    sensitivity: Vector
    variance: float | None
    labels: Labels | None = None
    dof: float = math.inf
    common: bool = False

    @cached_property
    def _transposed(self) -> Any:  # noqa: ANN401  a sparse array
        """Z', (levels, n); dense where it is so small that a sparse product costs more to set up."""
        n = self.sensitivity.size
        rows = np.arange(n) if self.labels is None else self.labels
        shape = int(rows.max()) + 1, n
        if shape[0] * n > _MOST_DENSE:
            return scipy.sparse.csr_array((self.sensitivity, (rows, np.arange(n))), shape=shape)
        dense = np.zeros(shape)
        dense[rows, np.arange(n)] = self.sensitivity
        return dense

    def gather(self, values: Matrix) -> Matrix:
        """Return Z' values: the sums over the points of each group, weighted with the sensitivity.

        Parameters
        ----------
        values : ndarray of float64
            One row per point, (n,) or (n, k).

        Returns
        -------
        ndarray of float64
            One row per group, (levels,) or (levels, k).
        """
        return np.asarray(self._transposed @ values, np.float64)

    def spread(self, errors: Matrix) -> Matrix:
        """Return Z errors: the effect of the groups' errors on each point.

        Parameters
        ----------
        errors : ndarray of float64
            One row per group, (levels,) or (levels, k).

        Returns
        -------
        ndarray of float64
            One row per point, (n,) or (n, k).
        """
        return np.asarray(self._transposed.T @ errors, np.float64)

    def columns(self) -> Matrix:
        """Return Z, (n, levels)."""
        whole = self._transposed.T
        return np.asarray(whole if isinstance(whole, np.ndarray) else whole.toarray(), np.float64)


def index_labels(labels: Sequence[Any]) -> Labels:
    """Return the index of each label among the sorted different ones.

    Parameters
    ----------
    labels : sequence of str or float
        Label of each point, n in all.

    Returns
    -------
    ndarray of intp
        Index of each point's group, (n,).
    """
    return np.unique(np.asarray(labels), return_inverse=True)[1].astype(np.intp)


def contribute(component: Component, weights: Matrix) -> Matrix:
    """Return the effects of a component's errors on linear combinations of the response.

    Parameters
    ----------
    component : Component
        Source of error.
    weights : ndarray of float64
        One combination per row, (r, n).

    Returns
    -------
    ndarray of float64
        Error of each combination per unit error of each group, (r, levels).
    """
    return component.gather(weights.T).T
