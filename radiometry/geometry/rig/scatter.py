"""Scatter of a rig's orientation from trigger to trigger beyond that of the corners."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy
from numpy.typing import NDArray

_POSE: Final = 6
# corners of a picture share errors of their search: 3.3 times at most in rendered pictures of rigid rigs
_CLEAR_RATIO: Final = 4.0

Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Scatter:
    """Scale of the corners' noise, and scatter of a pose from trigger to trigger, per axis.

    ``significant`` : steps of triggers are more than four times as large as independent corners make them
    ``dof`` : degrees of freedom of each of the two scatters
    """

    scale: float
    rotation_rad: float
    translation_mm: float
    significant: bool
    dof: float


def estimate_scatter(reduced: Sequence[tuple[Matrix, Matrix]], *, within: tuple[float, int]) -> Scatter:
    """Estimate the scatter of the poses between triggers (REML).

    Parameters
    ----------
    reduced : sequence of tuple of (ndarray, ndarray)
        Information and right-hand side of each trigger at the common minimum, its board's pose eliminated.
    within : tuple of (float, int)
        Sum of squares at the minimum, and degrees of freedom with the poses free in each trigger.

    Notes
    -----
    d_k = H_k^-1 g_k is the step that trigger k alone would take, of variance s^2 H_k^-1 + T; its gain
    g_k' H_k^-1 g_k is what frees s^2 from the scatter.
    """
    steps, precise, gained = [], [], 0.0
    for information, right in reduced:
        active = np.flatnonzero(np.diag(information) > 0.0)
        mine = information[np.ix_(active, active)]
        if not len(active) or np.linalg.cond(_scale(mine)) > 1e12:
            continue
        inverse = np.linalg.inv(mine)
        gained += float(right[active] @ inverse @ right[active])
        steps.append((active, inverse @ right[active]))
        precise.append(inverse)
    cost, dof = within
    scale2 = max(cost - gained, 0.0) / dof
    size = len(reduced[0][1])
    free = sum(len(active) for active, _ in steps) - size
    if free <= 0 or scale2 == 0.0:
        return Scatter(math.sqrt(scale2), 0.0, 0.0, significant=False, dof=1.0)
    typical = [
        max(
            1e-12,
            float(
                np.sqrt(
                    np.mean(
                        np.concatenate([step[active % _POSE // 3 == half] ** 2 for active, step in steps])
                    )
                )
            ),
        )
        for half in (0, 1)
    ]

    def deviance(logs: Matrix) -> float:
        t = [(one * size_) ** 2 for one, size_ in zip(logs, typical, strict=True)]
        total, information, right, squares = 0.0, np.zeros((size, size)), np.zeros(size), 0.0
        for (active, step), inverse in zip(steps, precise, strict=True):
            variance = scale2 * inverse + np.diag(np.array(t)[active % _POSE // 3])
            weight = np.linalg.inv(variance)
            total += float(np.linalg.slogdet(variance)[1])
            squares += float(step @ weight @ step)
            information[np.ix_(active, active)] += weight
            right[active] += weight @ step
        squares -= float(right @ np.linalg.solve(information, right))
        return total + squares + float(np.linalg.slogdet(information)[1])

    found = scipy.optimize.minimize(
        deviance, np.array([0.7, 0.7]), method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-4}
    )
    rotation, translation = (abs(float(one)) * size_ for one, size_ in zip(found.x, typical, strict=True))
    return Scatter(
        math.sqrt(scale2),
        rotation,
        translation,
        significant=gained > _CLEAR_RATIO**2 * scale2 * free,
        dof=free / 2.0,
    )


def _scale(matrix: Matrix) -> Matrix:
    scale = np.sqrt(np.diag(matrix))
    return np.asarray(matrix / np.outer(scale, scale), np.float64)
