"""Hashes that identify a blob, the proof that bytes are its own, and how a store can refuse."""

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import field
from pathlib import Path
from typing import Final, Literal

import xxhash

from radiometry.records import Record

Damage = Literal["damaged", "missing"]


class BlobDamaged(Exception):  # noqa: N818 (named by the state that it reports)
    """The stored bytes are not those that were uploaded, or cannot be read any more."""

    damage: Damage = "damaged"

    def __init__(self, sha256: str) -> None:
        super().__init__(f"the stored file {sha256} is {self.damage}")
        self.sha256 = sha256


class BlobMissing(BlobDamaged):
    damage = "missing"


class StorageFull(Exception):  # noqa: N818 (named by the state that it reports)
    """The disk, quota or file size limit leaves no room for these bytes; worth a retry once there is room."""


class StorageUnavailable(Exception):  # noqa: N818 (named by the state that it reports)
    """The store does not answer or does not let us in; worth a retry."""


PIECE_BYTES: Final = 1 << 20
DIGEST_BYTES: Final = 16


def digest_piece(piece: bytes | memoryview) -> bytes:
    """Compute the digest of one piece; only a file's last one may be shorter than a MiB."""
    return xxhash.xxh3_128_digest(piece)


def count_pieces(size_bytes: int) -> int:
    return -(-size_bytes // PIECE_BYTES)


class PieceDigester:
    """Computes the digests of a file while it streams by."""

    def __init__(self) -> None:
        self._done: list[bytes] = []
        self._hash = xxhash.xxh3_128()
        self._missing = PIECE_BYTES

    def update(self, chunk: bytes | memoryview) -> None:
        rest = memoryview(chunk)
        while rest:
            taken, rest = rest[: self._missing], rest[self._missing :]
            self._hash.update(taken)
            self._missing -= len(taken)
            if not self._missing:
                self._done.append(self._hash.digest())
                self._hash.reset()
                self._missing = PIECE_BYTES

    def digests(self) -> bytes:
        """Return the digests of all that was taken, joined in the order of the pieces."""
        last = [self._hash.digest()] if self._missing < PIECE_BYTES else []
        return b"".join([*self._done, *last])


class StoredBlob(Record, kw_only=False):
    """A blob's name, its size, and a digest per MiB that proves any part of it."""

    sha256: str
    size_bytes: int
    digests: bytes = field(repr=False)


class StoredFile(Record, kw_only=False):
    """A blob as a real file, to be mapped and never written."""

    path: Path
    blob: StoredBlob


def prove_pieces(blob: StoredBlob, chunks: Iterable[bytes | memoryview]) -> Iterator[bytes]:
    """Yield a blob's bytes MiB by MiB, each after its proof; raise BlobDamaged at the first wrong one."""
    taken = 0
    for piece in _cut(chunks):
        expected = blob.digests[taken * DIGEST_BYTES : (taken + 1) * DIGEST_BYTES]
        if digest_piece(piece) != expected:
            raise BlobDamaged(blob.sha256)
        taken += 1
        yield piece
    if taken * DIGEST_BYTES != len(blob.digests):
        raise BlobDamaged(blob.sha256)


def prove_file(file: StoredFile) -> None:
    """Prove all of a file for a reader that proves nothing itself; raise BlobDamaged."""
    with file.path.open("rb") as opened:
        for _ in prove_pieces(file.blob, iter(lambda: opened.read(PIECE_BYTES), b"")):
            pass


def prove_whole(sha256: str, chunks: Iterable[bytes | memoryview]) -> StoredBlob:
    """Read a whole blob; return what it is known by, or raise BlobDamaged unless it hashes to its name."""
    whole, digester, size = hashlib.sha256(), PieceDigester(), 0
    for chunk in chunks:
        whole.update(chunk)
        digester.update(chunk)
        size += len(chunk)
    if whole.hexdigest() != sha256:
        raise BlobDamaged(sha256)
    return StoredBlob(sha256, size, digester.digests())


def _cut(chunks: Iterable[bytes | memoryview]) -> Iterator[bytes]:
    """Yield the same bytes in pieces of a MiB, the last one shorter."""
    waiting = bytearray()
    for chunk in chunks:
        waiting += chunk
        while len(waiting) >= PIECE_BYTES:
            yield bytes(waiting[:PIECE_BYTES])
            del waiting[:PIECE_BYTES]
    if waiting:
        yield bytes(waiting)
