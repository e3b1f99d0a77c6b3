"""Layout, levels, colour filter and opcodes of the pixels, as a directory states them."""

import hashlib
import struct
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import files
from radiometry.frame import Opcode
from worker.decode import limits, tags, tiff

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


def read_visible_area(raw: tiff.Directory, rows: int, cols: int) -> Area:
    if not (stated := raw.integers(tags.ACTIVE_AREA, at_most=4)):
        return Area(0, 0, rows, cols)
    if len(stated) != 4:
        raise files.SIZE_MISMATCH.refuse("The file's active area is incomplete.")
    area = Area(*stated)
    if not (0 <= area.top < area.bottom <= rows and 0 <= area.left < area.right <= cols):
        raise files.SIZE_MISMATCH.refuse("The file's active area lies outside its image.")
    limits.check_frame_size(area.height, area.width)
    return area


def read_cfa(raw: tiff.Directory) -> str:
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


_MAX_REPEAT = 64


@dataclass(frozen=True)
class BlackLevels:
    """Level(row, col) = pattern[row % R, col % C] + per_row[row] + per_col[col], from the visible corner."""

    pattern: NDArray[np.float64]  # (R, C, sample)
    per_row: NDArray[np.float64]  # BlackLevelDeltaV
    per_col: NDArray[np.float64]  # BlackLevelDeltaH
    origin: str

    def mean_over(self, row0: int, col0: int, height: int, width: int, *, cell: int) -> tuple[float, ...]:
        """The window's mean for each site of a ``cell`` x ``cell`` cell, row by row; per sample for RGB."""
        means: list[float] = []
        for row_phase in range(cell):
            rows = _matching(row0, height, row_phase, cell)
            for col_phase in range(cell):
                cols = _matching(col0, width, col_phase, cell)
                means.extend(self._mean(rows, cols).tolist())
        return tuple(means)

    def _mean(self, rows: NDArray[np.int64], cols: NDArray[np.int64]) -> NDArray[np.float64]:
        repeat_rows, repeat_cols, _ = self.pattern.shape
        row_share = np.bincount(rows % repeat_rows, minlength=repeat_rows) / len(rows)
        col_share = np.bincount(cols % repeat_cols, minlength=repeat_cols) / len(cols)
        level: NDArray[np.float64] = np.einsum("r,c,rcs->s", row_share, col_share, self.pattern)
        level += self.per_row[rows].mean() if len(self.per_row) else 0.0
        level += self.per_col[cols].mean() if len(self.per_col) else 0.0
        return level


def _matching(start: int, count: int, phase: int, cell: int) -> NDArray[np.int64]:
    """Indices of one phase; a window too narrow to hold any is answered for the phase's nearest line."""
    chosen: NDArray[np.int64] = np.arange(start + (phase - start) % cell, start + count, cell)
    if len(chosen):
        return chosen
    nearest = start - start % cell + phase
    return np.array([nearest - cell if nearest > start >= cell else nearest])


def read_black_levels(directory: tiff.Directory, *, height: int, width: int, samples: int) -> BlackLevels:
    repeat = directory.integers(tags.BLACK_LEVEL_REPEAT, at_most=2) or [1, 1]
    if len(repeat) != 2 or not all(1 <= side <= _MAX_REPEAT for side in repeat):
        raise files.UNSUPPORTED_LAYOUT.refuse("The file's black level pattern cannot be read.")
    values = _levels(directory, tags.BLACK_LEVEL, at_most=_MAX_REPEAT**2 * 4)
    if len(values) == 1:
        # Some writers give one value for a larger pattern.
        repeat, values = [1, 1], values * samples
    if values and len(values) != repeat[0] * repeat[1] * samples:
        message = f"The file has {len(values)} black levels for a {repeat} pattern."
        raise files.UNSUPPORTED_LAYOUT.refuse(message)
    pattern = np.array(values or [0.0] * samples).reshape(*(repeat if values else (1, 1)), samples)
    return BlackLevels(
        pattern=pattern,
        per_row=_deltas(directory, tags.BLACK_LEVEL_DELTA_V, height),
        per_col=_deltas(directory, tags.BLACK_LEVEL_DELTA_H, width),
        origin="tag" if values else "default",
    )


def _deltas(directory: tiff.Directory, tag: int, expected: int) -> NDArray[np.float64]:
    values = np.array(_levels(directory, tag, at_most=expected))
    if len(values) not in (0, expected):
        message = f"The file has {len(values)} black level deltas for {expected} lines."
        raise files.SIZE_MISMATCH.refuse(message)
    return values


def _levels(directory: tiff.Directory, tag: int, *, at_most: int) -> list[float]:
    values = directory.numbers(tag, at_most=at_most)
    stated = [float(value) for value in values if value is not None]
    if len(stated) != len(values):
        raise files.UNSUPPORTED_LAYOUT.refuse(f"The file's level in tag {tag} is no number.")
    return stated


def read_white_levels(
    directory: tiff.Directory, *, samples: int, bits: int, table: NDArray[np.uint16] | None
) -> tuple[tuple[float, ...], str]:
    """Per sample. Not stated: the largest value that can occur, which a linearisation table decides."""
    values = _levels(directory, tags.WHITE_LEVEL, at_most=16)
    if len(values) not in (0, 1, samples):
        raise files.UNSUPPORTED_LAYOUT.refuse(f"The file has {len(values)} white levels.")
    if values:
        return tuple(values * samples if len(values) == 1 else values), "tag"
    largest = float((1 << bits) - 1) if table is None else float(table.max())
    return (largest,) * samples, "default"


def read_linearization(directory: tiff.Directory) -> NDArray[np.uint16] | None:
    """A table with a value for every possible sample: the last entry stands for all beyond it."""
    if not (entries := directory.integers(tags.LINEARIZATION_TABLE, at_most=1 << 16)):
        return None
    if min(entries) < 0 or max(entries) > 65_535:
        raise files.UNSUPPORTED_LAYOUT.refuse("The file's linearization table leaves the 16 bit range.")
    table = np.full(1 << 16, entries[-1], np.uint16)
    table[: len(entries)] = entries
    return table


_NAMES: Final = (
    *("WarpRectilinear", "WarpFisheye", "FixVignetteRadial", "FixBadPixelsConstant", "FixBadPixelsList"),
    *("TrimBounds", "MapTable", "MapPolynomial", "GainMap", "DeltaPerRow", "DeltaPerColumn"),
    *("ScalePerRow", "ScalePerColumn", "WarpRectilinear2"),
)
"""Of the opcodes from 1 on."""
_MAX_LIST_BYTES: Final = 64 << 20
_HEAD: Final = struct.Struct(">IIII")  # big endian whatever the file's order


def read_opcodes(directory: tiff.Directory) -> tuple[Opcode, ...]:
    found: list[Opcode] = []
    for stage, tag in enumerate(tags.OPCODE_LISTS, start=1):
        found.extend(_parse(directory.raw(tag, at_most=_MAX_LIST_BYTES), stage))
    return tuple(found)


def _parse(data: bytes, stage: int) -> list[Opcode]:
    """Parse a list; one that cannot be parsed to its end ends in "unreadable", with the hash of the rest."""
    found: list[Opcode] = []
    count, position = int.from_bytes(data[:4], "big"), 4
    for _ in range(min(count, limits.MAX_OPCODES)):
        if position + _HEAD.size > len(data):
            break
        number, _version, _flags, size = _HEAD.unpack_from(data, position)
        start = position + _HEAD.size
        if start + size > len(data):
            break
        name = _NAMES[number - 1] if 1 <= number <= len(_NAMES) else f"opcode-{number}"
        found.append(
            Opcode(stage=stage, name=name, sha256=hashlib.sha256(data[start : start + size]).hexdigest())
        )
        position = start + size
    if len(found) < count:
        rest = hashlib.sha256(data[position:]).hexdigest()
        found.append(Opcode(stage=stage, name="unreadable", sha256=rest))
    return found


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


def read_layout(directory: tiff.Directory, file_size: int) -> Layout:
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


def _read_bits(directory: tiff.Directory, samples: int) -> int:
    bits = directory.integers(tags.BITS_PER_SAMPLE, at_most=64) or [1]
    if len(set(bits)) != 1 or len(bits) not in (1, samples) or bits[0] not in _PACKABLE_BITS:
        raise files.UNSUPPORTED_LAYOUT.refuse(f"The image has {bits[0]} bits per sample; 8 to 16 are read.")
    if directory.integer(tags.SAMPLE_FORMAT, 1) != 1:
        raise files.UNSUPPORTED_LAYOUT.refuse("The image holds signed or floating point samples.")
    if directory.integer(tags.FILL_ORDER, 1) != 1:
        raise files.UNSUPPORTED_LAYOUT.refuse("The image stores its bits in reversed order.")
    return bits[0]


def _segment_shape(directory: tiff.Directory, rows: int, cols: int) -> tuple[bool, int, int]:
    if tags.TILE_WIDTH not in directory:
        strip_rows = directory.integer(tags.ROWS_PER_STRIP, rows)
        if strip_rows < 1:
            raise files.SIZE_MISMATCH.refuse("The image is cut into strips without rows.")
        return False, min(strip_rows, rows), cols
    tile_rows = directory.integer(tags.TILE_LENGTH, 0)
    tile_cols = directory.integer(tags.TILE_WIDTH, 0)
    if tile_rows < 1 or tile_cols < 1:
        raise files.SIZE_MISMATCH.refuse("The image is cut into tiles without pixels.")
    # a tile may overhang a small frame, but not by much more than tiles are large
    if tile_rows * tile_cols > max(4 * rows * cols, 1 << 22):
        raise files.FRAME_TOO_LARGE.refuse("The file claims tiles that are far larger than its image.")
    return True, tile_rows, tile_cols


def _places(
    directory: tiff.Directory, *, tiled: bool, expected: int
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
        message = f"The image has {expected} pieces, the file knows of {min(len(offsets), len(byte_counts))}."
        raise files.TRUNCATED.refuse(message)
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
    size = layout.byte_counts.sum(keepdims=True)
    return replace(layout, segment_rows=layout.rows, offsets=layout.offsets[:1], byte_counts=size)
