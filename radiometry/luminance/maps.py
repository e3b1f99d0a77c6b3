"""Luminance of every pixel of a window, and the relative illumination that it is divided by."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from radiometry.fitting.evidence import FieldCorrection
from radiometry.frame import Frame, opencv, roi, statistics
from radiometry.frame.exposure import Exposure
from radiometry.luminance import application, results
from radiometry.records import Record
from radiometry.vignetting.lens import Lens, LensShare

Plane = NDArray[np.float32]
Sums = NDArray[np.unsignedinteger]

RIM_PX = 1  # how far beyond its own pixels a block must be read for its values to be those of the whole frame

_MOST_IN_16_BITS = (1 << 16) - 1
_BAND_ROWS = 256
_CHUNK_ROWS = 16
"""Even, so that every chunk starts at the same CFA position; few, so that it stays in the cache."""

_PLANES = ("R", "G", "B")


class MapScale(Record):
    """Conversion of a frame's raw values to luminance: L = (N - dark) slope - offset."""

    slope_cd_m2_per_dn: float
    dark_signal_dn: float
    channel: str  # the calibration's signal
    lens: Lens | None = None  # for a K that was fitted with vignetting: L = (N - D) slope / V
    offset_cd_m2: float = 0.0  # stray light


def find_map_scale(
    coefficients: tuple[results.Coefficient, ...],
    exposure: Exposure,
    *,
    lens: Lens | None = None,
    corrections: Sequence[FieldCorrection] = (),
) -> MapScale:
    coefficient = application.choose_coefficient(coefficients, iso=exposure.iso)
    application.require_alike(coefficient, corrected=lens is not None)
    time_s = exposure.on_basis(coefficient.exposure_basis).exposure_time_s
    return MapScale(
        slope_cd_m2_per_dn=application.luminance_per_dn(coefficient, exposure)
        * math.prod(each.factor for each in corrections),
        dark_signal_dn=coefficient.at(time_s).dark_signal_dn,
        channel=coefficient.channel,
        lens=lens,
        offset_cd_m2=sum(each.offset_cd_m2 for each in corrections),
    )


def sum_signal(frame: Frame, *, channel: str) -> tuple[Sums, int]:
    """Compute each pixel's signal as a whole number of parts of one DN.

    For "green" of a mosaic it is a green position's own value, and elsewhere the mean of the four green
    neighbours. For "grey" of a mosaic it is the 3 x 3 mean with weights 1 2 1, 2 4 2, 1 2 1 over 16, in which
    each of the four CFA positions has the weight of a quarter wherever it is placed. For a colour image it is
    the green plane or the mean of the three, for a grey image the value itself.

    Beyond the window's border the values are mirrored at the outermost pixels, which keeps the pattern in
    phase: a block that is not at the frame's border must be read with RIM_PX more on each side.
    """
    parts, bands = _sum_bands(frame, channel=channel)
    return np.concatenate([sums for _, sums in bands]), parts


def _sum_bands(frame: Frame, *, channel: str) -> tuple[int, Iterator[tuple[int, Sums]]]:
    """Return the parts of one DN, and the sums of `sum_signal` a few rows at a time, with the first row."""
    samples = frame.samples_dn
    firsts = range(0, len(samples), _CHUNK_ROWS)
    if frame.cfa == "rgb" and channel == statistics.GREY:
        return 3, ((row, samples[row : row + _CHUNK_ROWS].sum(axis=2, dtype=np.uint32)) for row in firsts)
    if frame.cfa in {"rgb", statistics.GREY}:
        plane = samples[..., 1] if frame.cfa == "rgb" else samples
        return 1, ((row, plane[row : row + _CHUNK_ROWS]) for row in firsts)
    parts, add = (16, _sum_around) if channel == statistics.GREY else (4, _sum_beside)
    # twice as fast where they fit, as they do for 14 bits
    wide = parts * int(samples.max()) > _MOST_IN_16_BITS
    kind = np.uint32 if wide else np.uint16
    # all bits where a pixel's own value counts: choosing by them is twice as fast as by every other pixel
    own = np.zeros((_CHUNK_ROWS, samples.shape[1]), kind)
    for site in () if channel == statistics.GREY else _green_sites(frame):
        own[site] = np.iinfo(kind).max

    def sum_band(first: int) -> Sums:
        rows_dn = _read_rows(samples, first - 1, min(first + _CHUNK_ROWS, len(samples)) + 1)
        band: Sums = rows_dn.astype(kind) if wide else rows_dn
        sums = add(band)
        if channel != statistics.GREY:
            chosen = np.left_shift(band[1:-1], 2)
            chosen ^= sums
            chosen &= own[: len(sums)]
            sums ^= chosen
        return sums

    return parts, ((first, sum_band(first)) for first in firsts)


def _read_rows(samples: Sums, first: int, last: int) -> Sums:
    """Return rows [first, last), of which those beyond the border are mirrored at the outermost ones."""
    if first >= 0 and last <= len(samples):
        return samples[first:last]
    end = len(samples) - 1
    rows = np.abs(np.arange(first, last))
    mirrored: Sums = samples[np.clip(np.where(rows > end, 2 * end - rows, rows), 0, end)]
    return mirrored


def _sum_beside(band: Sums) -> Sums:
    """Add up the four neighbours of each sample of the inner rows."""
    sums: Sums = band[:-2] + band[2:]
    _add_sides(sums, band[1:-1])
    return sums


def _sum_around(band: Sums) -> Sums:
    """Add up the 3 x 3 samples around each of the inner rows, with the weights 1 2 1, 2 4 2, 1 2 1."""
    lines: Sums = band + band
    _add_sides(lines, band)
    sums: Sums = lines[:-2] + lines[2:]
    sums += lines[1:-1]
    sums += lines[1:-1]
    return sums


def _add_sides(sums: Sums, band: Sums) -> None:
    """Add each sample's left and right neighbour; beyond the border the one inside counts twice."""
    beside = min(1, band.shape[1] - 1)
    sums[:, 1:] += band[:, :-1]
    sums[:, :-1] += band[:, 1:]
    sums[:, 0] += band[:, beside]
    sums[:, -1] += band[:, -1 - beside]


def compute_map(frame: Frame, scale: MapScale) -> Plane:
    """Compute the luminance of every pixel of a window.

    L = (N - D) f^2 / (K t S) with N from `sum_signal`, each value the float32 nearest to it. Nothing is
    clipped: noise below dark is a negative luminance. With a lens this is divided by the float32 nearest to V
    of the pixel.
    """
    parts, bands = _sum_bands(frame, channel=scale.channel)
    # one product per possible number, not per pixel; those beyond the table are saturated, where wrapped
    # ones do no harm and take least time
    top = min(math.ceil(max(frame.white_level_dn)), _MOST_IN_16_BITS) * parts
    table = _tabulate(scale.slope_cd_m2_per_dn, scale.dark_signal_dn, max(top, _MOST_IN_16_BITS), parts)
    luminance: Plane = np.empty(frame.samples_dn.shape[:2], np.float32)
    for first, sums in bands:
        target = luminance[first : first + len(sums)]
        # OpenCV has 16 bits only, and takes 0.6 of the time
        if sums.dtype == np.uint16:
            opencv.cv2.LUT(sums, table[: _MOST_IN_16_BITS + 1], target)
        else:
            table.take(sums, mode="wrap", out=target)
    if scale.lens is not None:
        luminance /= compute_shares(frame, scale.lens, channel=scale.channel)
    if scale.offset_cd_m2:
        luminance -= np.float32(scale.offset_cd_m2)
    saturated = find_saturated(frame, channel=scale.channel)
    if saturated is not None:
        luminance[saturated] = np.nan
    return luminance


def average_map(frame: Frame, scale: MapScale) -> float:
    """Compute the mean luminance of a window, band by band; saturated pixels count as saturation."""
    total = 0.0
    for row in range(0, frame.samples_dn.shape[0], _BAND_ROWS):
        band = replace(frame, samples_dn=frame.samples_dn[row : row + _BAND_ROWS], row0=frame.row0 + row)
        bright = (max(frame.white_level_dn) - scale.dark_signal_dn) * scale.slope_cd_m2_per_dn
        total += float(np.nan_to_num(compute_map(band, scale), nan=bright).sum(dtype=np.float64))
    return total / math.prod(frame.samples_dn.shape[:2])


@lru_cache(maxsize=8)
def _tabulate(slope: float, dark_dn: float, top: int, parts: int) -> Plane:
    """Compute the luminance of every possible sum."""
    return ((np.arange(top + 1) / parts - dark_dn) * slope).astype(np.float32)


def find_saturated(frame: Frame, *, channel: str) -> NDArray[np.bool_] | None:
    """Return the pixels at which a value that the signal is made of is saturated."""
    samples, white = frame.samples_dn, np.array(frame.white_level_dn)
    if not samples.size or samples.max() < white.min():
        return None
    if frame.cfa == "rgb":
        over = samples >= white
        return np.asarray(over.any(axis=2) if channel == statistics.GREY else over[..., 1], np.bool_)
    if frame.cfa == statistics.GREY:
        return np.asarray(samples >= white[0], np.bool_)
    height, width = samples.shape
    rows, cols = (np.arange(height) + frame.row0) % 2, (np.arange(width) + frame.col0) % 2
    over = samples >= white[2 * rows[:, None] + cols]
    padded = np.pad(over, 1, mode="reflect")
    beside = padded[:-2, 1:-1] | padded[2:, 1:-1] | padded[1:-1, :-2] | padded[1:-1, 2:]
    if channel == statistics.GREY:
        corners = padded[:-2, :-2] | padded[:-2, 2:] | padded[2:, :-2] | padded[2:, 2:]
        return np.asarray(beside | corners | over, np.bool_)
    for part in _green_sites(frame):
        beside[part] = over[part]
    return np.asarray(beside, np.bool_)


def find_measured(frame: Frame, *, channel: str) -> NDArray[np.bool_]:
    """Return the pixels whose signals are their own and not their neighbours'."""
    shape = frame.samples_dn.shape[:2]
    if frame.cfa in ("rgb", statistics.GREY) or channel == statistics.GREY:
        return np.ones(shape, np.bool_)
    measured = np.zeros(shape, np.bool_)
    for part in _green_sites(frame):
        measured[part] = True
    return measured


def _green_sites(frame: Frame) -> list[tuple[slice, slice]]:
    """Return the two green CFA positions of the pattern as parts of the window."""
    return [(each.rows, each.cols) for each in _list_parts(frame, channel="green")]


def name_channels(cfa: str, *, channel: str) -> tuple[str, ...]:
    """Name the channels of a frame that a calibration's signal is made of."""
    if cfa == statistics.GREY:
        return (statistics.GREY,)
    if cfa == "rgb":
        return _PLANES if channel == statistics.GREY else ("G",)
    sites = tuple(statistics.name_site(cfa, index) for index in range(4))
    return tuple(dict.fromkeys(site for site in sites if channel == statistics.GREY or site.startswith("G")))


def correct_signal(
    frame: Frame,
    polygon: roi.Polygon,
    signal: statistics.Signal,
    lens: Lens,
    *,
    channel: str,
    dark_signal_dn: float,
) -> tuple[statistics.Signal, LensShare]:
    """Correct a region's signal for vignetting.

    For an even surface N is the region's mean and V the harmonic mean of V_i. For a structured one, no part
    of the surface has more weight because the lens transmits more there::

        V = 1 / mean(1 / V_i),   N = D + V mean((N_i - D) / V_i)

    The channels have the same weights as in the uncorrected signal: both greens equal, every CFA position of
    "grey" equal. Noise is the standard deviation of (N_i - D) / V_i, which the falloff itself does not widen.
    """
    inside = roi.mask(polygon, frame.window)
    gains, lights = [], []
    for each in _list_parts(frame, channel=channel):
        chosen = inside[each.rows, each.cols]
        if not chosen.any():
            continue
        plane = lens.compute_plane(*_places(frame, each), channel=each.channel)
        gains.append(1.0 / plane[chosen].astype(np.float64))
        lights.append((frame.samples_dn[each.at][chosen] - dark_signal_dn) * gains[-1])
    if channel == statistics.GREY:
        gains, lights = [np.concatenate(gains)], [np.concatenate(lights)]
    count = len(gains)
    harmonic = 1.0 / (sum(float(gain.mean()) for gain in gains) / count)
    light = sum(float(found.mean()) for found in lights) / count
    deviations = [float(found.std(ddof=1)) if found.size > 1 else 0.0 for found in lights]
    spreads = [(each * harmonic, found.size) for each, found in zip(deviations, lights, strict=True)]
    variance = sum(statistics.mean_variance(std_dn, n) for std_dn, n in spreads) / count**2
    share = lens.over(polygon, channels=name_channels(frame.cfa, channel=channel))
    corrected = replace(
        signal,
        value_dn=dark_signal_dn + light * harmonic,
        standard_uncertainty_dn=math.sqrt(variance),
        rounding_dn=math.sqrt(sum(statistics.rounding_variance(std_dn) for std_dn, _ in spreads)) / count,
    )
    effects = tuple(effect * harmonic / share.value for effect in share.effects)
    return corrected, LensShare(value=harmonic, effects=effects)


def compute_shares(frame: Frame, lens: Lens, *, channel: str) -> NDArray[np.float32]:
    """Compute V of each pixel's signal as a map has it.

    A pixel that has its own value has its own channel's V. One that has the mean of its neighbours has the
    mean of the channels' V at its own place: over two pixels V is a plane.
    """
    height, width = frame.samples_dn.shape[:2]
    rows, cols = np.arange(height) + frame.row0, np.arange(width) + frame.col0
    channels = name_channels(frame.cfa, channel=channel)
    shares = np.empty((height, width), np.float32)
    for top in range(0, height, _BAND_ROWS):
        band = rows[top : top + _BAND_ROWS]
        planes = [lens.compute_plane(band, cols, channel=name) for name in channels]
        shares[top : top + _BAND_ROWS] = sum(planes[1:], planes[0]) / np.float32(len(planes))
        if channel == statistics.GREY or frame.cfa in ("rgb", statistics.GREY):
            continue
        for each in _list_parts(frame, channel=channel):
            plane, first = planes[channels.index(each.channel)], (each.rows.start - top) % 2
            shares[top : top + _BAND_ROWS][first::2, each.cols] = plane[first::2, each.cols]
    return shares


def _list_parts(frame: Frame, *, channel: str) -> list[statistics.Part]:
    wanted = name_channels(frame.cfa, channel=channel)
    return [each for each in statistics.list_parts(frame) if each.channel in wanted]


def _places(frame: Frame, part: statistics.Part) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the rows and columns, in the frame, of a part's pixels."""
    height, width = frame.samples_dn.shape[:2]
    return (np.arange(height) + frame.row0)[part.rows], (np.arange(width) + frame.col0)[part.cols]
