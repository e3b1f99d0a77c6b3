"""Receiving a file: streamed to the blob store, hashed on the way, checked against what the sender says."""

import asyncio
import base64
import binascii
import re
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from dataclasses import dataclass

from fastapi import Request
from python_multipart.exceptions import MultipartParseError
from python_multipart.multipart import MultipartParser, parse_options_header
from starlette.concurrency import run_in_threadpool

from radiometry.findings import Finding, interface
from service.problems import Problem
from store.blobs import Blobs, BlobWriter, StoredBlob

_FLUSH_BYTES = 1 << 20
_MOST_PARTS = 100
_REPR_DIGEST = re.compile(r"sha-256=:([A-Za-z0-9+/=]+):")


@dataclass(frozen=True, kw_only=True)
class Received:
    blob: StoredBlob
    filename: str | None
    """Of the multipart part, where it was one."""


Admit = Callable[[str | None, int], bool]
"""Raises where a file with this hash, of this size, may not be kept; False where only the hash will tell."""


async def receive(request: Request, blobs: Blobs, *, max_bytes: int, admit: Admit) -> Received:
    """Store the request's body, raw or the part ``file`` of a form; memory stays flat.

    Whatever goes wrong on the way leaves nothing behind: the writer removes what was not committed. ``admit``
    is asked before the body is read, and again when it is there and more is known of it.
    """
    expected = _announced_sha256(request)
    text = request.headers.get("content-length", "")
    announced = int(text) if text.isdecimal() else 0
    if announced > max_bytes:
        raise _too_large(max_bytes)
    admitted = await run_in_threadpool(admit, expected, announced)
    with blobs.writer() as writer:
        form = _find_form(request, writer)
        take = writer.write if form is None else form.feed
        rest = await _drain(request.stream(), take, max_bytes)

        def finish() -> Received:
            take(rest)
            filename = None if form is None else form.finish()
            if expected is not None and writer.sha256 != expected:
                raise Problem(
                    interface.DIGEST_MISMATCH,
                    f"The file arrived as SHA-256 {writer.sha256}, not the announced {expected}. "
                    "Send it again.",
                )
            if not admitted or writer.size_bytes > announced:
                admit(writer.sha256, writer.size_bytes)
            return Received(blob=writer.commit(), filename=filename)

        return await run_in_threadpool(finish)


def _find_form(request: Request, writer: BlobWriter) -> "_FilePart | None":
    kind, options = parse_options_header(request.headers.get("content-type", ""))
    return _FilePart(writer, options.get(b"boundary", b"")) if kind == b"multipart/form-data" else None


async def _drain(chunks: AsyncIterator[bytes], take: Callable[[bytes], object], max_bytes: int) -> bytes:
    """Hand the chunks on in pieces of a megabyte, one while the next one arrives; return what remains."""
    waiting: list[bytes] = []
    size = total = 0
    taking: asyncio.Future[None] | None = None
    try:
        async for chunk in chunks:
            waiting.append(chunk)
            size += len(chunk)
            total += len(chunk)
            if total > max_bytes:
                raise _too_large(max_bytes)
            if size >= _FLUSH_BYTES:
                if taking:
                    await asyncio.shield(taking)
                piece, waiting, size = waiting, [], 0
                taking = asyncio.ensure_future(run_in_threadpool(_join_and_take, take, piece))
        if taking:
            await asyncio.shield(taking)
    finally:
        # whatever ends this, the file is not closed under the thread that writes it
        while taking and not taking.done():
            with suppress(asyncio.CancelledError):
                await asyncio.wait([taking])
    return b"".join(waiting)


def _join_and_take(take: Callable[[bytes], object], piece: list[bytes]) -> None:
    take(b"".join(piece))


class _FilePart:
    """Picks the part named ``file`` out of a form as it streams by."""

    def __init__(self, writer: BlobWriter, boundary: bytes) -> None:
        self._writer = writer
        self._name = self._value = self._disposition = b""
        self._inside = False
        self._found = self._parts = 0
        self._filename = ""
        self._ended = False
        if not boundary:
            raise _bad_form("its Content-Type names no boundary")
        self._parser = MultipartParser(
            boundary,
            {
                "on_part_begin": self._begin,
                "on_header_field": self._field,
                "on_header_value": self._content,
                "on_header_end": self._header,
                "on_headers_finished": self._headers,
                "on_part_data": self._data,
                "on_end": self._end,
            },
        )

    def feed(self, chunk: bytes) -> None:
        try:
            self._parser.write(chunk)
        except MultipartParseError as error:
            raise _bad_form("it cannot be read") from error

    def finish(self) -> str | None:
        """The file's name as sent; a form without its end or without the part is refused."""
        if not self._ended:
            raise _bad_form("it ends too early", interface.UPLOAD_INCOMPLETE)
        if self._found != 1:
            raise _bad_form(f"it has {self._found} parts named 'file' where one is needed")
        return self._filename or None

    def _begin(self) -> None:
        self._parts += 1
        if self._parts > _MOST_PARTS:
            raise _bad_form(f"it has more than {_MOST_PARTS} parts")
        self._disposition = b""
        self._inside = False

    def _field(self, data: bytes, start: int, end: int) -> None:
        self._name += data[start:end]

    def _content(self, data: bytes, start: int, end: int) -> None:
        self._value += data[start:end]

    def _header(self) -> None:
        if self._name.lower() == b"content-disposition":
            self._disposition = self._value
        self._name = self._value = b""

    def _headers(self) -> None:
        _, options = parse_options_header(self._disposition)
        self._inside = options.get(b"name") == b"file"
        if self._inside:
            self._found += 1
            self._filename = options.get(b"filename", b"").decode("utf-8", "replace")

    def _data(self, data: bytes, start: int, end: int) -> None:
        if self._inside and self._found == 1:
            self._writer.write(data[start:end])

    def _end(self) -> None:
        self._ended = True


def _announced_sha256(request: Request) -> str | None:
    """The hash that the sender announces, in RFC 9530's form or in ours."""
    plain = request.headers.get("x-content-sha256")
    digest = _REPR_DIGEST.search(request.headers.get("repr-digest", ""))
    if digest is not None:
        try:
            plain = base64.b64decode(digest[1], validate=True).hex()
        except binascii.Error as error:
            raise _bad_digest() from error
    if plain is None:
        return None
    if re.fullmatch(r"[0-9a-fA-F]{64}", plain) is None:
        raise _bad_digest()
    return plain.lower()


def _bad_digest() -> Problem:
    return Problem(
        interface.BAD_REQUEST,
        "The announced hash is not a SHA-256: X-Content-SHA256 takes 64 hex digits, Repr-Digest sha-256.",
    )


def _bad_form(why: str, code: Finding = interface.BAD_REQUEST) -> Problem:
    return Problem(code, f"The multipart form cannot be used: {why}.")


def _too_large(max_bytes: int) -> Problem:
    return Problem(
        interface.UPLOAD_TOO_LARGE, f"A file may have at most {max_bytes} bytes (STILB_MAX_UPLOAD_BYTES)."
    )
