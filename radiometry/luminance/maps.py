"""Per-pixel luminance of a window of a frame, for maps that are made block by block."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from radiometry.fitting.evidence import FieldCorrection
from radiometry.frame import Frame
from radiometry.frame.exposure import Exposure
from radiometry.frame.opencv import cv2
from radiometry.frame.statistics import GREY
from radiometry.luminance.application import choose_coefficient, luminance_per_dn, require_alike
from radiometry.luminance.coefficient import Coefficient
from radiometry.luminance.lens import compute_shares
from radiometry.vignetting.lens import Lens

Plane = NDArray[np.float32]
Sums = NDArray[np.unsignedinteger]

RIM_PX = 1
"""How far beyond its own pixels a block must be read for its values to be those of the whole frame."""

_MOST_IN_16_BITS = (1 << 16) - 1
_BAND_ROWS = 256
_CHUNK_ROWS = 16
"""Even, so that every chunk starts at the same CFA position; few, so that it stays in the cache."""


@dataclass(frozen=True, kw_only=True)
class MapScale:
    """Conversion of a frame's raw values to luminance: L = (N - dark) slope - offset.

    Attributes
    ----------
    slope_cd_m2_per_dn : float
        Slope [cd/m2 per DN].
    dark_signal_dn : float
        Dark signal [DN].
    channel : str
        "green" or "grey", the calibration's signal.
    lens : Lens or None, default: None
        Relative illumination, for a K that was fitted with vignetting: L = (N - D)
        slope / V, pixel by pixel.
    offset_cd_m2 : float, default: 0.0
        Stray light [cd/m2].
    """

    slope_cd_m2_per_dn: float
    dark_signal_dn: float
    channel: str
    lens: Lens | None = None
    offset_cd_m2: float = 0.0


def find_map_scale(
    coefficients: tuple[Coefficient, ...],
    exposure: Exposure,
    *,
    lens: Lens | None = None,
    corrections: Sequence[FieldCorrection] = (),
) -> MapScale:
    """Return the scale of a frame's map.

    Parameters
    ----------
    coefficients : tuple of Coefficient
        Coefficients of the version, one per ISO value.
    exposure : Exposure
        Exposure of the frame.
    lens : Lens or None, default: None
        Relative illumination, if vignetting is corrected.
    corrections : sequence of FieldCorrection, default: ()
        Corrections of the frame.

    Raises
    ------
    InputRejected
        `iso_not_calibrated`; `fit_failed` if the calibration's model is not
        proportional; `vignetting_not_calibrated` if K needs the lens and has none,
        or the reverse.
    """
    coefficient = choose_coefficient(coefficients, iso=exposure.iso)
    require_alike(coefficient, corrected=lens is not None)
    time_s = exposure.on_basis(coefficient.exposure_basis).exposure_time_s
    return MapScale(
        slope_cd_m2_per_dn=luminance_per_dn(coefficient, exposure)
        * math.prod(each.factor for each in corrections),
        dark_signal_dn=coefficient.at(time_s).dark_signal_dn,
        channel=coefficient.channel,
        lens=lens,
        offset_cd_m2=sum(each.offset_cd_m2 for each in corrections),
    )


def sum_signal(frame: Frame, *, channel: str) -> tuple[Sums, int]:
    """Compute each pixel's signal as a whole number of parts of one DN.

    Parameters
    ----------
    frame : Frame
        Window of the frame.
    channel : str
        "green" or "grey".

    Returns
    -------
    tuple[Sums, int]
        Signal [DN / parts], (row, col), and the number of parts.

    Notes
    -----
    For "green" of a mosaic it is a green position's own value, and elsewhere the
    mean of the four green neighbours. For "grey" of a mosaic it is the 3 x 3 mean
    with weights 1 2 1, 2 4 2, 1 2 1 over 16, in which each of the four CFA
    positions has the weight of a quarter wherever it is placed. For a colour image
    it is the green plane or the mean of the three, for a grey image the value
    itself.

    Beyond the window's border the values are mirrored at the outermost pixels,
    which keeps the pattern in phase: a block that is not at the frame's border must
    be read with RIM_PX more on each side.
    """
    parts, bands = _sum_bands(frame, channel=channel)
    return np.concatenate([sums for _, sums in bands]), parts


def _sum_bands(frame: Frame, *, channel: str) -> tuple[int, Iterator[tuple[int, Sums]]]:
    """Return the parts of one DN, and the sums of `sum_signal` a few rows at a time, with the first row."""
    samples = frame.samples_dn
    firsts = range(0, len(samples), _CHUNK_ROWS)
    if frame.cfa == "rgb" and channel == GREY:
        return 3, ((row, samples[row : row + _CHUNK_ROWS].sum(axis=2, dtype=np.uint32)) for row in firsts)
    if frame.cfa in {"rgb", GREY}:
        plane = samples[..., 1] if frame.cfa == "rgb" else samples
        return 1, ((row, plane[row : row + _CHUNK_ROWS]) for row in firsts)
    parts, add = (16, _sum_around) if channel == GREY else (4, _sum_beside)
    # twice as fast where they fit, as they do for 14 bits
    wide = parts * int(samples.max()) > _MOST_IN_16_BITS
    kind = np.uint32 if wide else np.uint16
    # all bits where a pixel's own value counts: choosing by them is twice as fast as by every other pixel
    own = np.zeros((_CHUNK_ROWS, samples.shape[1]), kind)
    for site in () if channel == GREY else _green_sites(frame):
        own[site] = np.iinfo(kind).max

    def sum_band(first: int) -> Sums:
        rows_dn = _read_rows(samples, first - 1, min(first + _CHUNK_ROWS, len(samples)) + 1)
        band: Sums = rows_dn.astype(kind) if wide else rows_dn
        sums = add(band)
        if channel != GREY:
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

    Parameters
    ----------
    frame : Frame
        Window of the frame.
    scale : MapScale
        Scale of the map.

    Returns
    -------
    Plane
        Luminance [cd/m2], (row, col); NaN where a value that N is made of is
        saturated.

    Notes
    -----
    L = (N - D) f^2 / (K t S) with N from `sum_signal`, each value the float32
    nearest to it. Nothing is clipped: noise below dark is a negative luminance.
    With a lens this is divided by the float32 nearest to V of the pixel.
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
            cv2.LUT(sums, table[: _MOST_IN_16_BITS + 1], target)
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
    """Compute the mean luminance of a window, band by band; saturated pixels count as saturation.

    Returns
    -------
    float
        Mean [cd/m2]; with saturated pixels a lower bound.
    """
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
    """Return the pixels at which a value that the signal is made of is saturated.

    Parameters
    ----------
    frame : Frame
        Window of the frame.
    channel : str
        "green" or "grey".

    Returns
    -------
    ndarray of bool or None
        True for these pixels, (row, col); None if there is none.
    """
    samples, white = frame.samples_dn, np.array(frame.white_level_dn)
    if not samples.size or samples.max() < white.min():
        return None
    if frame.cfa == "rgb":
        over = samples >= white
        return np.asarray(over.any(axis=2) if channel == GREY else over[..., 1], np.bool_)
    if frame.cfa == GREY:
        return np.asarray(samples >= white[0], np.bool_)
    height, width = samples.shape
    rows, cols = (np.arange(height) + frame.row0) % 2, (np.arange(width) + frame.col0) % 2
    over = samples >= white[2 * rows[:, None] + cols]
    padded = np.pad(over, 1, mode="reflect")
    beside = padded[:-2, 1:-1] | padded[2:, 1:-1] | padded[1:-1, :-2] | padded[1:-1, 2:]
    if channel == GREY:
        corners = padded[:-2, :-2] | padded[:-2, 2:] | padded[2:, :-2] | padded[2:, 2:]
        return np.asarray(beside | corners | over, np.bool_)
    for part in _green_sites(frame):
        beside[part] = over[part]
    return np.asarray(beside, np.bool_)


def find_measured(frame: Frame, *, channel: str) -> NDArray[np.bool_]:
    """Return the pixels whose signals are their own and not their neighbours'.

    Parameters
    ----------
    frame : Frame
        Window of the frame.
    channel : str
        "green" or "grey".

    Returns
    -------
    ndarray of bool
        True for these pixels, (row, col).
    """
    shape = frame.samples_dn.shape[:2]
    if frame.cfa in ("rgb", GREY) or channel == GREY:
        return np.ones(shape, np.bool_)
    measured = np.zeros(shape, np.bool_)
    for part in _green_sites(frame):
        measured[part] = True
    return measured


def _green_sites(frame: Frame) -> list[tuple[slice, slice]]:
    """Return the two green CFA positions of the pattern as parts of the window."""
    return [
        (slice((site // 2 - frame.row0) % 2, None, 2), slice((site % 2 - frame.col0) % 2, None, 2))
        for site, letter in enumerate(frame.cfa)
        if letter == "G"
    ]
