"""Light of a flat frame: its blocks less dark, with the uncertainty of the dark level."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import Reason
from radiometry.frame.packing import unpack
from radiometry.frame.verdicts import inspect_black
from radiometry.records import Record
from radiometry.vignetting.blocks import ChannelBlocks, Features, FrameRow, Plane
from radiometry.vignetting.falloff import Blocks, DarkError
from radiometry.vignetting.results import DARK

# Of the span: a black level that the file states, and nobody measured, holds to one step of 12 bits
STATED_SHARE = 1.0 / 4096.0

# Of the span: by so much dark levels wander between frames; taken where a single frame cannot show it
WANDER_SHARE = 1e-4


def estimate_dark_error(
    means_dn: Sequence[float], variances_dn2: Sequence[float], *, span_dn: float
) -> DarkError:
    """Estimate the error of a dark level from the means of its n dark frames.

    With s the standard deviation of the means::

        own^2 = max(0, s^2 - mean u_i^2),    shared^2 = (own^2 + mean u_i^2) / n

    For one frame, own is the usual variation of dark levels. Without any dark frame it is the uncertainty
    of the stated black level, to a step of 12 bits.
    """
    n = len(means_dn)
    if n == 0:
        return DarkError(shared=STATED_SHARE * span_dn)
    noise = math.fsum(variances_dn2) / n
    own = WANDER_SHARE * span_dn
    if n > 1:
        own = math.sqrt(max(0.0, float(np.var(np.array(means_dn), ddof=1)) - noise))
    return DarkError(shared=math.sqrt((own**2 + noise) / n), own=own, dof=n - 1 if n > 1 else math.inf)


def estimate_dark_drift(
    times_s: Sequence[float],
    means_dn: Sequence[float],
    variances_dn2: Sequence[float],
    *,
    apart_s: float,
    span_dn: float,
) -> float:
    """Estimate the effect of dark current on a dark level used for a flat of another exposure time [DN].

    A line through the means, with t the mean time::

        mean_i = m + b t_i,    u^2 = (b apart)^2 + (u_b apart)^2,    u_b^2 = s^2 / sum (t_i - t)^2

    The level is not corrected: dark current depends on the sensor's temperature, so b apart is the size of
    the error and no more. s is the scatter about the line, at least pixel noise; for two frames, through
    which every line goes, it is the usual variation of dark levels.
    """
    t, y = np.array(times_s), np.array(means_dn)
    if len(t) == 0 or float(np.ptp(t)) == 0.0:
        return 0.0
    from_mean = t - t.mean()
    spread = float(from_mean @ from_mean)
    slope = float(from_mean @ y) / spread
    noise = math.fsum(variances_dn2) / len(t)
    residual = y - y.mean() - slope * from_mean
    dof = len(t) - 2
    scatter = float(residual @ residual) / dof if dof else (WANDER_SHARE * span_dn) ** 2
    return abs(apart_s) * math.hypot(slope, math.sqrt(max(scatter, noise) / spread))


def merge_dark_errors(errors: Sequence[DarkError], shares: Sequence[float]) -> DarkError:
    """Compute the error of a weighted mean of flats: shared errors add up, own errors average."""
    pairs = list(zip(errors, shares, strict=True))
    return DarkError(
        shared=math.fsum(share * error.shared for error, share in pairs),
        own=math.hypot(*(share * error.own for error, share in pairs)),
        dof=min(error.dof for error in errors),
    )


def find_not_dark(dark: FrameRow) -> Reason | None:
    """Check whether a dark frame saw light: a channel's median lies too far above the stated black level."""
    found = []
    for channel in dark.features.channels if dark.features else ():
        mean, n = unpack(channel.mean_dn), unpack(channel.n)
        if (n > 0).any():
            reason = inspect_black(
                float(np.median(mean[n > 0])),
                black_level_dn=channel.black_level_dn,
                white_level_dn=channel.white_level_dn,
            )
            found += [reason] if reason else []
    # "fail" comes before "warn"
    return min(found, key=lambda reason: reason.outcome, default=None)


EXPOSURE_RATIO = 2.0
MOST_CLIPPED_SHARE = 0.001
_ROUNDING_VARIANCE = 1.0 / 12.0


class ChannelLight(Record, kw_only=False):
    """One channel of a flat frame."""

    channel: str
    blocks: Blocks  # Light above dark [DN]
    span_dn: float  # Signal from dark to white [DN]
    clipped_share: float  # Fraction of its pixels that are clipped

    @property
    def median_share(self) -> float:
        """Median light of the blocks that count, as a fraction of the span; 0 if none counts."""
        light = self.blocks.light[np.isfinite(self.blocks.standard_error)]
        return float(np.median(light)) / self.span_dn if light.size else 0.0


class FlatLight(Record, kw_only=False):
    """Flat frame less dark."""

    frame: str
    f_number: float
    channels: tuple[ChannelLight, ...]
    dark_frames: int  # Number of dark frames that were subtracted
    dark_time_ratio: float | None  # Exposure time ratio of the nearest dark frames; None without any
    dark_times: int  # Number of exposure times of the dark frames of its ISO value


def list_darks(flat: FrameRow, rows: Sequence[FrameRow]) -> tuple[list[FrameRow], float | None]:
    """Return the dark frames that serve a flat: of its ISO value, and of the times nearest to its own."""
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

    A block is the same place in every channel; at a border of one odd pixel a channel may have one less.
    """
    errors = light.blocks.standard_error.copy()
    height, width = (min(sizes) for sizes in zip(errors.shape, spots.shape, strict=True))
    errors[:height, :width][spots[:height, :width]] = np.inf
    return replace(light, blocks=replace(light.blocks, standard_error=errors))
