"""How much a request may say: files stream without memory, everything else is read whole and stays small."""

import asyncio
import re
import time
from collections import Counter
from typing import Final

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from radiometry.findings import interface
from service.http import auth, counts, problems

MAX_BODY_BYTES: Final = 4 << 20
STRANGER_BYTES: Final = 64_000
"""What anybody may say who has no key."""
STRANGER_S: Final = 5.0
PAUSE_S: Final = 60.0
BYTES_PER_S: Final = 1000
"""Who has a key may be on a bad line, which pauses, and carries little; files too."""
OPEN_BYTES: Final = 64 << 20
"""Of all bodies under way of one organisation, or of one address without a key."""
_UPLOADS = re.compile(r"POST /v1/campaigns/[^/]+/frames|(POST|PATCH) /v1/uploads(/upl_[^/]+)?")


def is_upload(scope: Scope) -> bool:
    """Return True if what is sent is a file, which streams."""
    return _UPLOADS.fullmatch(f"{scope['method']} {scope['path']}") is not None


class BodyLimit:
    """Refuses a body that is too large or too slow as soon as that is known.

    How much is too large depends on who asks, which an operation knows before it takes the first byte.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        self._open: Counter[str] = Counter()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        headers = Headers(scope=scope) if scope["type"] == "http" else {}
        if headers.get("content-length", "0") == "0" and "transfer-encoding" not in headers:
            await self._app(scope, receive, send)
            return
        body = _Body(scope, receive, self._open)
        try:
            await self._app(scope, body, send)
        finally:
            self._open[body.whose] -= body.held
            if not self._open[body.whose]:
                del self._open[body.whose]


class _Body:
    """One body, as it comes; of whom, how much of it is held and how long it was waited for, counts."""

    def __init__(self, scope: Scope, receive: Receive, held: Counter[str]) -> None:
        self._scope, self._receive, self._open = scope, receive, held
        self._is_begun = self._is_file = self._is_whole = False
        self._came, self._waited_s = 0, 0.0
        self.held, self.whose = 0, counts.name_address((scope.get("client") or [None])[0])

    async def __call__(self) -> Message:
        if self._is_whole:
            # whoever asks once more waits for the end of the connection, and for nothing else
            while (message := await self._receive())["type"] == "http.request":
                pass
            return message
        if self._scope["method"] == "GET":
            # no such address reads one
            self._is_whole = True
            return {"type": "http.request"}
        state = self._scope.get("state", {})
        caller: auth.Caller | None = state.get("caller")
        most = MAX_BODY_BYTES if caller else STRANGER_BYTES
        if not self._is_begun:
            # the address of a begun upload needs no key: it is a secret of its own
            self._is_file = is_upload(self._scope) and (caller is not None or "caller" not in state)
            self._begin(caller, most)
        message = await self._wait(is_known=caller is not None or self._is_file)
        size = len(message.get("body", b""))
        self._came += size
        self._is_whole = not message.get("more_body", False)
        if not self._is_file:
            self._hold(size, most)
        return message

    async def _wait(self, *, is_known: bool) -> Message:
        """Wait for the next piece as long as the sender may take; the service's own time is not counted."""
        most_s = PAUSE_S + self._came / BYTES_PER_S if is_known else STRANGER_S
        began = time.monotonic()
        try:
            async with asyncio.timeout(min(PAUSE_S, most_s - self._waited_s)):
                return await self._receive()
        except TimeoutError:
            raise _too_slow() from None
        finally:
            self._waited_s += time.monotonic() - began

    def _hold(self, size: int, most: int) -> None:
        self.held += size
        self._open[self.whose] += size
        if self.held > most:
            raise _too_large(most)
        if self._open[self.whose] > OPEN_BYTES:
            raise _too_many()

    def _begin(self, caller: auth.Caller | None, most: int) -> None:
        self._is_begun = True
        headers = Headers(scope=self._scope)
        if caller:
            self.whose = caller.organisation_id
        announced = headers.get("content-length", "")
        if not self._is_file and announced.isdigit() and int(announced) > most:
            raise _too_large(most)


def _too_large(most: int) -> problems.Problem:
    detail = f"The body may have at most {most} bytes here. Send it in parts."
    return problems.Problem(interface.UPLOAD_TOO_LARGE, detail)


def _too_many() -> problems.Problem:
    detail = f"Requests under way hold {OPEN_BYTES} bytes already. Wait until some are answered."
    headers = {"Retry-After": "1", "Connection": "close"}
    return problems.Problem(interface.TOO_MANY_REQUESTS, detail, headers=headers)


def _too_slow() -> problems.Problem:
    detail = "The body was not there in time: it paused or came too slowly. Send it again."
    return problems.Problem(interface.UPLOAD_INCOMPLETE, detail, headers={"Connection": "close"})
