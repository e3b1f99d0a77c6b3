"""A region's linear signal, channel by channel, each on its own lattice of the sensor."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import shared
from radiometry.frame import Frame
from radiometry.frame.roi import Window
from radiometry.frame.statistics import GREY
from radiometry.records import Record

LUMINANCE = "luminance"
# As sfrmat5 weighs red, green and blue, after ITU-R BT.709
LUMINANCE_WEIGHTS = {"R": 0.213, "G": 0.715, "B": 0.072}

Matrix = NDArray[np.float64]


class Tone(Record):
    """The tone curve of a rendered image: linear | srgb | gamma, the latter with its exponent."""

    curve: str
    gamma: float


class Plane(Record):
    """Samples of one channel in a region: lines of equally spaced samples.

    Sample k of line j lies at (line_px[j], first_px[j] + k pitch_px), in pixel indices of the whole frame,
    the line along the rows or, transposed, along the columns. Green takes both its sites: lines of either
    row, each beginning where its own first green lies.
    """

    channel: str
    values: Matrix  # Signal above black, linear, (line, sample)
    line_px: Matrix  # Place of each line [px]
    first_px: Matrix  # Place of the first sample of each line [px]
    pitch_px: float  # Distance between samples of a line [px]; 2 on a colour filter array
    clipped_share: float  # Fraction of the samples at white, or at a raw number of 0

    @property
    def positions_px(self) -> Matrix:
        """Place of every sample along its line [px], (line, sample)."""
        return self.first_px[:, None] + self.pitch_px * np.arange(self.values.shape[1])


class _Site(Record, kw_only=False):
    """Samples of one CFA site or colour plane."""

    values: Matrix
    row_px: Matrix
    col_px: Matrix
    clipped: NDArray[np.bool_]

    @property
    def transposed(self) -> "_Site":
        return _Site(self.values.T, self.col_px, self.row_px, self.clipped.T)


def read_planes(frame: Frame, window: Window, *, tone: Tone | None, transposed: bool) -> tuple[Plane, ...]:
    """Read the channels of a window: grey; R, G, B and luminance of a colour image; R, G, B of a mosaic.

    A mosaic has no luminance of its own: that would need values that were never measured.
    """
    sites = _read_sites(frame, window, tone)
    turned = {
        name: [site.transposed if transposed else site for site in found] for name, found in sites.items()
    }
    planes = [_join(name, found) for name, found in turned.items()]
    if frame.cfa == "rgb":
        planes.append(_weigh(planes))
    return tuple(planes)


def average_sites(frame: Frame, window: Window, *, tone: Tone | None) -> tuple[Matrix, float]:
    """Compute a picture of a window in which to find things: 2 x 2 means of a mosaic; and its pitch [px]."""
    sites = _read_sites(frame, window, tone)
    if frame.cfa == "rgb":
        weighed = [LUMINANCE_WEIGHTS[name] * found[0].values for name, found in sites.items()]
        return np.asarray(np.sum(weighed, axis=0), np.float64), 1.0
    if frame.cfa == GREY:
        return sites[GREY][0].values, 1.0
    every = [site.values for found in sites.values() for site in found]
    height, width = (min(values.shape[axis] for values in every) for axis in (0, 1))
    return np.asarray(np.mean([values[:height, :width] for values in every], axis=0), np.float64), 2.0


def _read_sites(frame: Frame, window: Window, tone: Tone | None) -> dict[str, list[_Site]]:
    """Sort the samples by channel: both greens of a mosaic are one."""
    row0, col0 = window.row0 - frame.row0, window.col0 - frame.col0
    samples = frame.samples_dn[max(row0, 0) : row0 + window.height, max(col0, 0) : col0 + window.width]
    if samples.shape[:2] != (window.height, window.width):
        raise shared.ROI_OUTSIDE_FRAME.reject(
            "A region leaves the part of the frame that was read: draw it inside."
        )
    black, white = frame.black_level_dn, frame.white_level_dn

    def take(part: NDArray[np.uint16], index: int, first: tuple[int, int], step: int) -> _Site:
        low, high = black[index % len(black)], white[index % len(white)]
        rows = window.row0 + first[0] + step * np.arange(part.shape[0], dtype=np.float64)
        cols = window.col0 + first[1] + step * np.arange(part.shape[1], dtype=np.float64)
        return _Site(_linearise(part, low, high, tone), rows, cols, (part >= high) | (part == 0))

    if frame.cfa == "rgb":
        return {name: [take(samples[..., index], index, (0, 0), 1)] for index, name in enumerate("RGB")}
    if frame.cfa == GREY:
        return {GREY: [take(samples, 0, (0, 0), 1)]}
    sites: dict[str, list[_Site]] = {name: [] for name in "RGB"}
    for index, name in enumerate(frame.cfa):
        row, col = divmod(index, 2)
        first = (row - window.row0) % 2, (col - window.col0) % 2
        sites[name].append(take(samples[first[0] :: 2, first[1] :: 2], index, first, 2))
    return sites


def _linearise(samples: NDArray[np.uint16], black: float, white: float, tone: Tone | None) -> Matrix:
    """Subtract black, and undo a rendered image's tone curve; white keeps its number."""
    signal = samples.astype(np.float64) - black
    if tone is None or tone.curve == "linear":
        return signal
    share = np.clip(signal / (white - black), 0.0, None)
    if tone.curve == "gamma":
        return np.asarray(share**tone.gamma * (white - black))
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return np.asarray(linear * (white - black))


def _join(channel: str, sites: Sequence[_Site]) -> Plane:
    """Lay the lines of a channel's sites in order."""
    width = min(site.values.shape[1] for site in sites)
    lines = np.concatenate([site.row_px for site in sites])
    order = np.argsort(lines, kind="stable")
    firsts = np.concatenate([np.full(site.row_px.size, site.col_px[0] if width else 0.0) for site in sites])
    clipped = [site.clipped for site in sites]
    return Plane(
        channel=channel,
        values=np.ascontiguousarray(np.concatenate([site.values[:, :width] for site in sites])[order]),
        line_px=lines[order],
        first_px=firsts[order],
        pitch_px=float(sites[0].col_px[1] - sites[0].col_px[0]) if width > 1 else 1.0,
        clipped_share=sum(int(each.sum()) for each in clipped) / max(1, sum(each.size for each in clipped)),
    )


def _weigh(planes: Sequence[Plane]) -> Plane:
    """Add red, green and blue of a colour image to its luminance."""
    first = planes[0]
    weighed = np.sum([LUMINANCE_WEIGHTS[plane.channel] * plane.values for plane in planes], axis=0)
    return Plane(
        channel=LUMINANCE,
        values=weighed,
        line_px=first.line_px,
        first_px=first.first_px,
        pitch_px=first.pitch_px,
        clipped_share=max(plane.clipped_share for plane in planes),
    )
