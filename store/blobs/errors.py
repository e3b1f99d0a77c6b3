"""The ways in which a blob store can refuse."""


class BlobMissing(LookupError):  # noqa: N818 (named by the state that it reports)
    """No blob of this name is stored."""

    def __init__(self, sha256: str) -> None:
        super().__init__(f"no blob {sha256} is stored")
        self.sha256 = sha256


class BlobDamaged(Exception):  # noqa: N818 (named by the state that it reports)
    """The stored bytes no longer hash to their name."""

    def __init__(self, sha256: str) -> None:
        super().__init__(f"the stored blob {sha256} no longer hashes to its name")
        self.sha256 = sha256


class StorageFull(Exception):  # noqa: N818 (named by the state that it reports)
    """The disk, quota or file size limit leaves no room for these bytes; worth a retry once there is room."""


class StorageUnavailable(Exception):  # noqa: N818 (named by the state that it reports)
    """The store does not answer or does not let us in; worth a retry."""
