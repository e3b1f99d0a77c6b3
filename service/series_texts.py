"""Rows of a series as text: JSON, CSV, and CSV for Excel."""

import csv
import io
import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import get_args

from service.arrow import Kind
from service.schemas.base import Answer
from service.tabular import keep_texts, spell_instant, spell_text
from store.ready.rows import is_plain, split_records
from store.ready.series import Page

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
