"""Uploaded files on their way into a campaign: whether there is room, and the frame that each becomes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import PurePosixPath
from typing import Final

from fastapi import Response
from sqlalchemy.orm import Session
from starlette.concurrency import run_in_threadpool

from service.auth import Caller
from service.changes import REPLAYED, Reply, Writing, run_all
from service.context import Context
from service.frame_answers import answer_write
from service.lookup import owned
from service.regions import read_roi
from service.schemas.campaigns import NewRoi
from service.schemas.frames import Upload
from store.blobs import StoredBlob
from store.jobs import enqueue_extraction
from store.queries.campaigns import Drawing, find_known, find_or_add_roi
from store.queries.frames import NewFrame, find_or_add_frames, require_role
from store.queries.usage import QuotaExceeded, check_room, recount_if_old
from store.tables import Campaign

_LONGEST_NAME: Final = 255
"""As on file systems, some of which count bytes."""
_LONGEST_EXTENSION: Final = 20


@dataclass(frozen=True)
class _Arrival:
    """A frame whose file is stored, on its way into a campaign; its own region, if it has one."""

    campaign_id: str
    new: NewFrame
    drawing: Drawing | None
    had_room: bool


def admit(
    context: Context,
    campaign_id: str,
    caller: Caller,
    sha256: str | None,
    size_bytes: int,
    *,
    role: str,
    begin: Callable[[], object] | None = None,
) -> bool:
    """Refuse a role that the campaign does not take, and a file without room that it does not have already.

    False where there is none and the file is not known yet. ``begin`` : takes the room that was found
    """
    keeps = begin is not None and context.quotas.limits_files

    def check() -> bool:
        database, by = context.database, (caller.key_id, caller.organisation_id)
        with database.writing(*by) if keeps else database.reading() as session:
            campaign = owned(session, Campaign, campaign_id, caller)
            require_role(campaign, role)
            try:
                check_room(
                    session,
                    caller.organisation_id,
                    context.quotas,
                    context.partials,
                    size_bytes=size_bytes,
                    keep=keeps,
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
    writing: Writing,
    caller: Caller,
    campaign_id: str,
    *,
    upload: Upload,
    region: NewRoi | None,
    blob: StoredBlob,
    had_room: bool = False,
) -> Response:
    """Make a stored file a frame of a campaign, or find the one that it is already.

    ``had_room`` : since its upload began
    """
    new = NewFrame(
        blob=blob,
        filename=_plain_name(upload.filename or f"{blob.sha256[:12]}.bin"),
        role=upload.role,
        scene=upload.scene,
        roi_id=None,
        supplied=upload.supplied(),
    )
    arrival = _Arrival(campaign_id, new, read_roi(region) if region else None, had_room)
    answer = await context.together.do(
        caller.key_id,
        (writing.with_content(blob.sha256), arrival),
        lambda requests: run_all(caller, requests, partial(_add_frames, caller)),
    )
    if REPLAYED in answer.headers:
        # nothing was done for it, but also this upload has brought the bytes again
        await run_in_threadpool(context.files.heal, blob)
    return answer


def _add_frames(caller: Caller, session: Session, arrivals: Sequence[_Arrival]) -> list[Reply]:
    arrived = []
    for each in arrivals:
        campaign = owned(session, Campaign, each.campaign_id, caller)
        # again: it may have become a night since the upload began
        require_role(campaign, each.new.role)
        roi = find_or_add_roi(session, caller.organisation_id, each.drawing) if each.drawing else None
        arrived.append((campaign, replace(each.new, roi_id=roi.id if roi else None)))
    replies = []
    for arrival, (campaign, new), (frame, is_new, to_read) in zip(
        arrivals, arrived, find_or_add_frames(session, arrived), strict=True
    ):
        by = caller.key_id
        jobs = (
            [enqueue_extraction(session, frame, caller.organisation_id, by=by, is_new=is_new)]
            if to_read
            else []
        )
        stored = new.blob if is_new else None
        body = answer_write(session, frame, campaign, jobs, stored=stored)
        status, sizes = (200, []) if stored is None else (201, [stored.size_bytes])
        replies.append(
            Reply(status=status, body=body, jobs=jobs, frame_bytes=sizes, had_room=arrival.had_room)
        )
    return replies


def _plain_name(filename: str) -> str:
    """The last part of a path, without control characters: a name is data, never an address.

    Of one that is longer than file systems take, the end of the stem is left out.
    """
    name = "".join(c for c in filename.replace("\\", "/").rpartition("/")[2] if c.isprintable())
    if len(name) > _LONGEST_NAME:
        suffix = PurePosixPath(name).suffix
        extension = suffix if len(suffix) <= _LONGEST_EXTENSION else ""
        name = name[: _LONGEST_NAME - len(extension)] + extension
    return name if name.strip(". ") else "unnamed"
