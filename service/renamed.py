"""Old addresses of renamed resources. They answer for one release, with headers that name the new address."""

import re
from typing import Final

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from radiometry.findings import interface

_DEPRECATED_SINCE: Final = "@1795305600"
"""2026-11-22, as a date of RFC 9745."""

_RENAMED: Final = (
    (re.compile(r"/v1/purges(/.*)?"), r"/v1/recalls\1"),
    (re.compile(r"(/v1/measurements/[^/]+)/contrast"), r"\1/comparison"),
    (re.compile(r"/measurements/contrast"), "/measurements/comparison"),
)
_OLD_CODES: Final = {interface.RECALL_OUTDATED: interface.PURGE_OUTDATED}


class RenamedAddresses:
    """Serve an old address as the new one, with the headers Deprecation (RFC 9745) and Link (RFC 8288)."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        successor = _find_successor(scope["path"]) if scope["type"] == "http" else None
        if successor is None:
            await self._app(scope, receive, send)
            return
        scope["path"], scope["raw_path"] = successor, successor.encode()
        scope.setdefault("state", {})["old_codes"] = _OLD_CODES

        async def marked(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers["Deprecation"] = _DEPRECATED_SINCE
                headers.append("Link", f'<{successor}>; rel="successor-version"')
            await send(message)

        await self._app(scope, receive, marked)


def _find_successor(path: str) -> str | None:
    for pattern, successor in _RENAMED:
        found = pattern.fullmatch(path)
        if found:
            return found.expand(successor)
    return None
