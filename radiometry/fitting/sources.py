"""Points of a calibration curve and the sources of their errors, with the points that share each."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radiometry.fitting.gls import Component, Vector, shared_structure
from radiometry.fitting.models import LinearModel

READING = "meter repeatability"
SCATTER = "scatter between frames"


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
    f_number_u_rel, time_u_rel : float
        Relative standard uncertainties of f-number and exposure time.
    repeatability_u_rel : float or None
        Relative standard uncertainty of one meter reading; None if it is estimated
        from the scatter between scenes.
    lens_shares : ndarray of float64
        Relative illumination V by which the signals were divided, 1 if vignetting
        is not corrected, (n,). Their noise, and the dark signal's error, are
        divided by it too.
    lens_u_rel : ndarray of float64
        u(V) / V, shared within an f-number, (n,).
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
    f_number_u_rel: float
    time_u_rel: float
    repeatability_u_rel: float | None
    lens_shares: Vector
    lens_u_rel: Vector
    scatter_u_rel: float | None = None

    def take(
        self, keep: NDArray[np.bool_], *, repeatability_u_rel: float | None, scatter_u_rel: float
    ) -> "Curve":
        """Return some of the points, with repeatability and scatter now known.

        Parameters
        ----------
        keep : ndarray of bool
            True for the points to keep, (n,).
        repeatability_u_rel : float or None
            Relative standard uncertainty of one meter reading.
        scatter_u_rel : float
            Relative scatter between frames.

        Returns
        -------
        Curve
            The points that are kept, in the same order.
        """
        chosen = np.flatnonzero(keep)
        return Curve(
            rhs=self.rhs[keep],
            signal_dn=self.signal_dn[keep],
            signal_u_dn=self.signal_u_dn[keep],
            scenes=tuple(self.scenes[i] for i in chosen),
            f_numbers=tuple(self.f_numbers[i] for i in chosen),
            times_s=tuple(self.times_s[i] for i in chosen),
            readings=self.readings[keep],
            dark_u_dn=self.dark_u_dn,
            dark_dof=self.dark_dof,
            f_number_u_rel=self.f_number_u_rel,
            time_u_rel=self.time_u_rel,
            repeatability_u_rel=repeatability_u_rel,
            lens_shares=self.lens_shares[keep],
            lens_u_rel=self.lens_u_rel[keep],
            scatter_u_rel=scatter_u_rel,
        )


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
        return [Component(source="scatter", kind="A", structure=np.eye(n), variance=spread, dof=n - 2)]
    reading = linear.per_relative_x / np.sqrt(curve.readings)
    given = curve.repeatability_u_rel
    by_dark = linear.per_dn / curve.lens_shares
    return [
        Component(
            source="signal noise",
            kind="A",
            structure=np.diag((linear.per_dn * curve.signal_u_dn) ** 2),
            variance=1.0,
        ),
        Component(
            source="dark signal",
            kind="A" if math.isfinite(curve.dark_dof) else "B",
            structure=np.outer(by_dark, by_dark),
            variance=curve.dark_u_dn**2,
            dof=curve.dark_dof,
        ),
        Component(
            source=READING,
            kind="A" if given is None else "B",
            structure=shared_structure(curve.scenes, reading),
            variance=None if given is None else given**2,
        ),
        _relative("f-number", curve.f_numbers, 2 * linear.per_relative_x, curve.f_number_u_rel),
        _relative("exposure time", curve.times_s, linear.per_relative_x, curve.time_u_rel),
        *_of_lens(curve),
        *_of_frames(curve, linear, scattered=scattered),
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
            structure=np.diag(linear.per_relative_x**2),
            variance=None if given is None else given**2,
        )
    ]


def _of_lens(curve: Curve) -> list[Component]:
    """Return the error of V; the response is ln N, so the relative error of V is its change."""
    if not np.any(curve.lens_u_rel):
        return []
    return [
        Component(
            source="vignetting",
            kind="B",
            structure=shared_structure(curve.f_numbers, curve.lens_u_rel),
            variance=1.0,
            common=len(set(curve.f_numbers)) == 1,
        )
    ]


def _relative(source: str, labels: Sequence[float], sensitivity: Vector, u_rel: float) -> Component:
    return Component(
        source=source,
        kind="B",
        structure=shared_structure(labels, sensitivity),
        variance=u_rel**2,
        common=len(set(labels)) == 1,
    )


def _ordinary_variance(linear: LinearModel) -> float:
    """Return the residual variance of ordinary least squares, above 0 also for points on a line."""
    _, p = linear.design.shape
    theta = np.linalg.lstsq(linear.design, linear.response, rcond=None)[0]
    residual = linear.response - linear.design @ theta
    smallest = (math.ulp(1.0) * float(np.max(np.abs(linear.response)))) ** 2
    return max(float(residual @ residual) / float(len(residual) - p), smallest)
