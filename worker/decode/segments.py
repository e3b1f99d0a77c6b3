"""Windows of the stored samples: only the strips, tiles and bytes that they need are read."""

import zlib

import imagecodecs
import numpy as np
from numpy.typing import NDArray

from worker.decode import ljpeg, tags
from worker.decode.bits import unpack_rows
from worker.decode.layout import Layout
from worker.decode.refusals import Refusal, refuse
from worker.decode.source import Source

COMPRESSIONS = {
    tags.UNCOMPRESSED: "none",
    tags.JPEG: "ljpeg",
    tags.DEFLATE: "deflate",
    tags.DEFLATE_OLD: "deflate",
    tags.LZW: "lzw",
    tags.PACKBITS: "packbits",
}


def read_samples(
    source: Source, layout: Layout, row0: int, col0: int, height: int, width: int
) -> NDArray[np.uint16]:
    """A window of the whole frame as (row, col, sample), before linearisation."""
    out = np.empty((height, width, layout.samples), np.uint16)
    for segment_row in range(row0 // layout.segment_rows, -(-(row0 + height) // layout.segment_rows)):
        top = segment_row * layout.segment_rows
        first_row, last_row = max(row0, top), min(row0 + height, top + layout.segment_rows)
        for segment_col in range(col0 // layout.segment_cols, -(-(col0 + width) // layout.segment_cols)):
            left = segment_col * layout.segment_cols
            first_col, last_col = max(col0, left), min(col0 + width, left + layout.segment_cols)
            target = out[first_row - row0 : last_row - row0, first_col - col0 : last_col - col0]
            rows, cols = slice(first_row - top, last_row - top), slice(first_col - left, last_col - left)
            index = segment_row * layout.across + segment_col
            target[...] = _read_segment(source, layout, index, rows, cols)
    return out


def _read_segment(source: Source, layout: Layout, index: int, rows: slice, cols: slice) -> NDArray[np.uint16]:
    offset, size = int(layout.offsets[index]), int(layout.byte_counts[index])
    stored_rows = layout.rows_in(index // layout.across)
    shape = (stored_rows, layout.segment_cols, layout.samples)
    if layout.compression == tags.UNCOMPRESSED:
        stored = source.array(
            offset + rows.start * layout.row_bytes, (rows.stop - rows.start) * layout.row_bytes
        )
        return _cut(stored, layout, rows.stop - rows.start, slice(None), cols)
    data = source[offset : offset + size]
    if layout.compression == tags.JPEG:
        return ljpeg.decode(data, samples=shape[0] * shape[1] * shape[2]).reshape(shape)[rows, cols]
    expanded = _expand(data, layout.compression, stored_rows * layout.row_bytes)
    if layout.predictor == 1:
        return _cut(expanded, layout, stored_rows, rows, cols)
    everything = _cut(expanded, layout, stored_rows, slice(0, stored_rows), slice(0, layout.segment_cols))
    summed = np.cumsum(everything, axis=1, dtype=np.uint16)[rows, cols]
    return summed & np.uint16((1 << layout.bits) - 1)


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


def _expand(data: bytes, compression: int, size: int) -> NDArray[np.uint8]:
    """Decompress at most ``size`` bytes, however much the data would expand to."""
    try:
        if compression in (tags.DEFLATE, tags.DEFLATE_OLD):
            plain = zlib.decompressobj().decompress(data, size)
        elif compression == tags.LZW:
            plain = bytes(imagecodecs.lzw_decode(data, out=size))
        else:
            plain = bytes(imagecodecs.packbits_decode(data, out=size))
    except (zlib.error, RuntimeError, ValueError) as error:
        raise refuse(Refusal.SIZE_MISMATCH, "A piece of the image cannot be decompressed.") from error
    if len(plain) < size:
        raise refuse(Refusal.TRUNCATED, "A piece of the compressed image ends early.")
    return np.frombuffer(plain, np.uint8, count=size)
