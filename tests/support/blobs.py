"""Storing and counting."""

from pathlib import Path

from store.blobs import Blobs, StoredBlob


def put(blobs: Blobs, *chunks: bytes) -> StoredBlob:
    """Store the chunks as one blob."""
    with blobs.writer() as writer:
        for chunk in chunks:
            writer.write(chunk)
        return writer.commit()


def files(folder: Path) -> list[Path]:
    """Every file below the folder."""
    return sorted(path for path in folder.rglob("*") if path.is_file())
