"""Connections that say nothing must not take the place of those that do.

uvicorn waits for the end of a request's headers as long as the peer likes, and takes connections until the
process may open no more files: then nobody is answered. Here headers must arrive in time, and one peer has so
many connections and no more. How long a body may take is for `service/limits.py`.
"""

import asyncio
import logging
import resource
from collections import Counter
from contextlib import suppress
from typing import Any

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

log = logging.getLogger(__name__)

_HEADER_BYTES = 64 * 1024
_JOINED_BYTES = 1 << 16
"""A longer beginning of a body is not copied for its head."""
_KEPT_FILES = 256
"""For the database, uploads and everything else that is not a connection of a peer."""
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
        """Count one less."""
        self._open[peer] -= 1
        if not self._open[peer]:
            del self._open[peer]
            self._told.discard(peer)


class _Joining:
    """A transport that sends the head of an answer together with the beginning of its body.

    The server writes them one after the other, each with a system call and a packet of its own. A head
    without a body goes in the loop's next turn.
    """

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
    """Return uvicorn's protocol with these limits."""

    class Guarded(_Guarded):
        _guard = connections

    return Guarded
