"""Least squares over blocks that share some parameters and have one board's pose each."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]

_MOST_STEPS: Final = 200
TOLERANCE_REL: Final = 1e-12
_CONVERGED_STEPS: Final = 6
_ROUNDING_REL: Final = 1e-13
_MOST_DAMPING: Final = 1e12


class Linear(NamedTuple):
    """One block at a state: residuals, and derivatives of the model by shared parameters and by its pose."""

    residuals: Matrix
    of_shared: Matrix
    of_pose: Matrix


Linearise = Callable[[int, Matrix, Matrix], Linear]
"""``(block, shared, pose) -> Linear``."""


@dataclass(frozen=True)
class Minimum:
    """State with the least sum of squares.

    Attributes
    ----------
    shared, poses : ndarray of float64
        Shared parameters, and the pose of each block, (block, 6).
    linear : tuple of Linear
        Each block at this state.
    cost : float
        Sum of the squared residuals.
    """

    shared: Matrix
    poses: Matrix
    linear: tuple[Linear, ...]
    cost: float


def minimise(
    linearise: Linearise, shared: Matrix, poses: Matrix, *, tolerance_rel: float = TOLERANCE_REL
) -> Minimum:
    """Minimise the sum of squared residuals by Levenberg's and Marquardt's steps from a start.

    Parameters
    ----------
    linearise : callable
        Residuals and derivatives of a block.
    shared, poses : ndarray of float64
        Start: shared parameters, and the pose of each block, (block, 6).
    tolerance_rel : float
        Relative change of sum and parameters at which the descent ends.

    Raises
    ------
    numpy.linalg.LinAlgError
        The parameters are not determined.
    FloatingPointError
        A step leads to parameters that are not finite.
    """
    best = _evaluate(linearise, shared, poses)
    damping, converged = 1e-3, 0
    for _ in range(_MOST_STEPS):
        step, turns = _find_step(best.linear, damping)
        tried = best.shared + step
        if not np.isfinite(tried).all():
            raise FloatingPointError("the step is not finite")
        change = float((np.abs(step) / np.maximum(np.abs(tried), 1e-6)).max())
        then = _evaluate(linearise, tried, best.poses + turns)
        # the cost has rounding: steps that lower it by less still improve the parameters
        if np.isfinite(then.cost) and then.cost <= (1.0 + _ROUNDING_REL) * best.cost:
            gain, best = best.cost - then.cost, then
            damping = max(damping / 10.0, 1e-12)
            converged = converged + 1 if gain <= tolerance_rel * best.cost else 0
            if converged and (change <= tolerance_rel or converged == _CONVERGED_STEPS):
                break
        elif damping >= _MOST_DAMPING or change <= tolerance_rel:
            break
        else:
            damping *= 10.0
    return best


def reduce(block: Linear, *, damping: float = 0.0) -> tuple[Matrix, Matrix, Matrix]:
    """Eliminate the pose of a block from its normal equations (Schur's complement).

    Parameters
    ----------
    block : Linear
        Block at a state.
    damping : float
        Share by which the diagonal of the pose's part is raised.

    Returns
    -------
    tuple of (ndarray, ndarray, ndarray)
        Information matrix and right-hand side of the shared parameters, and the pose's way: its step is
        the last column less the others times the step of the shared parameters.
    """
    residuals, of_shared, of_pose = block
    cross, own = of_shared.T @ of_pose, of_pose.T @ of_pose
    right = np.column_stack((cross.T, of_pose.T @ residuals))
    way = np.asarray(np.linalg.solve(own + np.diag(np.diag(own)) * damping, right), np.float64)
    return of_shared.T @ of_shared - cross @ way[:, :-1], of_shared.T @ residuals - cross @ way[:, -1], way


def _evaluate(linearise: Linearise, shared: Matrix, poses: Matrix) -> Minimum:
    linear = tuple(linearise(block, shared, pose) for block, pose in enumerate(poses))
    return Minimum(shared, poses, linear, sum(float(each.residuals @ each.residuals) for each in linear))


def _find_step(linear: tuple[Linear, ...], damping: float) -> tuple[Matrix, Matrix]:
    reduced = [reduce(block, damping=damping) for block in linear]
    total = np.sum([each[0] for each in reduced], axis=0)
    right = np.sum([each[1] for each in reduced], axis=0)
    step = np.linalg.solve(total + np.diag(np.diag(total)) * damping, right)
    return step, np.array([way[:, -1] - way[:, :-1] @ step for _, _, way in reduced])
