"""Series as a stream of Arrow record batches (IPC format), and as Parquet."""

import io
import tempfile
from collections.abc import Iterator
from itertools import chain
from typing import Any, Final, Literal

Kind = Literal["text", "number", "count", "instant"]

_BATCH_ROWS: Final = 1000
"""A batch costs as much as some hundred rows, and its memory grows with it."""
_ROW_GROUP: Final = 1 << 16
_CHUNK_BYTES: Final = 1 << 18


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
    source = io.BufferedReader(_Feed(parts), _CHUNK_BYTES)
    read = arro3.io.read_csv(source, schema, has_header=True, batch_size=_BATCH_ROWS)
    with tempfile.TemporaryFile() as file:
        if parquet:
            arro3.io.write_parquet(read, file, compression="zstd(1)", max_row_group_size=_ROW_GROUP)
        else:
            arro3.io.write_ipc_stream(read, file, compression=None)
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
