"""A stored file's bytes, of which each MiB is proven against its digest before anything in it is used.

A region of a frame lies in a few MiB of its file: only those are read and proven. Mapped rather than read:
pages that are not asked for cost nothing, and copies of those that are cost more than the proof does.
"""

import mmap
import os
from typing import Final, Self, overload

import numpy as np
from numpy.typing import NDArray

from store.blobs.proof import DIGEST_BYTES, PIECE_BYTES, count_pieces, digest_piece

_READ_ONLY: Final = mmap.ACCESS_READ


class SourceDamagedError(Exception):
    """The file is not what was stored: no word about the frame, whose upload was whole."""


class Source:
    """A file of known size: `source[a:b]` copies bytes, `array` shows them to numpy; both prove them first.

    Parameters
    ----------
    content : bytes or mmap.mmap
        The whole file.
    digests : bytes or None
        One digest per MiB, joined; None for a file that is no stored one, of which nothing is proven.

    """

    def __init__(self, content: bytes | mmap.mmap, digests: bytes | None = None) -> None:
        self._content = memoryview(content)
        self._digests = digests
        self._proven = bytearray(count_pieces(len(self._content)))
        if digests is not None and len(digests) != DIGEST_BYTES * len(self._proven):
            raise SourceDamagedError("the stored file has another size than its upload")

    @classmethod
    def map(cls, descriptor: int, digests: bytes | None = None) -> Self:
        """Map an open file, which may be closed afterwards."""
        size = os.fstat(descriptor).st_size
        # a mapping of nothing is refused by the system
        return cls(mmap.mmap(descriptor, size, access=_READ_ONLY) if size else b"", digests)

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

    def prove_all(self) -> None:
        """Prove the whole file, before something reads it that does not read it through here."""
        self._prove(0, len(self))

    def _prove(self, first: int, last: int) -> None:
        if self._digests is None or first >= last:
            return
        for index in range(first // PIECE_BYTES, (min(last, len(self)) - 1) // PIECE_BYTES + 1):
            if not self._proven[index]:
                self._prove_piece(index, self._digests)

    def _prove_piece(self, index: int, digests: bytes) -> None:
        piece = self._content[index * PIECE_BYTES : (index + 1) * PIECE_BYTES]
        if digest_piece(piece) != digests[index * DIGEST_BYTES : (index + 1) * DIGEST_BYTES]:
            raise SourceDamagedError(f"MiB {index} of the stored file is not what was uploaded")
        self._proven[index] = 1
