"""One HTTP request and its repetitions: who may be sent again, when, and what comes of the answer."""

import errno
import hashlib
import json
import os
import random
import ssl
import threading
import time
import tomllib
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any, BinaryIO, Self, TypeVar
from urllib.parse import quote

import httpx

from stilb import problem
from stilb.records import as_text


@cache
def read_version() -> str:
    """Return the version in `pyproject.toml` of a checkout, else that of the installed package."""
    path = Path(__file__).parents[1] / "pyproject.toml"
    if path.is_file():
        project = tomllib.loads(path.read_text(encoding="utf-8")).get("project", {})
        if project.get("name") == "stilb":
            return str(project["version"])
    return metadata.version("stilb")


_REPEATABLE = frozenset({"GET", "HEAD", "PUT", "DELETE"})
_LONGEST_PAUSE_S = 60.0
_LOOK_EVERY_S = 1.0
_PATIENCE_S = 600.0
_FULL = frozenset({429, 507})  # too much at once, or no room left: the service says when to come back
_AWAY = frozenset({0, 502, 504})  # no answer at all, or a gateway's in the service's place
_KEY = "Idempotency-Key"
_CHUNK_BYTES = 1 << 20

Answer = TypeVar("Answer")

Query = Mapping[str, Any]

PathLike = str | os.PathLike[str]

OnRetry = Callable[[problem.Problem, float], None]
"""Is told what went wrong and how long the pause is [s] before the same request is sent again."""


def address(*parts: str) -> str:
    """The path of a resource; an id is data, so that none can lead elsewhere."""
    return "/v1/" + "/".join(quote(part, safe="") for part in parts)


@dataclass(frozen=True, kw_only=True)
class Call:
    """One request as meant by the caller, however often it has to be sent.

    ``stream`` opens the body again for each attempt. A POST or PATCH keeps one idempotency key over all
    attempts, by which the service knows a repetition.
    """

    method: str
    path: str
    query: Query = field(default_factory=dict)
    json: object = None
    text: str | None = None
    stream: Callable[[], Iterator[bytes]] | None = None
    headers: Mapping[str, str] = field(default_factory=dict)
    answer_within_s: float | None = None
    repeated_if_cut: bool = True

    def sent_headers(self) -> dict[str, str]:
        headers = dict(self.headers)
        if self.method in {"POST", "PATCH"}:
            headers.setdefault(_KEY, str(uuid.uuid4()))
        return headers


@cache
def _trusted() -> ssl.SSLContext:
    """Return the certificate authorities that are trusted, once: to read them takes longer than a request."""
    return httpx.create_ssl_context()


class Transport:
    """Sends calls and turns every failure into a ``Problem``."""

    def __init__(
        self,
        url: str,
        key: str,
        *,
        timeout_s: float,
        retries: int,
        backoff_s: float,
        on_retry: OnRetry | None = None,
    ) -> None:
        try:
            is_address = httpx.URL(url).scheme in {"http", "https"} and httpx.URL(url).host
        except httpx.InvalidURL:
            is_address = False
        if not is_address:
            raise problem.Unclear(f"{url!r} is not an address such as https://calib.example")
        key = key.strip()  # of a file, the end of its line
        if not (key.isascii() and key.isprintable() and key.split() == [key]):
            raise problem.Unclear("The key is empty, or more than one word of ASCII letters")
        self._http = httpx.Client(
            base_url=url,
            verify=_trusted(),
            timeout=timeout_s,
            headers={"Authorization": f"Bearer {key}", "User-Agent": f"stilb/{read_version()}"},
        )
        self._timeout_s, self.retries, self._backoff_s = timeout_s, retries, backoff_s
        self._on_retry = on_retry
        self._halted = threading.Event()

    def close(self) -> None:
        self._http.close()

    def halt(self) -> None:
        """End uploads and pauses of other threads at their next step; nothing is sent from then on."""
        self._halted.set()

    def send(self, call: Call) -> httpx.Response:
        """Send until it is answered; only what is safe to send twice is sent twice."""
        return self._repeat(call, self._once)

    def once(self, call: Call) -> httpx.Response:
        """Send a single time."""
        return self._once(call, call.sent_headers())

    def pause(self, attempt: int, found: problem.Problem) -> None:
        """Wait before the next attempt, unless somebody wants to stop."""
        pause_s = self._pause_s(attempt, found.retry_after_s)
        if self._on_retry is not None:
            self._on_retry(found, pause_s)
        if self._halted.wait(pause_s):
            raise found

    def download(self, call: Call, path: Path, *, sha256: str | None = None) -> None:
        """Write an answer to a file in flat memory; until it is complete the file keeps what it held."""
        path = path.resolve()
        if not path.parent.is_dir():
            raise FileNotFoundError(errno.ENOENT, "There is no such folder", str(path.parent))
        special = path.exists() and not path.is_file()  # a device or a pipe
        beside = path if special else path.with_name(f".{uuid.uuid4().hex}.part")

        def save(call: Call, headers: Mapping[str, str]) -> None:
            with beside.open("wb") as file:
                self._save(call, headers, file)
            if sha256 is not None and (found := hash_file(beside)) != sha256:
                detail = f"{path.name} has arrived with the hash {found}, not {sha256}"
                raise problem.Problem(status=200, code="export_damaged", detail=detail, retryable=True)

        try:
            self._repeat(call, save)
            beside.replace(path)
        except OSError as error:
            error.filename = str(path)
            raise
        finally:
            if not special:
                with suppress(OSError):
                    beside.unlink()

    def _repeat(self, call: Call, once: Callable[[Call, Mapping[str, str]], Answer]) -> Answer:
        headers = call.sent_headers()
        repeatable = call.method in _REPEATABLE or _KEY in headers
        attempt, waited_s, paused_until = 0, 0.0, 0.0
        while True:
            try:
                return once(call, headers)
            except problem.Problem as found:
                is_cut = found.code in {problem.UNREACHABLE, problem.DAMAGED}
                given_up = is_cut and not call.repeated_if_cut
                if given_up or not (self.retries and repeatable and found.retryable):
                    raise
                if time.monotonic() >= paused_until:
                    pause_s = self._pause_s(attempt, found.retry_after_s)
                    # Who is told to wait has not failed: it is one of the tries only when the time is up.
                    told_to_wait = found.status in _FULL and found.retry_after_s is not None
                    waited_s += pause_s if told_to_wait else 0.0
                    if attempt >= self.retries or waited_s > _PATIENCE_S:
                        raise
                    if self._on_retry is not None:
                        self._on_retry(found, pause_s)
                    attempt += not told_to_wait
                    paused_until = time.monotonic() + pause_s
                left_s = max(0.0, paused_until - time.monotonic())
                if found.status in _AWAY and found.retry_after_s is None:
                    # A service that is not there cannot be overrun; once it is back, it is found soon.
                    left_s = min(left_s, _LOOK_EVERY_S * random.uniform(0.5, 1.0))  # noqa: S311
                if self._halted.wait(left_s):
                    raise

    def json(self, call: Call) -> dict[str, Any]:
        """Send a call whose answer is one JSON object."""
        response = self.send(call)
        try:
            answer = response.json()
        except ValueError:  # a page of somebody else's
            answer = None
        if not isinstance(answer, dict):
            detail = f"{call.method} {call.path} did not return a JSON object: is this a stilb service?"
            status = response.status_code
            raise problem.Problem(status=status, code="unexpected_answer", detail=detail, retryable=False)
        return answer

    def items(
        self, path: str, query: Query | None = None, *, member: str = "items"
    ) -> Iterator[dict[str, Any]]:
        """Every item, page after page, by the query of ``next`` alone: no key goes to another host."""
        page = self.json(Call(method="GET", path=path, query=query or {}))
        while True:
            yield from page[member]
            if not page.get("next"):
                return
            page = self.json(Call(method="GET", path=path, query=dict(httpx.URL(page["next"]).params)))

    def _once(self, call: Call, headers: Mapping[str, str]) -> httpx.Response:
        sent: dict[str, Any] = {"headers": headers}
        sent["content"] = self._watched(call.stream()) if call.stream else call.text
        if call.json is not None:
            sent["headers"] = {"Content-Type": "application/json", **headers}
            sent["content"] = _write_json(call.json)
        # httpx drops an address's own query for an empty one
        sent["params"] = without_none(call.query) or None
        # httpx takes None in `timeout` for "wait for ever".
        read_s = call.answer_within_s or self._timeout_s
        try:
            within = httpx.Timeout(self._timeout_s, read=read_s)
            response = self._http.request(call.method, call.path, timeout=within, **sent)
        except httpx.TransportError as error:
            raise problem.from_transport(error) from error
        if not response.is_success:
            raise problem.from_response(response)
        return response

    def _watched(self, chunks: Iterator[bytes]) -> Iterator[bytes]:
        for chunk in chunks:
            if self._halted.is_set():
                raise problem.Problem(status=0, code="not_sent", detail="it was stopped", retryable=False)
            yield chunk

    def _save(self, call: Call, headers: Mapping[str, str], file: BinaryIO) -> None:
        try:
            params = without_none(call.query) or None
            with self._http.stream(call.method, call.path, params=params, headers=headers) as response:
                _require_success(response)
                file.writelines(response.iter_bytes(_CHUNK_BYTES))
        except httpx.TransportError as error:
            raise problem.from_transport(error) from error

    def _pause_s(self, attempt: int, retry_after_s: float | None) -> float:
        """Twice as long each time, with a random part, so that many clients do not come back as one."""
        # Not a secret: any spread will do.
        backoff_s = self._backoff_s * 2.0**attempt * random.uniform(0.5, 1.0)  # noqa: S311
        return min(_LONGEST_PAUSE_S, max(backoff_s, retry_after_s or 0.0))


def _require_success(response: httpx.Response) -> None:
    """Raise the problem of a streamed answer that is one."""
    if not response.is_success:
        response.read()
        raise problem.from_response(response)


def _write_json(value: object) -> bytes:
    def simplify(found: Any) -> object:  # noqa: ANN401
        if isinstance(found, datetime):
            return as_text(found)
        if hasattr(found, "tolist"):  # of NumPy and pandas
            return found.tolist()
        raise TypeError(f"{found!r} cannot be sent as JSON")

    text = json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False, default=simplify)
    return text.encode()


def write_whole(path: Path, content: str | bytes, *, mode: int = 0o666) -> None:
    """Write a file beside its place and put it there, never half of it; an error names the file."""
    beside = path.with_name(f".{uuid.uuid4().hex}.part")
    try:
        beside.touch(mode)
        beside.write_bytes(content.encode() if isinstance(content, str) else content)
        beside.replace(path)
    except OSError as error:
        with suppress(OSError):  # of a disk that cannot be written
            beside.unlink()
        error.filename, error.filename2 = str(path), None
        raise


def hash_file(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def without_none(row: Mapping[str, Any]) -> dict[str, Any]:
    """As the service answers: what is absent is left out."""
    return {name: value for name, value in row.items() if value is not None}


class Connection:
    """Requests, as all groups of calls of `stilb.Client` make them."""

    def __init__(
        self,
        url: str,
        key: str,
        *,
        timeout: float = 60.0,
        retries: int = 10,
        backoff_s: float = 0.25,
        on_retry: OnRetry | None = None,
    ) -> None:
        self._timeout_s = timeout
        self._transport = Transport(
            url, key, timeout_s=timeout, retries=retries, backoff_s=backoff_s, on_retry=on_retry
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._transport.close()

    def _get(self, path: str, query: Query | None = None) -> dict[str, Any]:
        return self._transport.json(Call(method="GET", path=path, query=query or {}))

    def _post(self, path: str, body: object) -> dict[str, Any]:
        return self._transport.json(Call(method="POST", path=path, json=body))

    def _put(self, path: str, body: object) -> dict[str, Any]:
        return self._transport.json(Call(method="PUT", path=path, json=body))

    def _patch(self, path: str, body: object) -> dict[str, Any]:
        return self._transport.json(Call(method="PATCH", path=path, json=body))

    def _delete(self, path: str) -> dict[str, Any]:
        return self._transport.json(Call(method="DELETE", path=path))

    def _items(
        self, path: str, query: Query | None = None, *, member: str = "items"
    ) -> Iterator[dict[str, Any]]:
        return self._transport.items(path, query, member=member)

    def _text(self, path: str, query: Query | None = None) -> str:
        return self._transport.send(Call(method="GET", path=path, query=query or {})).text

    def _save(self, target: PathLike, path: str, query: Query | None = None) -> Path:
        """Download to a file; return its path."""
        self._transport.download(Call(method="GET", path=path, query=query or {}), Path(target))
        return Path(target)
