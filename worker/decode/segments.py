"""Windows of the stored samples: only the strips, tiles and bytes that they need are read.

Each compressed piece is decoded to its own end and has to end there, whatever part of it is wanted: what the
format has to prove its samples with, a checksum or an end code, stands behind the last of them.
"""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.proof import Voucher
from worker.decode import expansion, ljpeg, tags
from worker.decode.bits import unpack_rows
from worker.decode.layout import Layout
from worker.decode.pieces import decode_all
from worker.decode.source import Source

COMPRESSIONS = {
    tags.UNCOMPRESSED: "none",
    tags.JPEG: "ljpeg",
    tags.DEFLATE: "deflate",
    tags.DEFLATE_OLD: "deflate",
    tags.LZW: "lzw",
    tags.PACKBITS: "packbits",
}

VOUCHERS: Final[dict[int, Voucher]] = {
    tags.UNCOMPRESSED: "length",
    tags.JPEG: "end",
    tags.DEFLATE: "checksum",
    tags.DEFLATE_OLD: "checksum",
    tags.LZW: "end",
    tags.PACKBITS: "end",
}


def read_samples(
    source: Source,
    layout: Layout,
    row0: int,
    col0: int,
    height: int,
    width: int,
    consumed: dict[int, int] | None = None,
) -> NDArray[np.uint16]:
    """A window of the whole frame as (row, col, sample), before linearisation.

    ``consumed`` : receives the bytes that each compressed piece took up to its end, by its index
    """
    out = np.empty((height, width, layout.samples), np.uint16)
    parts = list(_cut_window(layout, row0, col0, height, width))
    if layout.compression == tags.UNCOMPRESSED:
        for part in parts:
            out[part.target] = _read_stored(source, layout, part)
        return out

    def decode(part: _Part) -> None:
        out[part.target], took = _read_compressed(source, layout, part)
        if consumed is not None:
            consumed[part.segment] = took

    decode_all(decode, parts)
    return out


class _Part(NamedTuple):
    """Part of a strip or tile that a window needs: where it goes in the window, and which of its samples."""

    segment: int
    target: tuple[slice, slice]
    rows: slice
    cols: slice


def _cut_window(layout: Layout, row0: int, col0: int, height: int, width: int) -> Iterator[_Part]:
    for segment_row in range(row0 // layout.segment_rows, -(-(row0 + height) // layout.segment_rows)):
        top = segment_row * layout.segment_rows
        first_row, last_row = max(row0, top), min(row0 + height, top + layout.segment_rows)
        for segment_col in range(col0 // layout.segment_cols, -(-(col0 + width) // layout.segment_cols)):
            left = segment_col * layout.segment_cols
            first_col, last_col = max(col0, left), min(col0 + width, left + layout.segment_cols)
            yield _Part(
                segment=segment_row * layout.across + segment_col,
                target=(slice(first_row - row0, last_row - row0), slice(first_col - col0, last_col - col0)),
                rows=slice(first_row - top, last_row - top),
                cols=slice(first_col - left, last_col - left),
            )


def _read_stored(source: Source, layout: Layout, part: _Part) -> NDArray[np.uint16]:
    index, _, rows, cols = part
    offset, count = int(layout.offsets[index]), rows.stop - rows.start
    stored = source.array(offset + rows.start * layout.row_bytes, count * layout.row_bytes)
    return _cut(stored, layout, count, slice(None), cols)


def _read_compressed(source: Source, layout: Layout, part: _Part) -> tuple[NDArray[np.uint16], int]:
    index, _, rows, cols = part
    offset, size = int(layout.offsets[index]), int(layout.byte_counts[index])
    stored_rows = layout.rows_in(index // layout.across)
    shape = (stored_rows, layout.segment_cols, layout.samples)
    data = source[offset : offset + size]
    if layout.compression == tags.JPEG:
        samples, took = ljpeg.decode(data, samples=shape[0] * shape[1] * shape[2])
        return samples.reshape(shape)[rows, cols], took
    expanded, took = expansion.expand(
        data,
        layout.compression,
        wanted=stored_rows * layout.row_bytes,
        # a writer may store the last strip whole
        most=layout.segment_rows * layout.row_bytes,
    )
    if layout.predictor == 1:
        return _cut(expanded, layout, stored_rows, rows, cols), took
    everything = _cut(expanded, layout, stored_rows, slice(0, stored_rows), slice(0, layout.segment_cols))
    summed = np.cumsum(everything, axis=1, dtype=np.uint16)[rows, cols]
    return summed & np.uint16((1 << layout.bits) - 1), took


def _cut(
    stored: NDArray[np.uint8], layout: Layout, stored_rows: int, rows: slice, cols: slice
) -> NDArray[np.uint16]:
    table = stored.reshape(stored_rows, layout.row_bytes)[rows]
    first, count = cols.start * layout.samples, (cols.stop - cols.start) * layout.samples
    if layout.bits == 8:
        samples = table[:, first : first + count].astype(np.uint16)
    elif layout.bits == 16:
        # A tile may start on an odd byte: numpy copes with unaligned views.
        samples = table.view(layout.order + "u2")[:, first : first + count]
    else:
        samples = unpack_rows(table, bits=layout.bits, first=first, count=count)
    return samples.reshape(len(table), -1, layout.samples)
