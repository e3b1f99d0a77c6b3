"""Blobs in a folder of this machine: `ab/cd/<sha256>`."""

import errno
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import unquote, urlsplit

from store.blobs import proof, spool

# What a disk answers, and a filesystem with checksums, for what it cannot read back.
_UNREADABLE = {errno.EIO, errno.EBADMSG, errno.EUCLEAN}


class LocalBlobs(spool.Blobs):
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
            raise proof.StorageUnavailable(
                f"blobs cannot be written below {self._folder}: {error.strerror}"
            ) from error

    def _path(self, sha256: str) -> Path:
        spool.checked_name(sha256)
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
            raise proof.StorageUnavailable(
                f"blobs cannot be read below {self._folder}: {error.strerror}"
            ) from error

    def _place(self, temporary: Path, stored: proof.StoredBlob) -> None:
        final = self._path(stored.sha256)
        final.parent.mkdir(parents=True, exist_ok=True)
        # What is there is left alone, unless the disk has spoilt it: then the sender's copy is the cure.
        # Two writers of the same bytes may both get here; either rename leaves the same blob.
        if not final.is_file() or not spool.hashes_to(final, stored.sha256):
            temporary.replace(final)
        # Also when another writer was first: it may not have come as far as syncing the names yet.
        for folder in (final.parent, final.parent.parent, self._folder):
            spool.sync_folder(folder)


def blobs_from_url(url: str, data_folder: Path) -> spool.Blobs:
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
