"""Series as a stream of Arrow record batches (IPC format), and as Parquet."""

import io
import tempfile
from collections.abc import Iterator, Sequence
from itertools import chain
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic_core import from_json

from store.ready.series import Page, is_empty, is_text

Kind = Literal["text", "number", "count", "instant"]
Part = tuple[NDArray[np.bool_] | None, NDArray[Any], bytes]
"""Cells of a column: which are present (None: all), the values or the lengths of the texts, the texts."""

_BATCH_ROWS = 1000
"""A batch costs as much as some hundred rows, and its memory grows with it."""
_ROW_GROUP: Final = 1 << 16
_CHUNK_BYTES: Final = 1 << 18
_DTYPES: Final = {"text": np.int32, "number": np.float64, "count": np.int64, "instant": np.int64}


def write_arrow(pages: Iterator[Page], kinds: dict[str, Kind]) -> Iterator[bytes]:
    """Write the schema, and a record batch for each thousand rows."""
    import nanoarrow as na
    from nanoarrow.ipc import StreamWriter

    types = {
        "text": na.string,
        "number": na.float64,
        "count": na.int64,
        "instant": lambda: na.timestamp("us", "UTC"),
    }
    fields = [types[kind]() for kind in kinds.values()]
    schema = na.struct(dict(zip(kinds, fields, strict=True)))
    out = io.BytesIO()
    with StreamWriter.from_writable(out) as writer:
        # without a batch, no schema is written
        batches = _convert(pages, [*kinds.values()])
        nothing: list[list[Part]] = [[(None, np.zeros(0, _DTYPES[kind]), b"")] for kind in kinds.values()]
        for batch in chain([next(batches, nothing)], batches):
            buffers = [_join(kind, parts) for kind, parts in zip(kinds.values(), batch, strict=True)]
            count = sum(len(values) for _, values, _ in batch[0])
            children = [
                na.c_array_from_buffers(field, count, each)
                for field, each in zip(fields, buffers, strict=True)
            ]
            writer.write_array(na.c_array_from_buffers(schema, count, [None], children=children))
            yield out.getvalue()
            out.seek(0)
            out.truncate()
    yield out.getvalue()


def write_parquet(stream: Iterator[bytes]) -> Iterator[bytes]:
    """Write what `write_arrow` yields as Parquet, by way of a temporary file: its end says where all is."""
    import arro3.io

    with tempfile.TemporaryFile() as file:
        arro3.io.write_parquet(
            arro3.io.read_ipc_stream(io.BufferedReader(_Feed(stream))),
            file,
            compression="zstd(1)",
            max_row_group_size=_ROW_GROUP,
        )
        file.seek(0)
        yield from iter(lambda: file.read(_CHUNK_BYTES), b"")


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


def _convert(pages: Iterator[Page], kinds: Sequence[Kind]) -> Iterator[list[list[Part]]]:
    """Convert each page at once: cells as texts take several times the memory of a batch."""
    batch: list[list[Part]] = [[] for _ in kinds]
    rows = 0
    for page in pages:
        for kind, cells, parts in zip(kinds, page, batch, strict=True):
            parts.append(_convert_cells(kind, cells))
        rows += len(page[0])
        if rows >= _BATCH_ROWS:
            yield batch
            batch, rows = [[] for _ in kinds], 0
    if rows:
        yield batch


def _convert_cells(kind: Kind, cells: Sequence[Any]) -> Part:
    count, dtype = len(cells), _DTYPES[kind]
    if is_empty(cells):
        return np.zeros(count, bool), np.zeros(count, dtype), b""
    if not is_text(cells):
        present = np.array([each is not None for each in cells]) if None in cells else None
        return present, np.array(cells if present is None else [each or 0 for each in cells], dtype), b""
    present = np.fromiter(map(bool, cells), bool, count) if "" in cells else None
    if kind == "text":
        joined = "".join(cells)
        encoded = cells if joined.isascii() else [text.encode() for text in cells]
        return present, np.fromiter(map(len, encoded), dtype, count), joined.encode()
    if kind == "instant":
        different = dict.fromkeys(cells)
        moments = np.array([text.removesuffix("Z") or "NaT" for text in different], "M8[us]").view(np.int64)
        if len(different) < count:
            known = dict(zip(different, moments.tolist(), strict=True))
            moments = np.fromiter(map(known.__getitem__, cells), dtype, count)
        return present, moments, b""
    numbers = ",".join(cells if present is None else [text or "0" for text in cells])
    # a third of the time of float() for each of them, and as exact
    return present, np.array(from_json(f"[{numbers}]"), dtype), b""


def _join(kind: Kind, parts: Sequence[Part]) -> list[Any]:
    """Join the parts of a column to Arrow's buffers."""
    valid, values = None, np.concatenate([part[1] for part in parts])
    if any(present is not None for present, _, _ in parts):
        flags = [np.ones(len(each), bool) if present is None else present for present, each, _ in parts]
        valid = np.packbits(np.concatenate(flags), bitorder="little")
    if kind != "text":
        return [valid, values]
    return [valid, np.concatenate([[0], values]).cumsum(dtype=np.int32), b"".join(part[2] for part in parts)]
