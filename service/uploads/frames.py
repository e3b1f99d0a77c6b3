"""Receiving a file: streamed to the blob store, hashed on the way, and made a frame of a campaign."""

import asyncio
import base64
import binascii
import re
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import PurePosixPath
from typing import Final

from fastapi import Request, Response
from python_multipart.exceptions import MultipartParseError
from python_multipart.multipart import MultipartParser, parse_options_header
from sqlalchemy import select
from sqlalchemy.orm import Session
from starlette.concurrency import run_in_threadpool

from radiometry.findings import Finding, interface
from radiometry.frame.verdicts import Verdict
from radiometry.records import Record
from service.campaigns.schemas import NewRoi
from service.frames.schemas import FrameAnswer, StatisticsRow, Upload
from service.http import auth, changes, lookup, problems
from service.http.context import Context
from service.measurements.requests import read_roi
from store.blobs import Blobs, BlobWriter, StoredBlob
from store.jobs import enqueue_extraction
from store.queries.campaigns import Drawing, find_known, find_or_add_roi
from store.queries.frames import NewFrame, extractions_of, find_or_add_frames, require_role, statistics_of
from store.queries.jobs import find_reading_jobs
from store.queries.usage import QuotaExceeded, check_room, limits_files, recount_if_old
from store.reviews import judge_alone
from store.tables import Blob, Campaign, FrameRow, Job


def answer_frames(
    session: Session, frames: list[FrameRow], verdicts: Mapping[str, Verdict]
) -> list[FrameAnswer]:
    """Return frames with their statistics, in four queries however many they are."""
    extractions = extractions_of(session, [frame.id for frame in frames])
    rows = statistics_of(session, [e.id for found in extractions.values() for e in found])
    stored = session.scalars(select(Blob).where(Blob.sha256.in_({frame.sha256 for frame in frames})))
    blobs = {blob.sha256: blob for blob in stored}
    jobs = find_reading_jobs(session, [frame.id for frame in frames])
    return [
        FrameAnswer.of(
            frame,
            blob=blobs[frame.sha256],
            statistics=[
                StatisticsRow.of(extraction, row)
                for extraction in extractions[frame.id]
                for row in rows[extraction.id]
            ],
            verdict=verdicts.get(frame.id),
            job_id=jobs.get(frame.id),
        )
        for frame in frames
    ]


def answer_write(
    session: Session,
    frame: FrameRow,
    campaign: Campaign,
    jobs: list[Job],
    *,
    stored: StoredBlob | None = None,
) -> FrameAnswer:
    # nobody else may write meanwhile: the frame is not compared with a whole campaign here
    verdict = judge_alone(session, frame, campaign) if jobs else None
    if stored is not None:
        # the frame is new: nothing else is known of it
        blob = Blob(sha256=stored.sha256, size_bytes=stored.size_bytes)
        answer = FrameAnswer.of(frame, blob=blob, statistics=[], verdict=verdict)
    else:
        answer = answer_frames(session, [frame], {frame.id: verdict} if verdict else {})[0]
    return answer.model_copy(update={"job_id": jobs[0].id}) if jobs else answer


_FLUSH_BYTES = 1 << 20
_MOST_PARTS = 100
_REPR_DIGEST = re.compile(r"sha-256=:([A-Za-z0-9+/=]+):")
Admit = Callable[[str | None, int], bool]
"""Raises where a file with this hash, of this size, may not be kept; False where only the hash will tell."""

MAX_FILE_BYTES: Final = 2 << 30


async def receive(request: Request, blobs: Blobs, *, admit: Admit) -> tuple[StoredBlob, str | None]:
    """Store a body, or the part ``file`` of a form with its name; ``admit`` is asked before and after."""
    expected = _announced_sha256(request)
    text = request.headers.get("content-length", "")
    announced = int(text) if text.isdecimal() else 0
    require_size(announced)
    admitted = await run_in_threadpool(admit, expected, announced)
    with blobs.writer() as writer:
        kind, options = parse_options_header(request.headers.get("content-type", ""))
        form = _FilePart(writer, options.get(b"boundary", b"")) if kind == b"multipart/form-data" else None
        take = writer.write if form is None else form.feed
        rest = await _drain(request.stream(), take)

        def finish() -> tuple[StoredBlob, str | None]:
            take(rest)
            filename = None if form is None else form.finish()
            if expected is not None and writer.sha256 != expected:
                raise differs(writer, expected, "Send it again.")
            if not admitted or writer.size_bytes > announced:
                admit(writer.sha256, writer.size_bytes)
            return writer.commit(), filename

        return await run_in_threadpool(finish)


async def _drain(chunks: AsyncIterator[bytes], take: Callable[[bytes], object]) -> bytes:
    """Hand the chunks on in pieces of a megabyte, one while the next one arrives; return what remains."""
    waiting: list[bytes] = []
    size = total = 0
    taking: asyncio.Future[object] | None = None
    try:
        async for chunk in chunks:
            waiting.append(chunk)
            size += len(chunk)
            total += len(chunk)
            require_size(total)
            if size >= _FLUSH_BYTES:
                if taking:
                    await asyncio.shield(taking)
                piece, waiting, size = waiting, [], 0
                taking = asyncio.ensure_future(run_in_threadpool(lambda some: take(b"".join(some)), piece))
        if taking:
            await asyncio.shield(taking)
    finally:
        # whatever ends this, the file is not closed under the thread that writes it
        while taking and not taking.done():
            with suppress(asyncio.CancelledError):
                await asyncio.wait([taking])
    return b"".join(waiting)


class _FilePart:
    """Picks the part named ``file`` out of a form as it streams by."""

    def __init__(self, writer: BlobWriter, boundary: bytes) -> None:
        self._writer = writer
        self._name = self._value = self._disposition = b""
        self._inside = False
        self._found = self._parts = 0
        self._filename = ""
        self._ended = False
        if not boundary:
            raise _bad_form("its Content-Type names no boundary")
        self._parser = MultipartParser(
            boundary,
            {
                "on_part_begin": self._begin,
                "on_header_field": self._field,
                "on_header_value": self._content,
                "on_header_end": self._header,
                "on_headers_finished": self._headers,
                "on_part_data": self._data,
                "on_end": self._end,
            },
        )

    def feed(self, chunk: bytes) -> None:
        try:
            self._parser.write(chunk)
        except MultipartParseError as error:
            raise _bad_form("it cannot be read") from error

    def finish(self) -> str | None:
        """The file's name as sent; a form without its end or without the part is refused."""
        if not self._ended:
            raise _bad_form("it ends too early", interface.UPLOAD_INCOMPLETE)
        if self._found != 1:
            raise _bad_form(f"it has {self._found} parts named 'file' where one is needed")
        return self._filename or None

    def _begin(self) -> None:
        self._parts += 1
        if self._parts > _MOST_PARTS:
            raise _bad_form(f"it has more than {_MOST_PARTS} parts")
        self._disposition = b""
        self._inside = False

    def _field(self, data: bytes, start: int, end: int) -> None:
        self._name += data[start:end]

    def _content(self, data: bytes, start: int, end: int) -> None:
        self._value += data[start:end]

    def _header(self) -> None:
        if self._name.lower() == b"content-disposition":
            self._disposition = self._value
        self._name = self._value = b""

    def _headers(self) -> None:
        _, options = parse_options_header(self._disposition)
        self._inside = options.get(b"name") == b"file"
        if self._inside:
            self._found += 1
            self._filename = options.get(b"filename", b"").decode("utf-8", "replace")

    def _data(self, data: bytes, start: int, end: int) -> None:
        if self._inside and self._found == 1:
            self._writer.write(data[start:end])

    def _end(self) -> None:
        self._ended = True


def _announced_sha256(request: Request) -> str | None:
    """The hash that the sender announces, in RFC 9530's form or in ours."""
    plain = request.headers.get("x-content-sha256")
    if (digest := _REPR_DIGEST.search(request.headers.get("repr-digest", ""))) is not None:
        try:
            plain = base64.b64decode(digest[1], validate=True).hex()
        except binascii.Error as error:
            raise _bad_digest() from error
    if plain is None:
        return None
    if re.fullmatch(r"[0-9a-fA-F]{64}", plain) is None:
        raise _bad_digest()
    return plain.lower()


def differs(writer: BlobWriter, announced: str | None, advice: str, **headers: str) -> problems.Problem:
    detail = f"The file arrived as SHA-256 {writer.sha256}, not the announced {announced}. {advice}"
    return problems.Problem(interface.DIGEST_MISMATCH, detail, headers=headers)


def _bad_digest() -> problems.Problem:
    detail = "The announced hash is not a SHA-256: X-Content-SHA256 takes 64 hex digits, Repr-Digest sha-256."
    return problems.Problem(interface.BAD_REQUEST, detail)


def _bad_form(why: str, code: Finding = interface.BAD_REQUEST) -> problems.Problem:
    return problems.Problem(code, f"The multipart form cannot be used: {why}.")


def require_size(size_bytes: int) -> None:
    if size_bytes > MAX_FILE_BYTES:
        raise problems.Problem(interface.UPLOAD_TOO_LARGE, f"A file may have at most {MAX_FILE_BYTES} bytes.")


_LONGEST_NAME: Final = 255  # as on file systems, some of which count bytes
_LONGEST_EXTENSION: Final = 20


class _Arrival(Record, kw_only=False):
    """A frame whose file is stored, on its way into a campaign; its own region, if it has one."""

    campaign_id: str
    new: NewFrame
    drawing: Drawing | None
    had_room: bool


def admit(
    context: Context,
    campaign_id: str,
    caller: auth.Caller,
    sha256: str | None,
    size_bytes: int,
    *,
    role: str,
    begin: Callable[[], object] | None = None,
) -> bool:
    """Refuse a role not taken, and a file without room unless it is known; False where that is to be seen."""
    keeps = begin is not None and limits_files(context.settings)

    def check() -> bool:
        database, by = context.database, (caller.key_id, caller.organisation_id)
        with database.writing(*by) if keeps else database.reading() as session:
            campaign = lookup.owned(session, Campaign, campaign_id, caller)
            require_role(campaign, role)
            try:
                check_room(
                    session, caller.organisation_id, context.settings, size_bytes=size_bytes, keep=keeps
                )
            except QuotaExceeded:
                if sha256 is None and begin is None:
                    return False
                if sha256 is None or not find_known(session, campaign, [sha256]):
                    raise
            if begin is not None:
                begin()
        return True

    try:
        return check()
    except QuotaExceeded:
        with context.database.writing("service") as session:
            recount_if_old(session, caller.organisation_id)
        return check()


async def keep_frame(
    context: Context,
    writing: changes.Writing,
    caller: auth.Caller,
    campaign_id: str,
    *,
    upload: Upload,
    region: NewRoi | None,
    blob: StoredBlob,
    had_room: bool = False,
) -> Response:
    """Make a stored file a frame of a campaign, or find it; `had_room`: since its upload began."""
    new = NewFrame(
        blob=blob,
        filename=_plain_name(upload.filename or f"{blob.sha256[:12]}.bin"),
        role=upload.role,
        scene=upload.scene,
        roi_id=None,
        supplied=upload.model_dump(include={"exposure_time_s", "f_number", "iso"}, exclude_none=True),
    )
    arrival = _Arrival(campaign_id, new, read_roi(region) if region else None, had_room)
    answer = await context.together.do(
        caller.key_id,
        (writing.with_content(blob.sha256), arrival),
        lambda requests: changes.run_all(caller, requests, partial(_add_frames, caller)),
    )
    if changes.REPLAYED in answer.headers:
        # nothing was done for it, but also this upload has brought the bytes again
        await run_in_threadpool(context.files.heal, blob)
    return answer


def _add_frames(caller: auth.Caller, session: Session, arrivals: Sequence[_Arrival]) -> list[changes.Reply]:
    arrived = []
    for each in arrivals:
        campaign = lookup.owned(session, Campaign, each.campaign_id, caller)
        # again: it may have become a night since the upload began
        require_role(campaign, each.new.role)
        roi = find_or_add_roi(session, caller.organisation_id, each.drawing) if each.drawing else None
        arrived.append((campaign, replace(each.new, roi_id=roi.id if roi else None)))
    replies = []
    for arrival, (campaign, new), (frame, is_new, to_read) in zip(
        arrivals, arrived, find_or_add_frames(session, arrived), strict=True
    ):
        jobs, by = [], caller.key_id
        if to_read:
            jobs = [enqueue_extraction(session, frame, caller.organisation_id, by=by, is_new=is_new)]
        stored = new.blob if is_new else None
        body = answer_write(session, frame, campaign, jobs, stored=stored)
        body = body.model_copy(update={"kept": _list_kept(frame, new) or None})
        status, sizes = (200, []) if stored is None else (201, [stored.size_bytes])
        replies.append(
            changes.Reply(status=status, body=body, jobs=jobs, frame_bytes=sizes, had_room=arrival.had_room)
        )
    return replies


def _list_kept(frame: FrameRow, new: NewFrame) -> list[str]:
    """Return what was stated with a file otherwise than it stands of its frame."""
    stands = {"role": frame.role, "scene": frame.scene, "roi": frame.roi_id, **frame.supplied}
    stated = {"role": new.role, "scene": new.scene, "roi": new.roi_id, **new.supplied}
    return [name for name, said in stated.items() if said not in {None, stands.get(name)}]


def _plain_name(filename: str) -> str:
    """Return the last part of a path, without control characters, no longer than file systems take."""
    name = "".join(c for c in filename.replace("\\", "/").rpartition("/")[2] if c.isprintable())
    if len(name) > _LONGEST_NAME:
        suffix = PurePosixPath(name).suffix
        extension = suffix if len(suffix) <= _LONGEST_EXTENSION else ""
        name = name[: _LONGEST_NAME - len(extension)] + extension
    return name if name.strip(". ") else "unnamed"
