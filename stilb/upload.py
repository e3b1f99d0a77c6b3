"""Frames on their way from the disk to the service: hashed first, then streamed, never held in memory."""

import base64
import hashlib
import json
import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Required, TypedDict, TypeVar
from urllib.parse import urlsplit

from stilb.problem import DAMAGED, UNREACHABLE, Problem
from stilb.records import Frame, Polygon
from stilb.transport import Call, PathLike, Transport, address, hash_file

WHOLE_BYTES = 1 << 20  # a smaller file goes in one request; only if that is cut it is sent as what can go on
_AT_ONCE = 2
_MOST_AT_ONCE = 16  # small files; more gain nothing: what arrives together goes in one transaction anyway
_MOST_BYTES = 4 << 20  # of small files under way, beyond the first two
_QUICK_S = 1.0

_CHUNK_BYTES = 1 << 20
_LARGEST_PIECE_BYTES, _SMALLEST_PIECE_BYTES = 16 << 20, 16 << 10
_LONGEST_BACKOFF = 3  # doublings of the pause before the next piece
_TUS = {"Tus-Resumable": "1.0.0"}
_PIECE = _TUS | {"Content-Type": "application/offset+octet-stream"}
_OF_ONE_FILE = frozenset({400, 413, 422})

Sent = TypeVar("Sent")


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How far a ``push`` is. Bytes go back to what has arrived when a connection is lost."""

    filename: str
    files_done: int
    files_total: int
    bytes_sent: int
    bytes_total: int


OnProgress = Callable[[Progress], None]


class Width:
    """How many files may be under way: two, and of small ones as many as a line carries in about a second.

    Each that was answered within a second makes room for one more, and each that took longer for one less: a
    line that breaks loses what was on its way. A caller's own number holds for all files.
    """

    def __init__(self, own: int | None) -> None:
        self._least = self._now = own or _AT_ONCE
        self._most = own or _MOST_AT_ONCE
        self._sizes: list[int] = []

    def has_room(self, size_bytes: int) -> bool:
        under_way = len(self._sizes)
        small = sum(self._sizes) + size_bytes <= _MOST_BYTES and size_bytes < WHOLE_BYTES
        return under_way < self._least or (small and under_way < self._now)

    def begin(self, size_bytes: int) -> None:
        self._sizes.append(size_bytes)

    def end(self, size_bytes: int, took_s: float) -> None:
        self._sizes.remove(size_bytes)
        more = 1 if took_s < _QUICK_S else -1
        self._now = max(self._least, min(self._most, self._now + more))


class FrameDetails(TypedDict, total=False):
    """Details of one frame: a region, and exposure values that its file does not state."""

    roi: Polygon
    exposure_time_s: float
    f_number: float
    iso: float


class PushDetails(FrameDetails, total=False):
    role: Required[str]
    scene: str | None
    on_progress: OnProgress | None


@dataclass(frozen=True, kw_only=True)
class Upload:
    """One file to send, and what it is to its campaign. ``sha256``: where it is known already."""

    campaign_id: str
    path: PathLike
    role: str  # light | dark | flat | panel | chart | field
    scene: str | None = None
    roi: Polygon | None = None
    exposure_time_s: float | None = None
    f_number: float | None = None
    iso: float | None = None
    sha256: str | None = None


class Tally:
    """Counts over all threads of one push, and reports to one listener, one report at a time."""

    def __init__(self, paths: Sequence[Path], on_progress: OnProgress | None) -> None:
        self._lock = threading.Lock()
        self._on_progress, self._paths = on_progress, paths
        # A file that has gone is the matter of whoever opens it.
        self.sizes = [path.stat().st_size if path.exists() else 0 for path in paths]
        self._sent = [0] * len(paths)
        self._files_done = 0

    def count(self, index: int, sent_bytes: int | None = None) -> None:
        """Note how much of a file has arrived; without a number it is done."""
        with self._lock:
            if sent_bytes is None:
                self._files_done += 1
            else:
                self._sent[index] = sent_bytes
            if self._on_progress is not None:
                self._on_progress(
                    Progress(
                        filename=self._paths[index].name,
                        files_done=self._files_done,
                        files_total=len(self._paths),
                        bytes_sent=sum(self._sent),
                        bytes_total=sum(self.sizes),
                    )
                )


Count = Callable[[int | None], None]


def send_side_by_side(
    transport: Transport,
    uploads: list[Upload],
    send: Callable[[Transport, Upload, Count], Sent],
    *,
    at_once: int | None,
    on_progress: OnProgress | None,
) -> list[Sent]:
    """Send files side by side, until the first failure, which is raised; the answers come in their order."""
    tally = Tally([Path(upload.path) for upload in uploads], on_progress)
    width, under_way = Width(at_once), dict[Future[Sent], tuple[int, float]]()
    futures = list[Future[Sent]]()
    with ThreadPoolExecutor(at_once or _MOST_AT_ONCE, thread_name_prefix="stilb-push") as pool:
        try:
            for index, (upload, size_bytes) in enumerate(zip(uploads, tally.sizes, strict=True)):
                while not width.has_room(size_bytes):
                    _take_ended(under_way, width)
                width.begin(size_bytes)
                futures.append(pool.submit(send, transport, upload, partial(tally.count, index)))
                under_way[futures[-1]] = size_bytes, time.monotonic()
            while under_way:
                _take_ended(under_way, width)
        except (KeyboardInterrupt, SystemExit):
            transport.halt()
            raise
    return [future.result() for future in futures]


def _take_ended(under_way: dict[Future[Sent], tuple[int, float]], width: Width) -> None:
    """Wait for files that are answered, and raise the error of one that failed."""
    for future in wait(under_way, return_when=FIRST_COMPLETED).done:
        size_bytes, begun_at = under_way.pop(future)
        width.end(size_bytes, time.monotonic() - begun_at)
        future.result()


def try_file(transport: Transport, upload: Upload, count: Count) -> Frame | Exception:
    """Send one file; an error that concerns it alone is the answer."""
    try:
        return send_file(transport, upload, count)
    except OSError as error:
        return error
    except Problem as problem:
        if problem.status in _OF_ONE_FILE:
            return problem
        raise


def send_file(transport: Transport, upload: Upload, count: Count) -> Frame:
    """Send one file; sending it again is safe: a frame that has arrived answers as it did."""
    path = Path(upload.path)
    try:
        with path.open("rb") as file:
            size_bytes = os.fstat(file.fileno()).st_size
            sha256 = upload.sha256 or hashlib.file_digest(file, "sha256").hexdigest()
        frame = _send_whole(transport, _call(upload, path, sha256, size_bytes, count), size_bytes)
        if frame is None:
            frame = _send_resumably(transport, upload, path, sha256, size_bytes, count)
    except Exception as error:
        error.add_note(f"while sending {path}")
        raise
    count(None)
    return Frame.of(frame)


def _send_whole(transport: Transport, call: Call, size_bytes: int) -> dict[str, Any] | None:
    """Send a small file in one request; None for a large one, and where it did not arrive, or not whole."""
    if size_bytes >= WHOLE_BYTES:
        return None
    try:
        return transport.json(call)
    except Problem as problem:
        if problem.code not in {UNREACHABLE, DAMAGED}:
            raise
        transport.pause(0, problem)
    return None


def _send_resumably(
    transport: Transport, upload: Upload, path: Path, sha256: str, size_bytes: int, count: Count
) -> dict[str, Any]:
    """Send a file from where the last connection was cut, in smaller pieces until one arrives."""
    said = {"campaign_id": upload.campaign_id, "sha256": sha256} | _query(upload, path)
    pairs = {name: str(value).encode() for name, value in said.items() if value is not None}
    metadata = ",".join(f"{name} {base64.b64encode(value).decode()}" for name, value in pairs.items())
    # the same of the same file: a push that is begun again goes on with what the last one has sent
    named = hashlib.sha256(metadata.encode()).hexdigest()
    begin = {**_TUS, "Upload-Length": str(size_bytes), "Upload-Metadata": metadata, "Idempotency-Key": named}
    told = transport.send(Call(method="POST", path=address("uploads"), headers=begin)).headers
    place = urlsplit(told["Location"]).path
    tried, damaged, most = 0, 0, _LARGEST_PIECE_BYTES
    while "Content-Location" not in told:
        offset = int(told["Upload-Offset"])
        length = min(most, size_bytes - offset)
        piece = _PIECE | {"Content-Length": str(length), "Upload-Offset": str(offset)}
        try:
            stream = partial(_stream, path, count, offset, length)
            told = transport.once(Call(method="PATCH", path=place, stream=stream, headers=piece)).headers
            tried, most = 0, min(2 * most, _LARGEST_PIECE_BYTES)
        except Problem as problem:
            if not problem.retryable:
                raise
            if problem.code == DAMAGED and hash_file(path) != sha256:
                raise _unfinished(path) from problem
            damaged += problem.code == DAMAGED
            told = transport.send(Call(method="HEAD", path=place, headers=_TUS)).headers
            if int(told["Upload-Offset"]) > offset:
                tried = 0
            else:
                tried, most = tried + 1, max(length // 4, _SMALLEST_PIECE_BYTES)
            if max(tried, damaged) > transport.retries:
                raise
            # it has answered: it is back, and it is the line that breaks
            transport.pause(min(tried, _LONGEST_BACKOFF), problem)
    return transport.json(Call(method="GET", path=told["Content-Location"]))


def _unfinished(path: Path) -> OSError:
    return OSError(f"{path} is still being written: push again when it is complete")


def _stream(path: Path, count: Count, offset: int, length: int) -> Iterator[bytes]:
    end = offset + length
    with path.open("rb") as file:
        file.seek(offset)
        while offset < end:
            if not (chunk := file.read(min(end - offset, _CHUNK_BYTES))):
                raise _unfinished(path)
            yield chunk
            offset += len(chunk)
            count(offset)


def _call(upload: Upload, path: Path, sha256: str, size_bytes: int, count: Count) -> Call:
    return Call(
        method="POST",
        path=address("campaigns", upload.campaign_id, "frames"),
        query=_query(upload, path),
        stream=partial(_stream, path, count, 0, size_bytes),
        repeated_if_cut=False,
        headers={
            "Content-Type": "application/octet-stream",
            "Content-Length": str(size_bytes),  # without it the body would go out in HTTP chunks
            "X-Content-SHA256": sha256,
        },
    )


def _query(upload: Upload, path: Path) -> dict[str, str | float | None]:
    said = {name: getattr(upload, name) for name in ("role", "scene", "exposure_time_s", "f_number", "iso")}
    polygon = None if upload.roi is None else json.dumps([[x, y] for x, y in upload.roi], allow_nan=False)
    # A name that is not UTF-8 on disk has no other spelling in a URL.
    return said | {"filename": path.name.encode("utf-8", "replace").decode("utf-8"), "roi": polygon}
