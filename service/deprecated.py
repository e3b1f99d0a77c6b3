"""Deprecated operations and addresses: what answers says that they will end, and what takes their place.

A route is deprecated by `**deprecated(since=..., ends=...)`, which marks it in the OpenAPI document too.
"""

import re
from datetime import UTC, date, datetime, time
from email.utils import format_datetime
from typing import Any, Final

from fastapi.routing import APIRoute
from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from radiometry.findings import interface

_SINCE, _ENDS = "x-deprecated-since", "x-sunset"
_POLICY: Final = "/docs/http#changes-of-the-api"

_RENAMED_SINCE: Final = date(2026, 11, 22)
_RENAMED: Final = (
    (re.compile(r"/v1/purges(/.*)?"), r"/v1/recalls\1"),
    (re.compile(r"(/v1/measurements/[^/]+)/contrast"), r"\1/comparison"),
    (re.compile(r"/measurements/contrast"), "/measurements/comparison"),
)
_OLD_CODES: Final = {interface.RECALL_OUTDATED: interface.PURGE_OUTDATED}


def deprecated(*, since: date, ends: date | None = None) -> dict[str, Any]:
    """Return the arguments that make a route a deprecated one; ``ends`` once that day is fixed."""
    dates = {_SINCE: since.isoformat()} | ({_ENDS: ends.isoformat()} if ends else {})
    return {"deprecated": True, "openapi_extra": dates}


class Deprecations:
    """Serve an old address as the new one, and mark the answers of all that is deprecated.

    The headers are Deprecation (RFC 9745), Sunset (RFC 8594) and Link (RFC 8288).
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        successor = _find_successor(scope["path"]) if scope["type"] == "http" else None
        if successor is not None:
            scope["path"], scope["raw_path"] = successor, successor.encode()
            scope.setdefault("state", {})["old_codes"] = _OLD_CODES

        async def marked(message: Message) -> None:
            if message["type"] == "http.response.start":
                route = scope.get("route")
                if successor is not None:
                    _mark(message, _RENAMED_SINCE, None, f'<{successor}>; rel="successor-version"')
                elif isinstance(route, APIRoute) and route.deprecated:
                    dates = {
                        name: date.fromisoformat(text) for name, text in (route.openapi_extra or {}).items()
                    }
                    _mark(message, dates[_SINCE], dates.get(_ENDS))
            await send(message)

        await self._app(scope, receive, marked)


def _mark(message: Message, since: date, ends: date | None, *links: str) -> None:
    headers = MutableHeaders(scope=message)
    headers["Deprecation"] = f"@{_midnight(since).timestamp():.0f}"
    named = [*links, f'<{_POLICY}>; rel="deprecation"; type="text/html"']
    if ends is not None:
        headers["Sunset"] = format_datetime(_midnight(ends), usegmt=True)
        named.append(f'<{_POLICY}>; rel="sunset"; type="text/html"')
    headers.append("Link", ", ".join(named))


def _midnight(day: date) -> datetime:
    return datetime.combine(day, time(), UTC)


def _find_successor(path: str) -> str | None:
    for pattern, successor in _RENAMED:
        found = pattern.fullmatch(path)
        if found:
            return found.expand(successor)
    return None
