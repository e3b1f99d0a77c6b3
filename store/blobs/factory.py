"""Choice of the blob store by the setting."""

from pathlib import Path
from urllib.parse import unquote, urlsplit

from store.blobs.local import LocalBlobs
from store.blobs.surface import Blobs


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
