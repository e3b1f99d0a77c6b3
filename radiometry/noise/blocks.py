"""Square of raw samples from the middle of a frame's region, by channel."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected, shared
from radiometry.fitting.evidence import Extracted, FrameEvidence, Region
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.packing import Packed, pack
from radiometry.frame.roi import Window, mask
from radiometry.frame.statistics import GREY, compute_statistics, name_site

LARGEST_SIDE = 96  # Samples along a side. 9216 of them give the variance of a pair within 1.5 %.

SMALLEST_SIDE = 16  # 256 samples: a variance within 9 %, below which few levels give no gain worth its name


@dataclass(frozen=True, kw_only=True)
class ChannelBlock:
    """Square of raw samples of one channel, black included."""

    # R, G1, G2, B for a mosaic; R, G, B for a rendered image; grey; or the name of a multispectral band
    channel: str
    row0: int  # Position of its first sample in the visible area [px]
    col0: int
    step: int  # Distance to the next sample of the channel [px]
    samples_dn: Packed  # Raw samples [DN]
    clipped_share: float  # Fraction of samples at or above the white level
    zero_share: float  # Fraction of samples that are 0
    black_level_dn: float
    white_level_dn: float


@dataclass(frozen=True, kw_only=True)
class Features:
    """A frame's blocks, ready for JSON: all of the same place and size."""

    blocks: tuple[ChannelBlock, ...]


FrameRow = FrameEvidence[Features]


def extract_features(frame: Frame, regions: Sequence[Region], *, header: FrameHeader) -> Extracted[Features]:
    """Read the largest square about the middle of the first region, at most 96 samples a side and channel.

    In a mosaic the square consists of whole 2 x 2 cells, so that every channel has the same place. It is
    the same square in every frame of one region: differences of frames are differences of the same pixels.
    """
    height, width = frame.samples_dn.shape[:2]
    window = Window(row0=frame.row0, col0=frame.col0, height=height, width=width)
    inside = mask(regions[0].polygon, window)
    if not inside.any():
        raise InputRejected(shared.ROI_EMPTY, "The region holds no pixel of this window of the frame.")
    step = 1 if frame.cfa in (GREY, "rgb") else 2
    skip_row, skip_col = frame.row0 % step, frame.col0 % step
    cells = _join_cells(inside[skip_row:, skip_col:], step)
    row, col, side = _find_square(cells)
    part = frame.samples_dn[
        skip_row + row * step : skip_row + (row + side) * step,
        skip_col + col * step : skip_col + (col + side) * step,
    ]
    at = (frame.row0 + skip_row + row * step, frame.col0 + skip_col + col * step)
    band = header.multispectral.band if header.multispectral else GREY
    blocks = tuple(
        _describe(samples, channel, frame, level=level, at=(at[0] + offset[0], at[1] + offset[1]), step=step)
        for channel, level, offset, samples in _split(part, frame.cfa, band)
    )
    return Extracted(statistics=compute_statistics(frame, inside), features=Features(blocks=blocks))


def _join_cells(inside: NDArray[np.bool_], step: int) -> NDArray[np.bool_]:
    """Return, for every cell of step x step pixels, True if all of them are inside."""
    rows, cols = inside.shape[0] // step, inside.shape[1] // step
    cut = inside[: rows * step, : cols * step].reshape(rows, step, cols, step)
    return np.asarray(cut.all(axis=(1, 3)), np.bool_)


def _find_square(cells: NDArray[np.bool_]) -> tuple[int, int, int]:
    """Return row, column and side of the largest square of cells about the middle of the region."""
    spans = [np.flatnonzero(cells.any(axis=axis)) for axis in (1, 0)]
    if all(span.size for span in spans):
        middles = [int(span[0] + span[-1] + 1) for span in spans]  # twice the middle
        most = min(LARGEST_SIDE, *(int(span[-1] - span[0] + 1) for span in spans))
        for side in range(most, SMALLEST_SIDE - 1, -1):
            row, col = ((middle - side) // 2 for middle in middles)
            if cells[row : row + side, col : col + side].all():
                return row, col, side
    raise InputRejected(
        shared.ROI_EMPTY,
        f"The region holds no square of {SMALLEST_SIDE} x {SMALLEST_SIDE} samples of every channel in its "
        "middle: draw it larger.",
    )


def _split(
    part: NDArray[np.uint16], cfa: str, band: str
) -> Iterator[tuple[str, int, tuple[int, int], NDArray[np.uint16]]]:
    """Return channel, index of its levels, offset and samples of each plane."""
    if cfa == "rgb":
        for plane, name in enumerate("RGB"):
            yield name, plane, (0, 0), part[..., plane]
    elif cfa == GREY:
        yield band, 0, (0, 0), part
    else:
        for site in range(4):
            row, col = divmod(site, 2)
            yield name_site(cfa, site), site, (row, col), part[row::2, col::2]


def _describe(
    samples: NDArray[np.uint16], channel: str, frame: Frame, *, level: int, at: tuple[int, int], step: int
) -> ChannelBlock:
    white = frame.white_level_dn[level % len(frame.white_level_dn)]
    return ChannelBlock(
        channel=channel,
        row0=at[0],
        col0=at[1],
        step=step,
        samples_dn=pack(samples, dtype="<u2"),
        clipped_share=float(np.mean(samples >= white)),
        zero_share=float(np.mean(samples == 0)),
        black_level_dn=frame.black_level_dn[level % len(frame.black_level_dn)],
        white_level_dn=white,
    )
