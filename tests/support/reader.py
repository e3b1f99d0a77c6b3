"""Files that are read in this process, without a cell: for those that one trusts."""

from pathlib import Path

from radiometry.frame import Frame, FrameHeader
from radiometry.frame.proof import Proof
from worker.decode.reader import Reader, Window
from worker.decode.tiff import Source


def open_reader(path: Path) -> Reader:
    return Reader(Source(path.read_bytes()))


def read_header(path: Path) -> FrameHeader:
    return open_reader(path).read_header()


def read_window(path: Path, row0: int, col0: int, height: int, width: int) -> Frame:
    return open_reader(path).read_window(Window(row0, col0, height, width))


def render_preview(path: Path, longest_side_px: int = 1600) -> bytes:
    return open_reader(path).inspect(longest_side_px)[0]


def prove(path: Path) -> Proof:
    return open_reader(path).inspect(1600)[1]
