"""Fields of each log line of one request or job."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

_fields: ContextVar[dict[str, Any]] = ContextVar("fields")


@contextmanager
def fields(**known: Any) -> Iterator[dict[str, Any]]:  # noqa: ANN401
    """Add these fields to each line that is logged meanwhile, and those that are put into what is yielded."""
    token = _fields.set(known)
    try:
        yield known
    finally:
        _fields.reset(token)


def present_fields() -> dict[str, Any]:
    """Return the fields of the present request or job, which others may add to; else new ones."""
    return _fields.get(None) or {}


def present_request_id() -> str | None:
    """Return the id of the present request, or of the one that queued the present job."""
    return present_fields().get("request_id")
