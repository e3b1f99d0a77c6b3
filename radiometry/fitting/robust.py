"""Weights of points for a fit that outliers do not govern."""

from dataclasses import replace

import numpy as np

from radiometry.fitting.components import Vector
from radiometry.fitting.curve import fit_curve
from radiometry.fitting.sources import TAIL_DOF, Curve

_SMALLEST_SCATTER_REL = 1e-3
_MOST_ITERATIONS = 50
_TOLERANCE = 1e-3


def weigh_points(curve: Curve, *, model: str) -> Curve:
    """Return the curve with a weight for the scatter of each point: 1 for most, near 0 for outliers.

    Parameters
    ----------
    curve : Curve
        Points of the curve, with weights of 1.
    model : str
        Name of the model.

    Returns
    -------
    Curve
        The same points, with `scatter_weights`.

    Notes
    -----
    The scatter between frames is taken to follow Student's t with nu = 4 degrees of
    freedom instead of a normal distribution. With e_i the predicted error of a frame
    and s^2 the variance that REML finds with the weights so far, each round of the EM
    algorithm [1]_ sets::

        w_i = (nu + 1) / (nu + e_i^2 / s^2)

    s is at least 0.1 %: no shutter and no lamp repeat to better than that. With one
    frame per scene the error of a reading is one frame's too, and counts as scatter.

    References
    ----------
    .. [1] K. L. Lange, R. J. A. Little, J. M. G. Taylor, J. Am. Stat. Assoc. 84, 881
           (1989), doi:10.1080/01621459.1989.10478852
    """
    if len(set(curve.scenes)) == len(curve.scenes) and curve.repeatability_u_rel is None:
        curve = replace(curve, repeatability_u_rel=0.0)
    for _ in range(_MOST_ITERATIONS):
        fit = fit_curve(curve, model=model)
        if fit is None:
            break
        spread: Vector = fit.scatter_errors_rel / max(fit.scatter_u_rel, _SMALLEST_SCATTER_REL)
        weights = (TAIL_DOF + 1.0) / (TAIL_DOF + spread**2)
        converged = np.max(np.abs(weights - curve.scatter_weights)) < _TOLERANCE
        curve = replace(curve, scatter_weights=weights)
        if converged:
            break
    return curve
