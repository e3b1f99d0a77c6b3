"""How much a request may say: files stream without memory, everything else is read whole and stays small."""

import re
from typing import Final

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from radiometry.findings import interface
from service.problems import Problem, RefusedBody, answer

MAX_BODY_BYTES: Final = 4 << 20
_UPLOADS = re.compile(r"/v1/campaigns/[^/]+/frames|/v1/uploads(/upl_[^/]+)?")


def is_upload(path: str) -> bool:
    """Return True if what is sent there is a file, which streams."""
    return _UPLOADS.fullmatch(path) is not None


class BodyLimit:
    """Refuses a body above MAX_BODY_BYTES as soon as that is known, and one that is compressed.

    Uploads have a limit of their own.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        if headers.get("content-encoding", "identity").strip().lower() != "identity":
            await answer(_encoded())(scope, receive, send)
            return
        if is_upload(scope["path"]):
            await self._app(scope, receive, send)
            return
        announced = headers.get("content-length", "")
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


def _encoded() -> Problem:
    detail = "The body is compressed. Send it as it is, without Content-Encoding."
    return Problem(interface.CONTENT_ENCODED, detail, headers={"Accept-Encoding": "identity"})
