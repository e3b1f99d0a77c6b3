"""A small grey picture of a frame, to draw a region on: not for measuring."""

import imagecodecs
import numpy as np
from numpy.typing import NDArray

from radiometry.frame import FrameHeader

_GAMMA = 1 / 2.2
_BRIGHT_PERCENTILE = 99.7
_MAX_SIDE_PX = 4096


class PreviewMaker:
    """Makes an 8 bit PNG of the frame's rows as they come, from the top.

    A preview pixel is width_px / preview width frame pixels wide, from the visible corner.
    """

    def __init__(self, header: FrameHeader, longest_side_px: int) -> None:
        longest = max(16, min(longest_side_px, _MAX_SIDE_PX))
        scale = max(1.0, max(header.height_px, header.width_px) / longest)
        self._cell = 1 if header.cfa in ("grey", "rgb") else 2
        self._rows = _sampled(header.height_px, scale, self._cell)
        self._cols = _sampled(header.width_px, scale, self._cell)
        self._black = float(np.mean(header.black_level_dn))
        self._grey = np.zeros((len(self._rows), len(self._cols)), np.float32)

    def add(self, row0: int, samples: NDArray[np.uint16]) -> None:
        """Take of the next rows what the preview shows of them; a cell may lie in two calls."""
        if samples.ndim == 3:
            samples = samples[:, :, 1]  # green stands for brightness
        for phase in range(self._cell):
            first, last = np.searchsorted(self._rows + phase, (row0, row0 + len(samples)))
            lines = samples[self._rows[first:last] + phase - row0]
            for col_phase in range(self._cell):
                self._grey[first:last] += lines[:, self._cols + col_phase]

    def finish(self) -> bytes:
        """The PNG, when all rows have been seen."""
        self._grey /= self._cell**2
        return bytes(imagecodecs.png_encode(_stretch(self._grey, self._black), level=1))


def _sampled(size: int, scale: float, cell: int) -> NDArray[np.int64]:
    """The first line of the cell at the middle of each preview line.

    Any 2 x 2 sites hold all colours, so a cell may start anywhere; on even lines it stays in one tile.
    """
    count = max(1, round(size / scale))
    middles = ((np.arange(count) + 0.5) * size / count).astype(np.int64)
    first = np.minimum(middles, size - cell)
    return np.asarray(first // cell * cell if scale >= cell else first, np.int64)


def _stretch(grey: NDArray[np.float32], black: float) -> NDArray[np.uint8]:
    bright = max(float(np.percentile(grey, _BRIGHT_PERCENTILE)), black + 1.0)
    share = np.clip((grey - black) / (bright - black), 0.0, 1.0)
    return np.asarray(np.round(255 * share**_GAMMA), np.uint8)
