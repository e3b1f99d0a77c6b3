"""Errors, as the service states them (RFC 9457) or as the connection shows them."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from typing import Any, TypeVar

import httpx

from stilb.records import Job

# What a gateway answers in the service's place while the service is away or busy.
_PASSING = frozenset({429, 502, 503, 504})

UNREACHABLE = "unreachable"
DAMAGED = "digest_mismatch"  # a file arrived otherwise than it was announced
_Found = TypeVar("_Found")


@dataclass(kw_only=True, eq=False, repr=False)
class Problem(Exception):  # noqa: N818  the name of the media type
    """The service refused a request, or could not be reached.

    ``status`` is 0 where no answer came; ``code`` is then "unreachable" (trying later may help) or
    "not_sent" (it will not). ``retryable`` says whether the same request may succeed later.
    """

    status: int
    code: str
    detail: str
    retryable: bool
    title: str = ""
    retry_after_s: float | None = None
    raw: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__init__(f"{self.code}: {self.detail}" if self.detail else self.code)


class Unclear(ValueError):  # noqa: N818  what the caller asked, not an error of the program
    """A name that fits several things; the message says which, and how to name one."""


class NotSignedIn(Unclear):
    """No key is known to ask with."""


class JobFailed(Problem):
    """A job ended without a result; the problem is the one that the job carries."""

    def __init__(self, job: Job) -> None:
        error = job.error or {}
        super().__init__(
            status=int(error.get("status", 0)),
            code=str(error.get("code", job.state)),
            detail=str(error.get("detail") or f"job {job.id} ({job.kind}) {job.state}"),
            retryable=bool(error.get("retryable", False)),
            title=str(error.get("title", "")),
            raw=error,
        )
        self.job = job


def missing(detail: str) -> Problem:
    """A thing that was named by something else than its id, and that no list holds."""
    return Problem(status=404, code="not_found", detail=detail, retryable=False)


def only(found: Sequence[_Found], *, several: str, none: str) -> _Found:
    """Return the one thing that has a name; raise what is said of several or none."""
    if len(found) > 1:
        raise Unclear(several)
    if not found:
        raise missing(none)
    return found[0]


def from_response(response: httpx.Response) -> Problem:
    """Read an error answer; one that is no problem document (a gateway's page) still becomes a Problem."""
    body = _object(response)
    return Problem(
        status=response.status_code,
        code=str(body.get("code", f"http_{response.status_code}")),
        detail=str(body.get("detail", response.reason_phrase)),
        retryable=bool(body.get("retryable", response.status_code in _PASSING)),
        title=str(body.get("title", "")),
        retry_after_s=_retry_after_s(response.headers.get("Retry-After")),
        raw=body,
    )


def from_transport(error: httpx.TransportError) -> Problem:
    """A connection that failed: refused, lost in the middle or silent for too long."""
    said = re.sub(r"^\[Errno -?\d+\] ", "", str(error)) or type(error).__name__
    if "WRONG_VERSION" in said:
        said = "it uses http, not https: begin the address with http://"
    passing = isinstance(error, httpx.NetworkError | httpx.TimeoutException | httpx.RemoteProtocolError)
    code = UNREACHABLE if passing else "not_sent"
    return Problem(status=0, code=code, detail=f"{_asked(error)}{said}", retryable=passing)


def _asked(error: httpx.TransportError) -> str:
    try:
        url = error.request.url
    except RuntimeError:  # it has none where no request was made
        return ""
    return f"{url.scheme}://{url.netloc.decode()} does not answer: "


def _object(response: httpx.Response) -> dict[str, Any]:
    if "json" not in response.headers.get("Content-Type", ""):
        return {}
    try:
        body = response.json()
    except (json.JSONDecodeError, UnicodeDecodeError):
        return {}
    return body if isinstance(body, dict) else {}


def _retry_after_s(value: str | None) -> float | None:
    """Seconds from now: the header holds either a number of them or a date."""
    if value is None:
        return None
    if value.strip().isdigit():
        return float(value)
    try:
        moment = parsedate_to_datetime(value)
    except ValueError:
        return None
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=UTC)
    return max(0.0, (moment - datetime.now(UTC)).total_seconds())
