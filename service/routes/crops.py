"""Crops: parts of a frame as pictures of its very pixels, drawn when they are asked for."""

from typing import Annotated, Self

from fastapi import Request, Response
from pydantic import Field, model_validator
from sqlalchemy.orm import Session

from radiometry.findings import shared
from service.auth import Reader
from service.changes import Reply, Writes
from service.context import UsesContext
from service.immutable import immutable_headers, not_modified
from service.lookup import Id, owned
from service.operations import Router
from service.routes import problems, sends_file
from service.routes.frames import require_header
from service.schemas.base import WHOLE, Form, Number
from service.schemas.jobs import JobAnswer
from store import jobs
from store.queries.campaigns import find_crop_job, say_asked
from store.tables import Crop, FrameRow

MOST_SIDE_PX = 1024

_Start = Annotated[int, Field(ge=0, le=65_535, strict=True), WHOLE]
_Side = Annotated[int, Field(ge=1, le=MOST_SIDE_PX, strict=True), WHOLE]
_Level = Annotated[Number, Field(ge=0, le=65_535)]


class NewCrop(Form):
    """A window of the frame, and the range of raw values that its grey scale shows."""

    row0_px: _Start = Field(description="First row, from the top.")
    col0_px: _Start = Field(description="First column, from the left.")
    height_px: _Side
    width_px: _Side
    low_dn: _Level | None = Field(
        default=None, description="Shown black. Default: the black level, or what is darker in the window."
    )
    high_dn: _Level | None = Field(
        default=None, description="Shown white. Default: the window's brightest but a thousandth."
    )

    @model_validator(mode="after")
    def _range_is_one(self) -> Self:
        if self.low_dn is not None and self.high_dn is not None and self.low_dn >= self.high_dn:
            raise ValueError("high_dn must be above low_dn")
        return self


router = Router(prefix="/v1", tags=["frames"])


@router.post(
    "/frames/{frame_id}/crops",
    status_code=202,
    response_model=JobAnswer,
    responses={
        200: {"model": JobAnswer, "description": "The picture is there already: the job that drew it."},
        **problems(404, 409, 422),
    },
)
def draw_crop(frame_id: Id, body: NewCrop, caller: Reader, writing: Writes) -> Response:
    """Draw a part of a frame, one pixel for each of the sensor's, with clipped pixels in red.

    The job's result holds the address of the picture (`picture`, PNG), its place in the frame, the raw values
    shown black and white, and how many pixels are clipped. A mosaic is shown as it is: nothing is
    interpolated. The newest 32 crops of an organisation are kept.
    """
    window = (body.row0_px, body.col0_px, body.height_px, body.width_px)

    def change(session: Session) -> Reply:
        frame = owned(session, FrameRow, frame_id, caller)
        header = require_header(frame)
        if window[0] + window[2] > header["height_px"] or window[1] + window[3] > header["width_px"]:
            raise shared.ROI_OUTSIDE_FRAME.refuse(
                f"The crop leaves the {header['width_px']} x {header['height_px']} pixels of the image."
            )
        kept = find_crop_job(session, frame, say_asked(window, body.low_dn, body.high_dn))
        if kept is not None:
            return Reply(status=200, body=JobAnswer.of(kept, frame))
        job = jobs.enqueue(
            session,
            kind="extract",
            subject_id=frame.id,
            organisation_id=caller.organisation_id,
            by=caller.key_id,
            parameters={"window": list(window), "low_dn": body.low_dn, "high_dn": body.high_dn},
            lane=jobs.PREVIEW_LANE,
        )
        session.flush()
        return Reply(
            status=202, body=JobAnswer.of(job, frame), headers={"Location": f"/v1/jobs/{job.id}"}, jobs=[job]
        )

    return writing.run(caller, change)


@router.get(
    "/crops/{crop_id}.png", response_class=Response, responses={**sends_file("image/png"), **problems(404)}
)
def get_crop(crop_id: Id, request: Request, caller: Reader, context: UsesContext) -> Response:
    """The picture of a crop, while it is among the newest of your organisation; 404 then: draw it again."""
    with context.database.reading() as session:
        found = owned(session, Crop, crop_id, caller)
        return not_modified(request, crop_id) or Response(
            found.png, headers=immutable_headers(found.id), media_type="image/png"
        )
