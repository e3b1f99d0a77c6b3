"""Receipts of cards: what is missing, and what a card may be formatted for."""

from collections.abc import Iterable
from typing import Any, TypedDict

from stilb.connection import Connection
from stilb.transport import address


class CardFile(TypedDict):
    """A file of a card, by its path below the card's folder."""

    name: str
    size_bytes: int


class SentFile(CardFile):
    sha256: str


class Receipts(Connection):
    """Manifests and receipts."""

    def send_manifest(
        self, campaign_id: str, files: Iterable[SentFile], *, others: Iterable[CardFile] = ()
    ) -> dict[str, Any]:
        """State what a card holds; the answer lists what is ``missing``, each with its reason.

        ``others`` are files that are not sent: a receipt names them as not covered.
        """
        body = {"files": [*files], "others": [*others]}
        return self._post(address("campaigns", campaign_id, "manifest"), body)

    def receipt(self, campaign_id: str, manifest_id: str | None = None) -> dict[str, Any]:
        """Return a manifest's signed receipt, by default the newest; ``Problem`` while files are missing."""
        return self._get(address("campaigns", campaign_id, "receipt"), {"manifest_id": manifest_id})

    def signing_keys(self) -> list[dict[str, Any]]:
        """The service's public keys, newest first: keep them where receipts are verified."""
        return list(self._get(address("signing-keys"))["items"])
