"""Answers that never change: a strong ETag, cached for ever, 304 for who has it already."""

from fastapi import Request, Response

_FOR_EVER = "private, max-age=31536000, immutable"


def immutable_headers(tag: str) -> dict[str, str]:
    return {"ETag": f'"{tag}"', "Cache-Control": _FOR_EVER}


def not_modified(request: Request, tag: str) -> Response | None:
    """304 when the client names this tag."""
    named = request.headers.get("if-none-match", "")
    tags = {part.strip().removeprefix("W/") for part in named.split(",")}
    if f'"{tag}"' in tags or named.strip() == "*":
        return Response(status_code=304, headers=immutable_headers(tag))
    return None
