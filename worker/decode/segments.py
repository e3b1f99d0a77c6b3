"""Windows of the stored samples: only the strips, tiles and bytes that they need are read."""

import math
import zlib
from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import imagecodecs
import numpy as np
from numpy.typing import NDArray

from radiometry.findings import files
from radiometry.frame.proof import Voucher
from worker.decode import ljpeg, pieces, tags, tiff
from worker.decode.layout import Layout


def unpack_rows(packed: NDArray[np.uint8], *, bits: int, first: int, count: int) -> NDArray[np.uint16]:
    """Samples [first, first + count) of every row (row, byte), each of which begins on a byte of its own."""
    period = 8 // math.gcd(8, bits)  # samples after which the pattern of bytes repeats
    period_bytes = period * bits // 8
    start = first // period
    stop = -(-(first + count) // period)
    chunk = packed[:, start * period_bytes : stop * period_bytes]
    missing = (stop - start) * period_bytes - chunk.shape[1]
    if missing > 0:
        # The last row of a strip ends with its own last byte, in the middle of a pattern.
        chunk = np.pad(chunk, ((0, 0), (0, missing)))
    groups = chunk.reshape(len(packed), stop - start, period_bytes)
    samples = np.empty((len(packed), stop - start, period), np.uint16)
    for index in range(period):
        samples[:, :, index] = _sample(groups, index * bits, bits)
    skip = first - start * period
    return samples.reshape(len(packed), -1)[:, skip : skip + count]


def _sample(groups: NDArray[np.uint8], at_bit: int, bits: int) -> NDArray[np.uint16]:
    first_byte, last_byte = at_bit // 8, (at_bit + bits - 1) // 8
    # the narrower the word, the quicker: only 11 bits and more may lie in three bytes
    kind: type[np.uint16 | np.uint32] = np.uint16 if last_byte - first_byte <= 1 else np.uint32
    word: NDArray[Any] = groups[:, :, first_byte].astype(kind)
    for byte in range(first_byte + 1, last_byte + 1):
        word = (word << 8) | groups[:, :, byte]
    aligned = word >> ((last_byte + 1) * 8 - at_bit - bits)
    return np.asarray(aligned & ((1 << bits) - 1), np.uint16)


_LZW_END: Final = 257
_LZW_BITS: Final = range(9, 13)
# An end code ends anywhere in the last byte, before which a writer may have set one more.
_MOST_PADDING_BITS: Final = 15


def expand(data: bytes, compression: int, *, wanted: int, most: int) -> tuple[NDArray[np.uint8], int]:
    """Decompress a piece of ``most`` bytes at most; return those ``wanted``, and how many it took."""
    try:
        if compression in (tags.DEFLATE, tags.DEFLATE_OLD):
            plain, took = _inflate(data, most)
        elif compression == tags.LZW:
            # one more than it may hold: an end that lies beyond is no end
            plain, took = bytes(imagecodecs.lzw_decode(data, out=most + 1)), len(data)
            _require_lzw_end(data)
        else:
            plain, took = bytes(imagecodecs.packbits_decode(data, out=most + 1)), len(data)
    except (zlib.error, RuntimeError, ValueError) as error:
        message = "A piece of the image cannot be decompressed to its end."
        raise files.INCOMPLETE_IMAGE.refuse(message) from error
    if len(plain) < wanted:
        raise files.TRUNCATED.refuse("A piece of the compressed image ends early.")
    if len(plain) > most:
        raise files.INCOMPLETE_IMAGE.refuse("A piece of the compressed image does not end where it should.")
    return np.frombuffer(plain, np.uint8, count=wanted), took


def _inflate(data: bytes, most: int) -> tuple[bytes, int]:
    """Read on behind the last byte, where the checksum stands: zlib compares it only there."""
    inflate = zlib.decompressobj()
    plain = inflate.decompress(data, most)
    if not inflate.eof:
        plain += inflate.decompress(inflate.unconsumed_tail, 1)
    if not inflate.eof or any(inflate.unused_data):
        raise files.INCOMPLETE_IMAGE.refuse("A piece of the compressed image does not end with its checksum.")
    return plain, len(data) - len(inflate.unused_data)


def _require_lzw_end(data: bytes) -> None:
    if data[:1] == b"\0":
        return  # of the order of bits before TIFF 6, whose end code is written the other way round
    tail = int.from_bytes(data[-4:], "big")
    for padding in range(_MOST_PADDING_BITS + 1):
        if tail & ((1 << padding) - 1):
            break
        if any((tail >> padding) & ((1 << bits) - 1) == _LZW_END for bits in _LZW_BITS):
            return
    raise files.INCOMPLETE_IMAGE.refuse("A piece of the compressed image does not end with its end code.")


_KINDS: Final[dict[int, tuple[str, Voucher]]] = {
    tags.UNCOMPRESSED: ("none", "length"),
    tags.JPEG: ("ljpeg", "end"),
    tags.DEFLATE: ("deflate", "checksum"),
    tags.DEFLATE_OLD: ("deflate", "checksum"),
    tags.LZW: ("lzw", "end"),
    tags.PACKBITS: ("packbits", "end"),
}
COMPRESSIONS = {compression: name for compression, (name, _) in _KINDS.items()}
VOUCHERS: Final = {compression: voucher for compression, (_, voucher) in _KINDS.items()}


def read_samples(
    source: tiff.Source,
    layout: Layout,
    row0: int,
    col0: int,
    height: int,
    width: int,
    consumed: dict[int, int] | None = None,
) -> NDArray[np.uint16]:
    """A window (row, col, sample), before linearisation; ``consumed`` receives what each piece took."""
    out = np.empty((height, width, layout.samples), np.uint16)
    parts = list(_cut_window(layout, row0, col0, height, width))
    if layout.compression == tags.UNCOMPRESSED:
        for part in parts:
            index, _, rows, cols = part
            offset, count = int(layout.offsets[index]), rows.stop - rows.start
            stored = source.array(offset + rows.start * layout.row_bytes, count * layout.row_bytes)
            out[part.target] = _cut(stored, layout, count, slice(None), cols)
        return out

    def decode(part: _Part) -> None:
        out[part.target], took = _read_compressed(source, layout, part)
        if consumed is not None:
            consumed[part.segment] = took

    pieces.decode_all(decode, parts)
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


def _read_compressed(source: tiff.Source, layout: Layout, part: _Part) -> tuple[NDArray[np.uint16], int]:
    index, _, rows, cols = part
    offset, size = int(layout.offsets[index]), int(layout.byte_counts[index])
    stored_rows = layout.rows_in(index // layout.across)
    shape = (stored_rows, layout.segment_cols, layout.samples)
    data = source[offset : offset + size]
    if layout.compression == tags.JPEG:
        samples, took = ljpeg.decode(data, samples=shape[0] * shape[1] * shape[2])
        return samples.reshape(shape)[rows, cols], took
    # a writer may store the last strip whole
    wanted, most = stored_rows * layout.row_bytes, layout.segment_rows * layout.row_bytes
    expanded, took = expand(data, layout.compression, wanted=wanted, most=most)
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
