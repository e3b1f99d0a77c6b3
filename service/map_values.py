"""Numbers out of a map: a window of it, pixel by pixel or as means over squares, tile by tile."""

import json
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

MOST_VALUES = 250_000

Values = NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class Window:
    """Rows [top, bottom) and columns [left, right) of a map."""

    top: int
    left: int
    bottom: int
    right: int


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Where the tiles of a map lie in its file."""

    height_px: int
    width_px: int
    tile_px: int
    predicted: bool
    offsets: tuple[int, ...]
    sizes: tuple[int, ...]
    description: str

    @property
    def unit(self) -> str:
        """Unit of the values, as the file states it."""
        return str(json.loads(self.description)["unit"])

    @property
    def across(self) -> int:
        """Tiles in a row."""
        return -(-self.width_px // self.tile_px)


def read_layout(path: Path) -> Layout:
    """The layout of a file of worker/maps/tiff.py: square tiles of float32, deflated."""
    import tifffile

    with tifffile.TiffFile(path) as file:
        page = file.pages.first
        return Layout(
            height_px=page.imagelength,
            width_px=page.imagewidth,
            tile_px=page.tilewidth,
            predicted=page.predictor != 1,
            offsets=tuple(page.dataoffsets),
            sizes=tuple(page.databytecounts),
            description=page.description,
        )


def read_values(path: Path, layout: Layout, window: Window, *, step: int) -> Values:
    """Means over squares of ``step`` pixels from the window's corner on, (row, col); NaN where unknown.

    What is left at the right and the lower border, less than a square, is left out.
    """
    rows, cols = (window.bottom - window.top) // step, (window.right - window.left) // step
    inner = Window(
        top=window.top, left=window.left, bottom=window.top + rows * step, right=window.left + cols * step
    )
    sums = np.zeros((rows, cols), np.float64)
    touched = dict(_tiles_of(layout, inner))
    for index, plane in read_tiles(path, layout, touched):
        tile = touched[index]
        top, left = (index // layout.across) * layout.tile_px, (index % layout.across) * layout.tile_px
        part = plane[tile.top - top : tile.bottom - top, tile.left - left : tile.right - left]
        _add(sums, part, row=tile.top - inner.top, col=tile.left - inner.left, step=step)
    return (sums / step**2).astype(np.float32)


def read_tiles(path: Path, layout: Layout, indices: Iterable[int]) -> Iterator[tuple[int, Values]]:
    """Read tiles of a map one after the other, each with its index."""
    with path.open("rb") as file:
        for index in indices:
            file.seek(layout.offsets[index])
            yield index, _decode(zlib.decompress(file.read(layout.sizes[index])), layout)


def _decode(tile: bytes, layout: Layout) -> Values:
    """Undo TIFF's floating point predictor: differences of bytes, the highest byte of every pixel first."""
    size = layout.tile_px
    if not layout.predicted:
        return np.frombuffer(tile, "<f4").reshape(size, size)
    rows = np.cumsum(np.frombuffer(tile, np.uint8).reshape(size, 4 * size), axis=1, dtype=np.uint8)
    planes = np.ascontiguousarray(rows.reshape(size, 4, size).transpose(0, 2, 1))
    return planes.view(">f4")[..., 0]


def _tiles_of(layout: Layout, window: Window) -> Iterator[tuple[int, Window]]:
    """The index of each tile that a window touches, and what it touches of it."""
    size = layout.tile_px
    for tile_row in range(window.top // size, -(-window.bottom // size)):
        for tile_col in range(window.left // size, -(-window.right // size)):
            yield (
                tile_row * layout.across + tile_col,
                Window(
                    top=max(window.top, tile_row * size),
                    left=max(window.left, tile_col * size),
                    bottom=min(window.bottom, (tile_row + 1) * size),
                    right=min(window.right, (tile_col + 1) * size),
                ),
            )


def _add(sums: NDArray[np.float64], part: Values, *, row: int, col: int, step: int) -> None:
    """Add a part's pixels, the first of which is (row, col) from the window's corner, to their squares."""
    height, width = part.shape
    if step == 1:
        sums[row : row + height, col : col + width] = part
        return
    to_rows, to_cols = (row + np.arange(height)) // step, (col + np.arange(width)) // step
    lines = np.add.reduceat(part, np.flatnonzero(np.diff(to_rows, prepend=-1)), axis=0, dtype=np.float64)
    squares = np.add.reduceat(lines, np.flatnonzero(np.diff(to_cols, prepend=-1)), axis=1)
    sums[to_rows[0] : to_rows[-1] + 1, to_cols[0] : to_cols[-1] + 1] += squares
