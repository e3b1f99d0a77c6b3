"""Bytes on their way to becoming a blob: written to a temporary file and hashed as they pass."""

import errno
import hashlib
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from store.blobs.errors import StorageFull, StorageUnavailable
from store.blobs.proof import StoredBlob
from store.digests import PieceDigester

PREFIX = "blob-"

# EFBIG is what a file size limit (ulimit -f) answers; to the caller it is the same: there is no room.
_NO_ROOM = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
_BROKEN = {errno.EIO, errno.EROFS, errno.ENODEV, errno.ENXIO, errno.ESTALE, errno.ETIMEDOUT}


Place = Callable[[Path, StoredBlob], None]
"""Puts the finished, synced temporary file where it belongs; it may move the file or leave it."""


class BlobWriter:
    """Writes one blob: `with blobs.writer() as w: w.write(...); stored = w.commit()`."""

    def __init__(self, folder: Path, place: Place) -> None:
        self._folder = folder
        self._place = place
        self._hash = hashlib.sha256()
        self._digester = PieceDigester()
        self._size_bytes = 0
        self._fd = -1
        self._path = folder

    def __enter__(self) -> Self:
        with disk_errors_named(self._folder):
            self._folder.mkdir(parents=True, exist_ok=True)
            self._fd, name = tempfile.mkstemp(prefix=PREFIX, dir=self._folder)
        self._path = Path(name)
        return self

    def write(self, chunk: bytes | memoryview) -> None:
        rest = memoryview(chunk)
        self._hash.update(rest)
        self._digester.update(rest)
        self._size_bytes += rest.nbytes
        with disk_errors_named(self._folder):
            # A nearly full disk takes a part of the bytes before it refuses, so the count must be heeded.
            while rest:
                rest = rest[os.write(self._fd, rest) :]

    @property
    def sha256(self) -> str:
        """The name that these bytes would get, to be compared with what the sender says before `commit`."""
        return self._hash.hexdigest()

    @property
    def size_bytes(self) -> int:
        return self._size_bytes

    def commit(self) -> StoredBlob:
        """Make the bytes durable under their name; nobody may be told that they are kept before."""
        stored = StoredBlob(self.sha256, self._size_bytes, self._digester.digests())
        with disk_errors_named(self._folder):
            os.fchmod(self._fd, 0o440)
            os.fsync(self._fd)
            self._place(self._path, stored)
        return stored

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # Some filesystems report a full disk only here; the blob is placed by now or lost anyway.
        with suppress(OSError):
            os.close(self._fd)
        self._path.unlink(missing_ok=True)


@contextmanager
def disk_errors_named(folder: Path) -> Iterator[None]:
    """Turn the several errors of a full disk into StorageFull, and those of a broken one likewise."""
    try:
        yield
    except OSError as error:
        if error.errno in _NO_ROOM:
            raise StorageFull(f"no room left for blobs below {folder}: {error.strerror}") from error
        if error.errno in _BROKEN:
            raise StorageUnavailable(f"nothing can be written below {folder}: {error.strerror}") from error
        raise


def sweep(folder: Path, older_than_s: float) -> int:
    """Remove temporary files not written to for so long; a live upload keeps its file's time fresh."""
    limit = time.time() - older_than_s
    removed = 0
    for path in folder.glob(f"{PREFIX}*"):
        # Another sweeper or the writer itself may be quicker.
        with suppress(FileNotFoundError):
            if path.stat().st_mtime <= limit:
                path.unlink()
                removed += 1
    return removed


def sync_folder(folder: Path) -> None:
    """Make the names in a folder survive a power cut, as fsync does for a file's bytes."""
    fd = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)


def hashes_to(path: Path, sha256: str) -> bool:
    """Return whether a file still holds the bytes of its name; what cannot be read does not."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest() == sha256
    except OSError:
        return False
