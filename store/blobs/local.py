"""Blobs in a folder of this machine: `ab/cd/<sha256>`."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from store.blobs.errors import BlobMissing, StorageUnavailable
from store.blobs.spool import BlobWriter, StoredBlob, hashes_to, sweep, sync_folder
from store.blobs.surface import CHUNK_BYTES, checked_name


class LocalBlobs:
    """The blobs below one folder, which processes of one machine may share."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        # Below the same folder, hence on the same filesystem, where a rename is atomic.
        self._temporary = folder / "tmp"

    def writer(self) -> BlobWriter:
        return BlobWriter(self._temporary, self._place)

    def open(self, sha256: str) -> Iterator[bytes]:
        # Blobs are never removed, so one that is found now is there when the first piece is asked for.
        return _pieces(self._found(sha256))

    @contextmanager
    def local_path(self, sha256: str) -> Iterator[Path]:
        yield self._found(sha256)

    def exists(self, sha256: str) -> bool:
        return self._path(sha256).is_file()

    def size(self, sha256: str) -> int:
        return self._found(sha256).stat().st_size

    def sweep_temporary(self, older_than_s: float) -> int:
        return sweep(self._temporary, older_than_s)

    def check(self) -> None:
        try:
            with self.writer() as writer:
                writer.write(b"\0")
        except OSError as error:
            raise StorageUnavailable(
                f"blobs cannot be written below {self._folder}: {error.strerror}"
            ) from error

    def _path(self, sha256: str) -> Path:
        checked_name(sha256)
        return self._folder / sha256[:2] / sha256[2:4] / sha256

    def _found(self, sha256: str) -> Path:
        path = self._path(sha256)
        if not path.is_file():
            raise BlobMissing(sha256)
        return path

    def _place(self, temporary: Path, stored: StoredBlob) -> None:
        final = self._path(stored.sha256)
        final.parent.mkdir(parents=True, exist_ok=True)
        # What is there is left alone, unless the disk has spoilt it: then the sender's copy is the cure.
        # Two writers of the same bytes may both get here; either rename leaves the same blob.
        if not final.is_file() or not hashes_to(final, stored.sha256):
            temporary.replace(final)
        # Also when another writer was first: it may not have come as far as syncing the names yet.
        for folder in (final.parent, final.parent.parent, self._folder):
            sync_folder(folder)


def _pieces(path: Path) -> Iterator[bytes]:
    with path.open("rb") as file:
        while piece := file.read(CHUNK_BYTES):
            yield piece
