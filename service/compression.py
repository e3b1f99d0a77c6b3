"""Compression of answers that are text, for clients that accept gzip."""

import re
from typing import Final

from starlette.datastructures import Headers, MutableHeaders
from starlette.middleware.gzip import DEFAULT_EXCLUDED_CONTENT_TYPES, GZipMiddleware
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.series import MEDIA_TYPES

_SMALLEST_BYTES: Final = 1 << 10
_LEVEL: Final = 4
_LEFT: Final = (
    *DEFAULT_EXCLUDED_CONTENT_TYPES,
    *("image/*", "application/pdf", "application/octet-stream", MEDIA_TYPES["arrow"], MEDIA_TYPES["parquet"]),
)
_REFUSED: Final = re.compile(r"\bgzip\s*;\s*q=0(\.0*)?\s*(?=,|$)")
_MARK: Final = ".gz"
_UNCHANGED: Final = 304


class Compression:
    """Packs answers of more than a kilobyte; never pictures, PDFs, stored files or event streams.

    The entity tag of a packed answer ends in a mark, because the same tag would promise the same bytes. A
    page of a signed-in browser is left as it is: its size would tell of the token in it (BREACH).
    """

    def __init__(self, app: ASGIApp) -> None:
        self._packing = GZipMiddleware(app, _SMALLEST_BYTES, _LEVEL, exclude_content_types=_LEFT)
        self._signed_in = GZipMiddleware(
            app, _SMALLEST_BYTES, _LEVEL, exclude_content_types=(*_LEFT, "text/html")
        )

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._packing(scope, receive, send)
            return
        headers = MutableHeaders(scope=scope)
        if "gzip" in (accepted := headers.get("accept-encoding", "")):
            headers["accept-encoding"] = _REFUSED.sub("identity", accepted)
        named = headers.get("if-none-match", "")
        if has_mark := f'{_MARK}"' in named:
            headers["if-none-match"] = named.replace(f'{_MARK}"', '"')

        async def marked(message: Message) -> None:
            if message["type"] == "http.response.start":
                own = MutableHeaders(scope=message)
                packed = own.get("content-encoding") == "gzip"
                if "etag" in own and (packed or (has_mark and message["status"] == _UNCHANGED)):
                    own["etag"] = own["etag"].removesuffix('"') + f'{_MARK}"'
                if "vary" in own:
                    # it is added to what a route says itself
                    own["vary"] = ", ".join(dict.fromkeys(own["vary"].split(", ")))
            await send(message)

        app = self._signed_in if "cookie" in Headers(scope=scope) else self._packing
        await app(scope, receive, marked)
