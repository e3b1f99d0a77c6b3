"""Pictures of frames: region previews, crops and thumbnails."""

import base64
import hashlib
import io
import logging
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import Annotated, Final

from fastapi import Depends, Query, Request, Response
from PIL import Image, ImageDraw
from pydantic import Field, StringConstraints
from sqlalchemy import select
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from radiometry.findings import InputRejected, shared
from radiometry.frame.roi import Polygon, bounding_window
from radiometry.methods import get_method
from radiometry.road.lanes import describe_lanes
from radiometry.specification.application import SurfaceApplication
from service.campaigns.schemas import Point
from service.frames.routes import require_header, require_preview
from service.http import answers, changes, models, operations
from service.http.auth import Reader
from service.http.context import Context, UsesContext
from service.http.lookup import Own
from service.http.models import Answer, maybe, told
from service.jobs.routes import QUEUES, JobAnswer, queue
from service.measurements import requests, schemas
from service.tools.routes import stateless
from store import blobs, codec, database, files, queries
from store.queries.campaigns import find_crop_job, say_asked
from store.queries.frames import current_roi, region_ids
from store.tables import Campaign, Crop, FrameRow, Roi

WIDEST_PX: Final = 320
_MOST_BYTES: Final = 40_000
_GREYS: Final = (63, 31, 15, 7, 3)
"""Grey levels that are tried; the region's colour stands behind the last of them."""
_QUALITIES: Final = (60, 30, 10, 1)
_REGION: Final = (255, 120, 0)
_DRAWING: Final = "2"  # of the pictures' tags: counts up when the same frame is drawn differently

_Outlines = Sequence[Sequence[tuple[float, float]]]


def tag_of(preview_sha256: str | None, region_id: str | None) -> str | None:
    """Return what changes when the picture does; None while there is none."""
    if preview_sha256 is None:
        return None
    return hashlib.sha256(f"{_DRAWING} {preview_sha256} {region_id}".encode()).hexdigest()[:8]


def draw_thumbnail(preview: bytes, frame_width_px: int, roi: Roi | None) -> bytes:
    """Draw a preview of ours again, at most 320 px wide and high and 40 kB, as PNG."""
    grey, outlines = _reduce(preview, frame_width_px, roi)
    return _take_small(_encode_greys(grey, levels, outlines) for levels in _GREYS)


def draw_light_thumbnail(small_preview: bytes, frame_width_px: int, roi: Roi | None) -> bytes:
    """Draw a small preview with the region as WebP, at most 40 kB: a fifth of the PNG, for many at once."""
    grey, outlines = _reduce(small_preview, frame_width_px, roi)
    picture = grey.convert("RGB")
    draw = ImageDraw.Draw(picture)
    for points in outlines:
        # two pixels wide: colours are kept at half the resolution
        draw.line([*points, *points[:2]], fill=_REGION, width=2)
    return _take_small(_encode_lossy(picture, quality) for quality in _QUALITIES)


def _reduce(preview: bytes, frame_width_px: int, roi: Roi | None) -> tuple[Image.Image, _Outlines]:
    with Image.open(io.BytesIO(preview)) as opened:
        grey = opened.convert("L")
    grey.thumbnail((WIDEST_PX, WIDEST_PX), reducing_gap=2.0)
    scale = grey.width / frame_width_px
    outlines = [] if roi is None else [part["points"] for part in roi.parts or [{"points": roi.points}]]
    return grey, [[(x * scale, y * scale) for x, y in points] for points in outlines]


def _take_small(encoded: Iterable[bytes]) -> bytes:
    picture = b""
    for picture in encoded:
        if len(picture) <= _MOST_BYTES:
            break
    return picture


def _encode_greys(grey: Image.Image, levels: int, outlines: _Outlines) -> bytes:
    picture = grey.point([round(value * (levels - 1) / 255) for value in range(256)])
    picture.putpalette(
        [round(255 * level / (levels - 1)) for level in range(levels) for _ in "rgb"] + list(_REGION)
    )
    draw = ImageDraw.Draw(picture)
    for points in outlines:
        draw.polygon(points, outline=levels)
    out = io.BytesIO()
    picture.save(out, "PNG", optimize=True, bits=levels.bit_length())
    return out.getvalue()


def _encode_lossy(picture: Image.Image, quality: int) -> bytes:
    out = io.BytesIO()
    picture.save(out, "WEBP", quality=quality, method=2)
    return out.getvalue()


class NewLook(models.Form):
    """Corners of a region that is not set yet."""

    polygon: list[Point] = told("Corners [x, y] in pixels, x right, y down.", min_length=3, max_length=1000)


class GridLook(Answer):
    """A grid as it would be measured."""

    corners: list[list[float]] = told("[x, y] in pixels of the field between two luminaires.")
    rows: int
    columns: int
    point_u_m: float | None = maybe("Of lanes: largest standard uncertainty of a point's place on the road.")
    flags: list[schemas.FlagAnswer]
    findings: list[models.FindingGroupAnswer] = told("The flags, equal ones as one.")


router = operations.Router(prefix="/v1", tags=["frames"])


def _read_look(body: NewLook) -> Polygon:
    return Polygon.from_points(body.polygon)


@router.post("/frames/{frame_id}/region", **QUEUES, responses=answers.problems(409))
def look_at_region(
    frame: Own[FrameRow], polygon: Annotated[Polygon, Depends(_read_look)], caller: Reader, session: Session
) -> changes.Reply:
    """Preview a region without setting it. The job's result holds its statistics, histogram and clipping.

    `histogram`: counts per channel, bin i from first_dn + i * step_dn. `clipping`: the cells of cell_px
    pixels from (row0_px, col0_px) that hold samples at the white level, with the share of such pixels.
    """
    header = require_header(frame)
    bounding_window(polygon, height_px=header["height_px"], width_px=header["width_px"])
    return queue(session, caller, frame, {"polygon": [list(point) for point in polygon.points]})


@router.post("/frames/{frame_id}/grid", response_model=GridLook, dependencies=stateless)
def look_at_grid(frame: Own[FrameRow], body: requests.NewGrid, session: Session) -> Response:
    """Preview a grid without measuring it, with the flags that its corners would raise."""
    application = get_method(session.get_one(Campaign, frame.campaign_id).method).application
    if not isinstance(application, SurfaceApplication):
        raise InputRejected(shared.OPTION_NOT_OF_METHOD, "Frames of this method are measured without a grid.")
    grid, lanes = requests.read_grid(body)
    header = require_header(frame)
    size = {"height_px": header["height_px"], "width_px": header["width_px"]}
    bounding_window(application.outline(grid), **size)
    flags = [codec.encode(flag) for flag in application.check_grid(grid, **size)]
    return GridLook.restate(
        grid,
        point_u_m=describe_lanes(lanes)["point_u_m"] if lanes else None,
        flags=flags,
        findings=models.group_flags(flags),
    ).respond()


@router.get("/frames/{frame_id}/thumbnail.png", **answers.sends_stored_file("image/png"))
def get_frame_thumbnail(frame: Own[FrameRow], request: Request, context: UsesContext) -> Response:
    """A picture for lists, at most 320 px wide and 40 kB, with the region that holds for the frame."""
    with context.database.reading() as session:
        roi = current_roi(session, frame, session.get_one(Campaign, frame.campaign_id))
    preview_sha256 = require_preview(frame)
    tag = f"{tag_of(preview_sha256, roi.id if roi else None)}-{WIDEST_PX}"
    headers = answers.standing(request, tag)
    _, pieces = context.files.open(preview_sha256)
    png = draw_thumbnail(b"".join(pieces), (frame.header or {})["width_px"], roi)
    return Response(png, headers=headers, media_type="image/png")


MOST_SIDE_PX = 1024

_Start = Annotated[int, Field(ge=0, le=65_535, strict=True), models.WHOLE]
_Side = Annotated[int, Field(ge=1, le=MOST_SIDE_PX, strict=True), models.WHOLE]
_Level = Annotated[models.Number, Field(ge=0, le=65_535)]


class NewCrop(models.Form):
    """A window of the frame, and the range of raw values that its grey scale shows."""

    row0_px: _Start = told("First row, from the top.")
    col0_px: _Start = told("First column, from the left.")
    height_px: _Side
    width_px: _Side
    low_dn: _Level | None = maybe("Shown black. Default: the black level, or what is darker in the window.")
    high_dn: _Level | None = maybe("Shown white. Default: the window's brightest but a thousandth.")

    def check(self) -> None:
        if self.low_dn is not None and self.high_dn is not None and self.low_dn >= self.high_dn:
            raise ValueError("high_dn must be above low_dn")


@router.post(
    "/frames/{frame_id}/crops",
    **answers.makes(JobAnswer, "The picture is there already: the job that drew it.", 409) | QUEUES,
)
def draw_crop(frame: Own[FrameRow], body: NewCrop, caller: Reader, session: Session) -> changes.Reply:
    """Draw a part of a frame, one pixel for each of the sensor's, with clipped pixels in red.

    The job's result holds the address of the picture (`picture`, PNG), its place in the frame, the raw values
    shown black and white, and how many pixels are clipped. A mosaic is shown as it is: nothing is
    interpolated. The newest 32 crops of an organisation are kept.
    """
    window = (body.row0_px, body.col0_px, body.height_px, body.width_px)
    header = require_header(frame)
    if window[0] + window[2] > header["height_px"] or window[1] + window[3] > header["width_px"]:
        raise shared.ROI_OUTSIDE_FRAME.refuse(
            f"The crop leaves the {header['width_px']} x {header['height_px']} pixels of the image."
        )
    if (kept := find_crop_job(session, frame, say_asked(window, body.low_dn, body.high_dn))) is not None:
        return changes.Reply(status=200, body=JobAnswer.of(kept, frame))
    asked = {"window": list(window), "low_dn": body.low_dn, "high_dn": body.high_dn}
    return queue(session, caller, frame, asked)


@router.get("/crops/{crop_id}.png", **answers.sends_file("image/png"))
def get_crop(crop: Own[Crop], request: Request) -> Response:
    """The picture of a crop, while it is among the newest of your organisation; 404 then: draw it again."""
    return Response(crop.png, headers=answers.immutable(request, crop.id), media_type="image/png")


log = logging.getLogger(__name__)

MOST_THUMBNAILS = 100

_Wanted = Annotated[str, StringConstraints(max_length=60, pattern=r"^[A-Za-z0-9_]+(\.[0-9a-f]{8})?$")]


class ThumbnailAnswer(Answer):
    frame_id: str
    tag: str = told("As in the grid's column `thumbnail`.")
    picture: str = told(
        "WebP of at most 40 kB, in base64.",
        json_schema_extra={"contentEncoding": "base64", "contentMediaType": "image/webp"},
    )


class ThumbnailsAnswer(Answer):
    """Frames that have no picture are left out."""

    items: list[ThumbnailAnswer]


thumbnails_router = operations.Router(prefix="/v1/campaigns/{campaign_id}", tags=["frames"])


@thumbnails_router.get("/thumbnails", **answers.sends(ThumbnailsAnswer, 404))
def list_thumbnails(
    campaign: Own[Campaign],
    request: Request,
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
        chosen = select(FrameRow).where(FrameRow.campaign_id == campaign.id, FrameRow.id.in_(named))
        frames = {frame.id: frame for frame in session.scalars(chosen) if frame.preview_sha256}
        regions = region_ids(session, campaign, frames.values())
        rois = queries.by_id(session, Roi, {region for region in regions.values() if region})
    tags = {each: tag_of(frame.preview_sha256, regions[each]) or "" for each, frame in frames.items()}
    tag = hashlib.sha256(repr(sorted(tags.items())).encode()).hexdigest()
    headers = answers.immutable(request, tag) if tags == named else answers.standing(request, tag)
    small = _find_small(context, {frame.preview_sha256 or "" for frame in frames.values()})
    items = []
    for frame_id in (each for each in named if each in frames):
        frame, roi = frames[frame_id], rois.get(regions[frame_id] or "")
        if (preview := small.get(frame.preview_sha256 or "")) is None:
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
        found = files.find_small_previews(session, hashes)
    made = {}
    for sha256 in sorted(hashes - found.keys()):
        with suppress(blobs.BlobDamaged):
            made[sha256] = files.reduce_preview(b"".join(context.files.open(sha256)[1]))
    if made:
        try:
            with context.database.writing("thumbnails") as session:
                files.keep_small_previews(session, made)
        except SQLAlchemyError as error:
            log.warning("%d small previews are not kept: %s", len(made), database.summarise(error))
    return found | made
