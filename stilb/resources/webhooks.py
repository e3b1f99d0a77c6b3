"""Webhooks: addresses that are told of an organisation's events."""

from collections.abc import Iterator, Sequence
from typing import Any

from stilb.connection import Connection
from stilb.transport import Call, address


class Webhooks(Connection):
    """Webhooks and their deliveries, for administrators."""

    def webhooks(self) -> Iterator[dict[str, Any]]:
        """Return the webhooks of your organisation, without their secrets."""
        return self._transport.items(address("webhooks"))

    def create_webhook(self, url: str, events: Sequence[str]) -> dict[str, Any]:
        """Have events sent to an address; the ``secret`` of the signatures is in this answer only."""
        return self._post(address("webhooks"), {"url": url, "events": list(events)})

    def change_webhook(
        self,
        webhook_id: str,
        *,
        url: str | None = None,
        events: Sequence[str] | None = None,
        enabled: bool | None = None,
    ) -> dict[str, Any]:
        """Change address or events, disable it, or enable it again."""
        said = {"url": url, "events": events, "enabled": enabled}
        body = {name: value for name, value in said.items() if value is not None}
        return self._transport.json(Call(method="PATCH", path=address("webhooks", webhook_id), json=body))

    def remove_webhook(self, webhook_id: str) -> dict[str, Any]:
        """Remove a webhook and the log of its deliveries."""
        return self._transport.json(Call(method="DELETE", path=address("webhooks", webhook_id)))

    def test_webhook(self, webhook_id: str) -> dict[str, Any]:
        """Send an event ``webhook.test``; return its delivery."""
        return self._post(f"{address('webhooks', webhook_id)}/test", {})

    def retry_delivery(self, webhook_id: str, delivery_id: str) -> dict[str, Any]:
        """Send a delivery again at once; return it."""
        return self._post(f"{address('webhooks', webhook_id, 'deliveries', delivery_id)}/retry", {})

    def deliveries(self, webhook_id: str) -> Iterator[dict[str, Any]]:
        """Return what was sent, newest first, with the answers."""
        return self._transport.items(f"{address('webhooks', webhook_id)}/deliveries")
