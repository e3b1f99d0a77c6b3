"""Answers with a strong ETag: those that never change, and those that change with what is decided."""

import re
from collections.abc import Iterator
from typing import Final

from fastapi import Request, Response
from fastapi.responses import StreamingResponse

from radiometry.findings import interface
from service.problems import Problem
from store.files import Files

_RANGE: Final = re.compile(r"bytes=([0-9]{0,18})-([0-9]{0,18})")


def immutable_headers(tag: str) -> dict[str, str]:
    """Cached for ever."""
    return {"ETag": f'"{tag}"', "Cache-Control": "private, max-age=31536000, immutable"}


def standing_headers(tag: str) -> dict[str, str]:
    """Kept, and asked for again each time: 304 while nothing was decided since."""
    return {"ETag": f'"{tag}"', "Cache-Control": "private, no-cache"}


def send_blob(
    request: Request, files: Files, sha256: str, media_type: str, headers: dict[str, str]
) -> Response:
    """Send the bytes under a hash, which is their tag, each MiB after its proof; or a range of them.

    Damage within the first is a problem. Later it breaks the connection before the Content-Length is reached,
    so that no client takes what came for the file.
    """
    unchanged = not_modified(request, sha256)
    if unchanged is not None:
        return unchanged
    size_bytes, pieces = files.open(sha256)
    headers = {**immutable_headers(sha256), "Accept-Ranges": "bytes", **headers}
    wanted = _read_range(request, sha256, size_bytes)
    if wanted is None:
        headers["Content-Length"] = str(size_bytes)
        return StreamingResponse(pieces, headers=headers, media_type=media_type)
    headers["Content-Length"] = str(len(wanted))
    headers["Content-Range"] = f"bytes {wanted.start}-{wanted.stop - 1}/{size_bytes}"
    return StreamingResponse(_cut(pieces, wanted), 206, headers=headers, media_type=media_type)


def _read_range(request: Request, tag: str, size_bytes: int) -> range | None:
    """Return the bytes that are asked for; None for all, as for several ranges and unclear ones."""
    asked = _RANGE.fullmatch(request.headers.get("range", ""))
    if asked is None or request.headers.get("if-range", f'"{tag}"') != f'"{tag}"':
        return None
    first, last = asked.groups()
    if first:
        wanted = range(int(first), min(int(last) + 1, size_bytes) if last else size_bytes)
        if last and int(last) < int(first):
            return None
    elif last:
        wanted = range(max(0, size_bytes - int(last)), size_bytes)
    else:
        return None
    if not wanted:
        detail = f"The file has {size_bytes} bytes."
        raise Problem(interface.RANGE_OUTSIDE, detail, headers={"Content-Range": f"bytes */{size_bytes}"})
    return wanted


def _cut(pieces: Iterator[bytes], wanted: range) -> Iterator[bytes]:
    """Yield the part of a file; what lies before it is read too, because each piece is proven."""
    at = 0
    for piece in pieces:
        part = piece[max(0, wanted.start - at) : max(0, wanted.stop - at)]
        if part:
            yield part
        at += len(piece)
        if at >= wanted.stop:
            return


def not_modified(request: Request, tag: str, headers: dict[str, str] | None = None) -> Response | None:
    """304 when the client names this tag; ``headers`` where it is not for ever."""
    named = request.headers.get("if-none-match", "")
    tags = {part.strip().removeprefix("W/") for part in named.split(",")}
    if f'"{tag}"' in tags or named.strip() == "*":
        return Response(status_code=304, headers=headers or immutable_headers(tag))
    return None
