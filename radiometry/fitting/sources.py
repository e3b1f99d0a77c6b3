"""Sources of error of measurements, and the models of a curve between X = t S L / f^2 and the signal N.

    proportional  N = K X          power    N = K X^g
    affine        N = K X + b      semilog  N = a ln X + b

The first three are fitted on ln N: the errors of readings, apertures and times are factors, so they add up
there, whereas in DN their products (3 % of 3 % is 0.1 %) would exceed the noise of a well exposed region.
"""

import math
from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from radiometry.fitting.components import Component, Vector, index_labels
from radiometry.records import Record

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


class LinearModel(Record):
    """A model as a linear problem near some parameters: response = design @ theta."""

    design: Matrix  # Matrix of the linear problem, (n, p)
    response: Vector  # Left-hand side, (n,)
    per_dn: Vector  # Change of the response per DN of signal, (n,)
    per_relative_x: Vector  # Change of the response per relative change of X, (n,)
    # Sum of ln abs(d response / d signal), which makes likelihoods comparable between models
    log_jacobian: float


def linearise(model: str, rhs: Vector, signal_dn: Vector, theta: Vector) -> LinearModel | None:
    """Write a model as a linear problem, with the sensitivities on the curve of `theta`.

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
    """Return the theta at which the iteration starts: the proportional K."""
    log_k = float(np.mean(np.log(signal_dn / rhs)))
    guesses = {
        "proportional": [log_k],
        "affine": [math.exp(log_k), 0.0],
        "power": [log_k, 1.0],
        "semilog": [0.0, 0.0],
    }
    return np.array(guesses[model])


def from_theta(model: str, theta: Vector) -> Vector:
    """Convert the solution of the linear problem to the parameters of the model."""
    if model not in _IN_LOG_K:
        return theta
    return np.concatenate([np.exp(theta[:1]), theta[1:]])


def to_theta(model: str, parameters: Vector) -> Vector:
    """Convert the parameters of a model to the solution of its linear problem, against `from_theta`."""
    if model not in _IN_LOG_K:
        return parameters
    return np.concatenate([np.log(parameters[:1]), parameters[1:]])


def find_jacobian(model: str, theta: Vector) -> Vector:
    """Return the derivative of each parameter with respect to its element of theta."""
    jacobian = np.ones_like(theta)
    if model in _IN_LOG_K:
        jacobian[0] = math.exp(theta[0])
    return jacobian


def predict(model: str, parameters: Vector | Sequence[float], rhs: Vector | float) -> Vector:
    """Compute the signal above dark at X."""
    if model == "proportional":
        return np.asarray(parameters[0] * rhs, np.float64)
    if model == "affine":
        return np.asarray(parameters[0] * rhs + parameters[1], np.float64)
    if model == "power":
        return np.asarray(parameters[0] * rhs ** parameters[1], np.float64)
    return np.asarray(parameters[0] * np.log(rhs) + parameters[1], np.float64)


def invert(model: str, parameters: Sequence[float], signal_dn: float) -> float:
    """Compute X at a signal above dark."""
    first, second = (*parameters, 0.0)[:2]
    signal = np.float64(signal_dn)
    with np.errstate(all="ignore"):  # K of points that disagree wildly may be 0 to rounding
        if model == "power":
            return float(np.exp(np.log(signal / first) / second)) if signal_dn > 0.0 else math.nan
        if model == "semilog":
            return float(np.exp((signal - second) / first))
        return float((signal - second) / first)


def invert_gradient(model: str, parameters: Sequence[float], signal_dn: float) -> tuple[float, Vector]:
    """Compute the derivatives of X at a signal above dark where `invert` has a solution."""
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


READING = "meter repeatability"
DARK_CURRENT = "dark current"
LAMP = "lamp drift"
F_NUMBER = "f-number"
TIME = "exposure time"
FLICKER = "flicker"

# Degrees of freedom of Student's t, which a robust fit takes the scatter between frames to follow
TAIL_DOF = 4.0

# Variance of a location under that t, relative to what its weights alone state (Fisher information)
TAIL_FACTOR = (TAIL_DOF + 3.0) / (TAIL_DOF + 1.0)

# Scatter between readings or frames of one surface beyond which something else than a meter or a shutter is
# at work: meters repeat to 1 %, shutters and apertures to 2 %
IMPLAUSIBLE_SCATTER_REL = 0.05
SCATTER = "scatter between frames"

# what rounding leaves of a flicker over whole periods
_WHOLE_PERIODS_REL = 1e-9


class Curve(Record):
    """Points of one curve, n in all, and the uncertainties that the caller knows."""

    rhs: Vector  # Right-hand side X = t S L / f^2, (n,)
    signal_dn: Vector  # Signal N above dark, above 0 [DN], (n,)
    signal_u_dn: Vector  # Standard uncertainty of each point alone, above 0 [DN], (n,)
    scenes: tuple[str, ...]  # Label of each point; points with the same label share one error
    f_numbers: tuple[float, ...]  # Labels of each point, used in the same way
    times_s: tuple[float, ...]
    readings: NDArray[np.int64]  # Number of meter readings averaged for the point's scene, (n,)
    # Standard uncertainty of the dark signal that all points share [DN], and its degrees of freedom
    dark_u_dn: float
    dark_dof: float
    # Relative standard uncertainty of a nominal f-number; None if it is estimated from the scatter between
    # f-numbers
    f_number_u_rel: float | None
    time_u_rel: float  # Relative standard uncertainty of the exposure time
    # Relative standard uncertainty of one meter reading; None if it is estimated from the scatter between
    # scenes
    repeatability_u_rel: float | None
    # Relative illumination V by which the signals were divided, 1 if vignetting is not corrected, (n,). Their
    # noise, and the dark signal's error, are divided by it too.
    lens_shares: Vector
    lens_u_rel: Vector  # u(V) / V, shared within an f-number, (n,)
    dark_lever_s: Vector  # Exposure time of each point minus that at which `dark_u_dn` holds [s], (n,)
    # Relative standard uncertainty of the lamp's change from the reading to each point, signed, (n,)
    lamp_u_rel: Vector
    lamp_labels: tuple[str, ...]  # Label of each point for that error
    # Relative standard uncertainty of an independent change of the lamp that all points share, (n,)
    lamp_level_u_rel: Vector
    scatter_weights: Vector  # Weight of each point; its scatter has the variance u_s^2 / weight, (n,)
    # Standard uncertainty of the rate at which the dark signal grows [DN/s]
    dark_rate_u_dn_per_s: float = 0.0
    # What was subtracted from `signal_dn` per second of lever beyond the rate's expectation [DN/s]
    dark_rate_shift_dn_per_s: float = 0.0
    # True if dark frames determine that rate, with `dark_dof`; False if its uncertainty is a plausible size
    dark_rate_measured: bool = False
    # Relative standard uncertainty of each point's light by flicker of a random phase, (n,)
    flicker_u_rel: Vector | None = None
    # Relative scatter of a frame against the next at the same settings, by shutter, aperture and lamp. None
    # if it is estimated from the scatter where the other sources do not explain it.
    scatter_u_rel: float | None = None


def list_sources(curve: Curve, linear: LinearModel, *, model: str, scattered: bool) -> list[Component]:
    """List the sources of error with their structure in the units of the response."""
    n = len(curve.rhs)
    if model == "semilog":
        spread = _ordinary_variance(linear)
        return [Component(source="scatter", kind="A", sensitivity=np.ones(n), variance=spread, dof=n - 2)]
    x, by_dark = linear.per_relative_x, linear.per_dn / curve.lens_shares
    return [
        Component(
            source="signal noise", kind="A", sensitivity=linear.per_dn * curve.signal_u_dn, variance=1.0
        ),
        Component(
            source="dark signal",
            kind="A" if math.isfinite(curve.dark_dof) else "B",
            sensitivity=by_dark,
            labels=np.zeros(n, np.intp),
            variance=curve.dark_u_dn**2,
            dof=curve.dark_dof,
        ),
        *_of_dark_current(curve, by_dark * curve.dark_lever_s),
        Component(
            source=READING,
            kind="A" if curve.repeatability_u_rel is None else "B",
            sensitivity=x / np.sqrt(curve.readings),
            labels=index_labels(curve.scenes),
            variance=_square(curve.repeatability_u_rel),
        ),
        _relative(F_NUMBER, curve.f_numbers, 2 * x, curve.f_number_u_rel),
        _relative(TIME, curve.times_s, x, curve.time_u_rel),
        *_of_lamp(curve, linear),
        *_of_flicker(curve, linear),
        *_of_lens(curve),
        *_of_frames(curve, linear, scattered=scattered),
    ]


def _square(u_rel: float | None) -> float | None:
    return None if u_rel is None else u_rel**2


def _of_dark_current(curve: Curve, sensitivity: Vector) -> list[Component]:
    """Return the error of the rate at which the dark signal grows, which all points share by their times."""
    if not (curve.dark_rate_u_dn_per_s and np.any(sensitivity)):
        return []
    measured = curve.dark_rate_measured and math.isfinite(curve.dark_dof)
    return [
        Component(
            source=DARK_CURRENT,
            kind="A" if measured else "B",
            sensitivity=sensitivity,
            labels=np.zeros(sensitivity.size, np.intp),
            variance=curve.dark_rate_u_dn_per_s**2,
            dof=curve.dark_dof if measured else math.inf,
        )
    ]


def _of_frames(curve: Curve, linear: LinearModel, *, scattered: bool) -> list[Component]:
    """Return the error of each frame's own light, which its settings and its scene do not state."""
    given = curve.scatter_u_rel
    if not (scattered if given is None else given):
        return []
    return [
        Component(
            source=SCATTER,
            kind="A",
            sensitivity=linear.per_relative_x / np.sqrt(curve.scatter_weights),
            variance=_square(given),
        )
    ]


def _of_lamp(curve: Curve, linear: LinearModel) -> list[Component]:
    """Return the error of the lamp's change from the reading of a scene to its frames."""
    own, level = curve.lamp_u_rel, curve.lamp_level_u_rel
    return [
        Component(
            source=LAMP,
            kind="B",
            sensitivity=linear.per_relative_x * u_rel,
            labels=index_labels(labels),
            variance=1.0,
            common=len(set(labels)) == 1 and not np.ptp(u_rel),
        )
        for u_rel, labels in ((own, curve.lamp_labels), (level, ("",) * len(level)))
        if np.any(u_rel)
    ]


def _of_flicker(curve: Curve, linear: LinearModel) -> list[Component]:
    """Return the error of each frame's own part of the lamp's periods."""
    if curve.flicker_u_rel is None or np.max(curve.flicker_u_rel) < _WHOLE_PERIODS_REL:
        return []
    size = linear.per_relative_x * curve.flicker_u_rel
    return [Component(source=FLICKER, kind="B", sensitivity=size, variance=1.0)]


def _of_lens(curve: Curve) -> list[Component]:
    """Return the error of V; the response is ln N, so the relative error of V is its change."""
    if not np.any(curve.lens_u_rel):
        return []
    return [
        Component(
            source="vignetting",
            kind="B",
            sensitivity=curve.lens_u_rel,
            labels=index_labels(curve.f_numbers),
            variance=1.0,
            common=len(set(curve.f_numbers)) == 1,
        )
    ]


def _relative(source: str, labels: Sequence[float], sensitivity: Vector, u_rel: float | None) -> Component:
    return Component(
        source=source,
        kind="A" if u_rel is None else "B",
        sensitivity=sensitivity,
        labels=index_labels(labels),
        variance=_square(u_rel),
        common=len(set(labels)) == 1,
    )


def _ordinary_variance(linear: LinearModel) -> float:
    """Return the residual variance of ordinary least squares, above 0 also for points on a line."""
    _, p = linear.design.shape
    theta = np.linalg.lstsq(linear.design, linear.response, rcond=None)[0]
    residual = linear.response - linear.design @ theta
    smallest = (math.ulp(1.0) * float(np.max(np.abs(linear.response)))) ** 2
    return max(float(residual @ residual) / float(len(residual) - p), smallest)


# Degrees of freedom of what is expected of a scatter before a value is seen
EXPECTED_DOF = 4.0


def estimate_variance(
    squares: float, dof: float, *, expected: float, expected_dof: float = EXPECTED_DOF
) -> tuple[float, float]:
    """Return the variance of few values and its degrees of freedom, by the size that is expected of it.

    With a scaled inverse chi-square prior of nu_0 degrees of freedom and the size s_0^2 [1]::

        s^2 = (nu_0 s_0^2 + sum of squares) / (nu_0 + dof)        with nu_0 + dof degrees of freedom

    [1] A. Gelman et al., Bayesian Data Analysis, 3rd ed., Chapman & Hall 2013, section 2.6
    """
    freedom = expected_dof + dof
    return (expected_dof * expected + squares) / freedom, freedom
