"""Checks that a frame is whole, and the proof of it."""

import math
from collections.abc import Iterator
from dataclasses import field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from radiometry.frame import FrameHeader
from radiometry.records import Record

# Neighbours in a row that are looked at together. Noise around black leaves half of them above it: that all
# of a span lie below half of black has a chance of less than 2^-64. A column of dead pixels fills none.
SPAN_PX = 64
# A black level this near to what a sample can hold at least may be clipped there by the camera.
_CLIPPED_DN = 16.0
# A sensor may have a dead row, and a driver leave the first rows unwritten.
_DEAD_ROWS = 1
_UNWRITTEN_ROWS = 8
# What a camera clips at black ends gradually, what is missing at once: of the two rows beside it, one of
# which may be cut, most spans are lit.
_FEWEST_ROWS = 8
_EDGE_ROWS = 2
_LIT_SHARE = 0.75
# Where damage begins or ends amid the one row that is not empty, so much of it is left at least: a camera may
# write a counter there.
_FEWEST_LEFT_PX = 32
_MOST_GROUPS = 256
_MOST_BLOCKS = 16


class EmptyBlock(Record):
    """Rows [row0, row0 + rows) and columns [col0, col0 + cols) of the visible area."""

    row0: int  # First row and column
    col0: int
    rows: int  # Number of rows and columns
    cols: int


class Wholeness(Record):
    """Statistics of every row of an image."""

    # Rows that each of the following fractions covers, from the top; the last group may have fewer
    group_rows: int
    # Fractions of samples at the smallest value that a sample can hold, and below half of the black level
    zero_share: tuple[float, ...]
    below_share: tuple[float, ...]
    empty: tuple[EmptyBlock, ...]  # Blocks where data is probably missing; empty for an image without doubt


def describe_empty(blocks: tuple[EmptyBlock, ...], *, height_px: int, width_px: int) -> str:
    """Return where an image is empty, as a sentence without its full stop."""
    if not blocks:
        return ""
    share = sum(block.rows * block.cols for block in blocks) / (height_px * width_px)
    top, bottom = blocks[0].row0, max(block.row0 + block.rows for block in blocks)
    left, right = min(block.col0 for block in blocks), max(block.col0 + block.cols for block in blocks)
    cols = "" if right - left >= width_px else f" in columns {left} to {right - 1}"
    where = f"rows {top} to {bottom - 1}{cols}"
    return f"the image is empty in {where}, {share:.2%} of it: zeros or below black, without a sensor's noise"


class WholenessCheck:
    """Check of the rows of an image as they are read, from the top."""

    def __init__(
        self,
        *,
        height_px: int,
        width_px: int,
        channels: int,
        black_dn: float,
        lowest_dn: float,
        rendered: bool,
        doubts_black: bool = True,
    ) -> None:
        self._height, self._channels = height_px, channels
        self._rendered, self._doubts_black = rendered, doubts_black
        self._lowest = math.floor(lowest_dn)
        self._clipped = black_dn - lowest_dn < _CLIPPED_DN
        half = math.ceil(black_dn / 2) - 1
        self._limit = self._lowest if self._clipped else max(self._lowest, half)
        self._below = max(0, half)
        self._width = width_px * channels
        # what is left of a row is a span of its own, or part of the last one
        spans = max(1, (self._width + SPAN_PX // 2) // SPAN_PX)
        self._starts = np.arange(0, spans, dtype=np.intp) * SPAN_PX
        self._empty = np.zeros((height_px, len(self._starts)), bool)
        self._zeros = np.zeros(height_px, np.int64)
        self._first_lit = np.zeros(height_px, np.intp)
        self._end_lit = np.full(height_px, self._width, np.intp)
        self._belows = np.zeros(height_px, np.int64)

    def add(self, row0: int, samples: NDArray[np.uint16]) -> None:
        """Check the next rows, (row, col) or (row, col, channel) [DN]."""
        flat = samples.reshape(len(samples), self._width)
        # nearly every row of nearly every frame holds nothing that is looked for: that is told in one pass
        low = np.flatnonzero(flat.min(axis=1) <= max(self._limit, self._below))
        if not len(low):
            return
        rows = flat if len(low) == len(flat) else flat[low]
        at = row0 + low
        lit = rows > self._lowest
        self._zeros[at] = self._width - np.count_nonzero(lit, axis=1)
        self._first_lit[at] = lit.argmax(axis=1)
        self._end_lit[at] = self._width - lit[:, ::-1].argmax(axis=1)
        if self._below > self._lowest:
            self._belows[at] = np.count_nonzero(rows <= self._below, axis=1)
        self._empty[at] = np.maximum.reduceat(rows, self._starts, axis=1) <= self._limit

    def conclude(self) -> Wholeness:
        """Return the result after all rows have been added."""
        group = max(1, -(-self._height // _MOST_GROUPS))
        return Wholeness(
            group_rows=group,
            zero_share=self._share(self._zeros, group),
            below_share=self._share(self._belows, group),
            empty=tuple(self._find_empty()) if self._doubts_black else (),
        )

    def _share(self, counts: NDArray[np.int64], group: int) -> tuple[float, ...]:
        starts = np.arange(0, self._height, group)
        rows = np.diff(starts, append=self._height)
        shares = np.add.reduceat(counts, starts) / (rows * self._width)
        return tuple(round(float(share), 6) for share in shares)

    def _find_empty(self) -> Iterator[EmptyBlock]:
        empty = self._empty
        if self._clipped:
            rows = _find_black_rows(empty, fewest=_FEWEST_ROWS, rendered=self._rendered)
            found = [
                (*run, 0, empty.shape[1])
                for run in rows
                if _begins_beside_light(empty, *run) or self._begins_amid_a_row(*run)
            ]
            if not self._rendered:
                cols = _find_black_rows(empty.T, fewest=1, rendered=False)
                found += [(0, self._height, *run) for run in cols if _begins_beside_light(empty.T, *run)]
        else:
            found = list(_find_rows(empty))
        for row0, row_end, span0, span_end in found[:_MOST_BLOCKS]:
            col0, col_end = int(self._starts[span0]), self._end(span_end)
            yield EmptyBlock(
                row0=row0,
                col0=col0 // self._channels,
                rows=row_end - row0,
                cols=-(-col_end // self._channels) - col0 // self._channels,
            )

    def _begins_amid_a_row(self, row0: int, row_end: int) -> bool:
        """Return True if a neighbouring row is lit up to where the damage begins, or from where it ends.

        Only called for a row beyond which nothing is lit either: any other one has a whole row beside it.
        """
        lit = self._width - self._zeros
        before, after = row0 - 1, row_end
        alone = before == 0 or (before > 0 and self._empty[before - 1].all())
        if alone and lit[before] >= max(_FEWEST_LEFT_PX, _LIT_SHARE * self._end_lit[before]):
            return True
        alone = after == self._height - 1 or (after < self._height and self._empty[after + 1].all())
        reach = self._width - self._first_lit[min(after, self._height - 1)]
        return bool(alone and lit[after] >= max(_FEWEST_LEFT_PX, _LIT_SHARE * reach))

    def _end(self, span_end: int) -> int:
        """Return the end of a span; the last span contains the rest of the row."""
        return self._width if span_end == len(self._starts) else int(self._starts[span_end])


_Box = tuple[int, int, int, int]  # First and past-the-last row, first and past-the-last span


def _find_rows(empty: NDArray[np.bool_]) -> Iterator[_Box]:
    """Find the rows with an empty span, except those that a sensor or its driver may leave."""
    for row0, row_end in _find_runs(empty.any(axis=1)):
        part = empty[row0:row_end]
        whole = bool(part.all())
        dead = row_end - row0 <= _DEAD_ROWS or (row0 == 0 and row_end <= _UNWRITTEN_ROWS)
        # that all of an image lies below black is no dead row
        if whole and dead and row_end - row0 < len(empty):
            continue
        spans = np.flatnonzero(part.any(axis=0))
        yield row0, row_end, int(spans[0]), int(spans[-1]) + 1


def _find_black_rows(empty: NDArray[np.bool_], *, fewest: int, rendered: bool) -> Iterator[tuple[int, int]]:
    """Find the whole empty rows in which a camera's own black is not expected."""
    runs = _find_runs(empty.all(axis=1))
    for row0, row_end in runs:
        # a picture may have been set in black; that it ends in black below alone is another thing
        set_in_black = rendered and (row_end < len(empty) or runs[0][0] == 0)
        if row_end - row0 >= fewest and not set_in_black:
            yield row0, row_end


def _begins_beside_light(empty: NDArray[np.bool_], row0: int, row_end: int) -> bool:
    beside = (*empty[max(0, row0 - _EDGE_ROWS) : row0], *empty[row_end : row_end + _EDGE_ROWS])
    return any(1.0 - row.mean() >= _LIT_SHARE for row in beside)


def _find_runs(marked: NDArray[np.bool_] | np.bool_) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.asarray(marked).astype(np.int8), prepend=0, append=0))
    return [(int(first), int(end)) for first, end in edges.reshape(-1, 2)]


Voucher = Literal["digest", "checksum", "end", "length", "libraw"]
"""Check that shows that the samples are those that the camera wrote, the strongest first.

"digest" is the file's own digest of all samples, and "checksum" one of each compressed piece. "end": each
piece ends where it states and is as long as its samples need. "length": the file has a byte for each sample.
"libraw": LibRaw reported success.
"""


class PieceRun(Record):
    """Consecutive pieces (strips or tiles) of equal size."""

    pieces: int
    stored_bytes: int  #: Stored bytes of each piece
    consumed_bytes: int  #: Bytes of each piece up to the end of its data
    samples: int  #: Samples decoded from each piece


class Proof(Record):
    """Evidence collected while all pixels of a frame were read."""

    vouched_by: Voucher  #: Strongest check that the pixels passed
    wholeness: Wholeness  #: Result of the search for empty parts
    #: First thousand runs of pieces; empty if LibRaw decoded the frame
    pieces: tuple[PieceRun, ...] = field(default=())
    highest_dn: int = 0  #: Largest sample [DN]; 0 for frames that were read before it was noted

    def describe_doubt(self, header: FrameHeader) -> str:
        """Return the doubt about the pixels as a sentence without its full stop; "" if there is none."""
        return describe_empty(self.wholeness.empty, height_px=header.height_px, width_px=header.width_px)
