"""Covariance of a linear problem, factored without ever being formed.

It is a diagonal plus one number per group of points that share an error: the time
grows with the number of points, not with its cube.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy
from numpy.linalg import LinAlgError

from radiometry.fitting.components import Component, Matrix, Vector, contribute


@dataclass(frozen=True)
class Problem:
    """A linear problem y = A theta + e.

    Attributes
    ----------
    design : ndarray of float64
        Matrix A, (n, p).
    response : ndarray of float64
        Vector y, (n,).
    components : tuple of Component
        Sources of error.
    absorb : int or None, default: None
        Index of the shared component that is eliminated group by group, while the
        others have columns; None for the one with the most groups, if it has two.
    """

    design: Matrix
    response: Vector
    components: tuple[Component, ...]
    absorb: int | None = None

    @cached_property
    def ordinary(self) -> Vector:
        """Parameters by ordinary least squares, (p,): what is left is small beside the response."""
        return np.asarray(np.linalg.lstsq(self.design, self.response, rcond=None)[0], np.float64)

    @cached_property
    def centred(self) -> Vector:
        """Residuals of ordinary least squares, (n,)."""
        return self.response - self.design @ self.ordinary

    @cached_property
    def unknown(self) -> tuple[int, ...]:
        """Indices of the components whose variance is to be estimated."""
        return tuple(i for i, each in enumerate(self.components) if each.variance is None)

    @cached_property
    def own(self) -> tuple[int, ...]:
        """Indices of the components without groups."""
        return tuple(i for i, each in enumerate(self.components) if each.labels is None)

    @cached_property
    def absorbed(self) -> int | None:
        """Index of the shared component that is eliminated group by group; None if none has two groups."""
        last = {i: int(e.labels.max()) for i, e in enumerate(self.components) if e.labels is not None}
        several = [i for i, label in last.items() if label > 0]
        return self.absorb if self.absorb is not None else max(several, key=last.__getitem__, default=None)

    @cached_property
    def block(self) -> Matrix:
        """Design, and the columns of every shared component that is not absorbed, (n, p + levels)."""
        return np.column_stack([self.design, *(self.components[i].columns() for i in self.parts)])

    @cached_property
    def parts(self) -> dict[int, slice]:
        """Columns of `block` of each shared component that is not absorbed."""
        found, at = {}, self.parameters
        for i, each in enumerate(self.components):
            if each.labels is not None and i != self.absorbed:
                found[i] = slice(at, at := at + int(each.labels.max()) + 1)
        return found

    @property
    def parameters(self) -> int:
        """Number p of parameters."""
        return int(self.design.shape[1])

    @property
    def levels(self) -> int:
        """Number of columns of shared errors."""
        return int(self.block.shape[1]) - self.parameters


class Factored:
    """The covariance V at given variances, by an orthogonal factorisation of the mixed model.

    Notes
    -----
    With R the diagonal of the points' own errors and z the scaled sensitivities of the
    absorbed component, B^-1/2 = (I - phi q q') R^-1/2 in each group, q = z / |z| and
    phi = 1 - 1 / sqrt(1 + v z'z). With the rows X = B^-1/2 [A, Z sqrt(v)] above a unit
    matrix for the errors [1]_::

        [X; 0 I] = Q T,      P = B^-1/2' (I - Q_1 Q_1') B^-1/2,      Q_1 the upper rows of Q

    References
    ----------
    .. [1] S. R. Searle, G. Casella, C. E. McCulloch, Variance Components, Wiley 1992,
           chapter 7, doi:10.1002/9780470316856
    """

    def __init__(self, problem: Problem, variances: Vector) -> None:
        self.problem, self.variances = problem, variances
        own = [variances[i] * problem.components[i].sensitivity ** 2 for i in problem.own]
        diagonal = np.sum(own, axis=0)
        if not (np.all(diagonal > 0.0) and np.all(np.isfinite(diagonal))):
            raise LinAlgError("a point has no variance of its own")
        self.root = 1.0 / np.sqrt(diagonal)
        n = len(diagonal)
        absorbed = problem.absorbed
        alone = Component(
            source="", kind="B", sensitivity=np.zeros(n), variance=0.0, labels=np.zeros(n, np.intp)
        )
        shared = alone if absorbed is None else problem.components[absorbed]
        assert shared.labels is not None  # noqa: S101  an absorbed component is shared
        self.labels = shared.labels
        scaled = self.root * shared.sensitivity
        self.sizes = np.bincount(self.labels, scaled**2)
        self.direction = scaled / np.sqrt(np.where(self.sizes > 0.0, self.sizes, 1.0))[self.labels]
        self.shrunk = 1.0 / (1.0 + (0.0 if absorbed is None else variances[absorbed]) * self.sizes)
        self.groups = replace(shared, sensitivity=self.direction)
        self.scale = np.ones(problem.block.shape[1])
        for i, part in problem.parts.items():
            self.scale[part] = math.sqrt(variances[i])
        self.block = self.whiten(problem.block) * self.scale
        stacked = np.vstack([self.block, np.eye(problem.levels, len(self.scale), problem.parameters)])
        orthogonal, self.triangle = np.linalg.qr(stacked)
        if not np.all(np.isfinite(orthogonal)):
            raise LinAlgError("the problem is not finite")
        self.upper, self.lower = orthogonal[:n], orthogonal[n:]

    def _shrink(self, values: Matrix) -> Matrix:
        """Return (I - phi q q') values."""
        sums = self.groups.gather(values)
        return np.asarray(values - self.groups.spread(((1.0 - np.sqrt(self.shrunk)) * sums.T).T), np.float64)

    def whiten(self, values: Matrix) -> Matrix:
        """Return B^-1/2 values.

        Parameters
        ----------
        values : ndarray of float64
            One row per point, (n,) or (n, k).
        """
        return self._shrink((self.root * values.T).T)

    def reduce(self, whitened: Matrix) -> tuple[Matrix, Matrix]:
        """Return the two parts of (I - Q Q') [values; 0], whose squares add up to values' P values.

        Parameters
        ----------
        whitened : ndarray of float64
            Whitened values, (n,) or (n, k).

        Returns
        -------
        tuple[ndarray of float64, ndarray of float64]
            Rows of the points, and rows of the shared errors.
        """
        inside = self.upper.T @ whitened
        return whitened - self.upper @ inside, -(self.lower @ inside)

    def restore(self, whitened: Matrix) -> Matrix:
        """Return B^-1/2' values, values being whitened.

        Parameters
        ----------
        whitened : ndarray of float64
            Whitened values, (n,) or (n, k).
        """
        return np.asarray((self.root * self._shrink(whitened).T).T, np.float64)

    def project(self, values: Matrix) -> Matrix:
        """Return P values.

        Parameters
        ----------
        values : ndarray of float64
            One row per point, (n,) or (n, k).
        """
        return self.restore(self.reduce(self.whiten(values))[0])

    def square(self, residual: Vector) -> float:
        """Return residual' P residual.

        Parameters
        ----------
        residual : ndarray of float64
            Residuals of any parameters, (n,).

        Returns
        -------
        float
            chi^2 at the best parameters.
        """
        upper, lower = self.reduce(self.whiten(residual))
        return float(upper @ upper + lower @ lower)

    @cached_property
    def inverse(self) -> Matrix:
        """Inverse of the triangle T."""
        return np.asarray(
            scipy.linalg.solve_triangular(self.triangle, np.eye(len(self.triangle))), np.float64
        )

    @cached_property
    def weights(self) -> Matrix:
        """W with theta = W y, (p, n)."""
        parameters = self.inverse[: self.problem.parameters]
        return np.asarray((self.restore(self.upper) @ parameters.T).T, np.float64)

    def find_effects(self, index: int) -> Matrix:
        """Return the effects of a component's errors on the parameters, W Z, (p, levels).

        Parameters
        ----------
        index : int
            Index of the component.

        Notes
        -----
        From W Z sqrt(v) = -(T'T)^-1, its rows of the parameters and columns of the errors. The sum W Z loses
        the digits that cancel where the points determine the errors better than v does.
        """
        component, part = self.problem.components[index], self.problem.parts.get(index)
        if part is None or not np.all(self.scale[part]):
            return contribute(component, self.weights)
        inverse = self.inverse
        return np.asarray(-inverse[: self.problem.parameters] @ inverse[part].T / self.scale[part])

    def predict(self, index: int) -> tuple[Vector, Vector]:
        """Return the best linear prediction of a shared component's errors, and its standard uncertainties.

        Parameters
        ----------
        index : int
            Index of the component.

        Returns
        -------
        tuple[ndarray of float64, ndarray of float64]
            One number per group each.

        Notes
        -----
        They are from rows of T^-1 Q_1' B^-1/2 y and of (T'T)^-1. The variance is v - v^2 Z'P Z too, which
        loses the digits by which v exceeds it.
        """
        if index == self.problem.absorbed:
            shared = (i for i, each in enumerate(self.problem.components) if each.labels is not None)
            other = next(i for i in shared if i != index)
            return Factored(replace(self.problem, absorb=other), self.variances).predict(index)
        part = self.problem.parts[index]
        rows = self.scale[part, None] * self.inverse[part]
        return rows @ (self.upper.T @ self.whiten(self.problem.centred)), np.linalg.norm(rows, axis=1)

    @cached_property
    def _log_restricted(self) -> float:
        """The sum of ln |V| and ln |A' V^-1 A|."""
        return float(
            -2.0 * np.sum(np.log(self.root))
            - np.sum(np.log(self.shrunk))
            + 2.0 * np.sum(np.log(np.abs(np.diag(self.triangle))))
        )

    @property
    def log_determinant(self) -> float:
        """Logarithm of the determinant of V."""
        inverse = self.inverse[: self.problem.parameters]
        return self._log_restricted + float(np.linalg.slogdet(inverse @ inverse.T)[1])

    def restricted_likelihood(self) -> float:
        """Return the log likelihood of the residuals, up to a constant."""
        return -0.5 * (self._log_restricted + self.square(self.problem.centred))
