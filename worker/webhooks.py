"""Sending of webhooks: signed, to public addresses only, in threads beside the worker's own."""

import asyncio
import base64
import hashlib
import hmac
import ipaddress
import json
import logging
import socket
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, Final
from urllib.parse import urlsplit

from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from store.audit import digest_value
from store.database import Database, summarise
from store.jobs.processes import repeat
from store.settings import Settings, derive_webhook_secret
from store.software import read_version
from store.tables import Webhook, WebhookDelivery
from store.webhooks import claim_due, forget_old, is_any_due, note_outcome

if TYPE_CHECKING:
    import httpx

log = logging.getLogger(__name__)

_AT_ONCE: Final = 8
_LOOK_EVERY_S: Final = 1.0
_LOOK_AT_REST_S: Final = 5.0
_ANSWER_WITHIN_S: Final = 15.0
_FORGET_EVERY_S: Final = 3600.0
_NAT64: Final = ipaddress.ip_network("64:ff9b::/96")


class Unreachable(Exception):  # noqa: N818  it is what was found
    """An address that is not sent to, or not from here."""


def sign(secret: str, delivery_id: str, timestamp: int, body: bytes) -> str:
    """Return the header `webhook-signature` of Standard Webhooks."""
    key = base64.b64decode(secret.removeprefix("whsec_"))
    said = b".".join((delivery_id.encode(), str(timestamp).encode(), body))
    return f"v1,{base64.b64encode(hmac.new(key, said, hashlib.sha256).digest()).decode()}"


def find_address(host: str, port: int, private_hosts: frozenset[str]) -> str:
    """Return an address of a host; every one that its name has must be public, unless the host is listed."""
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError) as error:
        raise Unreachable(f"{host} has no address: {error}") from error
    addresses = [str(each[4][0]) for each in found]
    if host not in private_hosts and not all(map(is_public, addresses)):
        raise Unreachable(f"{host} has a private address. The operator may list it in STILB_WEBHOOK_HOSTS.")
    return addresses[0]


def is_public(address: str) -> bool:
    """Return True for an address of the internet, also where an IPv4 address is wrapped in an IPv6 one."""
    found: Any = ipaddress.ip_address(address.partition("%")[0])
    if found.version == 6:
        wrapped = found.ipv4_mapped or found.sixtofour or (found.teredo or (None, None))[1]
        if found in _NAT64:
            wrapped = ipaddress.ip_address(int(found) & 0xFFFFFFFF)
        if wrapped is not None and not is_public(str(wrapped)):
            return False
    return bool(found.is_global and not found.is_multicast)


async def _ask(request: "httpx.Request") -> int:
    """Return the status of an answer; nothing else is read, no proxy used and no redirect followed."""
    import httpx  # noqa: PLC0415  a worker without webhooks does not need it

    # of the whole: an address that sends a byte now and then is within every limit of a single read
    async with (
        asyncio.timeout(_ANSWER_WITHIN_S),
        httpx.AsyncClient(trust_env=False, timeout=_ANSWER_WITHIN_S) as client,
    ):
        answer = await client.send(request, stream=True)
        await answer.aclose()
    return answer.status_code


class Deliveries:
    """Sends what is due, each webhook one at a time, in threads of its own."""

    def __init__(
        self,
        database: Database,
        settings: Settings,
        *,
        leads: Callable[[Session], bool] = lambda _session: True,
    ) -> None:
        """``leads``: whether this process is the one of several that sends."""
        self._database = database
        self._settings = settings
        self._leads = leads
        self._forget_at = time.monotonic() + _FORGET_EVERY_S
        self._at_work: dict[str, Future[None]] = {}
        self._pool = ThreadPoolExecutor(_AT_ONCE, thread_name_prefix="webhook")

    def start(self) -> None:
        """Send until the process ends."""
        repeat("webhooks", self._do_round)

    def send_due(self) -> int:
        """Begin to send what is due; return how many are at work."""
        self._at_work = {name: future for name, future in self._at_work.items() if not future.done()}
        free = _AT_ONCE - len(self._at_work)
        if free > 0:
            with self._database.reading() as session:
                due = is_any_due(session) and self._leads(session)
            if due:
                with self._database.writing("webhooks") as session:
                    claimed = claim_due(session, without=set(self._at_work), limit=free)
                for delivery, hook in claimed:
                    self._at_work[hook.id] = self._pool.submit(self._send, delivery, hook)
        return len(self._at_work)

    def _do_round(self) -> float:
        if time.monotonic() >= self._forget_at:
            with self._database.writing("webhooks") as session:
                forget_old(session)
            self._forget_at = time.monotonic() + _FORGET_EVERY_S
        return _LOOK_EVERY_S if self.send_due() else _LOOK_AT_REST_S

    def _send(self, delivery: WebhookDelivery, hook: Webhook) -> None:
        status, error = self._try(delivery, hook)
        try:
            with self._database.writing("webhooks", hook.organisation_id) as session:
                note_outcome(session, delivery.id, status=status, error=error)
        except SQLAlchemyError as trouble:  # its lease ends, and it is sent again under the same id
            log.warning("the outcome of %s is not stored: %s", delivery.id, summarise(trouble))

    def _try(self, delivery: WebhookDelivery, hook: Webhook) -> tuple[int | None, str | None]:
        import httpx  # noqa: PLC0415  a worker without webhooks does not need it

        timestamp = int(time.time())
        said = {"type": delivery.event, "timestamp": delivery.created_at.isoformat(), "data": delivery.data}
        body = json.dumps(said, separators=(",", ":")).encode()
        parts = urlsplit(hook.url)
        host = (parts.hostname or "").lower()
        port = parts.port or (443 if parts.scheme == "https" else 80)
        try:
            secret = self._find_secret(hook)
            address = find_address(host, port, self._settings.private_webhook_hosts)
            # the very address that was checked: asked again, the name could lead elsewhere
            url = httpx.URL(hook.url).copy_with(host=address, port=port)
            headers = {
                "Host": parts.netloc.rpartition("@")[2],
                "Content-Type": "application/json",
                "User-Agent": f"stilb/{read_version()}",
                "webhook-id": delivery.id,
                "webhook-timestamp": str(timestamp),
                "webhook-signature": sign(secret, delivery.id, timestamp, body),
            }
            asked = httpx.Request(
                "POST", url, content=body, headers=headers, extensions={"sni_hostname": host}
            )
            status = asyncio.run(_ask(asked))
        except (TimeoutError, httpx.TimeoutException):
            return None, f"It did not answer within {_ANSWER_WITHIN_S:g} s."
        except (Unreachable, httpx.HTTPError, httpx.InvalidURL, ValueError, OSError) as error:
            return None, f"{error}"[:300] or type(error).__name__
        return status, None if 200 <= status < 300 else f"It answered {status}."

    def _find_secret(self, hook: Webhook) -> str:
        secret = derive_webhook_secret(self._settings, hook.id)
        if digest_value(secret) != hook.secret_sha256:
            raise Unreachable(
                "This worker has another STILB_WEBHOOK_KEY than the service that added the webhook. "
                "Give both the same, or add the webhook anew."
            )
        return secret
