"""Points of a calibration curve and the sources of their errors, with the points that share each."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radiometry.fitting.components import Component, Vector, index_labels
from radiometry.fitting.models import LinearModel

READING = "meter repeatability"
DARK_CURRENT = "dark current"
LAMP = "lamp drift"
F_NUMBER = "f-number"
TIME = "exposure time"
FLICKER = "flicker"

TAIL_DOF = 4.0
"""Degrees of freedom of Student's t, which a robust fit takes the scatter between frames to follow."""

TAIL_FACTOR = (TAIL_DOF + 3.0) / (TAIL_DOF + 1.0)
"""Variance of a location under that t, relative to what its weights alone state (Fisher information)."""

IMPLAUSIBLE_SCATTER_REL = 0.05
"""Scatter between readings or frames of one surface beyond which something else than a meter or a shutter
is at work: meters repeat to 1 %, shutters and apertures to 2 %."""
SCATTER = "scatter between frames"

# what rounding leaves of a flicker over whole periods
_WHOLE_PERIODS_REL = 1e-9


@dataclass(frozen=True, kw_only=True)
class Curve:
    """Points of one curve, n in all, and the uncertainties that the caller knows.

    Attributes
    ----------
    rhs : ndarray of float64
        Right-hand side X = t S L / f^2, (n,).
    signal_dn : ndarray of float64
        Signal N above dark, above 0 [DN], (n,).
    signal_u_dn : ndarray of float64
        Standard uncertainty of each point alone, above 0 [DN], (n,).
    scenes : tuple of str
        Label of each point; points with the same label share one error.
    f_numbers, times_s : tuple of float
        Labels of each point, used in the same way.
    readings : ndarray of int64
        Number of meter readings averaged for the point's scene, (n,).
    dark_u_dn, dark_dof : float
        Standard uncertainty of the dark signal that all points share [DN], and its
        degrees of freedom.
    f_number_u_rel : float or None
        Relative standard uncertainty of a nominal f-number; None if it is estimated
        from the scatter between f-numbers.
    time_u_rel : float
        Relative standard uncertainty of the exposure time.
    repeatability_u_rel : float or None
        Relative standard uncertainty of one meter reading; None if it is estimated
        from the scatter between scenes.
    lens_shares : ndarray of float64
        Relative illumination V by which the signals were divided, 1 if vignetting
        is not corrected, (n,). Their noise, and the dark signal's error, are
        divided by it too.
    lens_u_rel : ndarray of float64
        u(V) / V, shared within an f-number, (n,).
    dark_lever_s : ndarray of float64
        Exposure time of each point minus that at which `dark_u_dn` holds [s], (n,).
    dark_rate_u_dn_per_s : float, default: 0.0
        Standard uncertainty of the rate at which the dark signal grows [DN/s].
    dark_rate_shift_dn_per_s : float, default: 0.0
        What was subtracted from `signal_dn` per second of lever beyond the rate's
        expectation [DN/s].
    dark_rate_measured : bool, default: False
        True if dark frames determine that rate, with `dark_dof`; False if its
        uncertainty is a plausible size.
    lamp_u_rel : ndarray of float64
        Relative standard uncertainty of the lamp's change from the reading to each
        point, signed, (n,).
    lamp_labels : tuple of str
        Label of each point for that error.
    lamp_level_u_rel : ndarray of float64
        Relative standard uncertainty of an independent change of the lamp that all
        points share, (n,).
    scatter_weights : ndarray of float64
        Weight of each point; its scatter has the variance u_s^2 / weight, (n,).
    flicker_u_rel : ndarray of float64 or None, default: None
        Relative standard uncertainty of each point's light by flicker of a random phase, (n,).
    scatter_u_rel : float or None, default: None
        Relative scatter of a frame against the next at the same settings, by
        shutter, aperture and lamp. None if it is estimated from the scatter where
        the other sources do not explain it.
    """

    rhs: Vector
    signal_dn: Vector
    signal_u_dn: Vector
    scenes: tuple[str, ...]
    f_numbers: tuple[float, ...]
    times_s: tuple[float, ...]
    readings: NDArray[np.int64]
    dark_u_dn: float
    dark_dof: float
    f_number_u_rel: float | None
    time_u_rel: float
    repeatability_u_rel: float | None
    lens_shares: Vector
    lens_u_rel: Vector
    dark_lever_s: Vector
    lamp_u_rel: Vector
    lamp_labels: tuple[str, ...]
    lamp_level_u_rel: Vector
    scatter_weights: Vector
    dark_rate_u_dn_per_s: float = 0.0
    dark_rate_shift_dn_per_s: float = 0.0
    dark_rate_measured: bool = False
    flicker_u_rel: Vector | None = None
    scatter_u_rel: float | None = None


def list_sources(curve: Curve, linear: LinearModel, *, model: str, scattered: bool) -> list[Component]:
    """List the sources of error with their structure in the units of the response.

    Parameters
    ----------
    curve : Curve
        Points of the curve.
    linear : LinearModel
        The model as a linear problem.
    model : str
        Name of the model.
    scattered : bool
        True to include the scatter between frames as a variance to estimate.

    Returns
    -------
    list of Component
        One component per source.
    """
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
