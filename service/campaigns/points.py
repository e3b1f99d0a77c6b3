"""Points of a luminance campaign from a table, where the raw files are gone."""

import hashlib
import json
import re
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Final, Literal

from fastapi import Depends, Query, Request, Response
from pydantic import BeforeValidator, Field
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.findings import interface, shared
from radiometry.methods import get_method
from service.http import answers, auth, changes, lookup, models, operations, problems, tables
from service.tools.routes import ExposureTime, FNumber, Iso
from service.uploads.frames import admit
from store.jobs import enqueue_extraction
from store.queries.campaigns import Drawing, find_or_add_roi
from store.queries.frames import NewFrame, find_or_add_frames, require_role, whole_frame
from store.tables import Campaign, FrameRow

MOST_POINTS = 1000

_Level = Annotated[models.Number, Field(ge=0, le=1e6)]
_DARK = {"yes": True, "true": True, "1": True, "no": False, "false": False, "0": False}
_FRACTION = re.compile(r"1/(\d+(?:\.\d+)?)")


def _read_fraction(sent: Any) -> Any:  # noqa: ANN401  whatever was sent
    found = _FRACTION.fullmatch(sent) if isinstance(sent, str) else None
    return 1.0 / float(found[1]) if found and float(found[1]) else sent


def _read_dark(sent: Any) -> Any:  # noqa: ANN401  whatever was sent
    if (found := _DARK.get(str(sent).lower())) is None:
        raise ValueError("must be yes or no; a dark frame is a row of its own, with its own mean")
    return found


class NewPoint(models.Form):
    """One frame: what it shows, its settings, and the statistics of its region, black included."""

    filename: models.Text = models.told("Name of the frame, as ImageJ's Label.")
    scene: models.Text | None = models.maybe("Light level; a dark frame has none.")
    dark: Annotated[bool, BeforeValidator(_read_dark)] = models.told(
        "yes of a frame without light.", default=False
    )
    exposure_time_s: Annotated[ExposureTime, BeforeValidator(_read_fraction)]
    f_number: FNumber
    iso: Iso
    mean_dn: _Level
    min_dn: _Level
    max_dn: _Level
    std_dn: _Level | None = models.maybe("Else the largest that mean and range allow.")
    pixels: float = models.told("Number of samples; ImageJ's Area.", ge=1, le=1e9)

    def check(self) -> None:
        if not self.min_dn <= self.mean_dn <= self.max_dn:
            raise ValueError(
                f"mean_dn {self.mean_dn:g} lies outside min_dn to max_dn, {self.min_dn:g} to {self.max_dn:g}"
            )
        if not self.pixels.is_integer():
            raise ValueError("pixels is no whole number: in ImageJ, remove the scale (Analyze, Set Scale)")
        if self.dark == (self.scene is not None):
            raise ValueError("needs a scene, or dark yes without a scene")

    @property
    def role(self) -> Literal["light", "dark"]:
        return "dark" if self.dark else "light"


class PointsTable(models.Form):
    """Statements that a table does not contain."""

    white_level_dn: float = models.told("Where the sensor clips: 255 of 8 bits.", gt=0, le=1e6)
    black_level_dn: float | None = models.maybe("Absent if it is unknown.", ge=0, le=1e6)
    exposure_time_s: float | None = models.maybe("Of rows that state none.", gt=1e-9, le=86_400)
    f_number: float | None = models.maybe("Of rows that state none.", ge=0.1, le=1000)
    iso: float | None = models.maybe("Of rows that state none.", ge=0.1, le=1e9)


class AddedPoint(models.Answer, restates=FrameRow, fields="filename role scene"):
    frame_id: str


class PointsAnswer(models.Answer):
    """The frames of a table, in the order of its rows."""

    items: list[AddedPoint]
    ignored_columns: list[str] = models.told("Columns that were not read.")


_FIELDS: Final = frozenset(NewPoint.model_fields)
_ALSO: Final = {
    **dict.fromkeys(("label", "file"), "filename"),
    **dict.fromkeys(("exposure_time", "exposure_s", "shutter_speed_s"), "exposure_time_s"),
    **dict.fromkeys(("aperture", "fnumber"), "f_number"),
    "iso_value": "iso",
    "mean": "mean_dn",
    "min": "min_dn",
    "max": "max_dn",
    **dict.fromkeys(("stddev", "std"), "std_dn"),
    **dict.fromkeys(("area", "n"), "pixels"),
}
_NUMBERS: Final = _FIELDS - {"filename", "scene", "dark"}
_USUAL: Final = ("exposure_time_s", "f_number", "iso")
_NEEDED: Final = ("filename", *_USUAL, "mean_dn", "min_dn", "max_dn", "pixels")


def read_points(data: bytes, told: PointsTable) -> tuple[list[NewPoint], list[str]]:
    usual = told.model_dump(include=set(_USUAL), exclude_none=True)
    ignored: list[str] = []

    def name_fields(columns: list[str]) -> list[str]:
        plain = [re.sub(r"[^a-z0-9]+", "_", name).strip("_") for name in columns]
        fields = [_ALSO.get(name, name) for name in plain]
        needed = _NEEDED if "dark" in fields else (*_NEEDED, "scene")
        if lacking := [name for name in needed if name not in fields and name not in usual]:
            raise tables.refuse_columns(f"lacks {', '.join(lacking)}", columns)
        read = [name for name in fields if name in _FIELDS]
        if len(set(read)) < len(read):
            raise tables.refuse_columns("names a column twice", columns)
        ignored.extend(name for name, field in zip(columns, fields, strict=True) if field not in _FIELDS)
        return [name if name in _FIELDS else tables.UNREAD for name in fields]

    kind = tables.Kind(numbers=_NUMBERS, most=MOST_POINTS, rows_are="points", usual=usual)
    points = tables.read_sheet(data, NewPoint, kind, name_fields)
    problems.refuse(_find_wrong(points, told))
    if told.black_level_dn is not None and told.black_level_dn >= told.white_level_dn:
        raise problems.wrong("query.black_level_dn", "is not below white_level_dn")
    return points, [name for name in ignored if name]


def _find_wrong(points: list[NewPoint], told: PointsTable) -> Iterator[tuple[str, str]]:
    """Yield what only the whole table shows: names given twice, and levels above the white level."""
    seen: dict[str, int] = {}
    for line, point in enumerate(points, start=2):
        first = seen.setdefault(point.filename, line)
        if first != line:
            message = f"names {point.filename!r} as line {first} does; each frame is one row"
            yield f"line {line}.filename", message
        if point.max_dn > told.white_level_dn:
            yield f"line {line}.max_dn", f"is above white_level_dn {told.white_level_dn:g}"


router = operations.Router(prefix="/v1", tags=["frames"])

_BYTES: Final = "application/octet-stream"  # accepted too: generated clients know no bodies of CSV
_TABLE: Final = {
    "text/csv": {"schema": {"type": "string"}},
    _BYTES: {"schema": {"type": "string", "format": "binary"}},
}


async def _body(request: Request, _caller: auth.Uploader) -> bytes:
    return await request.body()


@router.post(
    "/campaigns/{campaign_id}/points",
    **answers.makes(PointsAnswer, "The campaign has these rows already.", 400, 409, 507),
    openapi_extra={"requestBody": {"required": True, "content": _TABLE}},
)
def add_points(
    campaign: lookup.Own[Campaign],
    told: Annotated[PointsTable, Query()],
    caller: auth.Uploader,
    request: Request,
    data: Annotated[bytes, Depends(_body)],
    writing: changes.Writes,
) -> Response:
    """Add frames of a luminance campaign as rows of a table: statistics without pixels.

    The columns are filename, scene, dark (yes or no), exposure_time_s, f_number, iso, mean_dn, min_dn,
    max_dn, std_dn and pixels, or those of ImageJ's Results with scene and settings added. A wrong row is
    named with its line and column, and nothing is stored.
    """
    if not tables.is_table(request) and request.headers.get("content-type") != _BYTES:
        raise problems.Problem(interface.BAD_REQUEST, "Send the table with Content-Type: text/csv.")
    points, ignored = read_points(data, told)
    context, rows = writing.context, [_write_row(point, told) for point in points]
    hashes = {
        point.filename: hashlib.sha256(row).hexdigest() for point, row in zip(points, rows, strict=True)
    }
    admit(context, campaign.id, caller, None, sum(map(len, rows)), role=points[0].role)
    with context.database.reading() as session:
        _refuse(campaign, session, hashes)
    blobs = [context.blobs.keep([row]) for row in rows]

    def change(session: Session) -> changes.Reply:
        here = session.get_one(Campaign, campaign.id)
        require_role(here, points[0].role)
        pixel = whole_frame(1, 1)
        roi = find_or_add_roi(session, caller.organisation_id, Drawing(polygon=pixel, corners=pixel.points))
        frames = [
            NewFrame(
                blob=blob,
                filename=point.filename,
                role=point.role,
                scene=point.scene,
                roi_id=roi.id,
                supplied={name: getattr(point, name) for name in _USUAL},
            )
            for point, blob in zip(points, blobs, strict=True)
        ]
        found = find_or_add_frames(session, [(here, frame) for frame in frames])
        jobs = [
            enqueue_extraction(session, frame, caller.organisation_id, by=caller.key_id, is_new=is_new)
            for frame, is_new, to_read in found
            if to_read
        ]
        items = [AddedPoint.restate(frame, frame_id=frame.id) for frame, *_ in found]
        new = [len(row) for row, (_, is_new, _) in zip(rows, found, strict=True) if is_new]
        body = PointsAnswer(items=items, ignored_columns=ignored)
        return changes.Reply(status=201 if new else 200, body=body, jobs=jobs, frame_bytes=new)

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
    mine = FrameRow.standing(campaign.id) & FrameRow.filename.in_(hashes)
    known = select(FrameRow.filename, FrameRow.sha256).where(mine)
    lines = {name: line for line, name in enumerate(hashes, start=2)}
    said = "the campaign has {} with other values: withdraw that frame first"
    problems.refuse(
        (f"line {lines[name]}.filename", said.format(name))
        for name, sha256 in session.execute(known)
        if hashes[name] != sha256
    )
