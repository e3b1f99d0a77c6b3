"""Storing and counting."""

from pathlib import Path

import obstore

from store.blobs import Blobs, LocalBlobs, StoredBlob


def put(blobs: Blobs, *chunks: bytes) -> StoredBlob:
    """Store the chunks as one blob."""
    return blobs.keep(chunks)


def spoil(blobs: Blobs, folder: Path, sha256: str, content: bytes | None) -> None:
    """Put other bytes, or none at all, in the place of a blob, below the folder or in its bucket."""
    if not isinstance(blobs, LocalBlobs):
        key = f"{sha256[:2]}/{sha256[2:4]}/{sha256}"
        if content is None:
            obstore.delete(blobs._store, key)
        else:
            obstore.put(blobs._store, key, content)
        return
    (path,) = folder.rglob(sha256)
    path.unlink()
    if content is not None:
        path.write_bytes(content)
        path.chmod(0o440)


def zero(folder: Path, sha256: str, *, first: int, count: int) -> None:
    """Write zeros into a stored file, in place, as a bad disk may."""
    (path,) = folder.rglob(sha256)
    path.chmod(0o600)
    with path.open("r+b") as file:
        file.seek(first)
        file.write(bytes(count))


def files(folder: Path) -> list[Path]:
    """Every file below the folder."""
    return sorted(path for path in folder.rglob("*") if path.is_file())
