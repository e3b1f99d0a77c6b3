"""Connections that say nothing, and names that this service is not known by."""

import asyncio
import ipaddress
import logging
import re
import resource
import socket
from collections import Counter
from contextlib import suppress
from functools import lru_cache
from typing import Any, Final
from urllib.parse import urlsplit

from starlette.requests import Request
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from store.settings import Settings

_HOST: Final = re.compile(r"([a-z0-9._-]+|\[[0-9a-f:.]+\])(:\d{1,5})?", re.ASCII | re.IGNORECASE)


class Hosts:
    """Names of our own: the settings', this machine's, and addresses that lead only into its network."""

    def __init__(self, settings: Settings) -> None:
        entries = [entry.strip().rstrip("/") for entry in settings.allowed_hosts.split(",")]
        parts = [urlsplit(entry if "//" in entry else f"//{entry}") for entry in entries if entry]
        self._schemes = {part.netloc.lower(): part.scheme for part in parts}
        self.are_listed = bool(parts)
        machine = socket.gethostname().lower()
        self._own = {"localhost", machine, f"{machine}.local", settings.host.lower()} - {""}

    def is_listed(self, host: str) -> bool:
        """Return whether the settings name this host, with its port or for any."""
        return bool({host.lower(), _without_port(host)} & self._schemes.keys())

    def is_own(self, host: str, reached_at: str) -> bool:
        """Return whether the host is this machine, or an address in its network, as far as we can know."""
        if _HOST.fullmatch(host) is None:
            return False
        name = _without_port(host).strip("[]")
        if name in self._own or name.endswith(".localhost"):
            return True
        is_local = _is_local(name)
        return is_local or (is_local is not None and name == reached_at)

    def scheme_of(self, host: str) -> str:
        """Return the scheme that the settings give this host; empty where they give none."""
        return self._schemes.get(host.lower()) or self._schemes.get(_without_port(host), "")


def absolute(request: Request, path_and_query: str) -> str:
    """Return an address of this service: absolute under a name of our own, else a path."""
    base: str = request.scope["state"]["base"]
    return f"{base}{path_and_query}"


def address_with(request: Request, **parameters: Any) -> str:  # noqa: ANN401  as their query takes them
    """Return the address of a request with these parameters in the place of its own."""
    following = request.url.include_query_params(**parameters)
    return absolute(request, f"{following.path}?{following.query}")


@lru_cache(maxsize=1024)
def _is_local(name: str) -> bool | None:
    """Return whether an address leads only into this machine's network; None for what is no address."""
    try:
        address = ipaddress.ip_address(name)
    except ValueError:
        return None
    return address.is_loopback or address.is_private


def _without_port(host: str) -> str:
    return re.sub(r":\d*$", "", host.lower())


log = logging.getLogger(__name__)

_HEADER_BYTES = 64 * 1024
_JOINED_BYTES = 1 << 16  # a longer beginning of a body is not copied for its head
_KEPT_FILES = 256  # for the database, uploads and everything else that is not a connection of a peer
_MANY_FILES = 65536


def raise_file_limit() -> int:
    """Raise the limit of open files to the highest that this process may have, and return it."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = _MANY_FILES if hard == resource.RLIM_INFINITY else hard
    with suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
        soft = wanted
    return soft


class Connections:
    """The open connections, by the address of their peer: those of one, and all together, are limited."""

    def __init__(self, *, files: int, per_peer: int, headers_within_s: float = 15.0) -> None:
        """``per_peer`` 0: no limit but that of all, as behind a proxy, whose address all of them have."""
        self._most = max(files - _KEPT_FILES, files // 2)
        self._per_peer = per_peer or self._most
        self.headers_within_s = headers_within_s
        self._open: Counter[str] = Counter()
        self._told: set[str] = set()

    def admit(self, peer: str) -> bool:
        """Count one more of this peer; False when it has enough, or when all have."""
        if self._open[peer] >= self._per_peer:
            if peer not in self._told:
                log.warning("no more connections are taken from %s, which has %d", peer, self._open[peer])
                self._told.add(peer)
            return False
        if self._open.total() >= self._most:
            return False
        self._open[peer] += 1
        return True

    def release(self, peer: str) -> None:
        self._open[peer] -= 1
        if not self._open[peer]:
            del self._open[peer]
            self._told.discard(peer)


class _Joining:
    """A transport that sends the head of an answer with the beginning of its body: one packet, not two."""

    def __init__(self, transport: asyncio.Transport, loop: asyncio.AbstractEventLoop) -> None:
        self._transport, self._loop = transport, loop
        self._head = b""

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401  the transport's own
        return getattr(self._transport, name)

    def write(self, data: bytes) -> None:
        if self._head and len(data) < _JOINED_BYTES:
            data, self._head = self._head + data, b""
        self._flush()
        if data.startswith(b"HTTP/1.1 ") and data.endswith(b"\r\n\r\n"):
            self._head = data
            self._loop.call_soon(self._flush)
        else:
            self._transport.write(data)

    def close(self) -> None:
        self._flush()
        self._transport.close()

    def _flush(self) -> None:
        if self._head:
            head, self._head = self._head, b""
            self._transport.write(head)


class _Guarded(HttpToolsProtocol):
    _guard: Connections
    _peer: str | None = None
    _due: asyncio.TimerHandle | None = None
    _header_bytes = 0
    _named_bytes = 0

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(_Joining(transport, self.loop))  # type: ignore[arg-type]
        peer = str((transport.get_extra_info("peername") or ("",))[0])
        if not self._guard.admit(peer):
            transport.abort()
            return
        self._peer = peer
        self._expect_headers()

    def connection_lost(self, exc: Exception | None) -> None:
        self._expect_nothing()
        if self._peer is not None:
            self._guard.release(self._peer)
            self._peer = None
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if self._due is not None:
            self._header_bytes += len(data)
            if self._header_bytes > _HEADER_BYTES:
                self.transport.abort()

    def on_message_begin(self) -> None:
        super().on_message_begin()
        self._named_bytes = 0
        self._expect_headers()

    def on_header(self, name: bytes, value: bytes) -> None:
        # those of one packet are read before their bytes are counted above
        self._named_bytes += len(name) + len(value)
        if self._named_bytes > _HEADER_BYTES:
            raise ValueError("the headers are too long")
        super().on_header(name, value)

    def on_headers_complete(self) -> None:
        self._expect_nothing()
        super().on_headers_complete()

    def _expect_headers(self) -> None:
        if self._due is None:
            self._header_bytes = 0
            self._due = self.loop.call_later(self._guard.headers_within_s, self._end_unless_busy)

    def _expect_nothing(self) -> None:
        if self._due is not None:
            self._due.cancel()
            self._due = None

    def _end_unless_busy(self) -> None:
        self._due = None
        if self.cycle is not None and not self.cycle.response_complete:
            # The next request came before the answer to the last, which goes first.
            self._expect_headers()
            return
        self.transport.abort()


def guarding(connections: Connections) -> type[HttpToolsProtocol]:
    class Guarded(_Guarded):
        _guard = connections

    return Guarded
