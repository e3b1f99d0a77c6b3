"""Headers of tus 1.0.0, and pieces on their way to the disk."""

import asyncio
import base64
import hashlib
import re
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from email.utils import format_datetime
from typing import Annotated, Final

from fastapi import Header, Request, Response
from pydantic import BaseModel, ValidationError
from pydantic.config import JsonDict
from starlette.concurrency import run_in_threadpool

from radiometry.findings import interface
from service.frames.schemas import Upload
from service.http import models, problems
from service.measurements.requests import read_region
from store.blobs.partials import Claim, Facts, OtherOffset, Partial, Superseded

TUS: Final = "1.0.0"
PIECE: Final = "application/offset+octet-stream"  # media type of a piece
_OF_BROWSERS: Final = frozenset({"name", "type", "filetype", "relativePath"})
"""What uploaders of browsers say of any file."""
_COUNT: Final = r"^[0-9]{1,18}$"
_COUNTED: Final[JsonDict] = {"pattern": _COUNT}


class UploadHeaders(BaseModel):
    """Statements of a request in headers; what is absent is None."""

    tus_version: str | None = models.maybe("`1.0.0`, of tus.", alias="Tus-Resumable")
    offset: str | None = models.maybe(
        "Where the piece begins [bytes], in digits; needed with a piece.",
        alias="Upload-Offset",
        json_schema_extra=_COUNTED,
    )
    length: str | None = models.maybe(
        "Size of the whole file [bytes], in digits; needed where an upload begins.",
        alias="Upload-Length",
        json_schema_extra=_COUNTED,
    )
    metadata: str | None = models.maybe(
        "Pairs of a name and a value in Base64, with commas between: `campaign_id`, "
        "`role`, `sha256` of the whole file (compared where stated), and what else a frame takes.",
        alias="Upload-Metadata",
    )
    checksum: str | None = models.maybe(
        "`sha256` and the piece's digest in Base64: it is kept whole or not at all.",
        alias="Upload-Checksum",
        json_schema_extra={"pattern": "^sha256 [A-Za-z0-9+/]{43}=$"},
    )


UsesHeaders = Annotated[UploadHeaders, Header()]


def is_piece(request: Request) -> bool:
    return request.headers.get("content-type", "").partition(";")[0].strip() == PIECE


class FrameSaid(Upload):
    """Statements about a file, made before its first byte."""

    campaign_id: models.Text
    sha256: models.Sha256 | None = None


def check_protocol(headers: UploadHeaders) -> None:
    if headers.tus_version != TUS:
        detail = "Send Tus-Resumable: 1.0.0."
        raise problems.Problem(interface.UPLOAD_VERSION, detail, headers={"Tus-Version": TUS})


def read_count(text: str | None, name: str) -> int:
    if text is None or re.fullmatch(_COUNT, text) is None:
        message = "is missing" if text is None else "must be a count of bytes, of at most 18 digits"
        raise problems.wrong(f"header.{name}", message)
    return int(text)


def read_metadata(text: str | None) -> dict[str, str]:
    """Read what is said of a file, each name once."""
    pairs = [pair.split() for pair in (text or "").split(",") if pair.strip()]
    try:
        said = {name: base64.b64decode("".join(value), validate=True).decode() for name, *value in pairs}
    except ValueError:
        message = "must be names with their values in Base64, separated by commas"
        raise problems.wrong("header.Upload-Metadata", message) from None
    if "filename" not in said and "name" in said:
        said["filename"] = said["name"]
    return {name: value for name, value in said.items() if name not in _OF_BROWSERS}


def read_said(said: dict[str, str]) -> FrameSaid:
    try:
        frame = FrameSaid.model_validate(said)
    except ValidationError as error:
        raise problems.invalid(problems.located(error, "header", "Upload-Metadata")) from None
    if frame.roi is not None:
        read_region(frame.roi)
    return frame


def read_checksum(text: str | None) -> bytes | None:
    if text is None:
        return None
    algorithm, _, digest = text.partition(" ")
    try:
        value = base64.b64decode(digest, validate=True)
    except ValueError:
        value = b""
    if algorithm != "sha256" or len(value) != hashlib.sha256().digest_size:
        raise problems.Problem(
            interface.BAD_REQUEST, "Upload-Checksum takes sha256 and the digest of the piece in Base64."
        )
    return value


def answer(partial: Partial, facts: Facts, status: int) -> Response:
    headers = {
        "Tus-Resumable": TUS,
        "Upload-Offset": str(partial.read_offset()),
        "Upload-Length": str(facts.size_bytes),
        "Upload-Expires": format_datetime(datetime.fromtimestamp(facts.expires_at, UTC), usegmt=True),
        "Cache-Control": "no-store",
    }
    if facts.frame_id:
        headers["Content-Location"] = f"/v1/frames/{facts.frame_id}"
    if facts.job_id:
        headers["Link"] = f'</v1/jobs/{facts.job_id}>; rel="status"'
    return Response(status_code=status, headers=headers)


_WRITE_BYTES: Final = 1 << 20
_KEEP_EVERY_S: Final = 0.5
"""So often what has arrived is made durable while more comes; and at once when nothing comes."""
_IDLE_S: Final = 0.1


async def append(request: Request, partial: Partial, begins: int, checksum: str | None) -> None:
    """Append the body where it begins; with a checksum whole or not at all, else what has arrived counts."""
    facts = await run_in_threadpool(partial.read_facts)
    announced = request.headers.get("content-length", "")
    if begins + (int(announced) if announced.isdecimal() else 0) > facts.size_bytes:
        raise _beyond(facts)
    expected = read_checksum(checksum)
    try:
        with await run_in_threadpool(partial.claim, begins) as claim:
            await _Piece(request, claim, facts, piecewise=expected is None).take(expected)
    except OtherOffset as error:
        raise problems.Problem(
            interface.UPLOAD_OFFSET_DIFFERS,
            f"{error.durable_bytes} bytes have arrived; this piece begins at {begins}.",
            headers={"Upload-Offset": str(error.durable_bytes)},
        ) from None
    except Superseded:
        detail = "Another connection has taken this upload over."
        raise problems.Problem(interface.UPLOAD_OFFSET_DIFFERS, detail) from None
    except FileNotFoundError:
        raise problems.not_found("upload") from None


@dataclass
class _Piece:
    """The body of a request on its way to the disk."""

    request: Request
    claim: Claim
    facts: Facts
    piecewise: bool  # whether what has arrived counts before the end

    def __post_init__(self) -> None:
        self._waiting: list[bytes] = []
        self._hash = hashlib.sha256()
        self._kept_at = time.monotonic()

    async def take(self, expected: bytes | None) -> None:
        """Write until the body's end; a cut keeps what has arrived."""
        try:
            await self._copy()
        finally:
            if self.piecewise:
                await run_in_threadpool(self._store, keep=True)
        if self.piecewise:
            return
        await run_in_threadpool(self._store, keep=False)
        if expected not in {None, self._hash.digest()}:
            detail = "The piece is not the one of Upload-Checksum. Send it again."
            raise problems.Problem(interface.UPLOAD_CHECKSUM_DIFFERS, detail)
        await run_in_threadpool(self.claim.keep)

    async def _copy(self) -> None:
        size = self.claim.written_bytes
        next_message = asyncio.ensure_future(self.request.receive())
        try:
            while True:
                kept = not self._waiting and self.claim.written_bytes <= self.claim.durable_bytes
                idle_s = None if kept or not self.piecewise else _IDLE_S
                arrived, _ = await asyncio.wait({next_message}, timeout=idle_s)
                if not arrived:
                    await run_in_threadpool(self._store, keep=True)
                    continue
                message = next_message.result()
                if message["type"] != "http.request":
                    raise problems.Problem(
                        interface.UPLOAD_INCOMPLETE, "The connection was lost before the end of the piece."
                    )
                size += len(message.get("body", b""))
                if size > self.facts.size_bytes:
                    raise _beyond(self.facts)
                self._waiting.append(message.get("body", b""))
                due = self.piecewise and time.monotonic() - self._kept_at >= _KEEP_EVERY_S
                if due or sum(map(len, self._waiting)) >= _WRITE_BYTES:
                    await run_in_threadpool(self._store, keep=due)
                if not message.get("more_body"):
                    return
                next_message = asyncio.ensure_future(self.request.receive())
        finally:
            next_message.cancel()

    def _store(self, *, keep: bool) -> None:
        waiting, self._waiting = self._waiting, []
        for chunk in waiting:
            self._hash.update(chunk)
        self.claim.write(waiting)
        if keep:
            self.claim.keep()
            self._kept_at = time.monotonic()


def _beyond(facts: Facts) -> problems.Problem:
    return problems.Problem(
        interface.UPLOAD_TOO_LARGE, f"More bytes came than the {facts.size_bytes} that Upload-Length states."
    )
