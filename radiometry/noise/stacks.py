"""Stacks of equal frames: mean, temporal noise and pattern of a channel, without what rounding adds."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np
import scipy
from numpy.typing import NDArray

from radiometry.frame.packing import unpack
from radiometry.noise.results import DARK, ChannelBlock, FrameRow
from radiometry.records import Record

Image = NDArray[np.float64]
Counts = NDArray[np.int64]

# Below this variance, in squared steps, rounding hides most of the noise (EMVA 1288, 6.6)
ROUNDING_DOMINATES = 0.24

_RANGE = (0.02, 0.9)  # Where noises are looked for, in steps; the first stands for none

_SPREAD_HIDES_PLACE = 0.5  # Pixels whose levels spread by this many steps lie anywhere between two numbers

_MOST_NUMBERS = 12
_NODES = np.linspace(-4.0, 4.0, 121)
_WEIGHTS = np.exp(-(_NODES**2) / 2.0) / np.exp(-(_NODES**2) / 2.0).sum()
_NORMAL_95 = 1.959964
# Of 97.5 %: where the spread of the pixels is at its bound 0, the usual interval covers too little
_BOUND_95 = 2.241403
_LEAST_LOG_SPREAD = -6.0
_FEW_CHANGES = 4.0
"""Of the limit's factor 1 + 4 / (n + 1), where n pixels change their number.

Wilks' limit holds for many counts; its error falls as 1 / n (Bartlett), and n + 1 keeps n = 0 finite. 4 is
chosen by simulation, at 7 and 45 changes of 4096. From 400 changes on the interval is at most 0.5 % longer,
and above `ROUNDING_DOMINATES` no interval of counts is used.
"""


def count_changes(images: Image) -> Counts:
    """Count the pairs of numbers that pixels have in two frames, of the disjoint pairs of a stack."""
    steps = (images - images.min()).round().astype(np.int64)
    size = int(steps.max()) + 1
    pairs = steps[0 : 2 * (len(steps) // 2) : 2] * size + steps[1 : 2 * (len(steps) // 2) : 2]
    return np.bincount(pairs.ravel(), minlength=size**2).reshape(size, size)


def estimate_rounded_noise(changes: Counts, *, u_rel: float, spread: float) -> tuple[float, float]:
    """Estimate a noise from the numbers that remain of it after rounding.

    A pixel of level m gives the number i in a frame with the probability P_i(m) = F((i + 1/2 - m) / s) -
    F((i - 1/2 - m) / s), F the normal distribution. Levels are normal about a mean that may differ between
    the two frames, so the pair (i, j) has the probability E[P_i(m) P_j(m + d)]. The likelihood is maximised
    over mean, d and spread of the levels for every s; the interval is where its logarithm has fallen by less
    than 1.92 (Wilks [1]), or than 2.51 where levels without spread are within 1.92; times 1 + 4 / (n + 1)
    where n pixels change their number. Where levels spread over half a step and more, all places between two
    numbers are alike, and with D a normal difference of standard deviation s sqrt(2) and {} the fraction::

        variance of the numbers = s^2 + E[{D} (1 - {D})] / 2

    which is solved for s.

    [1] S. S. Wilks, Ann. Math. Stat. 9, 60 (1938), doi:10.1214/aoms/1177732360
    """
    if spread > _SPREAD_HIDES_PLACE or changes.shape[0] > _MOST_NUMBERS:
        low, high = _invert(changes, u_rel=u_rel)
    else:
        low, high = _profile(changes, u_rel=u_rel)
    return (low + high) / 2.0, (high - low) / 2.0 / _NORMAL_95


def estimate_rounding_error(noise: float) -> float:
    """Return the standard uncertainty of a variance, because rounding adds 1/12 only on average.

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


_TREND_TERMS = 6
# A tail of one in a thousand lies 3.1 standard deviations out: cutting it off takes 1 % of the variance
CLIPPED_SHARE = 0.001


@dataclass(frozen=True, order=True)
class Setting:
    """Setting that the frames of a stack share; dark frames differ by ISO and time alone."""

    role: str
    scene: str
    iso: float
    f_number: float
    exposure_time_s: float
    channel: str
    place: tuple[int, int, int]  # Row, column and side of the block


class Variance(Record):
    """Variance [DN^2] with its standard uncertainty."""

    value_dn2: float  # Variance and its standard uncertainty [DN^2]
    u_dn2: float
    # Variance of a mean over the samples, relative to that of as many independent ones: rows and columns
    # share noise
    of_mean: float = 1.0

    @property
    def dof(self) -> float:
        """Effective degrees of freedom."""
        return 2.0 * (self.value_dn2 / self.u_dn2) ** 2 if self.u_dn2 else math.inf


class Stack(Record):
    """One channel of the frames of one setting, the same pixels in each."""

    setting: Setting  # Setting that the frames share
    frames: tuple[str, ...]  # Names of the frames, copies left out
    copies: dict[str, str]  # Name of a copy to the name of the frame that it copies
    frame_means_dn: tuple[float, ...]
    samples: int  # Number of samples of one frame
    mean_dn: float
    temporal: Variance | None  # Variance of one pixel from frame to frame; None for a single frame
    pattern: Variance | None  # Spatial variance that every frame repeats; None for a single frame
    # The same without the slow part, which light and lens cause; None for a single frame
    detrended: Variance | None
    drift_rel: float  # Range of the frames' means over their mean above black
    clipped_share: float  # Fraction of samples at or above the white level
    zero_share: float  # Fraction of samples that are 0
    # Step between neighbouring numbers [DN], above 1 where a sensor of fewer bits fills a larger container
    step_dn: float
    black_level_dn: float
    white_level_dn: float
    # Number of pixels with each pair of numbers in two frames, in steps from the lowest, (first, second);
    # None where rounding does not hide the noise
    changes: NDArray[np.int64] | None = field(default=None, compare=False)

    @property
    def clipped(self) -> bool:
        """True if enough samples reach white to cut the noise."""
        return self.clipped_share > CLIPPED_SHARE

    @property
    def mean_variance_dn2(self) -> float:
        """Variance of the mean [DN^2], from the noise of its samples; that of a single frame is not known."""
        if self.temporal is None:
            return 0.0
        return self.temporal.value_dn2 * self.temporal.of_mean / (self.samples * len(self.frames))


def make_stacks(rows: Sequence[FrameRow]) -> tuple[Stack, ...]:
    """Return the frames grouped by setting; the order of the rows does not matter."""
    found: dict[Setting, list[tuple[str, ChannelBlock]]] = {}
    for row in sorted(rows, key=lambda row: row.frame):
        for block in row.features.blocks if row.features and row.exposure else ():
            found.setdefault(_find_setting(row, block), []).append((row.frame, block))
    return tuple(_measure(setting, found[setting]) for setting in sorted(found))


def _find_setting(row: FrameRow, block: ChannelBlock) -> Setting:
    if row.exposure is None:
        raise AssertionError("frames without an exposure are no part of a stack")
    dark = row.role == DARK
    return Setting(
        role=row.role,
        scene="" if dark else row.scene or "",
        iso=row.exposure.iso,
        f_number=0.0 if dark else row.exposure.f_number,
        exposure_time_s=row.exposure.exposure_time_s,
        channel=block.channel,
        place=(block.row0, block.col0, block.samples_dn.shape[0]),
    )


def _measure(setting: Setting, members: Sequence[tuple[str, ChannelBlock]]) -> Stack:
    """Reduce a stack to its mean and variances.

    With m_l the mean of frame l, y_p that of pixel p and m that of all::

        temporal = sum_l sum_p (y_lp - m_l - (y_p - m))^2 / ((L - 1)(n - 1))                          (1)

    For L = 2 this is half of the variance of the difference, its mean removed [1] (eq. 18), so that a lamp
    that changed between the frames has no effect. Rows and columns may share noise, so the sum of squares is
    split into rows, columns and the rest [2], S = S_r + S_c + S_0 with nu_i degrees of freedom each::

        u(variance)^2 = 2 sum (S_i^2 / nu_i) / nu^2

    which is 2 / nu of its square where nothing is shared.

    [1] EMVA Standard 1288, release 3.1
    [2] S. R. Searle, G. Casella, C. E. McCulloch, Variance Components, 4.7, doi:10.1002/9780470316856
    """
    kept, copies = _drop_copies(members)
    images = np.array([image for _, image in kept])
    means = images.mean(axis=(1, 2))
    blocks = [block for _, block in members]
    black = blocks[0].black_level_dn
    average = images.mean(axis=0)
    temporal = _temporal(images, means, average) if len(kept) > 1 else None
    step_dn = _find_step(images)
    rounded = temporal is not None and temporal.value_dn2 < ROUNDING_DOMINATES * step_dn**2
    return Stack(
        setting=setting,
        frames=tuple(name for name, _ in kept),
        copies=copies,
        frame_means_dn=tuple(float(mean) for mean in means),
        samples=average.size,
        mean_dn=float(means.mean()),
        temporal=temporal,
        pattern=_spatial(average, temporal, len(kept), step_dn=step_dn, detrend=False) if temporal else None,
        detrended=_spatial(average, temporal, len(kept), step_dn=step_dn, detrend=True) if temporal else None,
        drift_rel=float(np.ptp(means) / max(1.0, float(means.mean()) - black)),
        clipped_share=max(block.clipped_share for block in blocks),
        zero_share=max(block.zero_share for block in blocks),
        step_dn=step_dn,
        black_level_dn=black,
        white_level_dn=min(block.white_level_dn for block in blocks),
        changes=count_changes(images / step_dn) if rounded else None,
    )


def _drop_copies(
    members: Sequence[tuple[str, ChannelBlock]],
) -> tuple[list[tuple[str, Image]], dict[str, str]]:
    """Leave out frames whose samples are another's: their difference would say that there is no noise.

    Frames of one number throughout, as white ones are, are equal without being copies.
    """
    kept: list[tuple[str, Image]] = []
    first: dict[str, str] = {}
    copies: dict[str, str] = {}
    for name, block in members:
        original = first.setdefault(block.samples_dn.data, name)
        image = unpack(block.samples_dn)
        if original == name or not np.ptp(image):
            kept.append((name, image))
        else:
            copies[name] = original
    return kept, copies


def _temporal(images: Image, means: NDArray[np.float64], average: Image) -> Variance:
    """Return the temporal variance, with what rows and columns share of it."""
    deviations = images - average - (means - means.mean())[:, None, None]
    count, rows, cols = deviations.shape
    squares = _split(deviations)
    dofs = (count - 1) * np.array([rows - 1, cols - 1, (rows - 1) * (cols - 1)])
    value = float(np.sum(deviations**2)) / float(dofs.sum())
    by_row, by_col, rest = (squares / dofs).tolist()
    return Variance(
        value_dn2=value,
        u_dn2=math.sqrt(2.0 * float(np.sum(squares**2 / dofs))) / float(dofs.sum()),
        of_mean=max(1.0, (by_row + by_col - rest) / value) if value > 0.0 else 1.0,
    )


def _split(deviations: Image) -> NDArray[np.float64]:
    """Return the sums of squares of rows, of columns and of the rest, (frame, row, col)."""
    _, rows, cols = deviations.shape
    shared = [cols * np.sum(deviations.mean(axis=2) ** 2), rows * np.sum(deviations.mean(axis=1) ** 2)]
    return np.array([*shared, max(0.0, float(np.sum(deviations**2)) - sum(shared))])


def _spatial(average: Image, temporal: Variance, count: int, *, step_dn: float, detrend: bool) -> Variance:
    """Compute the spatial variance of the mean image without the rest of temporal noise: s^2 - temporal / L.

    The slow part is a quadratic surface: six terms, as many degrees of freedom less. As for temporal noise,
    u(s^2) follows from rows, columns and the rest; that of the rest from its fourth moment, since few hot
    pixels may make most of it. Rounding changes the slope from light to number by 2 exp(-2 pi^2 s^2) cos(...)
    where noise and pattern s [steps] are small.
    """
    values = average - average.mean()
    terms = 1
    if detrend:
        design = _trend(*average.shape)
        values = (values.ravel() - design @ (design.T @ values.ravel())).reshape(average.shape)
        terms = _TREND_TERMS
    dof = average.size - terms
    measured = float(np.sum(values**2)) / dof
    left = temporal.value_dn2 / count
    rows, cols = average.shape
    squares = _split(values[None])
    of_parts = 2.0 * squares**2 / [rows - 1, cols - 1, (rows - 1) * (cols - 1)]
    single = values - values.mean(axis=0) - values.mean(axis=1, keepdims=True)
    of_parts[2] = max(of_parts[2], float(np.sum(single**4)) - squares[2] ** 2 / average.size)
    pattern = max(0.0, measured - left)
    spread = max(0.0, temporal.value_dn2 / step_dn**2 - 1.0 / 12.0) + pattern / step_dn**2
    rounded = 2.0 * math.sqrt(2.0) * math.exp(-2.0 * math.pi**2 * spread) * pattern
    u = math.hypot(math.sqrt(float(of_parts.sum())) / dof, temporal.u_dn2 / count, rounded)
    return Variance(value_dn2=measured - left, u_dn2=u)


@cache
def _trend(rows: int, cols: int) -> NDArray[np.float64]:
    """Return an orthonormal basis of quadratic surfaces, (rows * cols, 6)."""
    row, col = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, cols), indexing="ij")
    surfaces = [np.ones_like(row), row, col, row * row, row * col, col * col]
    basis: NDArray[np.float64] = np.linalg.qr(np.stack([surface.ravel() for surface in surfaces], axis=1))[0]
    return basis


def _find_step(images: Image) -> float:
    values = np.flatnonzero(np.bincount(images.ravel().astype(np.int64)))
    return float(np.gcd.reduce(np.diff(values))) if values.size > 1 else 1.0


def group_by_channel(stacks: Sequence[Stack]) -> dict[tuple[float, str], list[Stack]]:
    def key(stack: Stack) -> tuple[float, str]:
        return stack.setting.iso, stack.setting.channel

    return {name: list(group) for name, group in itertools.groupby(sorted(stacks, key=key), key=key)}
