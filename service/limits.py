"""How much a request may say: files stream without memory, everything else is read whole and stays small."""

import asyncio
import re
import time
from typing import Final

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from radiometry.findings import interface
from service.auth import is_known
from service.problems import Problem, RefusedBody, answer

MAX_BODY_BYTES: Final = 4 << 20
STRANGER_BYTES: Final = 64_000
"""What anybody may say who has no key."""
STRANGER_S: Final = 5.0
PAUSE_S: Final = 60.0
BYTES_PER_S: Final = 1000
"""Who has a key may be on a bad line, which pauses, and carries little."""
_UPLOADS = re.compile(r"/v1/campaigns/[^/]+/frames|/v1/uploads(/upl_[^/]+)?")


def is_upload(path: str) -> bool:
    """Return True if what is sent there is a file, which streams."""
    return _UPLOADS.fullmatch(path) is not None


class BodyLimit:
    """Refuses a body that is too large or too slow as soon as that is known, and one that is compressed.

    It asks for whom before it takes the first byte. Uploads have a limit of their own.
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
        announced = headers.get("content-length", "0")
        if announced == "0" and "transfer-encoding" not in headers:
            await self._app(scope, receive, send)
            return
        known = await run_in_threadpool(is_known, Request(scope))
        most = MAX_BODY_BYTES if known else STRANGER_BYTES
        begun_at, read, is_whole = time.monotonic(), 0, False

        async def limited() -> Message:
            nonlocal read, is_whole
            if is_whole:
                return await receive()
            if announced.isdigit() and int(announced) > most:
                raise _too_large() if known else _stranger()
            allowed_s = (PAUSE_S + read / BYTES_PER_S) if known else STRANGER_S
            try:
                message = await asyncio.wait_for(receive(), begun_at + allowed_s - time.monotonic())
            except TimeoutError:
                raise _too_slow() if known else _stranger() from None
            read += len(message.get("body", b""))
            is_whole = not message.get("more_body", False)
            if read > most:
                raise _too_large() if known else _stranger()
            return message

        await self._app(scope, limited, send)


def _too_large() -> RefusedBody:
    detail = f"The body may have at most {MAX_BODY_BYTES} bytes here. Send it in parts."
    return RefusedBody(Problem(interface.UPLOAD_TOO_LARGE, detail))


def _stranger() -> RefusedBody:
    detail = (
        f"Without a key a body has at most {STRANGER_BYTES} bytes and {STRANGER_S:g} s. "
        "Send a key: Authorization: Bearer <key>."
    )
    headers = {"WWW-Authenticate": "Bearer", "Connection": "close"}
    return RefusedBody(Problem(interface.UNAUTHENTICATED, detail, headers=headers))


def _too_slow() -> RefusedBody:
    detail = f"The body paused for {PAUSE_S:g} s, or came at less than {BYTES_PER_S} bytes/s. Send it again."
    return RefusedBody(Problem(interface.UPLOAD_INCOMPLETE, detail, headers={"Connection": "close"}))


def _encoded() -> Problem:
    detail = "The body is compressed. Send it as it is, without Content-Encoding."
    return Problem(interface.CONTENT_ENCODED, detail, headers={"Accept-Encoding": "identity"})
