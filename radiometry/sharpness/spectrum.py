"""The modulation transfer function of an edge's profile."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from radiometry.sharpness.features import CURVE_STEP_CYCLES_PER_PIXEL
from radiometry.sharpness.profile import Profile

Vector = NDArray[np.float64]

NYQUIST_CYCLES_PER_PIXEL = 0.5


def list_frequencies() -> Vector:
    """Return the frequencies of every stored response: 0, 0.01, ..., 1 cycles per pixel."""
    return np.linspace(0.0, 1.0, round(1.0 / CURVE_STEP_CYCLES_PER_PIXEL) + 1)


def compute_mtfs(profiles: Sequence[Profile], *, frequency: Vector) -> Vector:
    """Compute the normalised Fourier modulus of the windowed line spread function of each profile.

    Parameters
    ----------
    profiles : sequence of Profile
        Profiles at the same distances.
    frequency : ndarray of float64
        Frequencies [cycles per pixel], below 2.

    Returns
    -------
    ndarray of float64
        MTF, (profile, frequency).

    Notes
    -----
    After [1]_ and [2]_::

        LSF_k = (e_{k+1} - e_{k-1}) / 2,   v_k = (1 + cos(2 pi k / n)) / 2 (Tukey, alpha 1, about the edge)
        MTF(f) = D(f) |sum_k w_k LSF_k exp(-2 pi i f x_k)| / |sum_k w_k LSF_k|,   w = 1 - (1 - v)^3
        D(f) = a / sin(a), a = 2 pi f h

    The standard's window v averages the spectrum S over neighbouring frequencies, v * S. Two steps of the
    iteration S <- S + (v * S_0 - v * S) undo this; they amount to the window w, which is flat to the sixth
    order about the edge. D undoes the difference over two steps h. There is no factor for the bins' aperture:
    `form_profile` has already removed it, which sfrmat5 does not.

    References
    ----------
    .. [1] ISO 12233:2023 annex D
    .. [2] P. D. Burns, sfrmat5
    """
    first = profiles[0]
    signals = np.array([profile.signal for profile in profiles])
    spread = np.zeros_like(signals)
    spread[:, 1:-1] = (signals[:, 2:] - signals[:, :-2]) / 2.0
    length = first.distance_px.size * first.step_px
    spread *= 1.0 - np.sin(np.pi * first.distance_px / length) ** 6
    waves = np.exp(-2j * np.pi * np.outer(first.distance_px, frequency))
    modulus = np.abs(spread @ waves) / np.abs(spread.sum(axis=1))[:, None]
    return np.asarray(modulus / np.sinc(2.0 * frequency * first.step_px), np.float64)


def find_crossing(
    frequency: Sequence[float] | Vector, response: Sequence[float] | Vector, level: float
) -> float:
    """Find the first frequency at which a response falls below a level, between points by a line.

    Parameters
    ----------
    frequency : sequence of float or ndarray of float64
        Rising frequencies [cycles per pixel].
    response : sequence of float or ndarray of float64
        Response at each frequency.
    level : float
        Level.

    Returns
    -------
    float
        Frequency [cycles per pixel], or NaN.
    """
    below = np.flatnonzero(np.asarray(response) < level)
    if not below.size or below[0] == 0:
        return math.nan
    high = int(below[0])
    low = high - 1
    share = (response[low] - level) / (response[low] - response[high])
    return float(frequency[low] + share * (frequency[high] - frequency[low]))
