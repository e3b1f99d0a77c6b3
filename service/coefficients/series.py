"""Series as JSON or CSV, a page at a time: memory does not grow with them."""

import csv
import hashlib
import io
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, get_args

from fastapi import Request, Response
from fastapi.responses import StreamingResponse
from isal import isal_zlib
from pydantic import Field, create_model

from radiometry.records import Record
from service.http import answers, auth, connections, lookup, models, paging, tables
from service.http.context import Context
from store.database import Database
from store.ready.rows import COLUMNS, KINDS, is_plain, split_records
from store.ready.series import Asked, Page, Series
from store.software import read_version
from store.tables import Camera

Kind = Literal["text", "number", "count", "instant"]

_CHUNK_BYTES = 1 << 16


class Column(Record):
    name: str
    kind: Kind
    empty: str  # what JSON has where the cell is empty


def describe_columns(row: type[models.Answer]) -> tuple[Column, ...]:
    columns = []
    for name, field in row.model_fields.items():
        stated = {field.annotation, *get_args(field.annotation)}
        kind: Kind = "text" if str in stated else "count" if int in stated else "instant"
        kind = "number" if float in stated else kind
        columns.append(Column(name=name, kind=kind, empty='""' if field.is_required() else "null"))
    return tuple(columns)


def gather(parts: Iterable[bytes]) -> Iterator[bytes]:
    """Join small parts: each one that is sent costs a turn of the loop and a thread."""
    gathered = bytearray()
    for part in parts:
        if not gathered and len(part) >= _CHUNK_BYTES:
            yield part
            continue
        gathered += part
        if len(gathered) >= _CHUNK_BYTES:
            yield bytes(gathered)
            gathered.clear()
    yield bytes(gathered)


def write_json(pages: Iterator[Page], columns: Sequence[Column], following: str | None) -> Iterator[bytes]:
    """Write one object with all rows, and the address of the following ones."""
    quote = json.encoder.encode_basestring_ascii
    yield b'{"rows":['
    is_later = False
    for page in pages:
        joined = "".join(page)
        is_quotable = is_plain(joined) and joined.isascii()
        # what every row has, and between it the cells that differ
        text = ",{"
        texts: list[str] = []
        cells: list[Sequence[str]] = []
        for column, kept in zip(columns, split_records(page), strict=True):
            found, quoted, end = kept, column.kind in {"text", "instant"}, ","
            text += f'"{column.name}":'
            if found[0] == found[-1] and found.count(found[0]) == len(found):
                text += (quote(found[0]) if quoted else found[0]) if found[0] else column.empty
            else:
                if quoted and is_quotable and (column.empty == '""' or "" not in found):
                    text, end = text + '"', '",'
                elif quoted:
                    found = [quote(cell) if cell else column.empty for cell in found]
                elif "" in found:
                    found = [cell or column.empty for cell in found]
                texts.append(text)
                cells.append(found)
                text = ""
            text += end
        # by slices: a list for each row takes twice as long
        width = 2 * len(cells) + 1
        lines = [*chain.from_iterable((each, "") for each in texts), f"{text[:-1]}}}"] * len(page)
        for place, found in enumerate(cells):
            lines[2 * place + 1 :: width] = found
        joined = "".join(lines)
        yield (joined if is_later else joined[1:]).encode()
        is_later = True
    yield f'],"next":{json.dumps(following)}}}'.encode() if following else b"]}"


def write_csv(pages: Iterator[Page], columns: Sequence[Column]) -> Iterator[bytes]:
    """Write rows under the names of their columns, which a spreadsheet opens without running them."""
    head = ",".join(column.name for column in columns)
    for page in pages:
        yield "\r\n".join((head, *_keep(page, columns))).encode()
        head = ""
    yield f"{head}\r\n".encode()


def _keep(page: Page, columns: Sequence[Column]) -> Page:
    """Return records of which a spreadsheet runs no text as a formula."""
    if is_plain("".join(page)):
        return page
    out = io.StringIO(newline="")
    cells = [
        tables.keep_texts(found) if column.kind == "text" else found
        for column, found in zip(columns, split_records(page), strict=True)
    ]
    csv.writer(out, lineterminator="\r\n").writerows(zip(*cells, strict=True))
    return [out.getvalue().removesuffix("\r\n")]


_NULL: dict[str, Any] = {"nullable_on_purpose": True}
_Number = Annotated[float | None, Field(json_schema_extra=_NULL)]
_Word = Annotated[str | None, Field(json_schema_extra=_NULL)]


class SeriesRow(models.Answer):
    """One coefficient of one published version: flat, for a dashboard's panel. What it has not is null."""

    camera_id: str
    make: str
    model_name: str
    serial: str
    method: str
    version: int
    calibration_id: str
    name: str
    value: float
    standard_uncertainty: float
    unit: str
    iso: _Number = None
    f_number: _Number = None
    band: _Word = None
    channel: _Word = None
    model: str
    flags: str = models.told("Codes, separated by spaces.")
    valid_from: models.Instant
    valid_to: Annotated[models.Instant | None, Field(json_schema_extra=_NULL)] = None
    campaign_id: str
    computed_at: models.Instant = models.told("When the version was fitted.")
    effective_dof: _Number = None
    coverage_factor: _Number = None
    expanded_uncertainty: _Number = None


_NEXT = models.maybe("Where the next rows are. Absent where none are left.")


class SeriesAnswer(models.Answer):
    rows: list[SeriesRow]
    next: str | None = _NEXT


_ALWAYS = frozenset(
    (
        *("id", "frame_id", "filename", "calibration_id", "calibration_version", "calibration_state"),
        *("region_origin", "frames", "vignetting", "signal", "flags", "created_at"),
        *("camera_id", "make", "model_name", "serial", "campaign_id", "method"),
    )
)
_NULLABLE = {float: _Number, str: _Word, int: Annotated[int | None, Field(json_schema_extra=_NULL)]}

if TYPE_CHECKING:
    MeasurementRow = dict[str, Any]
    MeasurementSeriesRow = dict[str, Any]
else:
    MeasurementRow = create_model(
        "MeasurementRow",
        __base__=models.Answer,
        __doc__="One measurement, flat; what it does not have is left out.",
        **{name: (KINDS.get(name, float) | None, None) for name in COLUMNS},
    )
    MeasurementSeriesRow = create_model(
        "MeasurementSeriesRow",
        __base__=models.Answer,
        __doc__="One measurement, flat, with every column; what it does not have is null.",
        **{
            name: (kind, ...) if name in _ALWAYS else (_NULLABLE[kind], None)
            for name in COLUMNS
            for kind in (KINDS.get(name, float),)
        }
        | {"created_at": (models.Instant, ...)},
    )


class MeasurementSeriesAnswer(models.Answer):
    """One row a measurement; the columns are those of its CSV."""

    rows: list[MeasurementSeriesRow]
    next: str | None = _NEXT


class PointAnswer(models.Answer):
    """A GeoJSON point: longitude, latitude and, where known, altitude [m]."""

    type: Literal["Point"]
    coordinates: list[float] = Field(min_length=2, max_length=3)


class FeatureAnswer(models.Answer):
    """A measurement as a GeoJSON feature; without geometry where the file names no place."""

    type: Literal["Feature"]
    id: str
    geometry: PointAnswer | None = Field(json_schema_extra={"nullable_on_purpose": True})
    properties: MeasurementRow


class FeaturesAnswer(models.Answer):
    """Measurements as a GeoJSON feature collection (RFC 7946)."""

    type: Literal["FeatureCollection"]
    features: list[FeatureAnswer]


class CellRow(models.Answer):
    """A cell of a surface: its luminance, and its centre in the frame and, of lanes, on the road."""

    row: int
    column: int
    luminance_cd_m2: float
    standard_uncertainty_cd_m2: float
    x_px: float
    y_px: float
    x_m: float | None = None
    y_m: float | None = None
    seen_from: Literal["above"]


class OutlineAnswer(models.Answer):
    type: Literal["Polygon"]
    coordinates: list[list[list[float]]]


class CellFeatureAnswer(models.Answer):
    type: Literal["Feature"]
    id: str
    geometry: OutlineAnswer
    properties: CellRow


class CellsAnswer(models.Answer):
    """Cells in the form of GeoJSON; their coordinates are not longitude and latitude."""

    type: Literal["FeatureCollection"]
    coordinates_in: Literal["pixel", "road_m"] = models.told(
        "`pixel`: x right, y down, of the frame. `road_m`: along and across the lanes from the first corner."
    )
    features: list[CellFeatureAnswer]


Shape = Literal["json", "csv"]

ROW_LIMIT: Final = 200_000
MOST_ROWS: Final = 1_000_000
MEDIA_TYPES: Final[dict[Shape, str]] = {"json": "application/json", "csv": "text/csv; charset=utf-8"}
RESPONSES: Final = {**answers.text(), **answers.UNCHANGED, **answers.problems(404)}
_GZIP = 31  # the window of zlib's format with the header of gzip


_CHOOSING = ("camera_id", "campaign_id", "calibration_id", "method", "start", "end")


class SeriesQuery(models.Period):
    """Which rows of a series, how many, and in which form."""

    camera_id: models.Text | None = None
    method: models.Method | None = None
    computed_from: models.Instant | None = models.maybe("Computed at this time or later.")
    computed_to: models.Instant | None = models.maybe("Computed before this time.")
    limit: Annotated[int, Field(ge=1, le=MOST_ROWS)] | None = models.maybe(
        f"How many rows at most; without it, {ROW_LIMIT:,}."
    )
    cursor: models.Text | None = models.maybe("Taken from the `next` address of the answer before.")
    format: Shape | None = models.maybe("Without it, what `Accept` names first of JSON and CSV; else JSON.")


def answer_series(
    request: Request,
    context: Context,
    caller: auth.Caller,
    kind: Callable[[Database, Asked], Series],
    query: SeriesQuery,
    columns: tuple[Column, ...],
) -> Response:
    """Stream the rows that were asked for, or answer 304 while none of the organisation has changed."""
    chosen = {name: getattr(query, name, None) for name in _CHOOSING}
    asked = Asked(
        organisation_id=caller.organisation_id,
        computed_start=query.computed_from,
        computed_end=query.computed_to,
        **chosen,
    )
    series = kind(context.database, asked)
    shape = query.format or _choose_shape(request.headers.get("accept", ""))
    packs = "gzip" in request.headers.get("accept-encoding", "")
    after = None if query.cursor is None else paging.read_cursor(query.cursor, series.is_place)
    with context.database.reading(snapshot=True) as session:
        if query.camera_id is not None:
            lookup.owned(session, Camera, query.camera_id, caller)
        said = [read_version(), series.read_state(session), caller.organisation_id, str(request.url), shape]
        tag = hashlib.sha256(json.dumps(said).encode()).hexdigest()[:32]
        headers = answers.standing(request, tag, Vary="Accept, Accept-Encoding, Authorization")
        until = series.find_end(session, after=after, limit=query.limit or ROW_LIMIT)
    following = None
    if until is not None:
        following = connections.address_with(request, cursor=paging.write_cursor(until))
        headers["Link"] = f'<{following}>; rel="next"'
    pages = series.read(after=after, until=until)
    content = gather(write_json(pages, columns, following) if shape == "json" else write_csv(pages, columns))
    if packs:
        headers["Content-Encoding"] = "gzip"
        content = _pack(content)
    # what fails at the first page is a problem, not an answer that breaks off
    first = next(content, b"")
    return StreamingResponse(chain([first], content), headers=headers, media_type=MEDIA_TYPES[shape])


def _choose_shape(accept: str) -> Shape:
    shapes = {media_type.partition(";")[0]: shape for shape, media_type in MEDIA_TYPES.items()}
    named = (part.partition(";")[0].strip().lower() for part in accept.split(","))
    return next((shapes[name] for name in named if name in shapes), "json")


def _pack(parts: Iterable[bytes]) -> Iterator[bytes]:
    packer = isal_zlib.compressobj(1, wbits=_GZIP)
    for part in parts:
        if packed := packer.compress(part):
            yield packed
    yield packer.flush()
