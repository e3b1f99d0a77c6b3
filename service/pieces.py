"""A piece of a file on its way to the disk: what has arrived is kept, also when the connection is cut."""

import asyncio
import hashlib
import time
from typing import Final

from fastapi import Request
from starlette.concurrency import run_in_threadpool

from radiometry.findings import interface
from service.problems import Problem, not_found
from service.upload_headers import read_checksum
from store.blobs.partials import Claim, Facts, OtherOffset, Partial, Superseded

_WRITE_BYTES: Final = 1 << 20
_KEEP_EVERY_S: Final = 0.5
"""So often what has arrived is made durable while more comes; and at once when nothing comes."""
_IDLE_S: Final = 0.1


async def append(request: Request, partial: Partial, begins: int, checksum: str | None) -> None:
    """Append the request's body to an upload, at the place where it begins.

    A piece with a checksum is kept whole or not at all; of any other what has arrived counts.
    """
    facts = await run_in_threadpool(partial.read_facts)
    announced = request.headers.get("content-length", "")
    if begins + (int(announced) if announced.isdecimal() else 0) > facts.size_bytes:
        raise _beyond(facts)
    expected = read_checksum(checksum)
    whole_or_not = expected is not None or "content-digest" in request.headers
    try:
        with await run_in_threadpool(partial.claim, begins) as claim:
            await _Piece(request, claim, facts, piecewise=not whole_or_not).take(expected)
    except OtherOffset as error:
        raise Problem(
            interface.UPLOAD_OFFSET_DIFFERS,
            f"{error.durable_bytes} bytes have arrived; this piece begins at {begins}.",
            headers={"Upload-Offset": str(error.durable_bytes)},
        ) from None
    except Superseded:
        detail = "Another connection has taken this upload over."
        raise Problem(interface.UPLOAD_OFFSET_DIFFERS, detail) from None
    except FileNotFoundError:
        raise not_found("upload") from None


class _Piece:
    """The body of a request on its way to the disk."""

    def __init__(self, request: Request, claim: Claim, facts: Facts, *, piecewise: bool) -> None:
        self._request = request
        self._claim = claim
        self._facts = facts
        self._piecewise = piecewise
        """Whether what has arrived counts before the end."""
        self._waiting: list[bytes] = []
        self._hash = hashlib.sha256()
        self._kept_at = time.monotonic()

    async def take(self, expected: bytes | None) -> None:
        """Write until the body's end; a cut keeps what has arrived."""
        try:
            await self._copy()
        finally:
            if self._piecewise:
                await run_in_threadpool(self._store, keep=True)
        if self._piecewise:
            return
        await run_in_threadpool(self._store, keep=False)
        if expected not in {None, self._hash.digest()}:
            detail = "The piece is not the one of Upload-Checksum. Send it again."
            raise Problem(interface.UPLOAD_CHECKSUM_DIFFERS, detail)
        await run_in_threadpool(self._claim.keep)

    async def _copy(self) -> None:
        size = self._claim.written_bytes
        next_message = asyncio.ensure_future(self._request.receive())
        try:
            while True:
                idle_s = _IDLE_S if self._piecewise and self._has_more_than_is_kept() else None
                arrived, _ = await asyncio.wait({next_message}, timeout=idle_s)
                if not arrived:
                    await run_in_threadpool(self._store, keep=True)
                    continue
                message = next_message.result()
                if message["type"] != "http.request":
                    raise Problem(
                        interface.UPLOAD_INCOMPLETE, "The connection was lost before the end of the piece."
                    )
                size += len(message.get("body", b""))
                if size > self._facts.size_bytes:
                    raise _beyond(self._facts)
                self._waiting.append(message.get("body", b""))
                due = self._piecewise and time.monotonic() - self._kept_at >= _KEEP_EVERY_S
                if due or sum(map(len, self._waiting)) >= _WRITE_BYTES:
                    await run_in_threadpool(self._store, keep=due)
                if not message.get("more_body"):
                    return
                next_message = asyncio.ensure_future(self._request.receive())
        finally:
            next_message.cancel()

    def _has_more_than_is_kept(self) -> bool:
        return bool(self._waiting) or self._claim.written_bytes > self._claim.durable_bytes

    def _store(self, *, keep: bool) -> None:
        waiting, self._waiting = self._waiting, []
        for chunk in waiting:
            self._hash.update(chunk)
        self._claim.write(waiting)
        if keep:
            self._claim.keep()
            self._kept_at = time.monotonic()


def _beyond(facts: Facts) -> Problem:
    return Problem(
        interface.UPLOAD_TOO_LARGE, f"More bytes came than the {facts.size_bytes} that Upload-Length states."
    )
