"""Uploads through networks that pass on GET and POST alone: `X-HTTP-Method-Override`, as tus has it."""

from typing import Final

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

_UPLOAD: Final = "/v1/uploads/"
_METHODS: Final = frozenset({"HEAD", "PATCH", "DELETE"})


class OverriddenMethods:
    """Serve a POST to an upload as the method that its header names."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http" and scope["method"] == "POST" and scope["path"].startswith(_UPLOAD):
            method = Headers(scope=scope).get("x-http-method-override", "").upper()
            if method in _METHODS:
                scope["method"] = method
        await self._app(scope, receive, send)
