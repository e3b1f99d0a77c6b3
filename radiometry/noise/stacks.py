"""Frames of one setting as a stack: the mean, the temporal variance and the spatial variance of a channel."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.packing import unpack
from radiometry.noise.blocks import ChannelBlock, FrameRow
from radiometry.noise.rows import DARK

Image = NDArray[np.float64]

_TREND_TERMS = 6
CLIPPED_SHARE = 0.001
"""A tail of one in a thousand lies 3.1 standard deviations out: cutting it off takes 1 % of the variance."""


@dataclass(frozen=True, order=True)
class Setting:
    """What the frames of a stack share. Dark frames differ by ISO and time alone.

    ``place`` : row, column and side of the block
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
    """A variance [DN^2] with its standard uncertainty."""

    value_dn2: float
    u_dn2: float


@dataclass(frozen=True, kw_only=True)
class Stack:
    """One channel of the frames of one setting, the same pixels in each.

    ``frames`` : names, copies left out; ``frame_means_dn`` : theirs; ``copies`` : name -> whose copy it is
    ``temporal`` : of one pixel from frame to frame; None of a single frame
    ``pattern`` : spatial variance that every frame repeats; ``detrended`` : without the slow part, which
        light and lens make; None of a single frame
    ``drift_rel`` : range of the frames' means over their mean above black
    ``step_dn`` : between neighbouring numbers, above 1 where a sensor of fewer bits fills a larger container
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

    @property
    def clipped(self) -> bool:
        """Whether enough samples reach white to cut the noise."""
        return self.clipped_share > CLIPPED_SHARE

    @property
    def mean_variance_dn2(self) -> float:
        """Of the mean, from the noise of its samples; of a single frame none is known."""
        return self.temporal.value_dn2 / (self.samples * len(self.frames)) if self.temporal else 0.0


def make_stacks(rows: Sequence[FrameRow]) -> tuple[Stack, ...]:
    """Put frames of one setting together; the order of the rows does not matter."""
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
    """Reduce a stack.

        temporal = sum_l sum_p (y_lp - m_l - (y_p - m))^2 / ((L - 1)(n - 1))                          (1)
    m_l the mean of frame l, y_p that of pixel p, m that of all: for L = 2 this is half of the variance of the
    difference, its mean removed [1, eq. 18], so that a lamp that changed between the frames does not count. A
    variance of nu degrees of freedom is known to sqrt(2 / nu) of itself.

    References [1] EMVA Standard 1288, release 3.1
    """
    kept, copies = _drop_copies(members)
    images = np.array([image for _, image in kept])
    means = images.mean(axis=(1, 2))
    blocks = [block for _, block in members]
    black = blocks[0].black_level_dn
    average = images.mean(axis=0)
    temporal = _temporal(images, means, average) if len(kept) > 1 else None
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
        step_dn=_find_step(images),
        black_level_dn=black,
        white_level_dn=min(block.white_level_dn for block in blocks),
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
    count, samples = images.shape[0], average.size
    differences = images - average - (means - means.mean())[:, None, None]
    dof = (count - 1) * (samples - 1)
    value = float(np.sum(differences**2)) / dof
    return Variance(value_dn2=value, u_dn2=value * math.sqrt(2.0 / dof))


def _spatial(average: Image, temporal: Variance, count: int, *, detrend: bool) -> Variance:
    """Give the spatial variance of the mean image without what is left of temporal noise: s^2 - temporal / L.

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
    """Give an orthonormal basis of quadratic surfaces, (rows * cols, 6)."""
    row, col = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, cols), indexing="ij")
    surfaces = [np.ones_like(row), row, col, row * row, row * col, col * col]
    basis: NDArray[np.float64] = np.linalg.qr(np.stack([surface.ravel() for surface in surfaces], axis=1))[0]
    return basis


def _find_step(images: Image) -> float:
    values = np.flatnonzero(np.bincount(images.ravel().astype(np.int64)))
    return float(np.gcd.reduce(np.diff(values))) if values.size > 1 else 1.0


def group_by_channel(stacks: Sequence[Stack]) -> dict[tuple[float, str], list[Stack]]:
    """Give the stacks of every ISO value and channel."""

    def key(stack: Stack) -> tuple[float, str]:
        return stack.setting.iso, stack.setting.channel

    return {name: list(group) for name, group in itertools.groupby(sorted(stacks, key=key), key=key)}
