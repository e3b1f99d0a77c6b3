"""Raw files under the name of their own SHA-256: written once, never changed, the same bytes only once."""

from store.blobs.errors import BlobDamaged, BlobMissing, Damage, StorageFull, StorageUnavailable
from store.blobs.factory import blobs_from_url
from store.blobs.local import LocalBlobs
from store.blobs.proof import StoredBlob, StoredFile, prove_file
from store.blobs.spool import BlobWriter
from store.blobs.surface import Blobs

__all__ = [
    "BlobDamaged",
    "BlobMissing",
    "BlobWriter",
    "Blobs",
    "Damage",
    "LocalBlobs",
    "StorageFull",
    "StorageUnavailable",
    "StoredBlob",
    "StoredFile",
    "blobs_from_url",
    "prove_file",
]
