"""Statistics of a region of a file on the disk: ours, other people's ways, and the limit.

Every way ends in the same function on the same region, and must give the same numbers.
"""

import itertools
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import imagecodecs
import numpy as np
import rawpy
import tifffile

from bench import imagej
from bench.report import judge, say, show_times
from bench.subject import CAMERA, KINDS, Scale, draw_roi, measure_kinds
from bench.timing import compare, take_turns
from radiometry.frame import Frame
from radiometry.frame.roi import Polygon, Window, bounding_window
from radiometry.frame.statistics import ChannelStatistics
from radiometry.luminance import method as luminance
from simulation.dng import Compression
from worker.decode.pool import DecoderPool

Rows = tuple[ChannelStatistics, ...]

OURS = "ours, as the worker does it, its process included"
RAWPY = "rawpy's full decode"
LIMIT = "the limit: only these pixels or tiles, no header"


def run(scale: Scale) -> list[bool]:
    """Measure both kinds of file."""
    return measure_kinds(scale, partial(_measure, scale))


def _measure(scale: Scale, compression: Compression, paths: list[Path], pool: DecoderPool) -> list[bool]:
    polygon, kind = draw_roi(scale), KINDS[compression]
    window = bounding_window(polygon, height_px=scale.rows, width_px=scale.cols)
    size_mb = paths[0].stat().st_size / 1e6
    say(f"\nreading a region of 5 % of {scale.cols} x {scale.rows} px, {kind}, {size_mb:.0f} MB")
    ours, theirs = itertools.cycle(paths), itertools.cycle(paths)
    limit = (
        _limit_of_pixels(paths[0], window, polygon)
        if compression == "none"
        else _limit_of_tiles(paths[0], window, polygon)
    )
    ways: dict[str, Callable[[], Rows]] = {
        OURS: lambda: extract_ours(pool, next(ours), polygon),
        RAWPY: lambda: extract_with_rawpy(next(theirs), polygon),
        LIMIT: limit,
    }
    _require_equal(ways)
    seconds = take_turns(ways, rounds=scale.rounds)
    show_times(seconds)
    imagej.run(paths[0], polygon, ours=seconds[OURS])
    against_rawpy = compare(seconds[RAWPY], seconds[OURS])
    against_limit = compare(seconds[OURS], seconds[LIMIT])
    if compression == "none":
        return [
            judge("times faster than rawpy", against_rawpy, at_least=4.0),
            judge("times the limit", against_limit, at_most=2.0),
        ]
    return [
        judge("times faster than rawpy", against_rawpy, at_least=8.0),
        judge("times the limit", against_limit, at_most=1.5),
    ]


def extract_ours(pool: DecoderPool, path: Path, polygon: Polygon) -> Rows:
    """Extract as the worker does for one frame: header, window, statistics."""
    with pool.hold(path):
        header = pool.read_header(path)
        window = bounding_window(polygon, height_px=header.height_px, width_px=header.width_px)
        frame = pool.read_window(path, (window.row0, window.col0, window.height, window.width))
    return luminance.extract(frame, polygon)


def extract_with_rawpy(path: Path, polygon: Polygon) -> Rows:
    """Extract as a script with rawpy does: decode all of it, then read the region."""
    with rawpy.imread(str(path)) as raw:
        mosaic = raw.raw_image_visible
        window = bounding_window(polygon, height_px=mosaic.shape[0], width_px=mosaic.shape[1])
        rows, cols = _slices(window)
        return luminance.extract(_as_frame(mosaic[rows, cols], window, *mosaic.shape), polygon)


def _limit_of_pixels(path: Path, window: Window, polygon: Polygon) -> Callable[[], Rows]:
    """Map the file where the samples are known to lie, and touch only the region."""
    with tifffile.TiffFile(path) as file:
        page = file.pages[0]
        offset, shape = page.dataoffsets[0], page.shape

    def extract() -> Rows:
        mosaic = np.memmap(path, "<u2", mode="r", offset=offset, shape=shape)
        return luminance.extract(_as_frame(mosaic[_slices(window)], window, *shape), polygon)

    return extract


def _limit_of_tiles(path: Path, window: Window, polygon: Polygon) -> Callable[[], Rows]:
    """Decode only the tiles that the region's window touches, each known by its place in the file."""
    with tifffile.TiffFile(path) as file:
        page = file.pages[0]
        shape, tile = page.shape, page.tile or page.shape
        segments = list(zip(page.dataoffsets, page.databytecounts, strict=True))
    across = -(-shape[1] // tile[1])

    def touched() -> Iterator[tuple[int, int]]:
        last_row, last_col = window.row0 + window.height - 1, window.col0 + window.width - 1
        for row in range(window.row0 // tile[0], last_row // tile[0] + 1):
            for col in range(window.col0 // tile[1], last_col // tile[1] + 1):
                yield row, col

    wanted = list(touched())
    top, left = wanted[0][0] * tile[0], wanted[0][1] * tile[1]
    height = (wanted[-1][0] + 1) * tile[0] - top
    width = (wanted[-1][1] + 1) * tile[1] - left
    inner = Window(row0=window.row0 - top, col0=window.col0 - left, height=window.height, width=window.width)

    def extract() -> Rows:
        samples = np.empty((height, width), np.uint16)
        with path.open("rb") as file:
            for row, col in wanted:
                offset, count = segments[row * across + col]
                file.seek(offset)
                at_row, at_col = row * tile[0] - top, col * tile[1] - left
                samples[at_row : at_row + tile[0], at_col : at_col + tile[1]] = imagecodecs.ljpeg_decode(
                    file.read(count)
                )
        return luminance.extract(_as_frame(samples[_slices(inner)], window, *shape), polygon)

    return extract


def _as_frame(samples_dn: np.ndarray, window: Window, height_px: int, width_px: int) -> Frame:
    return Frame(
        samples_dn=samples_dn,
        row0=window.row0,
        col0=window.col0,
        height_px=height_px,
        width_px=width_px,
        cfa=CAMERA.sensor.cfa,
        black_level_dn=(CAMERA.sensor.black_level_dn,) * 4,
        white_level_dn=(CAMERA.sensor.white_level_dn,) * 4,
    )


def _slices(window: Window) -> tuple[slice, slice]:
    return slice(window.row0, window.row0 + window.height), slice(window.col0, window.col0 + window.width)


def _require_equal(ways: dict[str, Callable[[], Rows]]) -> None:
    """A quick way that gives other numbers is no way."""
    answers = {name: way() for name, way in ways.items()}
    if len(set(answers.values())) != 1:
        raise AssertionError(f"the ways differ: {answers}")
