"""The ways in which a blob store can refuse."""

from typing import Literal

Damage = Literal["damaged", "missing"]


class BlobDamaged(Exception):  # noqa: N818 (named by the state that it reports)
    """The stored bytes are not those that were uploaded, or cannot be read any more."""

    damage: Damage = "damaged"

    def __init__(self, sha256: str) -> None:
        super().__init__(f"the stored file {sha256} is {self.damage}")
        self.sha256 = sha256


class BlobMissing(BlobDamaged):
    """No bytes are stored under this name."""

    damage = "missing"


class StorageFull(Exception):  # noqa: N818 (named by the state that it reports)
    """The disk, quota or file size limit leaves no room for these bytes; worth a retry once there is room."""


class StorageUnavailable(Exception):  # noqa: N818 (named by the state that it reports)
    """The store does not answer or does not let us in; worth a retry."""
