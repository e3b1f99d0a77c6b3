"""The four models between the right-hand side X = t S L / f^2 and the signal N above dark.

    proportional  N = K X          power    N = K X^g
    affine        N = K X + b      semilog  N = a ln X + b

The first three are fitted on ln N: readings, apertures and times err by factors, so their errors add up
there, whereas in DN their products (3 % of 3 % is 0.1 %) would exceed the noise of a well exposed region.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import xlogy

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

PARAMETER_NAMES: dict[str, tuple[str, ...]] = {
    "proportional": ("luminance_k",),
    "affine": ("luminance_k", "offset_dn"),
    "power": ("luminance_k", "exponent"),
    "semilog": ("slope_dn", "offset_dn"),
}
_IN_LOG_K = ("proportional", "power")

K_UNITS = {
    "proportional": "DN*m2/(cd*s)",
    "affine": "DN*m2/(cd*s)",
    "power": "DN*(m2/(cd*s))^exponent",
    "semilog": "DN",
}


@dataclass(frozen=True, kw_only=True)
class LinearModel:
    """A model as a linear problem near some parameters: response = design @ theta.

    ``per_dn`` : change of the response per DN of signal; ``per_relative_x`` : per relative change of X
    ``log_jacobian`` : ln |d response / d signal| summed, which makes likelihoods comparable between models
    """

    design: Matrix
    response: Vector
    per_dn: Vector
    per_relative_x: Vector
    log_jacobian: float


def linearise(model: str, rhs: Vector, signal_dn: Vector, theta: Vector) -> LinearModel | None:
    """Lay a model out as a linear problem; the sensitivities are taken on the curve of ``theta``.

    On the curve and not at the measured points: a weight that followed a point's noise would bias the fit.

    Takes
      rhs, signal_dn : (n,) > 0; theta : `from_theta`'s argument
    Returns None where the curve is not above dark at every point
    """
    one = np.ones_like(rhs)
    if model == "semilog":
        return LinearModel(
            design=np.column_stack([np.log(rhs), one]),
            response=signal_dn,
            per_dn=one,
            per_relative_x=theta[0] * one,
            log_jacobian=0.0,
        )
    fitted = predict(model, from_theta(model, theta), rhs)
    if not np.all(fitted > 0.0):
        return None
    slope = theta[1] * one if model == "power" else one
    if model == "affine":
        slope = theta[0] * rhs / fitted
        design = np.column_stack([rhs / fitted, 1.0 / fitted])
    else:
        design = np.column_stack([one, np.log(rhs)])[:, : theta.size]
    offset = np.log(rhs) if model == "proportional" else 0.0
    response = np.log(signal_dn) - offset
    if model == "affine":
        response = np.log(signal_dn / fitted) + design @ theta
    return LinearModel(
        design=design,
        response=response,
        per_dn=1.0 / fitted,
        per_relative_x=slope,
        log_jacobian=-float(np.sum(np.log(signal_dn))),
    )


def start(model: str, rhs: Vector, signal_dn: Vector) -> Vector:
    """Give theta to start the iteration from: the proportional K; semilog needs none."""
    log_k = float(np.mean(np.log(signal_dn / rhs)))
    guesses = {
        "proportional": [log_k],
        "affine": [math.exp(log_k), 0.0],
        "power": [log_k, 1.0],
        "semilog": [0.0, 0.0],
    }
    return np.array(guesses[model])


def from_theta(model: str, theta: Vector) -> Vector:
    """Turn the linear problem's solution into the model's parameters: two models solve for ln K."""
    if model not in _IN_LOG_K:
        return theta
    return np.concatenate([np.exp(theta[:1]), theta[1:]])


def covariance_from_theta(model: str, theta: Vector, covariance: Matrix) -> Matrix:
    """Carry a covariance along `from_theta`."""
    if model not in _IN_LOG_K:
        return covariance
    jacobian = np.ones_like(theta)
    jacobian[0] = math.exp(theta[0])
    return covariance * np.outer(jacobian, jacobian)


def relative_scale(model: str, theta: Vector) -> float:
    """Give the factor from the variance of theta's first element to K's relative variance."""
    return 1.0 if model in _IN_LOG_K else 1.0 / float(theta[0]) ** 2


def predict(model: str, parameters: Vector, rhs: Vector) -> Vector:
    """Give the signal above dark [DN] at X."""
    if model == "proportional":
        return np.asarray(parameters[0] * rhs, np.float64)
    if model == "affine":
        return np.asarray(parameters[0] * rhs + parameters[1], np.float64)
    if model == "power":
        return np.asarray(parameters[0] * rhs ** parameters[1], np.float64)
    return np.asarray(parameters[0] * np.log(rhs) + parameters[1], np.float64)


def invert(model: str, parameters: Sequence[float], signal_dn: float) -> float:
    """Give X at a signal above dark; infinite or NaN where the model has none (power: at dark and below)."""
    first, second = (*parameters, 0.0)[:2]
    with np.errstate(all="ignore"):
        if model == "power":
            return (
                float(np.exp(np.log(np.float64(signal_dn / first)) / second)) if signal_dn > 0.0 else math.nan
            )
        if model == "semilog":
            return float(np.exp(np.float64((signal_dn - second) / first)))
    return (signal_dn - second) / first


def invert_gradient(model: str, parameters: Sequence[float], signal_dn: float) -> tuple[float, Vector]:
    """Give dX / dN [1/DN] and dX / d parameters at a signal above dark, where `invert` has an answer."""
    first, second = (*parameters, 0.0)[:2]
    rhs = invert(model, parameters, signal_dn)
    if model == "proportional":
        return 1.0 / first, np.array([-rhs / first])
    if model == "affine":
        return 1.0 / first, np.array([-rhs / first, -1.0 / first])
    if model == "power":
        return rhs / (second * signal_dn), np.array([-rhs / (second * first), -xlogy(rhs, rhs) / second])
    return rhs / first, np.array([-xlogy(rhs, rhs) / first, -rhs / first])
