"""The three things that are asked of a file: its header, a window of its mosaic, a picture to draw on."""

from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

from radiometry.findings import InputRejected, shared
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.proof import Proof
from worker.decode.budget import Allow, allow_all
from worker.decode.inspection import inspect
from worker.decode.opened import OpenedFile, open_source
from worker.decode.source import Source

PREVIEW_SIDE_PX = 1600


class Window(NamedTuple):
    """Rows and columns of the visible area."""

    row0: int
    col0: int
    height: int
    width: int


class Reader:
    """Reads one file, which is opened and parsed when it is first asked for."""

    def __init__(self, source: Source, allow: Allow = allow_all) -> None:
        self._source = source
        self._allow = allow
        self._opened: OpenedFile | None = None

    @classmethod
    def of(cls, path: Path) -> Self:
        """Read a file in this process: for files that one trusts."""
        with path.open("rb") as file:
            return cls(Source.map(file.fileno()))

    def read_header(self) -> FrameHeader:
        return self._open().header

    def read_window(self, window: Window) -> Frame:
        opened = self._open()
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

    def inspect(self, longest_side_px: int = PREVIEW_SIDE_PX) -> tuple[bytes, Proof]:
        """The frame's preview, and the proof of its pixels: every row is read."""
        return inspect(self._open(), longest_side_px)

    def _open(self) -> OpenedFile:
        if self._opened is None:
            self._opened = open_source(self._source, self._allow)
        return self._opened


def _check_inside(window: Window, header: FrameHeader) -> None:
    row_end, col_end = window.row0 + window.height, window.col0 + window.width
    fits = row_end <= header.height_px and col_end <= header.width_px
    if not (fits and min(window) >= 0 and window.height > 0 and window.width > 0):
        raise InputRejected(
            shared.ROI_OUTSIDE_FRAME,
            f"The region reaches beyond the image's {header.width_px} x {header.height_px} pixels. "
            "Draw it inside the image.",
        )


def read_header(path: Path) -> FrameHeader:
    return Reader.of(path).read_header()


def read_window(path: Path, row0: int, col0: int, height: int, width: int) -> Frame:
    return Reader.of(path).read_window(Window(row0, col0, height, width))


def render_preview(path: Path, longest_side_px: int = PREVIEW_SIDE_PX) -> bytes:
    return Reader.of(path).inspect(longest_side_px)[0]


def prove(path: Path) -> Proof:
    return Reader.of(path).inspect()[1]
