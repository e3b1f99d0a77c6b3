"""A small grey picture of a frame, to draw a region on: not for measuring."""

from collections.abc import Iterator

import imagecodecs
import numpy as np
from numpy.typing import NDArray

from worker.decode.opening import OpenedFile

_GAMMA = 1 / 2.2
_BRIGHT_PERCENTILE = 99.7
_MAX_SIDE_PX = 4096


def render(opened: OpenedFile, longest_side_px: int) -> bytes:
    """PNG, 8 bit. A preview pixel is width_px / preview width frame pixels wide, from the visible corner."""
    header = opened.header
    longest = max(16, min(longest_side_px, _MAX_SIDE_PX))
    scale = max(1.0, max(header.height_px, header.width_px) / longest)
    cell = 1 if header.cfa in ("grey", "rgb") else 2
    rows = _sampled(header.height_px, scale, cell)
    cols = _sampled(header.width_px, scale, cell)
    grey = _read_cells(opened, rows, cols, cell)
    black = float(np.mean(header.black_level_dn))
    return bytes(imagecodecs.png_encode(_stretch(grey, black), level=1))


def _sampled(size: int, scale: float, cell: int) -> NDArray[np.int64]:
    """The first line of the cell at the middle of each preview line.

    Any 2 x 2 sites hold all colours, so a cell may start anywhere; on even lines it stays in one tile.
    """
    count = max(1, round(size / scale))
    middles = ((np.arange(count) + 0.5) * size / count).astype(np.int64)
    first = np.minimum(middles, size - cell)
    return np.asarray(first // cell * cell if scale >= cell else first, np.int64)


def _read_cells(
    opened: OpenedFile, rows: NDArray[np.int64], cols: NDArray[np.int64], cell: int
) -> NDArray[np.float32]:
    out = np.zeros((len(rows), len(cols)), np.float32)
    width = opened.header.width_px
    for start, stop in _bands(rows, opened.band_rows):
        top = int(rows[start])
        band = opened.read(top, 0, int(rows[stop - 1]) + cell - top, width)
        if band.ndim == 3:
            band = band[:, :, 1]  # green stands for brightness
        for row_phase in range(cell):
            lines = band[rows[start:stop] - top + row_phase]
            for col_phase in range(cell):
                out[start:stop] += lines[:, cols + col_phase]
    out /= cell**2
    return out


def _bands(rows: NDArray[np.int64], band_rows: int) -> Iterator[tuple[int, int]]:
    """Runs of preview lines that lie in the same band, so that no compressed tile is decoded twice."""
    bands = rows // band_rows
    starts = np.flatnonzero(np.diff(bands, prepend=-1))
    yield from zip(starts.tolist(), [*starts[1:].tolist(), len(rows)], strict=True)


def _stretch(grey: NDArray[np.float32], black: float) -> NDArray[np.uint8]:
    bright = max(float(np.percentile(grey, _BRIGHT_PERCENTILE)), black + 1.0)
    share = np.clip((grey - black) / (bright - black), 0.0, 1.0)
    return np.asarray(np.round(255 * share**_GAMMA), np.uint8)
