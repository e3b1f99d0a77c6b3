"""Light of a flat frame: its blocks less dark."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.packing import unpack
from radiometry.vignetting.darkness import estimate_dark_drift, estimate_dark_error
from radiometry.vignetting.features import ChannelBlocks, Features, FrameRow
from radiometry.vignetting.grid import Plane
from radiometry.vignetting.rows import DARK
from radiometry.vignetting.solution import Blocks

EXPOSURE_RATIO = 2.0
MOST_CLIPPED_SHARE = 0.001
_ROUNDING_VARIANCE = 1.0 / 12.0


@dataclass(frozen=True)
class ChannelLight:
    """One channel of a flat frame.

    Attributes
    ----------
    channel : str
        Name of the channel.
    blocks : Blocks
        Light above dark [DN].
    span_dn : float
        Signal from dark to white [DN].
    clipped_share : float
        Fraction of its pixels that are clipped.
    """

    channel: str
    blocks: Blocks
    span_dn: float
    clipped_share: float

    @property
    def median_share(self) -> float:
        """Median light of the blocks that count, as a fraction of the span; 0 if none counts."""
        light = self.blocks.light[np.isfinite(self.blocks.standard_error)]
        return float(np.median(light)) / self.span_dn if light.size else 0.0


@dataclass(frozen=True)
class FlatLight:
    """Flat frame less dark.

    Attributes
    ----------
    frame : str
        Name of the frame.
    f_number : float
        F-number.
    channels : tuple of ChannelLight
        Light of each channel.
    dark_frames : int
        Number of dark frames that were subtracted.
    dark_time_ratio : float or None
        Exposure time ratio of the nearest dark frames; None without any.
    dark_times : int
        Number of exposure times of the dark frames of its ISO value.
    """

    frame: str
    f_number: float
    channels: tuple[ChannelLight, ...]
    dark_frames: int
    dark_time_ratio: float | None
    dark_times: int


def list_darks(flat: FrameRow, rows: Sequence[FrameRow]) -> tuple[list[FrameRow], float | None]:
    """Return the dark frames that serve a flat: of its ISO value, and of the times nearest to its own.

    Parameters
    ----------
    flat : FrameRow
        Evidence of the flat frame.
    rows : sequence of FrameRow
        Evidence of the campaign's frames.

    Returns
    -------
    tuple of (list of FrameRow, float or None)
        Dark frames and the ratio of times. All within a factor of two count, else those
        of the one nearest time. Without any: none, and None.
    """
    darks = [(row, time_ratio(flat, row)) for row in _list_alike(flat, rows)]
    if not darks:
        return [], None
    nearest = min(ratio for _, ratio in darks)
    limit = max(EXPOSURE_RATIO, nearest)
    return [row for row, ratio in darks if ratio <= limit], nearest


def _list_alike(flat: FrameRow, rows: Sequence[FrameRow]) -> list[FrameRow]:
    """Return every dark frame of a flat's ISO value, of whatever time."""
    return [
        row
        for row in sorted(rows, key=lambda row: row.frame)
        if row.role == DARK and row.features is not None and _is_alike(flat, row)
    ]


def time_ratio(one: FrameRow, other: FrameRow) -> float:
    """Return how many times longer the longer of two exposures is.

    Parameters
    ----------
    one, other : FrameRow
        Evidence of the two frames.

    Returns
    -------
    float
        Ratio, 1 or more.
    """
    times = [row.exposure.exposure_time_s for row in (one, other) if row.exposure]
    return max(times) / min(times)


def _is_alike(flat: FrameRow, dark: FrameRow) -> bool:
    """Return True if a dark frame has the flat's ISO value, picture size and colour filter."""
    if flat.exposure is None or dark.exposure is None or flat.features is None or dark.features is None:
        return False
    return (
        flat.exposure.iso == dark.exposure.iso
        and flat.features.grid == dark.features.grid
        and flat.features.cfa == dark.features.cfa
    )


def measure_light(flat: FrameRow, rows: Sequence[FrameRow]) -> FlatLight:
    """Compute the light of a flat frame less dark, block by block.

    Parameters
    ----------
    flat : FrameRow
        Evidence of the flat frame.
    rows : sequence of FrameRow
        Evidence of the campaign's frames.

    Notes
    -----
    light = mean - dark,  u^2 = noise^2 / n + u(dark)^2, noise^2 the straight line through the blocks' own
    noise over their light: the random noise estimate of a single block must not decide its weight.
    """
    darks, ratio = list_darks(flat, rows)
    channels = _features(flat).channels
    by_dark = [{each.channel: each for each in _features(dark).channels} for dark in darks]
    if flat.exposure is None:
        raise ValueError(f"{flat.frame} has no f-number")
    alike = _list_alike(flat, rows)
    lights = [
        _subtract(blocks, [each[blocks.channel] for each in by_dark], _features(flat)) for blocks in channels
    ]
    return FlatLight(
        frame=flat.frame,
        f_number=flat.exposure.f_number,
        channels=tuple(_add_drift(light, flat, darks, alike) for light in lights),
        dark_frames=len(darks),
        dark_time_ratio=ratio,
        dark_times=len({_time_s(row) for row in alike}),
    )


def _add_drift(
    light: ChannelLight, flat: FrameRow, darks: Sequence[FrameRow], alike: Sequence[FrameRow]
) -> ChannelLight:
    """Add the uncertainty due to dark current, where the dark frames have another time than the flat.

    `darks` are those that were subtracted; `alike` are all of the ISO value, from which the dark current
    follows.
    """
    if not darks:
        return light
    apart_s = _time_s(flat) - math.fsum(_time_s(row) for row in darks) / len(darks)
    known = [(_time_s(row), *level) for row in alike if (level := _measure_level(row, light.channel))]
    times_s, means_dn, variances_dn2 = zip(*known, strict=True) if known else ((), (), ())
    drift = estimate_dark_drift(times_s, means_dn, variances_dn2, apart_s=apart_s, span_dn=light.span_dn)
    dark = replace(light.blocks.dark, shared=math.hypot(light.blocks.dark.shared, drift))
    return replace(light, blocks=replace(light.blocks, dark=dark))


def _measure_level(dark: FrameRow, channel: str) -> tuple[float, float] | None:
    """Return the mean of a dark frame's blocks and the variance of it due to pixel noise."""
    blocks = next(each for each in _features(dark).channels if each.channel == channel)
    n = unpack(blocks.n)
    pixels = math.fsum(n.ravel())
    if not pixels:
        return None
    mean = math.fsum((unpack(blocks.mean_dn) * n).ravel()) / pixels
    noise = math.fsum((unpack(blocks.noise_dn) ** 2 * n).ravel()) / pixels
    return mean, max(noise, _ROUNDING_VARIANCE) / pixels


def _time_s(row: FrameRow) -> float:
    if row.exposure is None:
        raise ValueError(f"{row.frame} has no exposure time")
    return row.exposure.exposure_time_s


def _features(row: FrameRow) -> Features:
    if row.features is None:
        raise ValueError(f"{row.frame} is not extracted")
    return row.features


def _subtract(flat: ChannelBlocks, darks: Sequence[ChannelBlocks], features: Features) -> ChannelLight:
    mean, noise, n, clipped = (
        unpack(each) for each in (flat.mean_dn, flat.noise_dn, flat.n, flat.clipped_share)
    )
    dark: Plane = np.full_like(mean, flat.black_level_dn)
    variance: Plane = np.zeros_like(mean)
    known = n > 0
    dark_means, dark_variances = [], []
    if darks:
        dark = np.asarray(np.mean([unpack(each.mean_dn) for each in darks], axis=0))
        counts = [unpack(each.n) for each in darks]
        known &= np.all(np.array(counts) > 0, axis=0)
        own = [
            _smooth_noise(unpack(each.mean_dn), unpack(each.noise_dn), count > 0) / np.maximum(count, 1.0)
            for each, count in zip(darks, counts, strict=True)
        ]
        variance = np.asarray(np.sum(own, axis=0) / len(darks) ** 2)
        dark_means = [float(np.mean(unpack(each.mean_dn)[known])) for each in darks] if known.any() else []
        dark_variances = [float(np.mean(each[known])) / int(known.sum()) for each in own if known.any()]
    light = mean - dark
    variance = variance + _smooth_noise(light, noise, known) / np.maximum(n, 1.0)
    counts_here = known & (clipped <= MOST_CLIPPED_SHARE)
    rows, cols = features.grid.axes(flat.site)
    total = math.fsum(n.ravel())
    span_dn = max(1.0, flat.white_level_dn - float(np.mean(dark)))
    return ChannelLight(
        channel=flat.channel,
        blocks=Blocks(
            grid=features.grid,
            rows=rows,
            cols=cols,
            light=np.where(known, light, 0.0),
            standard_error=np.where(counts_here, np.sqrt(variance), np.inf),
            dark=estimate_dark_error(dark_means, dark_variances, span_dn=span_dn),
        ),
        span_dn=span_dn,
        clipped_share=math.fsum((clipped * n).ravel()) / total if total else 0.0,
    )


def _smooth_noise(light: Plane, noise: Plane, known: NDArray[np.bool_]) -> Plane:
    """Return a pixel's variance as a straight line over the light, at least that of rounding."""
    x, y = light[known], noise[known] ** 2
    if x.size < 3 or float(np.ptp(x)) == 0.0:
        return np.full_like(light, max(_ROUNDING_VARIANCE, float(np.mean(y)) if y.size else 0.0))
    slope = max(0.0, float(np.cov(x, y)[0, 1] / np.var(x, ddof=1)))
    line = float(np.mean(y)) + slope * (light - float(np.mean(x)))
    return np.maximum(line, _ROUNDING_VARIANCE)


def leave_out(light: ChannelLight, spots: NDArray[np.bool_]) -> ChannelLight:
    """Return the light without the blocks of spots, which may have been found in another channel.

    Parameters
    ----------
    light : ChannelLight
        Light of the channel.
    spots : ndarray of bool
        True for each block of a spot.

    Returns
    -------
    ChannelLight
        Light without these blocks.

    Notes
    -----
    A block is the same place in every channel; at a border of one odd pixel a channel may have one less.
    """
    errors = light.blocks.standard_error.copy()
    height, width = (min(sizes) for sizes in zip(errors.shape, spots.shape, strict=True))
    errors[:height, :width][spots[:height, :width]] = np.inf
    return replace(light, blocks=replace(light.blocks, standard_error=errors))
