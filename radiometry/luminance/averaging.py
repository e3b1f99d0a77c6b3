"""Several frames of one scene as one: mean signals, their noise, and their scatter beyond it."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from radiometry.findings import Raised
from radiometry.fitting.repeats import shows_scatter
from radiometry.frame.statistics import Signal
from radiometry.luminance import codes
from radiometry.luminance.maps import Sums

SCATTER = "scatter between repeats"

_COVERAGE = 0.95
_FLAG_LEVEL = 0.99
_WORTH_NAMING_REL = 0.01

Values = NDArray[np.float64]


def average_signals(
    signals: Sequence[Signal], *, dark_signal_dn: float, drift_rel: Values | None = None
) -> tuple[Signal, float]:
    """Average the signals of one region in repeated frames.

    Parameters
    ----------
    signals : sequence of Signal
        Signal of the region in each frame.
    dark_signal_dn : float
        Dark signal D [DN].
    drift_rel : ndarray of float64 or None, default: None
        Relative deviation of each frame's light that all regions share, which is
        not counted as scatter of this one.

    Returns
    -------
    tuple[Signal, float]
        Mean signal with its noise, and the standard uncertainty of the mean by
        scatter beyond noise [DN].

    Notes
    -----
    Noise averages, the error of rounding does not: it is the same in frames that
    are alike. With u_i the noise of each frame and r_i the error of rounding in it::

        u^2 = sum(u_i^2) / n^2 + mean(r_i^2)

    For the scatter see `evaluate_scatter`.
    """
    count = len(signals)
    if count == 1:
        return signals[0], 0.0
    rounding = np.array([signal.rounding_dn**2 for signal in signals])
    noise = np.array([signal.standard_uncertainty_dn**2 for signal in signals]) - rounding
    values = np.array([signal.value_dn for signal in signals])
    steady = values - dark_signal_dn
    if drift_rel is not None:
        steady /= 1.0 + drift_rel
    mean = replace(
        signals[0],
        value_dn=float(values.mean()),
        standard_uncertainty_dn=math.sqrt(float(noise.sum()) / count**2 + float(rounding.mean())),
        saturated_share=max(signal.saturated_share for signal in signals),
    )
    return mean, evaluate_scatter(steady, noise)


def add_signal(summed: tuple[Sums, int] | None, signal: tuple[Sums, int]) -> tuple[Sums, int]:
    """Add the signal of each pixel of one more frame.

    Parameters
    ----------
    summed : tuple[Sums, int] or None
        Sum so far as from `maps.sum_signal`; None before the first frame.
    signal : tuple[Sums, int]
        Signal of the frame.

    Returns
    -------
    tuple[Sums, int]
        Sum with the parts of one DN that it has now.
    """
    if summed is None:
        return signal
    return summed[0].astype(np.uint32, copy=False) + signal[0], summed[1] + signal[1]


def evaluate_scatter(values: Values, noise_variances: Values) -> float:
    """Evaluate the uncertainty of a mean by what its values scatter beyond their noise.

    Parameters
    ----------
    values : ndarray of float64
        Repeated values, (n,), n >= 2.
    noise_variances : ndarray of float64
        Variance of the noise of each value, (n,).

    Returns
    -------
    float
        Standard uncertainty of the mean by the excess; 0 if the values scatter no
        more than their noise.

    Notes
    -----
    With s^2 the variance of the values and w the mean variance of their noise, the
    whole variance of the mean is [1]_::

        max(w, s^2) / n          if (n - 1) s^2 / w is within a quantile of chi^2
        (s t / 1.96)^2 / n       otherwise, with Student's t for n - 1 degrees of freedom

    The excess is this less w / n. The second form gives an interval of 1.96
    standard uncertainties the coverage of Student's interval: the scatter of few
    frames is itself hardly known. For the quantile see `repeats.shows_scatter`.

    References
    ----------
    .. [1] JCGM 100:2008, 4.2 and G.3, doi:10.59161/JCGM100-2008E
    """
    count = values.size
    observed, expected = float(values.var(ddof=1)), float(noise_variances.mean())
    if shows_scatter(observed, expected, count):
        observed *= (float(scipy.special.stdtrit(count - 1, (1 + _COVERAGE) / 2)) / 1.96) ** 2
    return math.sqrt(max(0.0, observed - expected) / count)


def find_drift(cells: Sequence[Sequence[Signal]], *, dark_signal_dn: float) -> tuple[Values, float]:
    """Find how the light of all cells together differs between repeated frames.

    Parameters
    ----------
    cells : sequence of sequence of Signal
        For each cell its signal in each frame.
    dark_signal_dn : float
        Dark signal D [DN].

    Returns
    -------
    tuple[ndarray of float64, float]
        Relative deviation of each frame, and the relative standard uncertainty of
        the mean by it, which all cells share.
    """
    values = np.array([[signal.value_dn for signal in cell] for cell in cells]) - dark_signal_dn
    own = [[signal.standard_uncertainty_dn**2 - signal.rounding_dn**2 for signal in cell] for cell in cells]
    mean = float(values.mean())
    if mean <= 0.0:
        return np.zeros(values.shape[1]), 0.0
    totals = values.mean(axis=0) / mean
    noise = np.array(own).sum(axis=0) / (len(cells) * mean) ** 2
    return totals - 1.0, evaluate_scatter(totals, noise)


def flag_scatter(signals: Sequence[Signal], *, dark_signal_dn: float) -> tuple[Raised, ...]:
    """Return the flag `frames_disagree` if repeated frames differ beyond noise, and by 1 % or more.

    Parameters
    ----------
    signals : sequence of Signal
        Signal of the region in each frame.
    dark_signal_dn : float
        Dark signal D [DN].

    Returns
    -------
    tuple of Raised
        The flag, or nothing.
    """
    count = len(signals)
    if count == 1:
        return ()
    values = np.array([signal.value_dn for signal in signals]) - dark_signal_dn
    mean, observed = abs(float(values.mean())), float(values.var(ddof=1))
    noise = float(np.mean([signal.standard_uncertainty_dn**2 for signal in signals]))
    largest_noise = noise * float(scipy.special.chdtri(count - 1, 1.0 - _FLAG_LEVEL)) / (count - 1)
    if observed < max((_WORTH_NAMING_REL * mean) ** 2, largest_noise):
        return ()
    detail = (
        f"The signals above dark of {count} frames go from {values.min():.4g} to {values.max():.4g} DN, "
        f"{(values.max() - values.min()) / (mean or 1.0):.1%} of their mean."
    )
    return (codes.FRAMES_DISAGREE.at("", detail),)
