"""The bytes of a file, proven as they are read, and the directories of a TIFF."""

import math
import mmap
import struct
from dataclasses import dataclass
from typing import Final, overload

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import files
from store.blobs.proof import DIGEST_BYTES, PIECE_BYTES, count_pieces, digest_piece
from worker.decode import limits


class SourceDamagedError(Exception):
    """The file is not what was stored: no word about the frame, whose upload was whole."""


class Source:
    """A file of known size: `source[a:b]` copies bytes, `array` shows them to numpy, both proven first."""

    def __init__(self, content: bytes | mmap.mmap, digests: bytes | None = None) -> None:
        self._content = memoryview(content)
        self._digests = digests
        self._proven = bytearray(count_pieces(len(self._content)))
        if digests is not None and len(digests) != DIGEST_BYTES * len(self._proven):
            raise SourceDamagedError("the stored file has another size than its upload")

    def __len__(self) -> int:
        return len(self._content)

    @overload
    def __getitem__(self, place: int) -> int: ...

    @overload
    def __getitem__(self, place: slice) -> bytes: ...

    def __getitem__(self, place: int | slice) -> int | bytes:
        if isinstance(place, int):
            self._prove(place, place + 1)
            return self._content[place]
        first, last, step = place.indices(len(self))
        if step != 1:
            raise ValueError("a source is read without gaps")
        self._prove(first, last)
        return bytes(self._content[first:last])

    def array(self, offset: int, size: int) -> NDArray[np.uint8]:
        """Return bytes [offset, offset + size) as a read-only array that shares the file's memory."""
        self._prove(offset, offset + size)
        return np.frombuffer(self._content, np.uint8, count=size, offset=offset)

    def _prove(self, first: int, last: int) -> None:
        if self._digests is None or first >= last:
            return
        for index in range(first // PIECE_BYTES, (min(last, len(self)) - 1) // PIECE_BYTES + 1):
            if self._proven[index]:
                continue
            piece = self._content[index * PIECE_BYTES : (index + 1) * PIECE_BYTES]
            if digest_piece(piece) != self._digests[index * DIGEST_BYTES : (index + 1) * DIGEST_BYTES]:
                raise SourceDamagedError(f"MiB {index} of the stored file is not what was uploaded")
            self._proven[index] = 1


TYPE_SIZES: Final = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 13: 4}
_DTYPES: Final = dict(
    enumerate(["u1", "u1", "u2", "u4", "u4", "i1", "u1", "i2", "i4", "i4", "f4", "f8", "u4"], start=1)
)
_RATIONALS: Final = (5, 10)

Buffer = bytes | Source
SUB_IFDS: Final = 330


@dataclass(frozen=True)
class Entry:
    kind: int
    count: int
    offset: int  # of the value, in the file

    @property
    def size(self) -> int:
        return TYPE_SIZES[self.kind] * self.count


class Directory:
    """One IFD. Values are read when asked for; what is absent or nonsense reads as nothing."""

    def __init__(self, buffer: Buffer, order: str, entries: dict[int, Entry]) -> None:
        self._buffer, self.order, self._entries = buffer, order, entries

    def __contains__(self, tag: int) -> bool:
        return tag in self._entries

    def count(self, tag: int) -> int:
        entry = self._entries.get(tag)
        return entry.count if entry else 0

    def raw(self, tag: int, *, at_most: int) -> bytes:
        """The value's bytes, or none when the tag is absent. A value outside the file means it was cut."""
        if (entry := self._entries.get(tag)) is None:
            return b""
        if entry.size > at_most:
            raise files.FRAME_TOO_LARGE.refuse(
                f"The file's tag {tag} claims {entry.size} bytes, far more than is sane."
            )
        if entry.offset + entry.size > len(self._buffer):
            message = f"The file ends before the data that its tag {tag} points to: it was cut short."
            raise files.TRUNCATED.refuse(message)
        return self._buffer[entry.offset : entry.offset + entry.size]

    def numbers(self, tag: int, *, at_most: int) -> list[float | None]:
        """Numbers of any type. Zero over zero, division by zero, NaN and infinity are not stated: None."""
        if (entry := self._entries.get(tag)) is None:
            return []
        raw = self.raw(tag, at_most=at_most * TYPE_SIZES[entry.kind])
        values = np.frombuffer(raw, self.order + _DTYPES[entry.kind]).tolist()
        if entry.kind in _RATIONALS:
            pairs = zip(values[::2], values[1::2], strict=True)
            return [above / below if below else None for above, below in pairs]
        return [value if math.isfinite(value) else None for value in values]

    def integers(self, tag: int, *, at_most: int) -> list[int]:
        """Whole numbers only; anything else in their place makes the tag unreadable."""
        values = self.numbers(tag, at_most=at_most)
        # A double can be whole and beyond anything that a file of this format can count.
        whole = [
            int(value) for value in values if value is not None and abs(value) < 2**32 and value == int(value)
        ]
        if len(whole) != len(values):
            raise files.UNSUPPORTED_LAYOUT.refuse(f"The file's tag {tag} does not hold whole numbers.")
        return whole

    def integer(self, tag: int, default: int) -> int:
        """The first value: some writers repeat one per sample."""
        values = self.integers(tag, at_most=64)
        return values[0] if values else default

    def directory(self, tag: int) -> "Directory | None":
        """A directory beside the image ones, such as EXIF; None where it is absent or outside the file."""
        if not (offsets := self.integers(tag, at_most=1)) or not 8 <= offsets[0] <= len(self._buffer) - 2:
            return None
        return _read_directory(self._buffer, self.order, offsets[0])


def is_tiff(head: bytes) -> bool:
    return head[:4] in (b"II*\0", b"MM\0*")


def read_directories(buffer: Buffer) -> list[Directory]:
    """The first directory and, depth first, its sub-directories: where DNG keeps thumbnail and raw."""
    order = "<" if buffer[:2] == b"II" else ">"
    found: list[Directory] = []
    if len(buffer) < 8:
        raise files.TRUNCATED.refuse("The file ends within its own header.")
    _walk(buffer, order, struct.unpack(order + "I", buffer[4:8])[0], found, seen=set(), depth=0)
    return found


def _walk(
    buffer: Buffer, order: str, offset: int, found: list[Directory], seen: set[int], depth: int
) -> None:
    if offset in seen or depth > limits.MAX_DIRECTORY_DEPTH or len(found) >= limits.MAX_DIRECTORIES:
        raise files.UNSUPPORTED_LAYOUT.refuse("The file's directories point at each other without end.")
    seen.add(offset)
    directory = _read_directory(buffer, order, offset)
    found.append(directory)
    for child in directory.integers(SUB_IFDS, at_most=limits.MAX_DIRECTORIES):
        _walk(buffer, order, child, found, seen, depth + 1)


def _read_directory(buffer: Buffer, order: str, offset: int) -> Directory:
    size = len(buffer)
    if offset < 8 or offset + 2 > size:
        raise files.TRUNCATED.refuse("The file ends before its own directory: it was cut short.")
    (count,) = struct.unpack(order + "H", buffer[offset : offset + 2])
    if count > limits.MAX_TAGS:
        raise files.FRAME_TOO_LARGE.refuse(f"The file's directory claims {count} tags.")
    if offset + 2 + 12 * count > size:
        raise files.TRUNCATED.refuse("The file ends within its own directory: it was cut short.")
    entries: dict[int, Entry] = {}
    table = buffer[offset + 2 : offset + 2 + 12 * count]
    for index, (tag, kind, number, value) in enumerate(struct.iter_unpack(order + "HHII", table)):
        if kind not in TYPE_SIZES:
            continue
        inline = TYPE_SIZES[kind] * number <= 4
        place = offset + 2 + 12 * index + 8 if inline else value
        entries.setdefault(tag, Entry(kind, number, place))
    return Directory(buffer, order, entries)
