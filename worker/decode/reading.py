"""What is asked of a file: its header, a window of its mosaic, and its preview with its proof."""

import os
from collections import OrderedDict
from pathlib import Path
from typing import NamedTuple

import numpy as np

from radiometry.errors import Code, InputRejected
from radiometry.frame import Frame, FrameHeader
from radiometry.proof import Proof
from worker.decode.inspection import inspect
from worker.decode.opening import OpenedFile, open_file

PREVIEW_SIDE_PX = 1600
_KEPT_OPEN = 4


class Window(NamedTuple):
    """Rows and columns of the visible area."""

    row0: int
    col0: int
    height: int
    width: int


class Reader:
    """Keeps the last few files open, parsed: a header is mostly followed by a window of the same file."""

    def __init__(self) -> None:
        self._opened: OrderedDict[tuple[str, int, int, int], OpenedFile] = OrderedDict()

    def read_header(self, path: Path, digests: bytes | None = None) -> FrameHeader:
        return self._open(path, digests).header

    def read_window(self, path: Path, window: Window, digests: bytes | None = None) -> Frame:
        opened = self._open(path, digests)
        header = opened.header
        _check_inside(window, header)
        samples = opened.read(*window)
        return Frame(
            samples_dn=np.ascontiguousarray(samples),
            row0=window.row0,
            col0=window.col0,
            height_px=header.height_px,
            width_px=header.width_px,
            cfa=header.cfa,
            black_level_dn=opened.black_level(*window),
            white_level_dn=header.white_level_dn,
        )

    def inspect(
        self, path: Path, longest_side_px: int = PREVIEW_SIDE_PX, digests: bytes | None = None
    ) -> tuple[bytes, Proof]:
        """The frame's preview, and the proof of its pixels: every row is read."""
        return inspect(self._open(path, digests), longest_side_px)

    def _open(self, path: Path, digests: bytes | None) -> OpenedFile:
        status = os.stat(path)  # noqa: PTH116  one call, and the path may be a str from the wire
        key = (str(path), status.st_mtime_ns, status.st_size, status.st_ino)
        opened = self._opened.pop(key, None) or open_file(path, digests)
        self._opened[key] = opened
        while len(self._opened) > _KEPT_OPEN:
            self._opened.popitem(last=False)
        return opened


def _check_inside(window: Window, header: FrameHeader) -> None:
    row_end, col_end = window.row0 + window.height, window.col0 + window.width
    fits = row_end <= header.height_px and col_end <= header.width_px
    if not (fits and min(window) >= 0 and window.height > 0 and window.width > 0):
        raise InputRejected(
            Code.ROI_OUTSIDE_FRAME,
            f"The region reaches beyond the image's {header.width_px} x {header.height_px} pixels. "
            "Draw it inside the image.",
        )


def read_header(path: Path) -> FrameHeader:
    return Reader().read_header(path)


def read_window(path: Path, row0: int, col0: int, height: int, width: int) -> Frame:
    return Reader().read_window(path, Window(row0, col0, height, width))


def render_preview(path: Path, longest_side_px: int = PREVIEW_SIDE_PX) -> bytes:
    return Reader().inspect(path, longest_side_px)[0]


def prove(path: Path) -> Proof:
    return Reader().inspect(path)[1]
