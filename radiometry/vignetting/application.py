"""Application of a fitted falloff: V anywhere in the frame, and between f-numbers."""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected, shared
from radiometry.frame.roi import Window
from radiometry.vignetting.curve import Array, evaluate_slopes, propagate
from radiometry.vignetting.results import Coefficient

Slopes = NDArray[np.float64]

GREENS = ("G1", "G2")
BAND_ROWS = 256


@dataclass(frozen=True)
class Share:
    """V at some places and its standard uncertainty, arrays of one shape; a signal divided by V is corrected.

    Attributes
    ----------
    share : ndarray of float64
        V at each place.
    standard_uncertainty : ndarray of float64
        Standard uncertainty of V.
    """

    share: Array
    standard_uncertainty: Array

    @property
    def gain(self) -> Array:
        """1 / V."""
        return np.asarray(1.0 / self.share)


def evaluate(
    coefficients: Sequence[Coefficient], row_px: Array, col_px: Array, *, channel: str, f_number: float
) -> Share:
    """Compute V of a channel at places of the frame, at an f-number within the range of the flats.

    Parameters
    ----------
    coefficients : sequence of Coefficient
        Coefficients of one version.
    row_px, col_px : ndarray of float64
        Rows and columns of pixel centres [px], in shapes that broadcast together.
    channel : str
        Name of the channel.
    f_number : float
        F-number.

    Returns
    -------
    Share
        V and its standard uncertainty at each place.

    Raises
    ------
    InputRejected
        `vignetting_not_calibrated` for another channel, or outside the range.

    Notes
    -----
    At an f-number of the flats::

        V = 1 + k1 r^2 + k2 r^4 + k3 r^6,   u(V)^2 = J C J' + (model_u_rel V)^2

    Between two f-numbers a and b, V is interpolated linearly in log2 of the f-number::

        V = (1 - w) V_a + w V_b,  w = log2(N / N_a) / log2(N_b / N_a)
        u(V)^2 = (1 - w)^2 u(V_a)^2 + w^2 u(V_b)^2 + (4 w (1 - w) (V_b - V_a) / (2 sqrt 3))^2

    The last term is included because the true value may lie anywhere between the neighbours: a rectangular
    distribution that closes at both.
    """
    ends = []
    for coefficient, weight in bracket(coefficients, channel=channel, f_number=f_number):
        value, slopes = evaluate_one(coefficient, np.asarray(row_px), np.asarray(col_px))
        ends.append((weight, value, _total_u(coefficient, value, slopes)))
    return _interpolate(ends)


def bracket(
    coefficients: Sequence[Coefficient], *, channel: str, f_number: float
) -> tuple[tuple[Coefficient, float], ...]:
    """Return the coefficients next to an f-number with their weights.

    Parameters
    ----------
    coefficients : sequence of Coefficient
        Coefficients of one version.
    channel : str
        Name of the channel.
    f_number : float
        F-number.

    Returns
    -------
    tuple of tuple of (Coefficient, float)
        One coefficient where the f-number was calibrated, else two.

    Raises
    ------
    InputRejected
        `vignetting_not_calibrated` for another channel, or outside the range.
    """
    own = sorted((each for each in coefficients if each.channel == channel), key=lambda each: each.f_number)
    if not own:
        known = ", ".join(dict.fromkeys(each.channel for each in coefficients)) or "none"
        raise InputRejected(
            shared.VIGNETTING_NOT_CALIBRATED,
            f"The vignetting calibration has no channel {channel}; it has {known}. Calibrate with flats of "
            "the same kind of frame.",
        )
    if not own[0].f_number <= f_number <= own[-1].f_number:
        raise InputRejected(
            shared.VIGNETTING_NOT_CALIBRATED,
            f"f/{f_number:g} is outside the calibrated range, f/{own[0].f_number:g} to "
            f"f/{own[-1].f_number:g}: nothing is extrapolated. Take flats at f/{f_number:g}.",
        )
    for each in own:
        if each.f_number == f_number:
            return ((each, 1.0),)
    lower, higher = next(
        pair for pair in itertools.pairwise(own) if pair[0].f_number < f_number < pair[1].f_number
    )
    weight = math.log2(f_number / lower.f_number) / math.log2(higher.f_number / lower.f_number)
    return (lower, 1.0 - weight), (higher, weight)


def require_format(coefficients: Sequence[Coefficient], *, height_px: int, width_px: int) -> None:
    """Check that frames have the size of the calibration: another crop or binning has another centre.

    Parameters
    ----------
    coefficients : sequence of Coefficient
        Coefficients of one version.
    height_px, width_px : int
        Size of the frames [px].

    Raises
    ------
    InputRejected
        `vignetting_not_calibrated` if the size differs.
    """
    sizes = {(each.height_px, each.width_px) for each in coefficients}
    if sizes != {(height_px, width_px)}:
        known = ", ".join(f"{width} x {height}" for height, width in sorted(sizes)) or "no"
        raise InputRejected(
            shared.VIGNETTING_NOT_CALIBRATED,
            f"The frame is {width_px} x {height_px} pixels, the vignetting was calibrated with {known}: "
            "another crop or binning. Set the camera as for the flats.",
        )


def select_channels(coefficients: Sequence[Coefficient], *, signal: str) -> tuple[str, ...]:
    """Return the channels whose mean a signal is: both greens for "green", all for "grey".

    Parameters
    ----------
    coefficients : sequence of Coefficient
        Coefficients of one version.
    signal : str
        Name of the signal.

    Returns
    -------
    tuple of str
        Names of channels; all channels if the calibration lacks the requested colour
        (grey, a single band).
    """
    channels = tuple(dict.fromkeys(each.channel for each in coefficients))
    greens = tuple(channel for channel in channels if channel in (*GREENS, "G"))
    return greens if signal == "green" and greens else channels


def list_windows(height_px: int, width_px: int) -> Iterator[Window]:
    """Return the bands of rows of a frame, so that a whole map needs little memory.

    Parameters
    ----------
    height_px, width_px : int
        Size of the frame [px].
    """
    for row0 in range(0, height_px, BAND_ROWS):
        yield Window(row0=row0, col0=0, height=min(BAND_ROWS, height_px - row0), width=width_px)


def evaluate_one(coefficient: Coefficient, row_px: Array, col_px: Array) -> tuple[Array, Slopes]:
    """Compute V of one f-number and channel, and its derivatives by each of its parameters.

    Parameters
    ----------
    coefficient : Coefficient
        Falloff of one f-number and channel.
    row_px, col_px : ndarray of float64
        Rows and columns [px], in shapes that broadcast together.

    Returns
    -------
    tuple of ndarray of float64
        V, and its derivatives.
    """
    return evaluate_slopes(
        row_px, col_px, coefficient.k, centre_px=coefficient.centre_px, radius_px=coefficient.radius_px
    )


def _total_u(coefficient: Coefficient, value: Array, slopes: Slopes) -> Array:
    of_curve = propagate(slopes, np.array(coefficient.covariance))
    return np.asarray(np.hypot(of_curve, coefficient.model_u_rel * value))


def _interpolate(ends: Sequence[tuple[float, Array, Array]]) -> Share:
    value = np.sum([weight * share for weight, share, _ in ends], axis=0)
    variance = np.sum([(weight * u) ** 2 for weight, _, u in ends], axis=0)
    if len(ends) == 2:
        variance = variance + (spread_between(ends[1][0]) * (ends[1][1] - ends[0][1])) ** 2
    return Share(share=np.asarray(value), standard_uncertainty=np.asarray(np.sqrt(variance)))


def spread_between(weight: float) -> float:
    """Return the standard uncertainty between two f-numbers, as a multiple of the difference of their V."""
    return 4.0 * weight * (1.0 - weight) / (2.0 * math.sqrt(3.0))
