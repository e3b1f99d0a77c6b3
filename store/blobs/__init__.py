"""Raw files under the name of their own SHA-256: written once, never changed, the same bytes only once."""

from store.blobs.errors import BlobDamaged, BlobMissing, StorageFull, StorageUnavailable
from store.blobs.factory import blobs_from_url
from store.blobs.local import LocalBlobs
from store.blobs.objects import ObjectBlobs
from store.blobs.spool import BlobWriter, StoredBlob
from store.blobs.surface import Blobs

__all__ = [
    "BlobDamaged",
    "BlobMissing",
    "BlobWriter",
    "Blobs",
    "LocalBlobs",
    "ObjectBlobs",
    "StorageFull",
    "StorageUnavailable",
    "StoredBlob",
    "blobs_from_url",
]
