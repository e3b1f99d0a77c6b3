"""Answers as routes document and send them: problems, files, and what carries a strong ETag."""

import re
from collections.abc import Iterator
from typing import Any, Final

from fastapi import FastAPI, Request, Response
from fastapi.responses import StreamingResponse

from radiometry.findings import interface
from service.http.problems import Problem
from store.files import Files

_MEANINGS = {
    400: "The body cannot be read.",
    401: "No key, or none that is known.",
    403: "The key lacks a scope.",
    404: "There is no such thing for this key's organisation.",
    409: "It contradicts what is recorded.",
    412: "A condition in a header cannot be met, or an upload does not speak tus 1.0.0.",
    413: "The body is too large.",
    415: "The body has another media type than is taken here, or it is compressed (`content_encoded`).",
    416: "The range lies behind the end of the file.",
    422: "A field is wrong, or what was sent cannot be used; the problem says what and why.",
    429: "Too much at once, or more than your organisation may have; wait as `Retry-After` says.",
    460: "A piece of a file is not the one that was announced.",
    500: "The stored file is damaged or missing; the same upload heals it.",
    503: "A part of the service does not answer just now; try again.",
    507: "There is no room left.",
}


USUAL: Final = (401, 403, 422, 429, 503)  # problems that any route with a key can give


def problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Document the problems that a route can give beside the usual ones, which `Operation` adds."""
    return {
        status: {"description": _MEANINGS[status], "content": {"application/problem+json": {}}}
        for status in sorted(statuses)
    }


def makes(model: Any, already: str, *statuses: int) -> dict[str, Any]:  # noqa: ANN401  a type
    """State a POST that makes nothing twice. ``already`` : what 200 means; ``statuses`` : its problems."""
    stated = {200: {"model": model, "description": already}, **problems(*statuses)}
    return {"status_code": 201, "response_model": model, "responses": stated}


def with_usual_problems(stated: dict[int | str, dict[str, Any]], *, of_one: bool) -> dict[int | str, Any]:
    """Return the answers of a route with a key; ``of_one`` : of a thing that may not be there."""
    found = problems(*USUAL, *([404] if of_one else []))
    if found.keys() <= stated.keys():
        return stated
    others = {status: answer for status, answer in stated.items() if status not in _MEANINGS}
    found |= {status: answer for status, answer in stated.items() if status in _MEANINGS}
    return others | {status: found[status] for status in _MEANINGS if status in found}


UNCHANGED: dict[int | str, dict[str, Any]] = {304: {"description": "You have it already."}}


def sends(model: Any, *statuses: int) -> dict[str, Any]:  # noqa: ANN401  a type
    """State a route whose answer has a tag. ``statuses`` : its problems."""
    return {"response_model": model, "responses": {**UNCHANGED, **problems(*statuses)}}


def text(media_type: str = "text/csv") -> dict[int | str, dict[str, Any]]:
    """Document an answer in a form that is not JSON: a table or lines."""
    return {200: {"content": {media_type: {"schema": {"type": "string"}}}}}


def sends_file(media_type: str) -> dict[str, Any]:
    schema = {"type": "string", "format": "binary"}
    if media_type.startswith("text/"):
        schema = {"type": "string"}
    elif media_type.endswith("json"):
        schema = {"type": "object"}
    stated = {200: {"content": {media_type: {"schema": schema}}}, **UNCHANGED}
    return {"response_class": Response, "responses": with_usual_problems(stated, of_one=True)}


def sends_stored_file(media_type: str) -> dict[str, Any]:
    """State a route that sends what the file store keeps, which a disk may have lost."""
    stated, part = sends_file(media_type), {media_type: {"schema": {"type": "string", "format": "binary"}}}
    asked = {206: {"description": "The part that `Range` asks for.", "content": part}}
    return stated | {"responses": {**stated["responses"], **asked, **problems(416, 500)}}


_RANGE: Final = re.compile(r"bytes=([0-9]{0,18})-([0-9]{0,18})")


class Unchanged(Exception):  # noqa: N818  it is what the client is told
    """The client has what it asks for: a 304 with these headers takes the place of the answer."""

    def __init__(self, headers: dict[str, str]) -> None:
        super().__init__()
        self._headers = headers

    def respond(self) -> Response:
        return Response(status_code=304, headers=self._headers)


def install(app: FastAPI) -> None:
    @app.exception_handler(Unchanged)
    async def answer(_: Request, unchanged: Unchanged) -> Response:
        return unchanged.respond()


def immutable(request: Request, tag: str) -> dict[str, str]:
    """Return the headers of what never changes, unless the client has it."""
    return unless_kept(request, tag, {"Cache-Control": "private, max-age=31536000, immutable"})


def standing(request: Request, tag: str, **more: str) -> dict[str, str]:
    """Return those of what is asked for again each time, unless nothing was decided since."""
    return unless_kept(request, tag, {"Cache-Control": "private, no-cache", **more})


def unless_kept(request: Request, tag: str, headers: dict[str, str]) -> dict[str, str]:
    headers = {"ETag": f'"{tag}"', **headers}
    named = request.headers.get("if-none-match", "")
    tags = {part.strip().removeprefix("W/") for part in named.split(",")}
    if headers["ETag"] in tags or named.strip() == "*":
        raise Unchanged(headers)
    return headers


def send_blob(
    request: Request, files: Files, sha256: str, media_type: str, headers: dict[str, str]
) -> Response:
    """Send the bytes under a hash, or a range of them, each MiB after its proof; damage breaks it off."""
    headers = {**immutable(request, sha256), "Accept-Ranges": "bytes", **headers}
    size_bytes, pieces = files.open(sha256)
    if (wanted := _read_range(request, sha256, size_bytes)) is None:
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
        if part := piece[max(0, wanted.start - at) : max(0, wanted.stop - at)]:
            yield part
        at += len(piece)
        if at >= wanted.stop:
            return
