"""A whole frame's rows in order, read strip by strip, the next ones while the last is worked on."""

import itertools
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from types import TracebackType
from typing import Self

import numpy as np

from radiometry.frame import Frame, FrameHeader
from worker.decode.pool import DecoderPool, Readable

_STRIP_PX = 1 << 21
_AHEAD = 2


def cut_strips(header: FrameHeader) -> list[tuple[int, int]]:
    """First row and height of each strip: whole bands of the file's tiles, so that none is decoded twice."""
    bands = max(1, round(_STRIP_PX / (header.width_px * header.band_rows)))
    ends = range(
        header.first_band_rows + (bands - 1) * header.band_rows,
        header.height_px,
        bands * header.band_rows,
    )
    edges = [0, *ends, header.height_px]
    return [(top, bottom - top) for top, bottom in itertools.pairwise(edges)]


class StripReader:
    """Reader of any rows of a frame, as long as they are asked for from the top downwards.

    The next two strips are read meanwhile, by one process: starting another takes longer than it saves.
    """

    def __init__(self, decoders: DecoderPool, file: Readable, header: FrameHeader) -> None:
        self._decoders = decoders
        self._file = file
        self._width = header.width_px
        self._ahead = ThreadPoolExecutor(1, thread_name_prefix="strips")
        self._left = iter(cut_strips(header))
        self._coming: deque[Future[Frame]] = deque()
        self._held: list[Frame] = []

    def __enter__(self) -> Self:
        for _ in range(_AHEAD):
            self._fetch()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ahead.shutdown(cancel_futures=True)

    def rows(self, first: int, last: int) -> Frame:
        """Rows [first, last) of the frame; what lies above them is forgotten."""
        self._held = [frame for frame in self._held if _end(frame) > first]
        while not self._held or _end(self._held[-1]) < last:
            self._held.append(self._take())
        parts = [
            frame.samples_dn[max(0, first - frame.row0) : last - frame.row0]
            for frame in self._held
            if frame.row0 < last
        ]
        samples = parts[0] if len(parts) == 1 else np.concatenate(parts)
        return replace(self._held[0], samples_dn=samples, row0=first)

    def _take(self) -> Frame:
        frame = self._coming.popleft().result()
        self._fetch()
        return frame

    def _fetch(self) -> None:
        strip = next(self._left, None)
        if strip is not None:
            window = (strip[0], 0, strip[1], self._width)
            self._coming.append(self._ahead.submit(self._decoders.read_window, self._file, window))


def _end(frame: Frame) -> int:
    return int(frame.row0 + frame.samples_dn.shape[0])


def cut_bands(height_px: int, rows: int) -> Iterator[tuple[int, int]]:
    """First and last row (exclusive) of each band of a map."""
    return ((top, min(top + rows, height_px)) for top in range(0, height_px, rows))
