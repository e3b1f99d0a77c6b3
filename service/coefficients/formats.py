"""Rows of a series as JSON, CSV, CSV for Excel, Arrow record batches and Parquet."""

import csv
import io
import json
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any, Final, Literal, get_args

from service.http.models import Answer
from service.http.tables import keep_texts, spell_instant, spell_text
from store.ready.rows import is_plain, split_records
from store.ready.series import Page

Kind = Literal["text", "number", "count", "instant"]

_BATCH_ROWS: Final = 1000
"""A batch costs as much as some hundred rows, and its memory grows with it."""
_ROW_GROUP: Final = 1 << 16
_BATCH_BYTES: Final = 1 << 18


def write_arrow(
    records: Iterator[bytes], kinds: dict[str, Kind], *, parquet: bool = False
) -> Iterator[bytes]:
    """Write CSV with the names of its columns as Arrow or Parquet, through a file; an empty cell is none."""
    import arro3.core
    import arro3.io

    types = {
        "text": arro3.core.DataType.utf8(),
        "number": arro3.core.DataType.float64(),
        "count": arro3.core.DataType.int64(),
        "instant": arro3.core.DataType.timestamp("us", tz="UTC"),
    }
    schema = arro3.core.Schema([arro3.core.Field(name, types[kind]) for name, kind in kinds.items()])
    # what fails before the first rows is raised here, as it is
    parts = chain([next(records)], records)
    source = io.BufferedReader(_Feed(parts), _BATCH_BYTES)
    read = arro3.io.read_csv(source, schema, has_header=True, batch_size=_BATCH_ROWS)
    with tempfile.TemporaryFile() as file:
        if parquet:
            arro3.io.write_parquet(read, file, compression="zstd(1)", max_row_group_size=_ROW_GROUP)
        else:
            arro3.io.write_ipc_stream(read, file, compression=None)
        file.seek(0)
        yield from iter(lambda: file.read(_BATCH_BYTES), b"")


class _Feed(io.RawIOBase):
    """A file of parts that are made while it is read."""

    def __init__(self, parts: Iterator[bytes]) -> None:
        self._parts = parts
        self._left = b""

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:  # noqa: ANN401  a writable buffer
        while not self._left:
            part = next(self._parts, None)
            if part is None:
                return 0
            self._left = part
        taken, self._left = self._left[: len(buffer)], self._left[len(buffer) :]
        buffer[: len(taken)] = taken
        return len(taken)


_CHUNK_BYTES = 1 << 16


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


def write_records(pages: Iterator[Page], columns: Sequence[Column]) -> Iterator[bytes]:
    """Write rows as they are kept, with the names of their columns."""
    head = ",".join(column.name for column in columns)
    for page in pages:
        yield "\r\n".join((head, *page)).encode()
        head = ""
    yield f"{head}\r\n".encode()


def write_csv(pages: Iterator[Page], columns: Sequence[Column]) -> Iterator[bytes]:
    """Write rows that a spreadsheet opens without running them."""
    return write_records((_keep(page, columns) for page in pages), columns)


def _keep(page: Page, columns: Sequence[Column]) -> Page:
    """Return records of which a spreadsheet runs no text as a formula."""
    if is_plain("".join(page)):
        return page
    out = io.StringIO(newline="")
    cells = [
        keep_texts(found) if column.kind == "text" else found
        for column, found in zip(columns, split_records(page), strict=True)
    ]
    csv.writer(out, lineterminator="\r\n").writerows(zip(*cells, strict=True))
    return [out.getvalue().removesuffix("\r\n")]


def write_excel(
    pages: Iterator[Page], columns: Sequence[Column], separator: str, decimal: str
) -> Iterator[bytes]:
    """Write rows that Excel takes for what they are: UTF-8 by its mark, times of UTC, numbers, texts."""
    out = io.StringIO("\ufeff")
    out.seek(1)
    writer = csv.writer(out, delimiter=separator, lineterminator="\r\n")
    writer.writerow([column.name for column in columns])
    for page in pages:
        spelt = []
        for column, cells in zip(columns, split_records(page), strict=True):
            match column.kind:
                case "text":
                    spelt.append([spell_text(cell, decimal) for cell in cells])
                case "instant":
                    spelt.append([spell_instant(cell, decimal) for cell in cells])
                case _:
                    spelt.append([cell.replace(".", decimal) for cell in cells])
        writer.writerows(zip(*spelt, strict=True))
        yield out.getvalue().encode()
        out.seek(0)
        out.truncate()
    yield out.getvalue().encode()
