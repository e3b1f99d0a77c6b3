"""Answers with a strong ETag: those that never change, and those that change with what is decided."""

from fastapi import Request, Response
from fastapi.responses import StreamingResponse

from store.files import Files


def immutable_headers(tag: str) -> dict[str, str]:
    """Cached for ever."""
    return {"ETag": f'"{tag}"', "Cache-Control": "private, max-age=31536000, immutable"}


def standing_headers(tag: str) -> dict[str, str]:
    """Kept, and asked for again each time: 304 while nothing was decided since."""
    return {"ETag": f'"{tag}"', "Cache-Control": "private, no-cache"}


def send_blob(
    request: Request, files: Files, sha256: str, media_type: str, headers: dict[str, str]
) -> Response:
    """Send the bytes under a hash, which is their tag, each MiB after its proof.

    Damage within the first is a problem. Later it breaks the connection before the Content-Length is reached,
    so that no client takes what came for the file.
    """
    unchanged = not_modified(request, sha256)
    if unchanged is not None:
        return unchanged
    size_bytes, pieces = files.open(sha256)
    return StreamingResponse(
        pieces,
        headers={**immutable_headers(sha256), "Content-Length": str(size_bytes), **headers},
        media_type=media_type,
    )


def not_modified(request: Request, tag: str, headers: dict[str, str] | None = None) -> Response | None:
    """304 when the client names this tag; ``headers`` where it is not for ever."""
    named = request.headers.get("if-none-match", "")
    tags = {part.strip().removeprefix("W/") for part in named.split(",")}
    if f'"{tag}"' in tags or named.strip() == "*":
        return Response(status_code=304, headers=headers or immutable_headers(tag))
    return None
