"""Signals divided by the relative illumination per pixel, so that K holds anywhere in the frame."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from radiometry.frame import Frame
from radiometry.frame.roi import Polygon, Window, mask
from radiometry.frame.statistics import GREY, Signal, mean_variance, name_site, rounding_variance
from radiometry.vignetting.lens import Lens, LensShare

_BAND_ROWS = 256
_PLANES = ("R", "G", "B")


@dataclass(frozen=True)
class _Part:
    """The pixels of one channel in a window, and their position in the frame."""

    channel: str
    part: tuple[slice | int, ...]  # of the samples
    rows: slice
    cols: slice


def name_channels(cfa: str, *, channel: str) -> tuple[str, ...]:
    """Name the channels of a frame that a calibration's signal is made of.

    Parameters
    ----------
    cfa : str
        CFA pattern of the frame.
    channel : str
        "green" or "grey".
    """
    if cfa == GREY:
        return (GREY,)
    if cfa == "rgb":
        return _PLANES if channel == GREY else ("G",)
    sites = tuple(name_site(cfa, index) for index in range(4))
    return tuple(dict.fromkeys(site for site in sites if channel == GREY or site.startswith("G")))


def correct_signal(
    frame: Frame, polygon: Polygon, signal: Signal, lens: Lens, *, channel: str, dark_signal_dn: float
) -> tuple[Signal, LensShare]:
    """Correct a region's signal for vignetting.

    Parameters
    ----------
    frame : Frame
        Window that contains the region's window.
    polygon : Polygon
        Region.
    signal : Signal
        Signal of the region's statistics.
    lens : Lens
        Relative illumination at the frame's f-number.
    channel : str
        "green" or "grey".
    dark_signal_dn : float
        Dark signal D [DN].

    Returns
    -------
    tuple[Signal, LensShare]
        Signal N and relative illumination V, such that (N - D) / V is the mean of
        (N_i - D) / V_i.

    Raises
    ------
    InputRejected
        `vignetting_not_calibrated`.

    Notes
    -----
    For an even surface N is the region's mean and V the harmonic mean of V_i. For a
    structured one, no part of the surface has more weight because the lens
    transmits more there::

        V = 1 / mean(1 / V_i),   N = D + V mean((N_i - D) / V_i)

    The channels have the same weights as in the uncorrected signal: both greens
    equal, every CFA position of "grey" equal. Noise is the standard deviation of
    (N_i - D) / V_i, which the falloff itself does not widen.
    """
    height, width = frame.samples_dn.shape[:2]
    inside = mask(polygon, Window(row0=frame.row0, col0=frame.col0, height=height, width=width))
    gains, lights = [], []
    for each in _list_parts(frame, channel=channel):
        chosen = inside[each.rows, each.cols]
        if not chosen.any():
            continue
        plane = lens.compute_plane(*_places(frame, each), channel=each.channel)
        gains.append(1.0 / plane[chosen].astype(np.float64))
        lights.append((frame.samples_dn[each.part][chosen] - dark_signal_dn) * gains[-1])
    if channel == GREY:
        gains, lights = [np.concatenate(gains)], [np.concatenate(lights)]
    count = len(gains)
    harmonic = 1.0 / (sum(float(gain.mean()) for gain in gains) / count)
    light = sum(float(found.mean()) for found in lights) / count
    spreads = [(_spread(found) * harmonic, found.size) for found in lights]
    variance = sum(mean_variance(std_dn, n) for std_dn, n in spreads) / count**2
    share = lens.over(polygon, channels=name_channels(frame.cfa, channel=channel))
    corrected = replace(
        signal,
        value_dn=dark_signal_dn + light * harmonic,
        standard_uncertainty_dn=math.sqrt(variance),
        rounding_dn=math.sqrt(sum(rounding_variance(std_dn) for std_dn, _ in spreads)) / count,
    )
    effects = tuple(effect * harmonic / share.value for effect in share.effects)
    return corrected, LensShare(value=harmonic, effects=effects)


def _spread(values: NDArray[np.float64]) -> float:
    return float(values.std(ddof=1)) if values.size > 1 else 0.0


def compute_shares(frame: Frame, lens: Lens, *, channel: str) -> NDArray[np.float32]:
    """Compute V of each pixel's signal as a map has it.

    Parameters
    ----------
    frame : Frame
        Window of the frame.
    lens : Lens
        Relative illumination at the frame's f-number.
    channel : str
        "green" or "grey".

    Returns
    -------
    ndarray of float32
        V, (row, col).

    Notes
    -----
    A pixel that has its own value has its own channel's V. One that has the mean of
    its neighbours has the mean of the channels' V at its own place: over two pixels
    V is a plane.
    """
    height, width = frame.samples_dn.shape[:2]
    rows, cols = np.arange(height) + frame.row0, np.arange(width) + frame.col0
    channels = name_channels(frame.cfa, channel=channel)
    shares = np.empty((height, width), np.float32)
    for top in range(0, height, _BAND_ROWS):
        band = rows[top : top + _BAND_ROWS]
        planes = [lens.compute_plane(band, cols, channel=name) for name in channels]
        shares[top : top + _BAND_ROWS] = sum(planes[1:], planes[0]) / np.float32(len(planes))
        if channel == GREY or frame.cfa in ("rgb", GREY):
            continue
        for each in _list_parts(frame, channel=channel):
            plane, first = planes[channels.index(each.channel)], (each.rows.start - top) % 2
            shares[top : top + _BAND_ROWS][first::2, each.cols] = plane[first::2, each.cols]
    return shares


def _list_parts(frame: Frame, *, channel: str) -> list[_Part]:
    every = slice(None)
    if frame.cfa == GREY:
        return [_Part(GREY, (every, every), every, every)]
    wanted = name_channels(frame.cfa, channel=channel)
    if frame.cfa == "rgb":
        return [
            _Part(name, (every, every, index), every, every)
            for index, name in enumerate(_PLANES)
            if name in wanted
        ]
    parts = []
    for index in range(4):
        name = name_site(frame.cfa, index)
        rows = slice((index // 2 - frame.row0) % 2, None, 2)
        cols = slice((index % 2 - frame.col0) % 2, None, 2)
        if name in wanted:
            parts.append(_Part(name, (rows, cols), rows, cols))
    return parts


def _places(frame: Frame, part: _Part) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the rows and columns, in the frame, of a part's pixels."""
    height, width = frame.samples_dn.shape[:2]
    return (np.arange(height) + frame.row0)[part.rows], (np.arange(width) + frame.col0)[part.cols]
