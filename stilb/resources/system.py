"""The service itself, and the key that asks."""

from stilb.connection import Connection
from stilb.health import Health, examine
from stilb.records import Finding, OwnKey
from stilb.transport import address


class System(Connection):
    """Own key, and state of the service."""

    def own_key(self) -> OwnKey:
        """The key that this client asks with: its organisation and its scopes."""
        return OwnKey.of(self._get(address("keys", "own")))

    def findings(self) -> dict[str, Finding]:
        """Return the registry of findings by code."""
        items = self._get(address("findings"))["items"]
        return {item["code"]: Finding.of(item) for item in items}

    def health(self) -> Health:
        """How the service fares, as far as it tells."""
        return examine(self._transport)
