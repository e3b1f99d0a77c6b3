"""Prediction of each scene of a curve from the others."""

import math
from dataclasses import replace

import numpy as np
from numpy.linalg import LinAlgError

from radiometry.fitting import models
from radiometry.fitting.components import index_labels
from radiometry.fitting.curve import CurveFit, linearise_curve
from radiometry.fitting.gls import leave_groups_out
from radiometry.fitting.sources import F_NUMBER, Curve, list_sources


def leave_scenes_out(fit: CurveFit, curve: Curve) -> list[float] | None:
    """Compute the error of the luminance of each point, predicted from the other scenes.

    Parameters
    ----------
    fit : CurveFit
        A model fitted to the curve.
    curve : Curve
        The same curve.

    Returns
    -------
    list of float or None
        (L_fit - L_meter) / L_meter by scene; t, S and f are the same on both sides, so
        that X stands for L. None if the other scenes do not determine the model.

    Notes
    -----
    The covariance, and the linearisation of a model that is not linear in ln N, are
    those of the whole curve; the parameters and the errors of the f-numbers are
    fitted again.
    """
    theta = models.to_theta(fit.model, fit.parameters)
    linear = linearise_curve(curve, fit.model, theta)
    scenes = index_labels(curve.scenes)
    counts = np.bincount(scenes)
    if linear is None or len(scenes) - counts.max() <= theta.size:
        return None
    known = replace(
        curve,
        repeatability_u_rel=fit.repeatability_u_rel,
        f_number_u_rel=fit.f_number_u_rel,
        scatter_u_rel=fit.scatter_u_rel,
    )
    components = list_sources(known, linear, model=fit.model, scattered=False)
    try:
        rest = leave_groups_out(linear.design, linear.response, components, scenes)
    except LinAlgError:
        return None
    f_numbers = index_labels(curve.f_numbers)
    errors: list[float] = []
    for scene, (parameters, predicted) in enumerate(rest):
        out = scenes == scene
        x_error = (
            2.0 * predicted[F_NUMBER][f_numbers[out]] if F_NUMBER in predicted else np.zeros(counts[scene])
        )
        found = models.from_theta(fit.model, parameters).tolist()
        errors += [
            models.invert(fit.model, found, signal) / x / math.exp(error) - 1.0
            for x, signal, error in zip(
                curve.rhs[out].tolist(), curve.signal_dn[out].tolist(), x_error.tolist(), strict=True
            )
        ]
    return errors if all(map(math.isfinite, errors)) else None
