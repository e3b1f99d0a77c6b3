"""How much a request may say: files stream without memory, everything else is read whole and stays small."""

import re
from typing import Final

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from radiometry.findings import interface
from service.problems import Problem, RefusedBody

MAX_BODY_BYTES: Final = 4 << 20
_UPLOADS = re.compile(r"/v1/campaigns/[^/]+/frames|/v1/uploads(/upl_[^/]+)?")


def is_upload(path: str) -> bool:
    """Return True if what is sent there is a file, which streams."""
    return _UPLOADS.fullmatch(path) is not None


class BodyLimit:
    """Refuses a body above MAX_BODY_BYTES as soon as that is known; uploads have a limit of their own."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or is_upload(scope["path"]):
            await self._app(scope, receive, send)
            return
        announced = dict(scope["headers"]).get(b"content-length", b"")
        read = 0

        async def limited() -> Message:
            nonlocal read
            if announced.isdigit() and int(announced) > MAX_BODY_BYTES:
                raise _too_large()
            message = await receive()
            read += len(message.get("body", b""))
            if read > MAX_BODY_BYTES:
                raise _too_large()
            return message

        await self._app(scope, limited, send)


def _too_large() -> RefusedBody:
    detail = f"The body may have at most {MAX_BODY_BYTES} bytes here. Send it in parts."
    return RefusedBody(Problem(interface.UPLOAD_TOO_LARGE, detail))
