"""Noise of a few tenths of a step: how often the numbers of a pixel change from frame to frame."""

import math
from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

Image = NDArray[np.float64]
Counts = NDArray[np.int64]

ROUNDING_DOMINATES = 0.24
"""Below this variance, in squared steps, rounding hides most of the noise (EMVA 1288, 6.6)."""

_RANGE = (0.02, 0.9)
"""Where noises are looked for, in steps; the first stands for none."""

_SPREAD_HIDES_PLACE = 0.5
"""Pixels whose levels spread by this many steps lie anywhere between two numbers."""

_MOST_NUMBERS = 12
_NODES = np.linspace(-4.0, 4.0, 121)
_WEIGHTS = np.exp(-(_NODES**2) / 2.0) / np.exp(-(_NODES**2) / 2.0).sum()
_NORMAL_95 = 1.959964
_BOUND_95 = 2.241403
"""Of 97.5 %: where the spread of the pixels is at its bound 0, the usual interval covers too little."""
_LEAST_LOG_SPREAD = -6.0
_FEW_CHANGES = 4.0
"""Of the limit's factor 1 + 4 / (n + 1), where n pixels change their number.

Wilks' limit holds for many counts; its error falls as 1 / n (Bartlett), and n + 1 keeps n = 0 finite. 4 is
chosen by simulation, at 7 and 45 changes of 4096. From 400 changes on the interval is at most 0.5 % longer,
and above `ROUNDING_DOMINATES` no interval of counts is used.
"""


def count_changes(images: Image) -> Counts:
    """Count the pairs of numbers that pixels have in two frames, of the disjoint pairs of a stack.

    Parameters
    ----------
    images : ndarray of float64
        Numbers of the frames in steps, (frame, row, col); at least two frames.

    Returns
    -------
    ndarray of int64
        Number of pixels, (first, second), from the lowest number on.
    """
    steps = (images - images.min()).round().astype(np.int64)
    size = int(steps.max()) + 1
    pairs = steps[0 : 2 * (len(steps) // 2) : 2] * size + steps[1 : 2 * (len(steps) // 2) : 2]
    return np.bincount(pairs.ravel(), minlength=size**2).reshape(size, size)


def estimate_rounded_noise(changes: Counts, *, u_rel: float, spread: float) -> tuple[float, float]:
    """Estimate a noise from the numbers that remain of it after rounding.

    Parameters
    ----------
    changes : ndarray of int64
        Number of pixels with each pair of numbers, as `count_changes` returns it.
    u_rel : float
        How many times larger the error is than if all pixels were independent.
    spread : float
        Standard deviation of the pixels' levels, in steps.

    Returns
    -------
    tuple of float
        Noise and its standard uncertainty, in steps: the middle of the interval that holds it with a
        probability of 95 %, and half of its length over 1.96.

    Notes
    -----
    A pixel of level m gives the number i in a frame with the probability P_i(m) = F((i + 1/2 - m) / s) -
    F((i - 1/2 - m) / s), F the normal distribution. Levels are normal about a mean that may differ between
    the two frames, so the pair (i, j) has the probability E[P_i(m) P_j(m + d)]. The likelihood is maximised
    over mean, d and spread of the levels for every s; the interval is where its logarithm has fallen by less
    than 1.92 (Wilks [1]_), or than 2.51 where levels without spread are within 1.92; times 1 + 4 / (n + 1)
    where n pixels change their number. Where levels spread over half a step and more, all places between two
    numbers are alike, and with D a normal difference of standard deviation s sqrt(2) and {} the fraction::

        variance of the numbers = s^2 + E[{D} (1 - {D})] / 2

    which is solved for s.

    References
    ----------
    .. [1] S. S. Wilks, Ann. Math. Stat. 9, 60 (1938), doi:10.1214/aoms/1177732360
    """
    if spread > _SPREAD_HIDES_PLACE or changes.shape[0] > _MOST_NUMBERS:
        low, high = _invert(changes, u_rel=u_rel)
    else:
        low, high = _profile(changes, u_rel=u_rel)
    return (low + high) / 2.0, (high - low) / 2.0 / _NORMAL_95


def estimate_rounding_error(noise: float) -> float:
    """Return the standard uncertainty of a variance, because rounding adds 1/12 only on average.

    Notes
    -----
    The first harmonic over the place between two numbers is (4 s^2 + 1 / pi^2) exp(-2 pi^2 s^2) cos(2 pi x).
    """
    size = (4.0 * noise**2 + 1.0 / math.pi**2) * math.exp(-2.0 * (math.pi * noise) ** 2)
    return size / math.sqrt(2.0)


def _profile(changes: Counts, *, u_rel: float) -> tuple[float, float]:
    """Return the ends of the interval of the likelihood."""
    numbers, total = np.arange(changes.shape[0]), changes.sum()
    first, second = (float(numbers @ changes.sum(axis=axis)) / total for axis in (1, 0))

    def fit(noise: float, start: Image) -> tuple[float, Image]:
        simplex = start + np.vstack([np.zeros(3), np.diag([0.1, 0.02, 0.7])])
        options = {"initial_simplex": simplex, "maxiter": 200, "xatol": 1e-4, "fatol": 1e-3}
        found = scipy.optimize.minimize(
            _deviance, start, (changes, noise), method="Nelder-Mead", options=options
        )
        return float(found.fun), found.x

    starts = [np.array([first, second - first, math.log(spread)]) for spread in (0.03, 0.3)]
    tried = [(*fit(size, start), size) for size in np.geomspace(*_RANGE, 8) for start in starts]
    _, near, size = min(tried, key=lambda each: each[0])

    def profile(log_size: float) -> float:
        return fit(math.exp(log_size), near)[0]

    width = math.log(_RANGE[1] / _RANGE[0]) / 7.0
    around = (math.log(size) - width, math.log(size) + width)
    best = scipy.optimize.minimize_scalar(profile, bounds=around, method="bounded", options={"xatol": 1e-3})
    least = min(float(best.fun), min(tried, key=lambda each: each[0])[0])
    even = scipy.optimize.minimize(
        lambda x: _deviance((*x[:2], _LEAST_LOG_SPREAD + 1.0), changes, math.exp(x[2])),
        np.array([*near[:2], float(best.x)]),
        method="Nelder-Mead",
        options={"maxiter": 200, "xatol": 1e-4, "fatol": 1e-3},
    )
    alike = float(even.fun) - least < (u_rel * _NORMAL_95) ** 2
    changed = int(total - np.trace(changes))
    few = 1.0 + _FEW_CHANGES / (changed + 1.0)
    limit = least + (u_rel * (_BOUND_95 if alike else _NORMAL_95)) ** 2 * few

    def cross(side: float, end: float) -> float:
        inner, step = float(best.x), 0.02 * side
        while side * (end - inner - step) > 0.0:
            if profile(inner + step) > limit:
                outer = inner + step
                return math.exp(scipy.optimize.brentq(lambda x: profile(x) - limit, inner, outer, xtol=1e-3))
            inner, step = inner + step, 1.6 * step
        return 0.0 if side < 0.0 else math.exp(end)

    return cross(-1.0, math.log(_RANGE[0])), cross(1.0, math.log(_RANGE[1]))


def _deviance(nuisance: Sequence[float], changes: Counts, noise: float) -> float:
    """Return -2 times the logarithm of the likelihood."""
    level, drift, log_spread = nuisance
    if not _LEAST_LOG_SPREAD < log_spread < 1.0:
        return 1e12
    levels = level + math.exp(log_spread) * _NODES
    edges = np.arange(changes.shape[0] + 1) - 0.5
    first, second = (
        np.diff(scipy.special.ndtr((edges[None, :] - each[:, None]) / noise), axis=1)
        for each in (levels, levels + drift)
    )
    probability = (first * _WEIGHTS[:, None]).T @ second
    return float(-2.0 * np.sum(changes * np.log(np.maximum(probability, 1e-300))))


def _invert(changes: Counts, *, u_rel: float) -> tuple[float, float]:
    """Return the ends of the interval where every place between two numbers is equally likely."""
    number = np.arange(changes.shape[0])
    differences = (number[:, None] - number[None, :]).astype(np.float64)
    total = float(changes.sum())
    mean = float(np.sum(changes * differences)) / total
    squares = (differences - mean) ** 2 / 2.0
    variance = float(np.sum(changes * squares)) / total
    error = u_rel * math.sqrt(float(np.sum(changes * (squares - variance) ** 2))) / total
    low, high = (
        _solve(max(0.0, variance + side * _NORMAL_95 * max(error, 1.0 / total))) for side in (-1.0, 1.0)
    )
    return low, high


def _solve(variance: float) -> float:
    return float(
        scipy.optimize.brentq(lambda noise: _spread_out(noise) - variance, 0.0, math.sqrt(variance) + 1e-9)
    )


def _spread_out(noise: float) -> float:
    """Return the variance of rounded numbers of a noise whose levels lie anywhere."""
    part = np.mod(math.sqrt(2.0) * noise * _FINE, 1.0)
    return noise**2 + float(_FINE_WEIGHTS @ (part * (1.0 - part))) / 2.0


_FINE = np.linspace(-6.0, 6.0, 2401)
_FINE_WEIGHTS = np.exp(-(_FINE**2) / 2.0) / np.exp(-(_FINE**2) / 2.0).sum()
