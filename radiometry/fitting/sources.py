"""The points of a calibration curve, and the sources of their errors: which points share which."""

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
    """The points of one curve, (n,) each, and the uncertainties that the caller knows.

    ``rhs`` : X = t S L / f^2; ``signal_dn`` : N above dark, > 0; ``signal_u_dn`` : of each point alone, > 0
    ``scenes``, ``f_numbers``, ``times_s`` : labels; points with one label share one error
    ``readings`` : how many meter readings were averaged for the point's scene
    ``dark_u_dn``, ``dark_dof`` : of the dark signal, which all points share
    ``repeatability_u_rel`` : of one meter reading; None: estimated from the scatter between scenes
    ``scatter_u_rel`` : of a frame against the next at the same settings, by shutter, aperture and lamp; None:
        estimated from the scatter, where the other sources do not explain it
    ``lens_shares`` : V, by which the signals were divided, 1 where vignetting is not corrected; so was their
        noise, and so is the dark signal's error; ``lens_u_rel`` : u(V) / V, shared within an f-number
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
        """Give some of the points, with the meter's repeatability and the frames' scatter now known."""
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

    ``scattered`` : with the scatter between frames, if it is to be estimated
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
    """Give the error that a frame has alone: its light was not what its settings and its scene say."""
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
    """Give the error of V; the response is ln N, so that V's relative error is its change."""
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
    """Give the residual variance of ordinary least squares, > 0 also for points on a line."""
    _, p = linear.design.shape
    theta = np.linalg.lstsq(linear.design, linear.response, rcond=None)[0]
    residual = linear.response - linear.design @ theta
    smallest = (math.ulp(1.0) * float(np.max(np.abs(linear.response)))) ** 2
    return max(float(residual @ residual) / float(len(residual) - p), smallest)
