"""Series as JSON, CSV, Parquet or an Arrow stream, a page at a time: memory does not grow with the rows."""

import base64
import binascii
import csv
import hashlib
import io
import json
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Annotated, Any, Final, Literal, get_args

from fastapi import Request, Response
from fastapi.responses import StreamingResponse
from isal import isal_zlib
from pydantic import Field
from pydantic_core import to_json

from service.arrow import Kind, write_arrow, write_parquet
from service.auth import Caller
from service.context import Context
from service.hosts import absolute
from service.immutable import not_modified, standing_headers
from service.lookup import owned
from service.problems import invalid
from service.routes import UNCHANGED
from service.schemas.base import Answer, Form, Instant, Method, Text
from service.tabular import keep_texts, spell_instant, spell_text
from store.database import Database
from store.ready.series import Asked, Key, Page, Series, is_empty, is_text
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
_CHUNK_BYTES = 1 << 16
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


@dataclass(frozen=True, kw_only=True)
class Column:
    name: str
    kind: Kind
    empty: str
    """What JSON has where the cell is empty."""


def describe_columns(row: type[Answer]) -> tuple[Column, ...]:
    """Return the columns of a series, as the schema of its rows states them."""
    columns = []
    for name, field in row.model_fields.items():
        stated = {field.annotation, *get_args(field.annotation)}
        kind: Kind = "text" if str in stated else "count" if int in stated else "instant"
        kind = "number" if float in stated else kind
        columns.append(Column(name=name, kind=kind, empty='""' if field.is_required() else "null"))
    return tuple(columns)


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
    after = _read_cursor(query.cursor, series)
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
        address = request.url.include_query_params(cursor=_write_cursor(until))
        following = absolute(request, f"{address.path}?{address.query}")
        headers["Link"] = f'<{following}>; rel="next"'
    pages = series.read(after=after, until=until)
    match shape:
        case "json":
            content = gather(_write_json(pages, columns, following))
        case "csv":
            content = gather(write_csv(pages, columns))
        case "excel" | "excel_semicolon":
            content = gather(write_excel(pages, columns, *_EXCEL[shape]))
        case "arrow" | "parquet":
            content = write_arrow(pages, {column.name: column.kind for column in columns})
            content = content if shape == "arrow" else write_parquet(content)
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


def _write_cursor(key: Key) -> str:
    return base64.urlsafe_b64encode(json.dumps(key, separators=(",", ":")).encode()).decode().rstrip("=")


def _read_cursor(text: str | None, series: Series) -> Key | None:
    if text is None:
        return None
    try:
        key = json.loads(base64.urlsafe_b64decode(text + "=" * (-len(text) % 4)))
        if isinstance(key, list) and series.is_place(key):
            return key
    except (binascii.Error, ValueError):
        pass
    raise invalid([{"type": "cursor", "loc": ("query", "cursor"), "msg": "is none of this series"}])


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


def _write_json(pages: Iterator[Page], columns: Sequence[Column], following: str | None) -> Iterator[bytes]:
    quote = json.encoder.encode_basestring_ascii
    yield b'{"rows":['
    is_later = False
    for page in pages:
        # what every row has, and between it the cells that differ
        text = ",{"
        texts: list[str] = []
        cells: list[Sequence[str]] = []
        for column, read in zip(columns, page, strict=True):
            found, quoted, end = read, column.kind in {"text", "instant"}, ","
            text += f'"{column.name}":'
            if is_empty(found):
                text += column.empty
            elif quoted and found[0] == found[-1] and len(different := set(found)) == 1:
                text += quote(*different)
            else:
                if quoted and _is_plain(found, '"\\') and (column.empty == '""' or "" not in found):
                    text, end = text + '"', '",'
                elif quoted:
                    found = [quote(cell) if cell else column.empty for cell in found]
                elif not is_text(found):
                    found = write_numbers(found, column.empty)
                elif "" in found:
                    found = [cell or column.empty for cell in found]
                texts.append(text)
                cells.append(found)
                text = ""
            text += end
        # by slices: a list for each row takes twice as long
        width = 2 * len(cells) + 1
        lines = [*chain.from_iterable((each, "") for each in texts), f"{text[:-1]}}}"] * len(page[0])
        for place, found in enumerate(cells):
            lines[2 * place + 1 :: width] = found
        joined = "".join(lines)
        yield (joined if is_later else joined[1:]).encode()
        is_later = True
    yield f'],"next":{json.dumps(following)}}}'.encode() if following else b"]}"


def write_numbers(cells: Sequence[float | None], empty: str) -> list[str]:
    """Write numbers as `repr` does, which takes several times as long."""
    text = to_json(cells)[1:-1].decode()
    if "e-" in text or "0.0000" in text:
        # pydantic writes 1e-6 and 0.00001 where Python has 1e-06 and 1e-05
        return [empty if cell is None else repr(cell) for cell in cells]
    written = text.split(",")
    return [empty if each == "null" else each for each in written] if None in cells else written


def write_csv(pages: Iterator[Page], columns: Sequence[Column]) -> Iterator[bytes]:
    """Write rows that a spreadsheet opens without running them."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\r\n")
    writer.writerow([column.name for column in columns])
    for page in pages:
        for place, column in enumerate(columns):
            if not is_text(page[place]):
                page[place] = write_numbers(page[place], "")
            elif column.kind == "text":
                page[place] = keep_texts(page[place])
        rows = zip(*page, strict=True)
        texts = (cells for cells, column in zip(page, columns, strict=True) if column.kind == "text")
        if all(_is_plain(cells, '",') for cells in texts):
            out.writelines(",".join(row) + "\r\n" for row in rows)
        else:
            writer.writerows(rows)
        yield out.getvalue().encode()
        out.seek(0)
        out.truncate()
    yield out.getvalue().encode()


def write_excel(
    pages: Iterator[Page], columns: Sequence[Column], separator: str, decimal: str
) -> Iterator[bytes]:
    """Write rows that Excel takes for what they are: UTF-8 by its mark, times of UTC, numbers, texts."""
    out = io.StringIO("\ufeff")
    out.seek(1)
    writer = csv.writer(out, delimiter=separator, lineterminator="\r\n")
    writer.writerow([column.name for column in columns])
    for page in pages:
        for place, column in enumerate(columns):
            cells = page[place] if is_text(page[place]) else write_numbers(page[place], "")
            match column.kind:
                case "text":
                    page[place] = [spell_text(cell, decimal) for cell in cells]
                case "instant":
                    page[place] = [spell_instant(cell, decimal) for cell in cells]
                case _:
                    page[place] = [cell.replace(".", decimal) for cell in cells]
        writer.writerows(zip(*page, strict=True))
        yield out.getvalue().encode()
        out.seek(0)
        out.truncate()
    yield out.getvalue().encode()


def _is_plain(texts: Sequence[str], special: str) -> bool:
    """Return whether texts are ASCII without control characters and these ones."""
    joined = "".join(texts)
    return joined.isascii() and joined.isprintable() and not any(each in joined for each in special)
