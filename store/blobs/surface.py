"""What every blob store offers, whichever place the bytes lie in."""

import re
from collections.abc import Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Protocol

from store.blobs.spool import BlobWriter

CHUNK_BYTES = 1 << 20
"""Size of the pieces in which blobs are read."""

_SHA256 = re.compile(r"[0-9a-f]{64}")


class Blobs(Protocol):
    """Content-addressed bytes; every method may be called from any thread and any process."""

    def writer(self) -> BlobWriter:
        """Start a blob: use as a context manager; leaving it without `commit` leaves nothing behind."""

    def open(self, sha256: str) -> Iterator[bytes]:
        """Yield the bytes in pieces; raises BlobMissing at once, not at the first piece."""

    def local_path(self, sha256: str) -> AbstractContextManager[Path]:
        """Give a real file with these bytes, to be mapped and never written, while the context lasts."""

    def exists(self, sha256: str) -> bool: ...

    def size(self, sha256: str) -> int:
        """Return the size [bytes]."""

    def sweep_temporary(self, older_than_s: float) -> int:
        """Remove what killed processes left half written for that long; return how many files."""

    def check(self) -> None:
        """Raise StorageUnavailable or StorageFull unless blobs can be written now."""


def checked_name(sha256: str) -> str:
    """Return the name unless it is no SHA-256, which would let a caller walk out of the folder."""
    if _SHA256.fullmatch(sha256) is None:
        raise ValueError(f"not a lower-case hexadecimal SHA-256: {sha256!r}")
    return sha256
