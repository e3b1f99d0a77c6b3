"""Bytes on their way to becoming a blob, the interface of all blob stores, and that of a folder."""

import errno
import hashlib
import os
import re
import tempfile
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import Self
from urllib.parse import unquote, urlsplit

from store.blobs import proof

PREFIX = "blob-"

# EFBIG is what a file size limit (ulimit -f) answers; to the caller it is the same: there is no room.
_NO_ROOM = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
_BROKEN = {errno.EIO, errno.EROFS, errno.ENODEV, errno.ENXIO, errno.ESTALE, errno.ETIMEDOUT}


Place = Callable[[Path, proof.StoredBlob], None]
"""Puts the finished, synced temporary file where it belongs; it may move the file or leave it."""


class BlobWriter:
    """Writes one blob: `with blobs.writer() as w: w.write(...); stored = w.commit()`."""

    def __init__(self, folder: Path, place: Place) -> None:
        self._folder, self._place = folder, place
        self._hash = hashlib.sha256()
        self._digester = proof.PieceDigester()
        self.size_bytes = 0
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
        self.size_bytes += rest.nbytes
        with disk_errors_named(self._folder):
            # A nearly full disk takes a part of the bytes before it refuses, so the count must be heeded.
            while rest:
                rest = rest[os.write(self._fd, rest) :]

    @property
    def sha256(self) -> str:
        """The name that these bytes would get, to be compared with what the sender says before `commit`."""
        return self._hash.hexdigest()

    def commit(self) -> proof.StoredBlob:
        """Make the bytes durable under their name; nobody may be told that they are kept before."""
        stored = proof.StoredBlob(self.sha256, self.size_bytes, self._digester.digests())
        with disk_errors_named(self._folder):
            os.fchmod(self._fd, 0o440)
            os.fsync(self._fd)
            self._place(self._path, stored)
        return stored

    def __exit__(self, *_: object) -> None:
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
            raise proof.StorageFull(f"no room left for blobs below {folder}: {error.strerror}") from error
        if error.errno in _BROKEN:
            message = f"nothing can be written below {folder}: {error.strerror}"
            raise proof.StorageUnavailable(message) from error
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


_SHA256 = re.compile(r"[0-9a-f]{64}")


class Blobs(ABC):
    """Content-addressed bytes; every method may be called from any thread and any process."""

    def __init__(self, temporary: Path) -> None:
        self._temporary = temporary

    def writer(self) -> BlobWriter:
        """Start a blob: use as a context manager; leaving it without `commit` leaves nothing behind."""
        return BlobWriter(self._temporary, self._place)

    def keep(self, pieces: Iterable[bytes]) -> proof.StoredBlob:
        with self.writer() as writer:
            for piece in pieces:
                writer.write(piece)
            return writer.commit()

    def open(self, blob: proof.StoredBlob) -> Iterator[bytes]:
        return proof.prove_pieces(blob, self._pieces(blob.sha256))

    def prove(self, sha256: str, pace: Callable[[int], object]) -> proof.StoredBlob:
        """Read all of a blob where it is kept, past every cache, and return what it is known by."""
        return proof.prove_whole(sha256, self._pieces(sha256, pace=pace))

    def sweep_temporary(self, older_than_s: float) -> int:
        """Remove what killed processes left half written for that long; return how many files."""
        return sweep(self._temporary, older_than_s)

    @abstractmethod
    def local_file(self, blob: proof.StoredBlob) -> AbstractContextManager[proof.StoredFile]:
        """Lend a real file; whoever reads it proves what it reads, and raises BlobDamaged in the context."""

    @abstractmethod
    def find_absent(self, sizes: Mapping[str, int]) -> set[str]:
        """Return which of these names are not stored, or not in their size; nothing is read."""

    @abstractmethod
    def check(self) -> None:
        """Raise StorageUnavailable or StorageFull unless blobs can be written now."""

    @abstractmethod
    def _place(self, temporary: Path, stored: proof.StoredBlob) -> None: ...

    @abstractmethod
    def _pieces(self, sha256: str, *, pace: Callable[[int], object] | None = None) -> Iterator[bytes]:
        """Read a blob from its start; with a pace past what memory holds of it."""


def checked_name(sha256: str) -> str:
    """Return the name unless it is no SHA-256, which would let a caller walk out of the folder."""
    if _SHA256.fullmatch(sha256) is None:
        raise ValueError(f"not a lower-case hexadecimal SHA-256: {sha256!r}")
    return sha256


# What a disk answers, and a filesystem with checksums, for what it cannot read back.
_UNREADABLE = {errno.EIO, errno.EBADMSG, errno.EUCLEAN}


class LocalBlobs(Blobs):
    """The blobs below one folder, which processes of one machine may share."""

    def __init__(self, folder: Path) -> None:
        # Below the same folder, hence on the same filesystem, where a rename is atomic.
        super().__init__(folder / "tmp")
        self._folder = folder

    @contextmanager
    def local_file(self, blob: proof.StoredBlob) -> Iterator[proof.StoredFile]:
        if self._size(blob.sha256) != blob.size_bytes:
            raise proof.BlobDamaged(blob.sha256)
        yield proof.StoredFile(self._path(blob.sha256), blob)

    def find_absent(self, sizes: Mapping[str, int]) -> set[str]:
        return {sha256 for sha256, size in sizes.items() if not self._holds(sha256, size)}

    def check(self) -> None:
        try:
            with self.writer() as writer:
                writer.write(b"\0")
        except OSError as error:
            message = f"blobs cannot be written below {self._folder}: {error.strerror}"
            raise proof.StorageUnavailable(message) from error

    def _path(self, sha256: str) -> Path:
        checked_name(sha256)
        return self._folder / sha256[:2] / sha256[2:4] / sha256

    def _size(self, sha256: str) -> int:
        with self._read_errors_named(sha256):
            return self._path(sha256).stat().st_size

    def _holds(self, sha256: str, size: int) -> bool:
        try:
            return self._size(sha256) == size
        except proof.BlobDamaged:
            return False

    def _pieces(self, sha256: str, *, pace: Callable[[int], object] | None = None) -> Iterator[bytes]:
        with self._read_errors_named(sha256), self._path(sha256).open("rb", buffering=0) as file:
            if pace is not None:
                os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
            while piece := file.read(proof.PIECE_BYTES):
                if pace is not None:
                    pace(len(piece))
                yield piece

    @contextmanager
    def _read_errors_named(self, sha256: str) -> Iterator[None]:
        try:
            yield
        except FileNotFoundError as error:
            # a folder that is gone as a whole is a disk that is not mounted, and no loss of this blob
            if not self._folder.is_dir():
                raise proof.StorageUnavailable(f"the blobs' folder {self._folder} is not there") from error
            raise proof.BlobMissing(sha256) from error
        except OSError as error:
            if error.errno in _UNREADABLE:
                raise proof.BlobDamaged(sha256) from error
            message = f"blobs cannot be read below {self._folder}: {error.strerror}"
            raise proof.StorageUnavailable(message) from error

    def _place(self, temporary: Path, stored: proof.StoredBlob) -> None:
        final = self._path(stored.sha256)
        final.parent.mkdir(parents=True, exist_ok=True)
        # What is there is left alone, unless the disk has spoilt it: then the sender's copy is the cure.
        # Two writers of the same bytes may both get here; either rename leaves the same blob.
        if not final.is_file() or not hashes_to(final, stored.sha256):
            temporary.replace(final)
        # Also when another writer was first: it may not have come as far as syncing the names yet.
        for folder in (final.parent, final.parent.parent, self._folder):
            sync_folder(folder)


def blobs_from_url(url: str, data_folder: Path) -> Blobs:
    """Open what the setting names: "" the data folder's own, a path or file:// a folder, s3:// a bucket."""
    parts = urlsplit(url)
    match parts.scheme:
        case "":
            return LocalBlobs(Path(url) if url else data_folder / "blobs")
        case "file":
            return LocalBlobs(Path(unquote(parts.path)))
        case "s3":
            from store.blobs.objects import ObjectBlobs

            return ObjectBlobs(url, data_folder / "blob-cache")
        case other:
            raise ValueError(f"blobs can be kept in a folder or at s3://, not at {other}://")
