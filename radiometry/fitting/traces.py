"""Traces of products of the projection P with the structures Q of unknown variances."""

from dataclasses import replace
from functools import cached_property

import numpy as np

from radiometry.fitting.components import Matrix, Vector
from radiometry.fitting.factoring import Factored


class Traces:
    """Traces tr(P Q_i) and tr(P Q_i P Q_j) of the components whose variances are unknown.

    Attributes
    ----------
    traces : ndarray of float64
        The first, (m,).
    products : ndarray of float64
        The second, (m, m).

    Notes
    -----
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
        """Return Z_i'B^-1/2' values, without the loss of digits of sums of unwhitened ones.

        Parameters
        ----------
        i : int
            Index of a component.
        whitened : ndarray of float64
            Whitened values, (n,).

        Returns
        -------
        ndarray of float64
            One sum per group, (levels,).
        """
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
        """Return the diagonal of P."""
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
