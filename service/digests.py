"""Check of a request's content against the digest that it states (RFC 9530)."""

import base64
import hashlib
import re
from typing import Any, Final

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from radiometry.findings import interface
from service.limits import is_upload
from service.problems import Problem

_ALGORITHMS: Final = {"sha-256": "sha256", "sha-512": "sha512"}
_MEMBER: Final = re.compile(r"(?:^|,)\s*(sha-256|sha-512)\s*=([^,]*)", re.IGNORECASE)


class ContentDigests:
    """Refuses a body that is not the announced one, when its last byte is there.

    Of an upload only `Content-Digest` is looked at here: `Repr-Digest` is the file's, also in a form, and
    `service/receive.py` hashes the file anyway.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        names = ("content-digest",) if is_upload(scope) else ("content-digest", "repr-digest")
        announced = {name: ", ".join(headers.getlist(name)) for name in names if name in headers}
        await self._app(scope, _Compared(receive, announced) if announced else receive, send)


class _Compared:
    """The body as it comes, hashed on the way."""

    def __init__(self, receive: Receive, announced: dict[str, str]) -> None:
        self._receive = receive
        self._announced = announced
        self._running: list[tuple[str, bytes, Any]] | None = None

    async def __call__(self) -> Message:
        if self._running is None:
            self._running = [
                (name, digest, hashlib.new(algorithm))
                for name, text in self._announced.items()
                for algorithm, digest in _read_digests(name, text)
            ]
        message = await self._receive()
        if message["type"] != "http.request":
            return message
        for _, _, running in self._running:
            running.update(message.get("body", b""))
        if not message.get("more_body"):
            self._compare()
        return message

    def _compare(self) -> None:
        for name, digest, running in self._running or ():
            if running.digest() != digest:
                found = base64.b64encode(running.digest()).decode()
                detail = f"The body is not the one of {name.title()}: it arrived as {running.name} {found}."
                raise Problem(interface.DIGEST_MISMATCH, f"{detail} Send it again.")


def _read_digests(name: str, text: str) -> list[tuple[str, bytes]]:
    """Read the digests of the algorithms that we know; others are for others to compare."""
    found = []
    for match in _MEMBER.finditer(text):
        algorithm, value = _ALGORITHMS[match[1].lower()], match[2].strip()
        try:
            digest = base64.b64decode(value[1:-1], validate=True)
        except ValueError:
            digest = b""
        if (value[:1], value[-1:]) != (":", ":") or len(digest) != hashlib.new(algorithm).digest_size:
            detail = f"{name.title()} cannot be read: it takes {match[1].lower()}=:base64 of the digest:"
            raise Problem(interface.BAD_REQUEST, detail)
        found.append((algorithm, digest))
    return found
