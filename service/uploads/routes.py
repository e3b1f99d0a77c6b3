"""Uploads that go on where they were cut (tus 1.0.0), and files that need not be sent."""

import json
import re
import secrets
import time
from collections.abc import Callable, Iterable
from typing import Annotated, Any, Final

from fastapi import Request, Response
from pydantic import Field
from sqlalchemy.orm import Session
from starlette.concurrency import run_in_threadpool

from radiometry.findings import interface
from service.campaigns.schemas import Role
from service.frames.schemas import Upload
from service.http import answers, changes, lookup, models, operations, problems
from service.http.auth import Caller, Uploader
from service.http.context import Context, UsesContext
from service.measurements.requests import read_region
from service.uploads import frames, tus
from store.blobs import StoredBlob
from store.blobs.partials import LASTS_S, Facts, FactsTooLong, Partial
from store.queries import group_by, organisations
from store.queries.campaigns import find_known, find_known_anywhere, read_sizes
from store.queries.jobs import find_reading_jobs
from store.tables import Campaign, FrameRow, campaign

MOST_HASHES = 1000


class HashesAsked(models.Form):
    sha256: Annotated[list[models.Sha256], Field(min_length=1, max_length=MOST_HASHES)]


class KnownFrame(models.Answer, restates=FrameRow, fields="sha256 filename scene campaign_id"):
    """A frame that is there, with its statements: a sender sees whether it means the same."""

    frame_id: str
    job_id: str | None = models.maybe("The newest job that reads it.")
    role: Role
    state: campaign.FrameState = models.told("A refused one may be sent again: it is then read again.")


class KnownAnswer(models.Answer):
    known: list[KnownFrame]
    unknown: list[str] = models.told("To be sent. In the order asked, each once.")


router = operations.Router(prefix="/v1/uploads", tags=["uploads"])

_MOST_UNDER_WAY: Final = 10_000
_OF_THE_FILE: Final = ("campaign_id", "size_bytes", "sha256", "said")
_ADDRESS: Final = re.compile(r"upl_([0-9A-Za-z]+)_([0-9a-f]{64})", re.ASCII)

_PIECE = {
    "requestBody": {
        "description": "The bytes from `Upload-Offset` on.",
        "content": {tus.PIECE: {"schema": {"type": "string", "format": "binary"}}},
    }
}
_STATED = {
    "Location": "Of a new upload: its address.",
    "Tus-Resumable": "The protocol's version.",
    "Upload-Offset": "How many bytes of the file are durable.",
    "Upload-Length": "How many it will have.",
    "Upload-Expires": "When what has arrived is forgotten.",
    "Content-Location": "The frame that a finished upload has become.",
    "Link": "Of a finished upload, as `status`: the job that reads its frame.",
}


def _states(description: str) -> dict[str, Any]:
    headers = {name: {"description": text, "schema": {"type": "string"}} for name, text in _STATED.items()}
    return {"description": description, "headers": headers}


@router.options("", status_code=204, response_class=Response, responses={204: _states("What is understood.")})
def describe_uploads() -> Response:
    """State which version and extensions of tus the service understands."""
    headers = {
        "Tus-Resumable": tus.TUS,
        "Tus-Version": tus.TUS,
        "Tus-Extension": "creation,creation-with-upload,checksum,expiration,termination",
        "Tus-Checksum-Algorithm": "sha256",
        "Tus-Max-Size": str(frames.MAX_FILE_BYTES),
    }
    return Response(status_code=204, headers=headers)


@router.post(
    "",
    status_code=201,
    response_class=Response,
    responses={
        201: _states("Begun; `Location` is its address."),
        **answers.problems(400, 404, 409, 412, 413, 415, 460, 507),
    },
    openapi_extra=_PIECE,
)
async def begin_upload(
    request: Request,
    caller: Uploader,
    context: UsesContext,
    idempotency_key: changes.IdempotencyKey = None,
    *,
    headers: tus.UsesHeaders,
) -> Response:
    """Begin an upload that can go on after a cut; bytes may come along.

    The address in `Location` is a capability: whoever has it sends the rest without a key, also when the
    session that began it is over, as long as its key is in force.
    """
    tus.check_protocol(headers)
    size_bytes = tus.read_count(headers.length, "Upload-Length")
    frames.require_size(size_bytes)
    said = tus.read_metadata(headers.metadata)
    frame = tus.read_said(said)
    address, partial = await run_in_threadpool(
        _begin, context, caller, frame, said, size_bytes, idempotency_key
    )
    if tus.is_piece(request):
        await tus.append(request, partial, 0, headers.checksum)
    begun = await _finish_if_whole(context, partial, 201)
    begun.headers["Location"] = f"/v1/uploads/{address}"
    return begun


@router.head(
    "/{upload_id}",
    response_class=Response,
    responses={200: _states("How far it is."), **answers.problems(*answers.USUAL, 404, 409, 507)},
)
async def get_upload(upload_id: lookup.Id, request: Request, context: UsesContext) -> Response:
    """State how many bytes are durable; whoever still sends to this upload is ended."""
    partial = await run_in_threadpool(_find, context, request, upload_id)
    await run_in_threadpool(_end_writer, partial)
    return await _finish_if_whole(context, partial, 200)


@router.patch(
    "/{upload_id}",
    status_code=204,
    response_class=Response,
    responses={
        204: _states("Kept."),
        **answers.problems(*answers.USUAL, 400, 404, 409, 412, 413, 415, 460, 507),
    },
    openapi_extra=_PIECE,
)
async def append_to_upload(
    upload_id: lookup.Id, request: Request, context: UsesContext, headers: tus.UsesHeaders
) -> Response:
    """Send the next bytes. What has arrived when the connection is cut is kept.

    The last byte makes a frame of the file. `Content-Location` names it, and `Link` the job that reads it.
    """
    partial = await run_in_threadpool(_find, context, request, upload_id)
    tus.check_protocol(headers)
    if not tus.is_piece(request):
        raise problems.Problem(interface.UPLOAD_TYPE, f"Send a piece with Content-Type: {tus.PIECE}.")
    begins = tus.read_count(headers.offset, "Upload-Offset")
    await tus.append(request, partial, begins, headers.checksum)
    return await _finish_if_whole(context, partial, 204)


@router.delete(
    "/{upload_id}", status_code=204, response_class=Response, responses=answers.problems(*answers.USUAL, 404)
)
def end_upload(upload_id: lookup.Id, request: Request, context: UsesContext) -> Response:
    """End an upload and forget what has arrived; the frame of a finished one stays."""
    _find(context, request, upload_id).remove()
    return Response(status_code=204, headers={"Tus-Resumable": tus.TUS})


def _begin(
    context: Context,
    caller: Caller,
    frame: tus.FrameSaid,
    said: dict[str, str],
    size_bytes: int,
    idempotency_key: str | None,
) -> tuple[str, Partial]:
    facts = Facts(
        organisation_id=caller.organisation_id,
        key_id=caller.key_id,
        campaign_id=frame.campaign_id,
        size_bytes=size_bytes,
        sha256=frame.sha256,
        said={name: value for name, value in said.items() if name not in {"campaign_id", "sha256"}},
        expires_at=time.time() + LASTS_S,
    )
    text = idempotency_key or secrets.token_hex(32)
    token = context.sessions.upload_token(f"{caller.organisation_id}:{text}")
    partials, organisation_id = context.partials, caller.organisation_id
    if not partials.is_under_way(token, organisation_id):
        if (under_way := partials.count(organisation_id)) >= _MOST_UNDER_WAY:
            detail = f"Your organisation has {under_way} unfinished uploads. Finish or end some."
            raise problems.Problem(interface.TOO_MANY_UPLOADS, detail, headers={"Retry-After": "60"})
        file = (frame.campaign_id, caller, frame.sha256, size_bytes)
        try:
            frames.admit(context, *file, role=frame.role, begin=lambda: partials.begin(token, facts))
        except FactsTooLong:
            raise problems.wrong("header.Upload-Metadata", "is too long") from None
    if (partial := partials.find(token, organisation_id)) is None:
        raise problems.not_found("upload")
    kept = partial.read_facts()
    if any(getattr(kept, name) != getattr(facts, name) for name in _OF_THE_FILE):
        detail = "This Idempotency-Key was used for another request. Use a new one for each new request."
        raise problems.Problem(interface.IDEMPOTENCY_KEY_REUSED, detail)
    return f"upl_{caller.organisation_id.removeprefix('org_')}_{token}", partial


def _end_writer(partial: Partial) -> None:
    with partial.claim():
        pass


def _find(context: Context, request: Request, upload_id: str) -> Partial:
    """Return the upload of an address. A key need not come along; one of others finds nothing."""
    match = _ADDRESS.fullmatch(upload_id)
    partial = context.partials.find(match[2], f"org_{match[1]}") if match else None
    if partial is None:
        detail = "There is no such upload: it was ended, or it has expired. Begin it again."
        raise problems.Problem(interface.NOT_FOUND, detail)
    caller = _find_caller(context, partial.read_facts())
    scheme, _, secret = request.headers.get("authorization", "").partition(" ")
    if scheme.lower() == "bearer":
        with context.database.reading() as session:
            sent = organisations.find_key(session, secret.strip())
        if sent is None or sent[1].id != caller.organisation_id:
            raise problems.not_found("upload")
    return partial


def _find_caller(context: Context, facts: Facts) -> Caller:
    """Return who began an upload, if the key is still in force and may upload."""
    with context.database.reading() as session:
        found = organisations.find_key_by_id(session, facts.key_id)
    if found is None:
        raise problems.not_found("upload")
    return Caller.holding(*found)


async def _finish_if_whole(context: Context, partial: Partial, status: int) -> Response:
    """Make a frame of a file whose last byte is there; what fails on the way is tried again by who asks."""
    try:
        facts, blob = await run_in_threadpool(_store_if_whole, context, partial)
        if blob is not None:
            await _make_frame(context, partial, facts, blob)
            facts = await run_in_threadpool(partial.read_facts)
    except FileNotFoundError:
        raise problems.not_found("upload") from None
    return await run_in_threadpool(tus.answer, partial, facts, status)


def _store_if_whole(context: Context, partial: Partial) -> tuple[Facts, StoredBlob | None]:
    if partial.read_offset() < partial.read_facts().size_bytes:
        return partial.read_facts(), None
    with partial.whole() as (facts, pieces):
        if facts.frame_id:
            return facts, None
        with context.blobs.writer() as writer:
            for piece in pieces:
                writer.write(piece)
            if facts.sha256 in {None, writer.sha256}:
                return facts, writer.commit()
        partial.restart()
    again = "Send it again from the start."
    raise frames.differs(writer, facts.sha256, again, **{"Upload-Offset": "0"})


async def _make_frame(context: Context, partial: Partial, facts: Facts, blob: StoredBlob) -> None:
    upload = Upload.model_validate(facts.said)
    answer = await frames.keep_frame(
        context,
        changes.Writing(context, None, ""),
        await run_in_threadpool(_find_caller, context, facts),
        facts.campaign_id,
        upload=upload,
        region=read_region(upload.roi) if upload.roi is not None else None,
        blob=blob,
        had_room=True,
    )
    frame = json.loads(bytes(answer.body))
    await run_in_threadpool(partial.become, frame["id"], frame.get("job_id", ""))


known_router = operations.Router(prefix="/v1", tags=["frames"])


@known_router.post("/uploads/known", response_model=KnownAnswer)
def ask_known(
    body: HashesAsked, caller: Uploader, context: UsesContext, _idempotency_key: changes.IdempotencyKey = None
) -> Response:
    """Ask by hash which files are stored whole, and in which campaigns.

    Nothing is stored: asked again it answers as things stand then, whatever the `Idempotency-Key`.
    """
    return _answer(
        context, body, lambda session: find_known_anywhere(session, caller.organisation_id, body.sha256)
    )


@known_router.post("/campaigns/{campaign_id}/frames/known", response_model=KnownAnswer)
def ask_known_frames(
    campaign: lookup.Own[Campaign],
    body: HashesAsked,
    _caller: Uploader,
    context: UsesContext,
    _idempotency_key: changes.IdempotencyKey = None,
) -> Response:
    """Ask by hash which files the campaign has, so that only the others are sent.

    Nothing is stored: asked again it answers as things stand then, whatever the `Idempotency-Key`.
    """
    return _answer(context, body, lambda session: find_known(session, campaign, body.sha256).values())


def _answer(context: Context, body: HashesAsked, find: Callable[[Session], Iterable[FrameRow]]) -> Response:
    with context.database.reading() as session:
        found = list(find(session))
        sizes = read_sizes(session, {frame.sha256 for frame in found})
        jobs = find_reading_jobs(session, [frame.id for frame in found])
    absent = context.files.find_absent(sizes)
    whole = group_by([frame for frame in found if frame.sha256 not in absent], lambda frame: frame.sha256)
    asked = dict.fromkeys(body.sha256)
    return KnownAnswer(
        known=[
            KnownFrame.restate(frame, frame_id=frame.id, job_id=jobs.get(frame.id))
            for each in asked
            for frame in whole.get(each, ())
        ],
        unknown=[each for each in asked if each not in whole],
    ).respond()
