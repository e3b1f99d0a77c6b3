"""Series as JSON, CSV, Parquet or an Arrow stream, a page at a time: memory does not grow with the rows."""

import hashlib
import json
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from itertools import chain
from typing import Annotated, Any, Final, Literal

from fastapi import Request, Response
from fastapi.responses import StreamingResponse
from isal import isal_zlib
from pydantic import Field

from service.arrow import write_arrow
from service.auth import Caller
from service.context import Context
from service.hosts import absolute
from service.immutable import not_modified, standing_headers
from service.lookup import owned
from service.paging import read_cursor, write_cursor
from service.routes import UNCHANGED
from service.schemas.base import Form, Instant, Method, Text
from service.series_texts import Column, gather, write_csv, write_excel, write_json, write_records
from store.database import Database
from store.ready.series import Asked, Series
from store.software import read_version
from store.tables import Camera

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

Shape = Literal["json", "csv", "arrow", "parquet", "excel", "excel_semicolon"]
Coding = Literal["zstd", "gzip", ""]

ROW_LIMIT: Final = 200_000
MOST_ROWS: Final = 1_000_000
MEDIA_TYPES: Final[dict[Shape, str]] = {
    "json": "application/json",
    "csv": "text/csv; charset=utf-8",
    "arrow": "application/vnd.apache.arrow.stream",
    "parquet": "application/vnd.apache.parquet",
    "excel": "text/csv; charset=utf-8",
    "excel_semicolon": "text/csv; charset=utf-8",
}
_EXCEL: Final[dict[Shape, tuple[str, str]]] = {"excel": (",", "."), "excel_semicolon": (";", ",")}
"""Separator and decimal sign, as Excel expects them of its country."""
_GZIP = 31
"""The window of zlib's format with the header of gzip."""


_CHOOSING = ("camera_id", "campaign_id", "calibration_id", "method", "start", "end")


class SeriesQuery(Form):
    """Which rows of a series, how many, and in which form."""

    camera_id: Text | None = None
    method: Method | None = None
    computed_from: Instant | None = Field(default=None, description="Computed at this time or later.")
    computed_to: Instant | None = Field(default=None, description="Computed before this time.")
    limit: Annotated[int, Field(ge=1, le=MOST_ROWS)] | None = Field(
        default=None, description=f"How many rows at most; without it, {ROW_LIMIT:,}."
    )
    cursor: Text | None = Field(
        default=None, description="Taken from the `next` address of the answer before."
    )
    format: Shape | None = Field(
        default=None,
        description="Without it, what `Accept` names first of JSON, CSV, Arrow and Parquet; else JSON. "
        "`excel` is CSV that Excel opens by itself where numbers have a decimal point, `excel_semicolon` "
        "where they have a comma.",
    )


def answer_series(
    request: Request,
    context: Context,
    caller: Caller,
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
    # the columns of Parquet are packed already
    coding = "" if shape == "parquet" else _choose_coding(request.headers.get("accept-encoding", ""))
    after = None if query.cursor is None else read_cursor(query.cursor, series.is_place)
    with context.database.reading(snapshot=True) as session:
        if query.camera_id is not None:
            owned(session, Camera, query.camera_id, caller)
        said = [read_version(), series.read_state(session), caller.organisation_id, str(request.url), shape]
        tag = hashlib.sha256(json.dumps(said).encode()).hexdigest()[:32] + (coding and f"-{coding}")
        headers = standing_headers(tag) | {"Vary": "Accept, Accept-Encoding, Authorization"}
        unchanged = not_modified(request, tag, headers)
        if unchanged is not None:
            return unchanged
        until = series.find_end(session, after=after, limit=query.limit or ROW_LIMIT)
    following = None
    if until is not None:
        address = request.url.include_query_params(cursor=write_cursor(until))
        following = absolute(request, f"{address.path}?{address.query}")
        headers["Link"] = f'<{following}>; rel="next"'
    pages = series.read(after=after, until=until)
    match shape:
        case "json":
            content = gather(write_json(pages, columns, following))
        case "csv":
            content = gather(write_csv(pages, columns))
        case "excel" | "excel_semicolon":
            content = gather(write_excel(pages, columns, *_EXCEL[shape]))
        case "arrow" | "parquet":
            kinds = {column.name: column.kind for column in columns}
            content = write_arrow(write_records(pages, columns), kinds, parquet=shape == "parquet")
    if coding:
        headers["Content-Encoding"] = coding
        content = _pack(content, coding)
    # what fails at the first page is a problem, not an answer that breaks off
    first = next(content, b"")
    return StreamingResponse(chain([first], content), headers=headers, media_type=MEDIA_TYPES[shape])


def sends_series() -> dict[int | str, dict[str, Any]]:
    """Document the forms of a series."""
    text, binary = {"type": "string"}, {"type": "string", "format": "binary"}
    schemas: dict[Shape, Any] = {"csv": text, "arrow": binary, "parquet": binary}
    content = {MEDIA_TYPES[shape].partition(";")[0]: {"schema": schema} for shape, schema in schemas.items()}
    return {200: {"content": content}, **UNCHANGED}


def _choose_shape(accept: str) -> Shape:
    named = [part.partition(";")[0].strip().lower() for part in accept.split(",")]
    for name in named:
        for shape, media_type in MEDIA_TYPES.items():
            if name == media_type.partition(";")[0]:
                return shape
    return "json"


def _choose_coding(accepted: str) -> Coding:
    """Return the quickest coding that is accepted, "" for none."""
    parts = (part.replace(" ", "").partition(";") for part in accepted.lower().split(","))
    named = {name for name, _, weight in parts if not re.fullmatch(r"q=0(\.0*)?", weight)}
    codings: tuple[Coding, ...] = ("zstd", "gzip")
    return next((each for each in codings if each in named), "")


def _pack(parts: Iterable[bytes], coding: Coding) -> Iterator[bytes]:
    zstandard = coding == "zstd"
    packer = zstd.ZstdCompressor(level=1) if zstandard else isal_zlib.compressobj(1, wbits=_GZIP)
    for part in parts:
        if packed := packer.compress(part):
            yield packed
    yield packer.flush()
