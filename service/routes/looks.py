"""Region previews that the pages request during drawing and upload; nothing is recorded."""

from collections.abc import Mapping
from typing import Annotated

from fastapi import Query, Request, Response
from pydantic import Field
from sqlalchemy.orm import Session

from radiometry.findings import InputRejected, shared
from radiometry.frame.grid import describe_lanes
from radiometry.frame.roi import Polygon, bounding_window
from radiometry.frame.verdicts import Verdict
from radiometry.methods import get_method
from radiometry.specification.application import SurfaceApplication
from service.auth import Reader
from service.changes import Reply, Writes
from service.context import UsesContext
from service.immutable import not_modified, standing_headers
from service.lookup import Id, owned
from service.operations import Router
from service.regions import read_grid
from service.routes import problems, sends_stored_file
from service.routes.frames import require_header, require_preview
from service.routes.tools import stateless
from service.schemas.base import Answer, Form
from service.schemas.campaigns import Point
from service.schemas.findings import FindingGroupAnswer, group_flags
from service.schemas.frames import VerdictAnswer
from service.schemas.jobs import JobAnswer
from service.schemas.measured_parts import FlagAnswer
from service.schemas.measurements import NewGrid
from service.thumbnails import WIDEST_PX, draw_thumbnail, tag_of
from store import jobs
from store.codec import encode
from store.queries.frames import current_roi
from store.tables import Campaign, FrameRow


class NewLook(Form):
    """Corners of a region that is not set yet."""

    polygon: Annotated[
        list[Point],
        Field(min_length=3, max_length=1000, description="Corners [x, y] in pixels, x right, y down."),
    ]


class GridLook(Answer):
    """A grid as it would be measured."""

    corners: list[list[float]] = Field(description="[x, y] in pixels of the field between two luminaires.")
    rows: int
    columns: int
    point_u_m: float | None = Field(
        default=None, description="Of lanes: largest standard uncertainty of a point's place on the road."
    )
    flags: list[FlagAnswer]
    findings: list[FindingGroupAnswer] = Field(description="The flags, equal ones as one.")


class FrameVerdict(VerdictAnswer):
    frame_id: str


class VerdictsAnswer(Answer):
    items: list[FrameVerdict]

    @classmethod
    def of(cls, verdicts: Mapping[str, Verdict]) -> "VerdictsAnswer":
        return cls(
            items=[
                FrameVerdict.restate(verdicts[frame_id], frame_id=frame_id) for frame_id in sorted(verdicts)
            ]
        )


router = Router(prefix="/v1", tags=["frames"])


@router.post(
    "/frames/{frame_id}/region", status_code=202, response_model=JobAnswer, responses=problems(404, 409)
)
def look_at_region(frame_id: Id, body: NewLook, caller: Reader, writing: Writes) -> Response:
    """Preview a region without setting it. The job's result holds its statistics, histogram and clipping.

    `histogram`: counts per channel, bin i from first_dn + i * step_dn. `clipping`: the cells of cell_px
    pixels from (row0_px, col0_px) that hold samples at the white level, with the share of such pixels.
    """
    polygon = Polygon.from_points(body.polygon)

    def change(session: Session) -> Reply:
        frame = owned(session, FrameRow, frame_id, caller)
        header = require_header(frame)
        bounding_window(polygon, height_px=header["height_px"], width_px=header["width_px"])
        job = jobs.enqueue(
            session,
            kind="extract",
            subject_id=frame.id,
            organisation_id=caller.organisation_id,
            by=caller.key_id,
            parameters={"polygon": [list(point) for point in polygon.points]},
            lane=jobs.PREVIEW_LANE,
        )
        session.flush()
        return Reply(
            status=202, body=JobAnswer.of(job, frame), headers={"Location": f"/v1/jobs/{job.id}"}, jobs=[job]
        )

    return writing.run(caller, change)


@router.post(
    "/frames/{frame_id}/grid", response_model=GridLook, responses=problems(404), dependencies=stateless
)
def look_at_grid(frame_id: Id, body: NewGrid, caller: Reader, context: UsesContext) -> Response:
    """Preview a grid without measuring it, with the flags that its corners would raise."""
    with context.database.reading() as session:
        frame = owned(session, FrameRow, frame_id, caller)
        application = get_method(session.get_one(Campaign, frame.campaign_id).method).application
    if not isinstance(application, SurfaceApplication):
        raise InputRejected(shared.OPTION_NOT_OF_METHOD, "Frames of this method are measured without a grid.")
    grid, lanes = read_grid(body)
    header = require_header(frame)
    size = {"height_px": header["height_px"], "width_px": header["width_px"]}
    bounding_window(application.outline(grid), **size)
    flags = [encode(flag) for flag in application.check_grid(grid, **size)]
    return GridLook(
        corners=[list(corner) for corner in grid.corners],
        rows=grid.rows,
        columns=grid.columns,
        point_u_m=describe_lanes(lanes)["point_u_m"] if lanes else None,
        flags=[FlagAnswer.model_validate(flag) for flag in flags],
        findings=group_flags(flags),
    ).respond()


@router.get("/campaigns/{campaign_id}/verdicts", response_model=VerdictsAnswer, responses=problems(404))
def list_verdicts(campaign_id: Id, caller: Reader, context: UsesContext) -> Response:
    """The verdict on every frame of a campaign, in one answer: to be asked again while frames arrive."""
    with context.database.reading() as session:
        campaign = owned(session, Campaign, campaign_id, caller)
        review = context.reviews.find(session, campaign.id, verdicts_of=None)
        return VerdictsAnswer.of(review.verdicts).respond()


@router.get(
    "/frames/{frame_id}/thumbnail.png", response_class=Response, responses=sends_stored_file("image/png")
)
def get_frame_thumbnail(
    frame_id: Id,
    request: Request,
    caller: Reader,
    context: UsesContext,
    side_px: Annotated[int, Query(ge=32, le=WIDEST_PX, description="Longest side.")] = WIDEST_PX,
) -> Response:
    """A picture for lists, at most 320 px wide and 40 kB, with the region that holds for the frame."""
    with context.database.reading() as session:
        frame = owned(session, FrameRow, frame_id, caller)
        roi = current_roi(session, frame, session.get_one(Campaign, frame.campaign_id))
    preview_sha256 = require_preview(frame)
    tag = f"{tag_of(preview_sha256, roi.id if roi else None)}-{side_px}"
    headers = standing_headers(tag)
    unchanged = not_modified(request, tag, headers)
    if unchanged is not None:
        return unchanged
    _, pieces = context.files.open(preview_sha256)
    png = draw_thumbnail(b"".join(pieces), (frame.header or {})["width_px"], roi, side_px)
    return Response(png, headers=headers, media_type="image/png")
