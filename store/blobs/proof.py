"""Hashes that identify a blob, and the proof that bytes are its own."""

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from store.blobs.errors import BlobDamaged
from store.digests import DIGEST_BYTES, PIECE_BYTES, PieceDigester, digest_piece


@dataclass(frozen=True)
class StoredBlob:
    """A blob's name, its size, and a digest per MiB that proves any part of it."""

    sha256: str
    size_bytes: int
    digests: bytes = field(repr=False)


@dataclass(frozen=True)
class StoredFile:
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
