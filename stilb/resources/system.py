"""The service itself, and the key that asks."""

from stilb.connection import Connection
from stilb.health import Health, examine
from stilb.records import OwnKey
from stilb.transport import address


class System(Connection):
    """Who asks, and how the service fares."""

    def own_key(self) -> OwnKey:
        """The key that this client asks with: its organisation and its scopes."""
        return OwnKey.of(self._get(address("keys", "own")))

    def health(self) -> Health:
        """How the service fares, as far as it tells."""
        return examine(self._transport)
