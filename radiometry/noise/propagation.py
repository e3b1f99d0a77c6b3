"""Standard uncertainties of figures that share their inputs."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from radiometry.fitting.evidence import Quantity

_STEP_REL = 1e-5


def propagate(
    figure: Callable[..., float], values: NDArray[np.float64], covariance: NDArray[np.float64], *, unit: str
) -> Quantity:
    """Give a figure of several inputs: u^2 = g' V g, with g its gradient by central differences (JCGM 100).

    Takes
      values : (n,), none of them 0; covariance : (n, n)
    """
    gradient = np.empty(values.size)
    for index, value in enumerate(values):
        step = _STEP_REL * abs(value)
        up, down = values.copy(), values.copy()
        up[index] += step
        down[index] -= step
        gradient[index] = (figure(*up) - figure(*down)) / (2 * step)
    variance = float(gradient @ covariance @ gradient)
    return Quantity(
        value=float(figure(*values)), standard_uncertainty=math.sqrt(max(0.0, variance)), unit=unit
    )
