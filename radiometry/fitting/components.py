"""Independent error components, and their covariance, factored without ever being formed.

It is a diagonal plus one number per group of points that share an error: the time grows with the number of
points, not with its cube.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from numpy.linalg import LinAlgError
from numpy.typing import NDArray

from radiometry.records import Record

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Labels = NDArray[np.intp]

_MOST_DENSE = 20_000


class Component(Record):
    """One source of error and its part of the covariance, V_j = variance * Z_j Z_j'."""

    source: str
    kind: str  # "A" (evaluated from scatter) or "B" (evaluated by other means)
    sensitivity: Vector  # Change s of the response per unit of the error, (n,)
    variance: float | None  # Variance v_j; None if it is to be estimated from the scatter
    # Index of each point's group, (n,), from `index_labels`: points of one group share one error. None if
    # each point has its own.
    labels: Labels | None = None
    dof: float = math.inf  # Degrees of freedom of a given variance
    common: bool = False  # True if all points have the same error, so that their scatter does not test it

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
        """Return Z' values: the sums over the points of each group, weighted with the sensitivity."""
        return np.asarray(self._transposed @ values, np.float64)

    def spread(self, errors: Matrix) -> Matrix:
        """Return Z errors: the effect of the groups' errors on each point."""
        return np.asarray(self._transposed.T @ errors, np.float64)

    def columns(self) -> Matrix:
        """Return Z, (n, levels)."""
        whole = self._transposed.T
        return np.asarray(whole if isinstance(whole, np.ndarray) else whole.toarray(), np.float64)


def index_labels(labels: Sequence[Any]) -> Labels:
    return np.unique(np.asarray(labels), return_inverse=True)[1].astype(np.intp)


def contribute(component: Component, weights: Matrix) -> Matrix:
    """Return the effects of a component's errors on linear combinations of the response."""
    return component.gather(weights.T).T


class Problem(Record, kw_only=False):
    """A linear problem y = A theta + e."""

    design: Matrix  # Matrix A, (n, p)
    response: Vector  # Vector y, (n,)
    components: tuple[Component, ...]  # Sources of error
    # Index of the shared component that is eliminated group by group, while the others have columns; None for
    # the one with the most groups, if it has two
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
        return int(self.design.shape[1])

    @property
    def levels(self) -> int:
        """Number of columns of shared errors."""
        return int(self.block.shape[1]) - self.parameters


class Factored:
    """The covariance V at given variances, by an orthogonal factorisation of the mixed model.

    With R the diagonal of the points' own errors and z the scaled sensitivities of the absorbed component,
    B^-1/2 = (I - phi q q') R^-1/2 in each group, q = z / |z| and phi = 1 - 1 / sqrt(1 + v z'z). With the rows
    X = B^-1/2 [A, Z sqrt(v)] above a unit matrix for the errors [1]::

        [X; 0 I] = Q T,      P = B^-1/2' (I - Q_1 Q_1') B^-1/2,      Q_1 the upper rows of Q

    [1] S. R. Searle, G. Casella, C. E. McCulloch, Variance Components, Wiley 1992, chapter 7,
        doi:10.1002/9780470316856
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
        return self._shrink((self.root * values.T).T)

    def reduce(self, whitened: Matrix) -> tuple[Matrix, Matrix]:
        """Return the two parts of (I - Q Q') [values; 0], whose squares add up to values' P values."""
        inside = self.upper.T @ whitened
        return whitened - self.upper @ inside, -(self.lower @ inside)

    def restore(self, whitened: Matrix) -> Matrix:
        """Return B^-1/2' values, values being whitened."""
        return np.asarray((self.root * self._shrink(whitened).T).T, np.float64)

    def project(self, values: Matrix) -> Matrix:
        return self.restore(self.reduce(self.whiten(values))[0])

    def square(self, residual: Vector) -> float:
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
        inverse = self.inverse[: self.problem.parameters]
        return self._log_restricted + float(np.linalg.slogdet(inverse @ inverse.T)[1])

    def restricted_likelihood(self) -> float:
        """Return the log likelihood of the residuals, up to a constant."""
        return -0.5 * (self._log_restricted + self.square(self.problem.centred))


class Traces:
    """Traces tr(P Q_i) and tr(P Q_i P Q_j) of the components whose variances are unknown.

    For shared errors these are sums of squares of Z_i' P Z_j. P itself is a diagonal
    less two products Y Y' and H H', of one vector per group of the absorbed component and
    of one per column: no sum is over pairs of points.
    """

    def __init__(self, factored: Factored) -> None:
        self._factored, problem = factored, factored.problem
        self._sizes = factored.sizes * factored.shrunk
        self._inner = self._gather(factored.upper)
        unknown = range(len(problem.unknown))
        self.traces: Vector = np.array([self._trace(i) for i in problem.unknown])
        self.products: Matrix = np.zeros((len(unknown), len(unknown)))
        for row in unknown:
            for column in unknown[: row + 1]:
                found = self._product(problem.unknown[row], problem.unknown[column])
                self.products[row, column] = self.products[column, row] = found

    def gather(self, i: int, whitened: Vector) -> Vector:
        """Return Z_i'B^-1/2' values, without the loss of digits of sums of unwhitened ones."""
        f = self._factored
        if i == f.problem.absorbed:
            return self._gather(whitened)
        if i in f.problem.own:
            return f.problem.components[i].sensitivity * f.restore(whitened)
        return np.asarray(self._whitened[:, self._part(i)].T @ whitened, np.float64)

    def _gather(self, whitened: Matrix) -> Matrix:
        """Return Z'B^-1/2' values of the absorbed component."""
        return (np.sqrt(self._sizes) * self._factored.groups.gather(whitened).T).T

    @cached_property
    def _whitened(self) -> Matrix:
        """The columns of the shared components but the absorbed one."""
        return self._factored.whiten(self._factored.problem.block[:, self._factored.problem.parameters :])

    @cached_property
    def _columns(self) -> tuple[Matrix, Matrix]:
        return self._factored.reduce(self._whitened)

    @cached_property
    def _table(self) -> Matrix:
        upper, lower = self._columns
        return np.asarray(upper.T @ upper + lower.T @ lower, np.float64)

    @cached_property
    def _low(self) -> tuple[Vector, Matrix]:
        """Y, which has one entry per point, and H."""
        f = self._factored
        return f.root * f.direction * np.sqrt(1.0 - f.shrunk)[f.labels], f.restore(f.upper)

    def _diagonal(self) -> Vector:
        of_group, of_columns = self._low
        return np.asarray(self._factored.root**2 - of_group**2 - np.sum(of_columns**2, axis=1), np.float64)

    def _part(self, i: int) -> slice:
        at, before = self._factored.problem.parts[i], self._factored.problem.parameters
        return slice(at.start - before, at.stop - before)

    def _squares(self, i: int) -> Vector:
        return np.asarray(self._factored.problem.components[i].sensitivity ** 2, np.float64)

    def _trace(self, i: int) -> float:
        problem = self._factored.problem
        if i in problem.own:
            return float(self._squares(i) @ self._diagonal())
        if i == problem.absorbed:
            return float(np.sum(self._sizes) - np.sum(self._inner**2))
        return float(np.trace(self._table[self._part(i), self._part(i)]))

    def _product(self, i: int, j: int) -> float:
        problem = self._factored.problem

        def rank(k: int) -> int:
            return 0 if k in problem.own else 1 if k == problem.absorbed else 2

        i, j = sorted((i, j), key=rank)
        match rank(i), rank(j):
            case 0, 0:
                return self._own_by_own(self._squares(i), self._squares(j))
            case 0, 1:
                return self._own_by_absorbed(self._squares(i))
            case 0, _:
                columns = self._factored.restore(self._columns[0])[:, self._part(j)]
                return float(self._squares(i) @ np.sum(columns**2, axis=1))
            case 1, 1:
                inner, sizes = self._inner, self._sizes
                cross = 2.0 * sizes @ np.sum(inner**2, axis=1)
                return float(np.sum(sizes**2) - cross + np.sum((inner.T @ inner) ** 2))
            case 1, _:
                return float(np.sum(self._gather(self._columns[0])[:, self._part(j)] ** 2))
            case _:
                return float(np.sum(self._table[self._part(i), self._part(j)] ** 2))

    def _own_by_own(self, squares: Vector, others: Vector) -> float:
        diagonal = self._diagonal()
        whole = self._factored.root**2
        one, other = self._sum_low(squares), self._sum_low(others)
        return float(
            (squares * others) @ (whole**2 - 2.0 * whole * (whole - diagonal))
            + one[0] @ other[0]
            + 2.0 * np.sum(one[1] * other[1])
            + np.sum(one[2] * other[2])
        )

    def _own_by_absorbed(self, squares: Vector) -> float:
        f, low = self._factored, self._low[1]
        of_group = f.root * f.direction * np.sqrt(f.sizes)[f.labels] * f.shrunk[f.labels]
        cross = 2.0 * (squares * of_group) @ np.sum(low * self._inner[f.labels], axis=1)
        return float(
            squares @ of_group**2 - cross + np.sum(self._inner @ self._sum_low(squares)[2] * self._inner)
        )

    def _sum_low(self, squares: Vector) -> tuple[Vector, Matrix, Matrix]:
        """Return the parts of [Y, H]' S [Y, H]: by group, between group and column, between columns."""
        of_group, of_columns = self._low
        labels = self._factored.labels
        return (
            np.asarray(np.bincount(labels, squares * of_group**2), np.float64),
            replace(self._factored.groups, sensitivity=squares * of_group).gather(of_columns),
            np.asarray(of_columns.T @ (squares[:, None] * of_columns), np.float64),
        )
