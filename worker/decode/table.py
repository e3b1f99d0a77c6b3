"""Rows of a table in the place of files: statistics of frames whose pixels nobody has."""

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from radiometry.findings import files
from radiometry.frame import FrameHeader, TableRow
from radiometry.frame.proof import PieceRun, Voucher
from worker.decode.source import Source

MAGIC: Final = b'{"stilb_row": 1,'
_MOST_BYTES: Final = 10_000
_ROW: Final = TypeAdapter(TableRow)


class TableFile:
    """A row, with one pixel of its mean for a preview to show."""

    band_rows = 1
    lowest_dn = 0.0

    def __init__(self, source: Source) -> None:
        try:
            row = _ROW.validate_json(source[:_MOST_BYTES])
        except ValidationError as error:
            raise files.SIZE_MISMATCH.refuse("The row of a table is not one that stilb wrote.") from error
        if not row.is_possible:
            raise files.SIZE_MISMATCH.refuse("No samples have the statistics of this row.")
        known = row.black_level_dn is not None
        self.header = FrameHeader(
            container="table",
            decoder="stilb",
            rendered=False,
            compression="none",
            bits_per_sample=16,
            width_px=1,
            height_px=1,
            cfa="grey",
            black_level_dn=(row.black_level_dn or 0.0,),
            black_level_origin="supplied" if known else "default",
            white_level_dn=(row.white_level_dn,),
            white_level_origin="supplied",
            table=row,
        )
        self._pixel = np.full((1, 1), min(max(1, round(row.mean_dn)), 65535), np.uint16)

    def read(self, row0: int, col0: int, height: int, width: int) -> NDArray[np.uint16]:
        return self._pixel[row0 : row0 + height, col0 : col0 + width]

    def bands(self) -> Iterator[tuple[int, NDArray[np.uint16]]]:
        """The only row."""
        yield 0, self._pixel

    def vouch(self) -> tuple[Voucher, tuple[PieceRun, ...]]:
        """No pixel is there to be proved."""
        return "length", ()

    def black_level(self, *_window: int) -> tuple[float, ...]:
        return self.header.black_level_dn
