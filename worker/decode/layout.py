"""Where the samples of an image lie in its file, checked against the file's size before anything is read."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import files
from worker.decode import limits, tags
from worker.decode.tiff import Directory

_PACKABLE_BITS = range(8, 17)
# What a format can make of one byte at most: samples of lossless JPEG, of which none takes less than a bit,
# and bytes of the others (deflate: 258 of two bits; LZW: 3,800, its longest string, of twelve; PackBits: 128
# of two bytes).
_MOST_SAMPLES_PER_BYTE: Final = 8
_MOST_EXPANSION: Final = {
    tags.UNCOMPRESSED: 1,
    tags.DEFLATE: 1032,
    tags.DEFLATE_OLD: 1032,
    tags.LZW: 2600,
    tags.PACKBITS: 64,
}


@dataclass(frozen=True, kw_only=True)
class Layout:
    """A grid of segments (strips or tiles), each with its place in the file."""

    rows: int  # of the whole frame, masked borders included
    cols: int
    samples: int  # per pixel
    bits: int
    order: str  # "<" or ">"
    compression: int
    predictor: int
    segment_rows: int
    segment_cols: int
    tiled: bool
    offsets: NDArray[np.int64]
    byte_counts: NDArray[np.int64]

    @property
    def across(self) -> int:
        return -(-self.cols // self.segment_cols)

    @property
    def row_bytes(self) -> int:
        """Return the bytes of one uncompressed segment row: each starts on a byte of its own."""
        return -(-self.segment_cols * self.samples * self.bits // 8)

    @property
    def band_rows(self) -> int:
        """Rows that are read together most cheaply: those of a compressed strip or tile."""
        return 2 if self.compression == tags.UNCOMPRESSED else self.segment_rows

    def rows_in(self, segment_row: int) -> int:
        """Tiles are stored whole, the last strip only as far as the image goes."""
        if self.tiled:
            return self.segment_rows
        return min(self.segment_rows, self.rows - segment_row * self.segment_rows)


def read_layout(directory: Directory, file_size: int) -> Layout:
    rows = directory.integer(tags.IMAGE_LENGTH, 0)
    cols = directory.integer(tags.IMAGE_WIDTH, 0)
    limits.check_frame_size(rows, cols)
    samples = directory.integer(tags.SAMPLES_PER_PIXEL, 1)
    if samples > 1 and directory.integer(tags.PLANAR_CONFIGURATION, 1) != 1:
        raise files.UNSUPPORTED_LAYOUT.refuse("The image stores its colours in separate planes.")
    tiled, segment_rows, segment_cols = _segment_shape(directory, rows, cols)
    across, down = -(-cols // segment_cols), -(-rows // segment_rows)
    limits.check_segment_count(across * down)
    offsets, byte_counts = _places(directory, tiled=tiled, expected=across * down)
    layout = Layout(
        rows=rows,
        cols=cols,
        samples=samples,
        bits=_read_bits(directory, samples),
        order=directory.order,
        compression=directory.integer(tags.COMPRESSION, tags.UNCOMPRESSED),
        predictor=directory.integer(tags.PREDICTOR, 1),
        segment_rows=segment_rows,
        segment_cols=segment_cols,
        tiled=tiled,
        offsets=offsets,
        byte_counts=byte_counts,
    )
    return _merge_strips(_checked(layout, file_size))


def _read_bits(directory: Directory, samples: int) -> int:
    bits = directory.integers(tags.BITS_PER_SAMPLE, at_most=64) or [1]
    if len(set(bits)) != 1 or len(bits) not in (1, samples) or bits[0] not in _PACKABLE_BITS:
        raise files.UNSUPPORTED_LAYOUT.refuse(f"The image has {bits[0]} bits per sample; 8 to 16 are read.")
    if directory.integer(tags.SAMPLE_FORMAT, 1) != 1:
        raise files.UNSUPPORTED_LAYOUT.refuse("The image holds signed or floating point samples.")
    if directory.integer(tags.FILL_ORDER, 1) != 1:
        raise files.UNSUPPORTED_LAYOUT.refuse("The image stores its bits in reversed order.")
    return bits[0]


def _segment_shape(directory: Directory, rows: int, cols: int) -> tuple[bool, int, int]:
    if tags.TILE_WIDTH not in directory:
        strip_rows = directory.integer(tags.ROWS_PER_STRIP, rows)
        if strip_rows < 1:
            raise files.SIZE_MISMATCH.refuse("The image is cut into strips without rows.")
        return False, min(strip_rows, rows), cols
    tile_rows = directory.integer(tags.TILE_LENGTH, 0)
    tile_cols = directory.integer(tags.TILE_WIDTH, 0)
    if tile_rows < 1 or tile_cols < 1:
        raise files.SIZE_MISMATCH.refuse("The image is cut into tiles without pixels.")
    limits.check_segment_size(tile_rows * tile_cols, rows * cols)
    return True, tile_rows, tile_cols


def _places(
    directory: Directory, *, tiled: bool, expected: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    names = (
        (tags.TILE_OFFSETS, tags.TILE_BYTE_COUNTS) if tiled else (tags.STRIP_OFFSETS, tags.STRIP_BYTE_COUNTS)
    )
    for tag in names:
        limits.check_segment_count(directory.count(tag))
    offsets, byte_counts = (
        np.array(directory.integers(tag, at_most=limits.MAX_SEGMENTS), np.int64) for tag in names
    )
    if not len(offsets):
        raise files.TRUNCATED.refuse("The file does not say where its image data lies.")
    if not len(byte_counts):
        byte_counts = np.zeros_like(offsets)
    if len(offsets) < expected or len(byte_counts) < expected:
        raise files.TRUNCATED.refuse(
            f"The image has {expected} pieces, the file knows of {min(len(offsets), len(byte_counts))}.",
        )
    if len(offsets) > expected or len(byte_counts) > expected:
        raise files.SIZE_MISMATCH.refuse(f"The file holds more image data than its {expected} pieces.")
    return offsets, byte_counts


def _checked(layout: Layout, file_size: int) -> Layout:
    """The layout with every segment known to lie in the file."""
    down = len(layout.offsets) // layout.across
    if layout.compression == tags.UNCOMPRESSED:
        per_row = [layout.rows_in(row) * layout.row_bytes for row in range(down)]
        needed = np.repeat(np.array(per_row, np.int64), layout.across)
        stated = layout.byte_counts
        if np.any((stated > 0) & (stated < needed)):
            raise files.SIZE_MISMATCH.refuse("The image data is smaller than the image's own dimensions.")
    else:
        needed = layout.byte_counts
        if np.any(needed <= 0):
            raise files.TRUNCATED.refuse("A piece of the image has no data.")
    if np.any(layout.offsets < 8) or np.any(layout.offsets + needed > file_size):
        raise files.TRUNCATED.refuse("The file ends before its image data does: it was cut short.")
    _check_claims(layout, needed, file_size)
    return replace(layout, byte_counts=needed)


def _check_claims(layout: Layout, held: NDArray[np.int64], file_size: int) -> None:
    """Each segment by what it holds, and all together by the whole file: many may lie in the same place."""
    down = len(layout.offsets) // layout.across
    rows = np.repeat(np.array([layout.rows_in(row) for row in range(down)], np.int64), layout.across)
    if layout.compression == tags.JPEG:
        claimed, most = rows * layout.segment_cols * layout.samples, _MOST_SAMPLES_PER_BYTE
    elif layout.compression in _MOST_EXPANSION:
        claimed, most = rows * layout.row_bytes, _MOST_EXPANSION[layout.compression]
    else:
        return  # not read here: who reads it has a bound of its own
    limits.check_backed(float(np.max(claimed / (most * held))), 1.0)
    limits.check_backed(float(claimed.sum()), float(most * file_size))


def _merge_strips(layout: Layout) -> Layout:
    """Uncompressed strips that follow each other are one strip, which is read in one go."""
    if layout.tiled or layout.compression != tags.UNCOMPRESSED or len(layout.offsets) == 1:
        return layout
    ends = layout.offsets + layout.byte_counts
    if np.any(ends[:-1] != layout.offsets[1:]):
        return layout
    return replace(
        layout,
        segment_rows=layout.rows,
        offsets=layout.offsets[:1],
        byte_counts=layout.byte_counts.sum(keepdims=True),
    )
