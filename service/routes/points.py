"""Points of a luminance campaign from a table, where the raw files are gone."""

import hashlib
import json
from collections.abc import Mapping
from typing import Annotated, Final

from fastapi import Depends, Query, Request, Response
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.findings import interface, shared
from radiometry.methods import get_method
from service.auth import Uploader
from service.changes import Reply, Writes
from service.frame_uploads import admit
from service.lookup import Id, owned
from service.operations import Router
from service.points_csv import read_points
from service.problems import Problem, invalid
from service.routes import problems
from service.schemas.points import AddedPoint, NewPoint, PointsAnswer, PointsTable
from service.sheets import is_table
from store.jobs import enqueue_extraction
from store.queries.campaigns import Drawing, find_or_add_roi
from store.queries.frames import NewFrame, find_or_add_frames, require_role, whole_frame
from store.tables import Campaign, FrameRow

router = Router(prefix="/v1", tags=["frames"])

_BYTES: Final = "application/octet-stream"
"""Accepted too: generated clients know no bodies of CSV."""
_TABLE: Final = {
    "text/csv": {"schema": {"type": "string"}},
    _BYTES: {"schema": {"type": "string", "format": "binary"}},
}
_SETTINGS: Final = ("exposure_time_s", "f_number", "iso")


async def _body(request: Request, _caller: Uploader) -> bytes:
    return await request.body()


@router.post(
    "/campaigns/{campaign_id}/points",
    status_code=201,
    response_model=PointsAnswer,
    responses={
        200: {"model": PointsAnswer, "description": "The campaign has these rows already."},
        **problems(400, 404, 409, 429, 507),
    },
    openapi_extra={"requestBody": {"required": True, "content": _TABLE}},
)
def add_points(
    campaign_id: Id,
    told: Annotated[PointsTable, Query()],
    caller: Uploader,
    request: Request,
    data: Annotated[bytes, Depends(_body)],
    writing: Writes,
) -> Response:
    """Add frames of a luminance campaign as rows of a table: statistics without pixels.

    The columns are filename, scene, dark (yes or no), exposure_time_s, f_number, iso, mean_dn, min_dn,
    max_dn, std_dn and pixels, or those of ImageJ's Results with scene and settings added. A wrong row is
    named with its line and column, and nothing is stored.
    """
    with writing.context.database.reading() as session:
        owned(session, Campaign, campaign_id, caller)
    if not is_table(request) and request.headers.get("content-type") != _BYTES:
        raise Problem(interface.BAD_REQUEST, "Send the table with Content-Type: text/csv.")
    points, ignored = read_points(data, told)
    context, rows = writing.context, [_write_row(point, told) for point in points]
    hashes = {
        point.filename: hashlib.sha256(row).hexdigest() for point, row in zip(points, rows, strict=True)
    }
    admit(context, campaign_id, caller, None, sum(map(len, rows)), role=points[0].role)
    with context.database.reading() as session:
        _refuse(owned(session, Campaign, campaign_id, caller), session, hashes)
    blobs = []
    for row in rows:
        with context.blobs.writer() as writer:
            writer.write(row)
            blobs.append(writer.commit())

    def change(session: Session) -> Reply:
        campaign = owned(session, Campaign, campaign_id, caller)
        require_role(campaign, points[0].role)
        pixel = whole_frame(1, 1)
        roi = find_or_add_roi(session, caller.organisation_id, Drawing(polygon=pixel, corners=pixel.points))
        frames = [
            NewFrame(
                blob=blob,
                filename=point.filename,
                role=point.role,
                scene=point.scene,
                roi_id=roi.id,
                supplied={name: getattr(point, name) for name in _SETTINGS},
            )
            for point, blob in zip(points, blobs, strict=True)
        ]
        found = find_or_add_frames(session, [(campaign, frame) for frame in frames])
        jobs = [
            enqueue_extraction(session, frame, caller.organisation_id, by=caller.key_id, is_new=is_new)
            for frame, is_new, to_read in found
            if to_read
        ]
        items = [AddedPoint.restate(frame, frame_id=frame.id) for frame, *_ in found]
        new = [len(row) for row, (_, is_new, _) in zip(rows, found, strict=True) if is_new]
        body = PointsAnswer(items=items, ignored_columns=ignored)
        return Reply(status=201 if new else 200, body=body, jobs=jobs, frame_bytes=new)

    return writing.run(caller, change)


def _write_row(point: NewPoint, told: PointsTable) -> bytes:
    """Return the row as its frame's file: the same row is the same file."""
    levels = told.model_dump(include={"white_level_dn", "black_level_dn"}, exclude_none=True)
    row = point.model_dump(exclude_none=True) | levels | {"pixels": int(point.pixels)}
    return json.dumps({"stilb_row": 1, **row}, ensure_ascii=False).encode()


def _refuse(campaign: Campaign, session: Session, hashes: Mapping[str, str]) -> None:
    """Refuse a method that needs pixels, and a row that the campaign has with other values."""
    spec = get_method(campaign.method)
    if spec.features is not None or spec.reference != "meter":
        raise shared.PIXELS_MISSING.refuse(f"A campaign of {spec.label.lower()} needs pixels, not a table.")
    known = select(FrameRow.filename, FrameRow.sha256).where(
        FrameRow.campaign_id == campaign.id,
        FrameRow.withdrawn_at.is_(None),
        FrameRow.filename.in_(hashes),
    )
    errors = [
        {
            "type": "csv",
            "loc": (f"line {list(hashes).index(name) + 2}", "filename"),
            "msg": f"the campaign has {name} with other values: withdraw that frame first",
        }
        for name, sha256 in session.execute(known)
        if hashes[name] != sha256
    ]
    if errors:
        raise invalid(errors)
