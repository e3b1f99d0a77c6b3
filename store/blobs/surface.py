"""Interface of all blob stores, wherever the bytes are."""

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from typing import Protocol

from store.blobs.proof import StoredBlob, StoredFile
from store.blobs.spool import BlobWriter

_SHA256 = re.compile(r"[0-9a-f]{64}")


class Blobs(Protocol):
    """Content-addressed bytes; every method may be called from any thread and any process."""

    def writer(self) -> BlobWriter:
        """Start a blob: use as a context manager; leaving it without `commit` leaves nothing behind."""

    def open(self, blob: StoredBlob) -> Iterator[bytes]:
        """Yield the bytes MiB by MiB, each proven.

        Raises BlobMissing at once, and BlobDamaged in place of the first wrong piece.
        """

    def local_file(self, blob: StoredBlob) -> AbstractContextManager[StoredFile]:
        """Lend a real file; whoever reads it proves what it reads, and raises BlobDamaged in the context."""

    def prove(self, sha256: str, pace: Callable[[int], object]) -> StoredBlob:
        """Read all of a blob where it is kept, past every cache, and return what it is known by.

        `pace` is told of every piece's size, and may wait. Raises BlobDamaged or BlobMissing.
        """

    def find_absent(self, sizes: Mapping[str, int]) -> set[str]:
        """Return which of these names are not stored, or not in their size; nothing is read."""

    def sweep_temporary(self, older_than_s: float) -> int:
        """Remove what killed processes left half written for that long; return how many files."""

    def check(self) -> None:
        """Raise StorageUnavailable or StorageFull unless blobs can be written now."""


def checked_name(sha256: str) -> str:
    """Return the name unless it is no SHA-256, which would let a caller walk out of the folder."""
    if _SHA256.fullmatch(sha256) is None:
        raise ValueError(f"not a lower-case hexadecimal SHA-256: {sha256!r}")
    return sha256
