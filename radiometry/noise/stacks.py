"""Stacks of frames of one setting: mean, temporal variance and spatial variance of a channel."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.packing import unpack
from radiometry.noise.blocks import ChannelBlock, FrameRow
from radiometry.noise.rounding import ROUNDING_DOMINATES, count_changes
from radiometry.noise.rows import DARK

Image = NDArray[np.float64]

_TREND_TERMS = 6
CLIPPED_SHARE = 0.001
"""A tail of one in a thousand lies 3.1 standard deviations out: cutting it off takes 1 % of the variance."""


@dataclass(frozen=True, order=True)
class Setting:
    """Setting that the frames of a stack share; dark frames differ by ISO and time alone.

    Attributes
    ----------
    role : str
        Role of the frame.
    scene : str
        Scene of the frame.
    iso : float
        ISO value.
    f_number : float
        F-number.
    exposure_time_s : float
        Exposure time [s].
    channel : str
        Name of the channel.
    place : tuple of int
        Row, column and side of the block.
    """

    role: str
    scene: str
    iso: float
    f_number: float
    exposure_time_s: float
    channel: str
    place: tuple[int, int, int]


@dataclass(frozen=True, kw_only=True)
class Variance:
    """Variance [DN^2] with its standard uncertainty.

    Attributes
    ----------
    value_dn2, u_dn2 : float
        Variance and its standard uncertainty [DN^2].
    of_mean : float, default: 1.0
        Variance of a mean over the samples, relative to that of as many independent ones: rows and columns
        share noise.
    """

    value_dn2: float
    u_dn2: float
    of_mean: float = 1.0

    @property
    def dof(self) -> float:
        """Effective degrees of freedom."""
        return 2.0 * (self.value_dn2 / self.u_dn2) ** 2 if self.u_dn2 else math.inf


@dataclass(frozen=True, kw_only=True)
class Stack:
    """One channel of the frames of one setting, the same pixels in each.

    Attributes
    ----------
    setting : Setting
        Setting that the frames share.
    frames : tuple of str
        Names of the frames, copies left out.
    copies : dict of str to str
        Name of a copy to the name of the frame that it copies.
    frame_means_dn : tuple of float
        Means of the frames [DN].
    samples : int
        Number of samples of one frame.
    mean_dn : float
        Mean of all frames [DN].
    temporal : Variance or None
        Variance of one pixel from frame to frame; None for a single frame.
    pattern : Variance or None
        Spatial variance that every frame repeats; None for a single frame.
    detrended : Variance or None
        The same without the slow part, which light and lens cause; None for a single
        frame.
    drift_rel : float
        Range of the frames' means over their mean above black.
    clipped_share : float
        Fraction of samples at or above the white level.
    zero_share : float
        Fraction of samples that are 0.
    step_dn : float
        Step between neighbouring numbers [DN], above 1 where a sensor of fewer bits
        fills a larger container.
    black_level_dn : float
        Black level [DN].
    white_level_dn : float
        White level [DN].
    changes : ndarray of int64 or None
        Number of pixels with each pair of numbers in two frames, in steps from the lowest, (first, second);
        None where rounding does not hide the noise.
    """

    setting: Setting
    frames: tuple[str, ...]
    copies: dict[str, str]
    frame_means_dn: tuple[float, ...]
    samples: int
    mean_dn: float
    temporal: Variance | None
    pattern: Variance | None
    detrended: Variance | None
    drift_rel: float
    clipped_share: float
    zero_share: float
    step_dn: float
    black_level_dn: float
    white_level_dn: float
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
    """Return the frames grouped by setting; the order of the rows does not matter.

    Returns
    -------
    tuple of Stack
        Stacks, one per setting and channel.
    """
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

    Notes
    -----
    With m_l the mean of frame l, y_p that of pixel p and m that of all::

        temporal = sum_l sum_p (y_lp - m_l - (y_p - m))^2 / ((L - 1)(n - 1))                          (1)

    For L = 2 this is half of the variance of the difference, its mean removed [1]_ (eq. 18), so that a lamp
    that changed between the frames has no effect. Rows and columns may share noise, so the sum of squares is
    split into rows, columns and the rest [2]_, S = S_r + S_c + S_0 with nu_i degrees of freedom each::

        u(variance)^2 = 2 sum (S_i^2 / nu_i) / nu^2

    which is 2 / nu of its square where nothing is shared.

    References
    ----------
    .. [1] EMVA Standard 1288, release 3.1
    .. [2] S. R. Searle, G. Casella, C. E. McCulloch, Variance Components, 4.7, doi:10.1002/9780470316856
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
        pattern=_spatial(average, temporal, len(kept), detrend=False) if temporal else None,
        detrended=_spatial(average, temporal, len(kept), detrend=True) if temporal else None,
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
    squares = np.array(
        [cols * np.sum(deviations.mean(axis=2) ** 2), rows * np.sum(deviations.mean(axis=1) ** 2), 0.0]
    )
    total = float(np.sum(deviations**2))
    squares[2] = max(0.0, total - squares.sum())
    dofs = (count - 1) * np.array([rows - 1, cols - 1, (rows - 1) * (cols - 1)])
    value = total / float(dofs.sum())
    by_row, by_col, rest = (squares / dofs).tolist()
    return Variance(
        value_dn2=value,
        u_dn2=math.sqrt(2.0 * float(np.sum(squares**2 / dofs))) / float(dofs.sum()),
        of_mean=max(1.0, (by_row + by_col - rest) / value) if value > 0.0 else 1.0,
    )


def _spatial(average: Image, temporal: Variance, count: int, *, detrend: bool) -> Variance:
    """Compute the spatial variance of the mean image without the rest of temporal noise: s^2 - temporal / L.

    The slow part is a quadratic surface: six terms, as many degrees of freedom less.
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
    u = math.hypot(measured * math.sqrt(2.0 / dof), temporal.u_dn2 / count)
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
    """Return the stacks of every ISO value and channel.

    Returns
    -------
    dict of tuple of (float, str) to list of Stack
        Stacks by ISO value and channel.
    """

    def key(stack: Stack) -> tuple[float, str]:
        return stack.setting.iso, stack.setting.channel

    return {name: list(group) for name, group in itertools.groupby(sorted(stacks, key=key), key=key)}
