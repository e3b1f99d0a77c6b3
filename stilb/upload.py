"""Frames on their way from the disk to the service: hashed first, then streamed, never held in memory."""

import base64
import hashlib
import json
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypedDict, TypeVar
from urllib.parse import urlsplit

from stilb.details import Polygon
from stilb.problem import UNREACHABLE, Problem
from stilb.records import Frame
from stilb.side_by_side import WHOLE_BYTES, FileCount, OnProgress, Tally, send_side_by_side
from stilb.transport import Call, Transport, address

_CHUNK_BYTES = 1 << 20
_LARGEST_PIECE_BYTES, _SMALLEST_PIECE_BYTES = 16 << 20, 16 << 10
_LONGEST_BACKOFF = 3
"""Doublings of the pause before the next piece."""
_TUS = {"Tus-Resumable": "1.0.0"}
_OF_ONE_FILE = frozenset({400, 413, 422})

Sent = TypeVar("Sent")

PathLike = str | os.PathLike[str]


class FrameDetails(TypedDict, total=False):
    """Details of one frame: a region, and exposure values that its file does not state."""

    roi: Polygon
    exposure_time_s: float
    f_number: float
    iso: float


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


def send_all(
    transport: Transport, uploads: list[Upload], *, concurrency: int | None, on_progress: OnProgress | None
) -> list[Frame]:
    """Send files side by side; frames come back in the order of ``uploads``.

    The first failure stops what has not begun and is raised, with the file's name as its note. Sending the
    same list again is safe: a frame that has arrived answers as it did.
    """
    return _side_by_side(transport, uploads, _send, concurrency=concurrency, on_progress=on_progress)


def send_each(
    transport: Transport, uploads: list[Upload], *, concurrency: int | None, on_progress: OnProgress | None
) -> list[Frame | Exception]:
    """The same, where a file that cannot be sent answers its error, and the others go on."""

    def send(transport: Transport, upload: Upload, count: FileCount) -> Frame | Exception:
        try:
            return _send(transport, upload, count)
        except OSError as error:
            return error
        except Problem as problem:
            if problem.status in _OF_ONE_FILE:
                return problem
            raise

    return _side_by_side(transport, uploads, send, concurrency=concurrency, on_progress=on_progress)


def _side_by_side(
    transport: Transport,
    uploads: list[Upload],
    send: Callable[[Transport, Upload, FileCount], Sent],
    *,
    concurrency: int | None,
    on_progress: OnProgress | None,
) -> list[Sent]:
    tally = Tally([Path(upload.path) for upload in uploads], on_progress)
    return send_side_by_side(
        tally,
        lambda index: send(transport, uploads[index], tally.file(index)),
        at_once=concurrency,
        stop=transport.halt,
    )


def _send(transport: Transport, upload: Upload, count: FileCount) -> Frame:
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
    count.finish()
    return Frame.of(frame)


def _send_whole(transport: Transport, call: Call, size_bytes: int) -> dict[str, Any] | None:
    """Send a small file in one request; None for a large one, and where the connection was cut."""
    if size_bytes >= WHOLE_BYTES:
        return None
    try:
        return transport.json(call)
    except Problem as problem:
        if problem.code != UNREACHABLE:
            raise
        transport.pause(0, problem)
    return None


def _send_resumably(
    transport: Transport, upload: Upload, path: Path, sha256: str, size_bytes: int, count: FileCount
) -> dict[str, Any]:
    """Send a file from where the last connection was cut, as long as each brings it forward.

    A proxy that holds a body back until it is whole loses what a cut leaves of it: pieces get smaller until
    one arrives.
    """
    said = {"campaign_id": upload.campaign_id, "sha256": sha256} | _query(upload, path)
    pairs = {name: str(value).encode() for name, value in said.items() if value is not None}
    metadata = ",".join(f"{name} {base64.b64encode(value).decode()}" for name, value in pairs.items())
    # the same of the same file: a push that is begun again goes on with what the last one has sent
    named = hashlib.sha256(metadata.encode()).hexdigest()
    begin = {**_TUS, "Upload-Length": str(size_bytes), "Upload-Metadata": metadata, "Idempotency-Key": named}
    told = transport.send(Call(method="POST", path=address("uploads"), headers=begin)).headers
    place = urlsplit(told["Location"]).path
    tried, most = 0, _LARGEST_PIECE_BYTES
    while "Content-Location" not in told:
        offset = int(told["Upload-Offset"])
        length = min(most, size_bytes - offset)
        piece = {
            **_TUS,
            "Content-Type": "application/offset+octet-stream",
            "Content-Length": str(length),
            "Upload-Offset": str(offset),
        }
        try:
            stream = partial(_stream, path, count, offset, length)
            told = transport.once(Call(method="PATCH", path=place, stream=stream, headers=piece)).headers
            tried, most = 0, min(2 * most, _LARGEST_PIECE_BYTES)
        except Problem as problem:
            if not problem.retryable:
                raise
            told = transport.send(Call(method="HEAD", path=place, headers=_TUS)).headers
            if int(told["Upload-Offset"]) > offset:
                tried = 0
            else:
                tried, most = tried + 1, max(length // 4, _SMALLEST_PIECE_BYTES)
            if tried > transport.retries:
                raise
            # it has answered: it is back, and it is the line that breaks
            transport.pause(min(tried, _LONGEST_BACKOFF), problem)
    return transport.json(Call(method="GET", path=told["Content-Location"]))


def _stream(path: Path, count: FileCount, offset: int, length: int) -> Iterator[bytes]:
    count.restart(offset)
    with path.open("rb") as file:
        file.seek(offset)
        while chunk := file.read(min(length, _CHUNK_BYTES)):
            yield chunk
            length -= len(chunk)
            count.advance(len(chunk))


def _call(upload: Upload, path: Path, sha256: str, size_bytes: int, count: FileCount) -> Call:
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
    polygon = None if upload.roi is None else json.dumps([[x, y] for x, y in upload.roi], allow_nan=False)
    return {
        "role": upload.role,
        "scene": upload.scene,
        # A name that is not UTF-8 on disk has no other spelling in a URL.
        "filename": path.name.encode("utf-8", "replace").decode("utf-8"),
        "roi": polygon,
        "exposure_time_s": upload.exposure_time_s,
        "f_number": upload.f_number,
        "iso": upload.iso,
    }
