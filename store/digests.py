"""A digest per MiB of a stored file, so that a reader proves what it reads without reading the rest.

xxh3 with 128 bits tells every accident of a disk or a cable from the bytes that were uploaded, in a
thirtieth of SHA-256's time. Against somebody who writes to the store on purpose it proves nothing: the whole
file's SHA-256 does.
"""

from typing import Final

import xxhash

PIECE_BYTES: Final = 1 << 20
DIGEST_BYTES: Final = 16


def digest_piece(piece: bytes | memoryview) -> bytes:
    """Compute the digest of one piece; only a file's last one may be shorter than a MiB."""
    return xxhash.xxh3_128_digest(piece)


def count_pieces(size_bytes: int) -> int:
    """Return in how many pieces a file of this size is proven."""
    return -(-size_bytes // PIECE_BYTES)


class PieceDigester:
    """Computes the digests of a file while it streams by."""

    def __init__(self) -> None:
        self._done: list[bytes] = []
        self._hash = xxhash.xxh3_128()
        self._missing = PIECE_BYTES

    def update(self, chunk: bytes | memoryview) -> None:
        """Take the file's next bytes, however many."""
        rest = memoryview(chunk)
        while rest:
            taken, rest = rest[: self._missing], rest[self._missing :]
            self._hash.update(taken)
            self._missing -= len(taken)
            if not self._missing:
                self._close_piece()

    def digests(self) -> bytes:
        """Return the digests of all that was taken, joined in the order of the pieces."""
        last = [self._hash.digest()] if self._missing < PIECE_BYTES else []
        return b"".join([*self._done, *last])

    def _close_piece(self) -> None:
        self._done.append(self._hash.digest())
        self._hash.reset()
        self._missing = PIECE_BYTES
