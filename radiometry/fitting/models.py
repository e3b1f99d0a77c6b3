"""The four models between the right-hand side X = t S L / f^2 and the signal N above dark.

    proportional  N = K X          power    N = K X^g
    affine        N = K X + b      semilog  N = a ln X + b

The first three are fitted on ln N: the errors of readings, apertures and times are
factors, so they add up there, whereas in DN their products (3 % of 3 % is 0.1 %)
would exceed the noise of a well exposed region.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

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

    Attributes
    ----------
    design : ndarray of float64
        Matrix of the linear problem, (n, p).
    response : ndarray of float64
        Left-hand side, (n,).
    per_dn : ndarray of float64
        Change of the response per DN of signal, (n,).
    per_relative_x : ndarray of float64
        Change of the response per relative change of X, (n,).
    log_jacobian : float
        Sum of ln abs(d response / d signal), which makes likelihoods comparable
        between models.
    """

    design: Matrix
    response: Vector
    per_dn: Vector
    per_relative_x: Vector
    log_jacobian: float


def linearise(model: str, rhs: Vector, signal_dn: Vector, theta: Vector) -> LinearModel | None:
    """Write a model as a linear problem, with the sensitivities on the curve of `theta`.

    Parameters
    ----------
    model : str
        Name of the model.
    rhs : ndarray of float64
        Right-hand side X, above 0, (n,).
    signal_dn : ndarray of float64
        Signal above dark, above 0 [DN], (n,).
    theta : ndarray of float64
        Argument of `from_theta`, (p,).

    Returns
    -------
    LinearModel or None
        None if the curve is not above dark at every point.

    Notes
    -----
    The sensitivities are taken on the curve and not at the measured points: a
    weight that followed the noise of a point would bias the fit.
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
    """Return the theta at which the iteration starts: the proportional K.

    Parameters
    ----------
    model : str
        Name of the model.
    rhs : ndarray of float64
        Right-hand side X, (n,).
    signal_dn : ndarray of float64
        Signal above dark [DN], (n,).

    Returns
    -------
    ndarray of float64
        Start values, (p,); zeros for "semilog", which needs none.
    """
    log_k = float(np.mean(np.log(signal_dn / rhs)))
    guesses = {
        "proportional": [log_k],
        "affine": [math.exp(log_k), 0.0],
        "power": [log_k, 1.0],
        "semilog": [0.0, 0.0],
    }
    return np.array(guesses[model])


def from_theta(model: str, theta: Vector) -> Vector:
    """Convert the solution of the linear problem to the parameters of the model.

    Parameters
    ----------
    model : str
        Name of the model.
    theta : ndarray of float64
        Solution of the linear problem, (p,). "proportional" and "power" solve for
        ln K.

    Returns
    -------
    ndarray of float64
        Parameters as named by `PARAMETER_NAMES`, (p,).
    """
    if model not in _IN_LOG_K:
        return theta
    return np.concatenate([np.exp(theta[:1]), theta[1:]])


def to_theta(model: str, parameters: Vector) -> Vector:
    """Convert the parameters of a model to the solution of its linear problem: the inverse of `from_theta`.

    Parameters
    ----------
    model : str
        Name of the model.
    parameters : ndarray of float64
        Parameters as named by `PARAMETER_NAMES`, (p,).

    Returns
    -------
    ndarray of float64
        Solution of the linear problem, (p,).
    """
    if model not in _IN_LOG_K:
        return parameters
    return np.concatenate([np.log(parameters[:1]), parameters[1:]])


def find_jacobian(model: str, theta: Vector) -> Vector:
    """Return the derivative of each parameter with respect to its element of theta.

    Parameters
    ----------
    model : str
        Name of the model.
    theta : ndarray of float64
        Solution of the linear problem, (p,).

    Returns
    -------
    ndarray of float64
        Diagonal of the Jacobian of `from_theta`, (p,).
    """
    jacobian = np.ones_like(theta)
    if model in _IN_LOG_K:
        jacobian[0] = math.exp(theta[0])
    return jacobian


def predict(model: str, parameters: Vector | Sequence[float], rhs: Vector | float) -> Vector:
    """Compute the signal above dark at X.

    Parameters
    ----------
    model : str
        Name of the model.
    parameters : ndarray of float64 or sequence of float
        Parameters as named by `PARAMETER_NAMES`, (p,).
    rhs : ndarray of float64 or float
        Right-hand side X, (n,).

    Returns
    -------
    ndarray of float64
        Signal above dark [DN], (n,).
    """
    if model == "proportional":
        return np.asarray(parameters[0] * rhs, np.float64)
    if model == "affine":
        return np.asarray(parameters[0] * rhs + parameters[1], np.float64)
    if model == "power":
        return np.asarray(parameters[0] * rhs ** parameters[1], np.float64)
    return np.asarray(parameters[0] * np.log(rhs) + parameters[1], np.float64)


def invert(model: str, parameters: Sequence[float], signal_dn: float) -> float:
    """Compute X at a signal above dark.

    Parameters
    ----------
    model : str
        Name of the model.
    parameters : sequence of float
        Parameters as named by `PARAMETER_NAMES`, (p,).
    signal_dn : float
        Signal above dark [DN].

    Returns
    -------
    float
        X; infinite or NaN where the model has none ("power": at dark and below).
    """
    first, second = (*parameters, 0.0)[:2]
    signal = np.float64(signal_dn)
    with np.errstate(all="ignore"):  # K of points that disagree wildly may be 0 to rounding
        if model == "power":
            return float(np.exp(np.log(signal / first) / second)) if signal_dn > 0.0 else math.nan
        if model == "semilog":
            return float(np.exp((signal - second) / first))
        return float((signal - second) / first)


def invert_gradient(model: str, parameters: Sequence[float], signal_dn: float) -> tuple[float, Vector]:
    """Compute the derivatives of X at a signal above dark where `invert` has a solution.

    Parameters
    ----------
    model : str
        Name of the model.
    parameters : sequence of float
        Parameters as named by `PARAMETER_NAMES`, (p,).
    signal_dn : float
        Signal above dark [DN].

    Returns
    -------
    tuple[float, Vector]
        dX / dN [1/DN], and dX / d parameters, (p,).
    """
    first, second = (*parameters, 0.0)[:2]
    rhs = invert(model, parameters, signal_dn)
    if model == "proportional":
        return 1.0 / first, np.array([-rhs / first])
    if model == "affine":
        return 1.0 / first, np.array([-rhs / first, -1.0 / first])
    if model == "power":
        return rhs / (second * signal_dn), np.array(
            [-rhs / (second * first), -scipy.special.xlogy(rhs, rhs) / second]
        )
    return rhs / first, np.array([-scipy.special.xlogy(rhs, rhs) / first, -rhs / first])
