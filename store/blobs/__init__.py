"""Raw files under the name of their own SHA-256: written once, never changed, the same bytes only once."""

from store.blobs.proof import (
    BlobDamaged,
    BlobMissing,
    Damage,
    StorageFull,
    StorageUnavailable,
    StoredBlob,
    StoredFile,
    prove_file,
)
from store.blobs.spool import Blobs, BlobWriter, LocalBlobs, blobs_from_url
