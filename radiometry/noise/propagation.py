"""Standard uncertainties of coefficients that share their inputs."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from radiometry.fitting.evidence import MOST_DOF, Quantity

_STEP_REL = 1e-5


def propagate(
    figure: Callable[..., float],
    values: NDArray[np.float64],
    covariance: NDArray[np.float64],
    *,
    unit: str,
    dofs: NDArray[np.float64] | None = None,
) -> tuple[Quantity, float]:
    """Compute a function of several inputs and its uncertainty: u^2 = g' V g (JCGM 100).

    Parameters
    ----------
    figure : callable
        Function of the inputs, with gradient g by central differences.
    values : ndarray of float64
        Inputs, none of them 0, (n,).
    covariance : ndarray of float64
        Covariance V of the inputs, (n, n).
    unit : str
        Unit of the value.
    dofs : ndarray of float64 or None, default: None
        Degrees of freedom of the inputs' uncertainties, (n,); None for infinite ones.

    Returns
    -------
    tuple of (Quantity, float)
        Value and standard uncertainty, and effective degrees of freedom by Welch and Satterthwaite.
    """
    gradient = np.empty(values.size)
    for index, value in enumerate(values):
        step = _STEP_REL * abs(value)
        up, down = values.copy(), values.copy()
        up[index] += step
        down[index] -= step
        gradient[index] = (figure(*up) - figure(*down)) / (2 * step)
    variance = float(gradient @ covariance @ gradient)
    own = gradient**2 * np.diag(covariance)
    restless = float(np.sum(own**2 / dofs)) if dofs is not None else 0.0
    dof = min(MOST_DOF, variance**2 / restless) if restless > 0.0 else MOST_DOF
    u = math.sqrt(max(0.0, variance))
    return Quantity(value=float(figure(*values)), standard_uncertainty=u, unit=unit), dof
