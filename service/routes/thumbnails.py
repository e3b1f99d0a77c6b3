"""Thumbnails of many frames of a campaign in one answer."""

import base64
import hashlib
import logging
from contextlib import suppress
from typing import Annotated

from fastapi import Query, Request, Response
from pydantic import Field, StringConstraints
from sqlalchemy import select
from sqlalchemy.exc import SQLAlchemyError

from service.auth import Reader
from service.context import Context, UsesContext
from service.immutable import immutable_headers, not_modified, standing_headers
from service.lookup import Id, owned
from service.operations import Router
from service.routes import UNCHANGED, problems
from service.schemas.base import Answer
from service.thumbnails import draw_light_thumbnail, tag_of
from store.blobs import BlobDamaged
from store.database import summarise
from store.files import find_small_previews, keep_small_previews, reduce_preview
from store.queries.frames import region_ids
from store.tables import Campaign, FrameRow, Roi

log = logging.getLogger(__name__)

MOST_THUMBNAILS = 100

_Wanted = Annotated[str, StringConstraints(max_length=60, pattern=r"^[A-Za-z0-9_]+(\.[0-9a-f]{8})?$")]


class ThumbnailAnswer(Answer):
    frame_id: str
    tag: str = Field(description="As in the grid's column `thumbnail`.")
    picture: str = Field(
        description="WebP of at most 40 kB, in base64.",
        json_schema_extra={"contentEncoding": "base64", "contentMediaType": "image/webp"},
    )


class ThumbnailsAnswer(Answer):
    """Frames that have no picture are left out."""

    items: list[ThumbnailAnswer]


router = Router(prefix="/v1/campaigns/{campaign_id}", tags=["frames"])


@router.get("/thumbnails", response_model=ThumbnailsAnswer, responses={**UNCHANGED, **problems(404)})
def list_thumbnails(
    campaign_id: Id,
    request: Request,
    caller: Reader,
    context: UsesContext,
    of: Annotated[
        list[_Wanted],
        Query(
            min_length=1,
            max_length=MOST_THUMBNAILS,
            description="A frame's id, or its id, a full stop and its tag in the grid's column `thumbnail`.",
        ),
    ],
) -> Response:
    """Return the thumbnails of up to 100 frames, at most 160 px wide and high, with the region that holds.

    If every frame is named with its current tag, the answer never changes and is cached. Otherwise it has an
    ETag and is asked for again.
    """
    named = dict(each.partition(".")[::2] for each in of)
    with context.database.reading() as session:
        campaign = owned(session, Campaign, campaign_id, caller)
        chosen = select(FrameRow).where(FrameRow.campaign_id == campaign_id, FrameRow.id.in_(named))
        frames = {frame.id: frame for frame in session.scalars(chosen) if frame.preview_sha256}
        regions = region_ids(session, campaign, frames.values())
        held = {region for region in regions.values() if region}
        rois = {roi.id: roi for roi in session.scalars(select(Roi).where(Roi.id.in_(held)))}
    tags = {each: tag_of(frame.preview_sha256, regions[each]) or "" for each, frame in frames.items()}
    tag = hashlib.sha256(repr(sorted(tags.items())).encode()).hexdigest()
    headers = immutable_headers(tag) if tags == named else standing_headers(tag)
    unchanged = not_modified(request, tag, headers)
    if unchanged is not None:
        return unchanged
    small = _find_small(context, {frame.preview_sha256 or "" for frame in frames.values()})
    items = []
    for frame_id in (each for each in named if each in frames):
        frame, roi = frames[frame_id], rois.get(regions[frame_id] or "")
        preview = small.get(frame.preview_sha256 or "")
        if preview is None:
            # it is damaged, and will be drawn again by the worker: an answer without it is not kept
            headers = {"Cache-Control": "no-store"}
            continue
        picture = draw_light_thumbnail(preview, (frame.header or {})["width_px"], roi)
        encoded = base64.b64encode(picture).decode()
        items.append(ThumbnailAnswer(frame_id=frame_id, tag=tags[frame_id], picture=encoded))
    answer = ThumbnailsAnswer(items=items).respond()
    answer.headers.update(headers)
    return answer


def _find_small(context: Context, hashes: set[str]) -> dict[str, bytes]:
    """Return small previews by the hash of theirs; those of frames that an older stilb has read are made."""
    with context.database.reading() as session:
        found = find_small_previews(session, hashes)
    made = {}
    for sha256 in sorted(hashes - found.keys()):
        with suppress(BlobDamaged):
            made[sha256] = reduce_preview(b"".join(context.files.open(sha256)[1]))
    if made:
        try:
            with context.database.writing("thumbnails") as session:
                keep_small_previews(session, made)
        except SQLAlchemyError as error:
            log.warning("%d small previews are not kept: %s", len(made), summarise(error))
    return found | made
