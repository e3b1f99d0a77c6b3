"""The sensor's visible area and its colour pattern there."""

from typing import Final, NamedTuple

from radiometry.findings import files
from worker.decode import limits, tags
from worker.decode.tiff import Directory

_LETTERS: Final = {0: "R", 1: "G", 2: "B"}
BAYER: Final = ("RGGB", "GBRG", "BGGR", "GRBG")


class Area(NamedTuple):
    """Rows [top, bottom) and columns [left, right) of the whole frame."""

    top: int
    left: int
    bottom: int
    right: int

    @property
    def height(self) -> int:
        return self.bottom - self.top

    @property
    def width(self) -> int:
        return self.right - self.left


def read_visible_area(raw: Directory, rows: int, cols: int) -> Area:
    stated = raw.integers(tags.ACTIVE_AREA, at_most=4)
    if not stated:
        return Area(0, 0, rows, cols)
    if len(stated) != 4:
        raise files.SIZE_MISMATCH.refuse("The file's active area is incomplete.")
    area = Area(*stated)
    if not (0 <= area.top < area.bottom <= rows and 0 <= area.left < area.right <= cols):
        raise files.SIZE_MISMATCH.refuse("The file's active area lies outside its image.")
    limits.check_frame_size(area.height, area.width)
    return area


def read_cfa(raw: Directory) -> str:
    """The pattern at the visible area's corner, which is where DNG anchors it."""
    if raw.integer(tags.PHOTOMETRIC, -1) != tags.PHOTOMETRIC_CFA:
        return "grey"
    if raw.integer(tags.CFA_LAYOUT, 1) != 1:
        raise files.UNSUPPORTED_LAYOUT.refuse("The sensor's colour sites are staggered.")
    if raw.integer(tags.ROW_INTERLEAVE, 1) > 1 or raw.integer(tags.COLUMN_INTERLEAVE, 1) > 1:
        raise files.UNSUPPORTED_LAYOUT.refuse("The sensor's lines are stored interleaved.")
    pattern = raw.integers(tags.CFA_PATTERN, at_most=64)
    cfa = "".join(_LETTERS.get(colour, "?") for colour in pattern)
    if raw.integers(tags.CFA_REPEAT, at_most=2) not in ([], [2, 2]) or cfa not in BAYER:
        raise files.UNSUPPORTED_LAYOUT.refuse("The sensor's colour pattern is no Bayer pattern.")
    return cfa
