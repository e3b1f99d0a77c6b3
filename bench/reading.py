"""Statistics of a region of a file on the disk: ours, another way, and the limit.

Ways that are compared must give the same numbers.
"""

import itertools
import tempfile
from collections.abc import Callable
from pathlib import Path

import imagecodecs
import numpy as np
import rawpy
import tifffile

from bench.frames import CAMERA, NAMES, draw_roi, make_mosaic, write_copies
from bench.harness import Scale, compare, judge, say, show_times, take_turns
from radiometry.frame import Frame, statistics
from radiometry.frame.roi import Polygon, Window, bounding_window
from radiometry.luminance import method as luminance
from simulation.dng import Compression
from worker.decode.pieces import keep_memory, share_one_arena
from worker.decode.pool import DecoderPool

Rows = tuple[statistics.ChannelStatistics, ...]
_FASTER: dict[Compression, float] = {"none": 4.0, "ljpeg": 8.0}
_OF_LIMIT: dict[Compression, float] = {"none": 2.0, "ljpeg": 1.5}


def run(scale: Scale) -> list[bool]:
    """Measure uncompressed files and lossless JPEG, in a process that keeps memory as the worker's does."""
    share_one_arena()
    keep_memory()
    verdicts: list[bool] = []
    mosaic = make_mosaic(scale)
    for compression in _FASTER:
        with tempfile.TemporaryDirectory(prefix="stilb-bench-") as folder, DecoderPool() as pool:
            paths = write_copies(Path(folder), mosaic, compression, names=NAMES)
            size_mb = paths[0].stat().st_size / 1e6
            say(f"\na frame of {scale.cols} x {scale.rows} px, {size_mb:.0f} MB, compression: {compression}")
            verdicts += _read_region(scale, compression, paths, pool)
    return verdicts


def _read_region(scale: Scale, compression: Compression, paths: list[Path], pool: DecoderPool) -> list[bool]:
    polygon = draw_roi(scale)
    window = bounding_window(polygon, height_px=scale.rows, width_px=scale.cols)
    ours, theirs = itertools.cycle(paths), itertools.cycle(paths)
    ways: dict[str, Callable[[], Rows]] = {
        "a region: ours, as the worker does it": lambda: _extract_ours(pool, next(ours), polygon),
        "a region: rawpy's full decode": lambda: _extract_with_rawpy(next(theirs), polygon),
        "a region: only its pixels or tiles, no header": _make_limit(paths[0], window, polygon),
    }
    if len({way() for way in ways.values()}) != 1:
        raise AssertionError("the ways differ")
    seconds = take_turns(ways, rounds=scale.rounds)
    show_times(seconds)
    our, rawpys, limit = seconds.values()
    return [
        judge("a region, times faster than rawpy", compare(rawpys, our), at_least=_FASTER[compression]),
        judge("a region, times the limit", compare(our, limit), at_most=_OF_LIMIT[compression]),
    ]


def _extract_ours(pool: DecoderPool, path: Path, polygon: Polygon) -> Rows:
    with pool.hold(path):
        header = pool.read_header(path)
        window = bounding_window(polygon, height_px=header.height_px, width_px=header.width_px)
        frame = pool.read_window(path, (window.row0, window.col0, window.height, window.width))
    return luminance.extract(frame, polygon)


def _extract_with_rawpy(path: Path, polygon: Polygon) -> Rows:
    with rawpy.imread(str(path)) as raw:
        mosaic = raw.raw_image_visible
        window = bounding_window(polygon, height_px=mosaic.shape[0], width_px=mosaic.shape[1])
        return _extract(mosaic[_slice(window)], window, mosaic.shape, polygon)


def _make_limit(path: Path, window: Window, polygon: Polygon) -> Callable[[], Rows]:
    """Read only the pixels, or the tiles, of the window, each known by its place in the file."""
    with tifffile.TiffFile(path) as file:
        page = file.pages[0]
        shape, tile = page.shape, page.tile
        segments = list(zip(page.dataoffsets, page.databytecounts, strict=True))

    def read_pixels() -> Rows:
        mosaic = np.memmap(path, "<u2", mode="r", offset=segments[0][0], shape=shape)
        return _extract(mosaic[_slice(window)], window, shape, polygon)

    def read_tiles() -> Rows:
        rows = range(window.row0 // tile[0], (window.row0 + window.height - 1) // tile[0] + 1)
        cols = range(window.col0 // tile[1], (window.col0 + window.width - 1) // tile[1] + 1)
        samples = np.empty((len(rows) * tile[0], len(cols) * tile[1]), np.uint16)
        with path.open("rb") as file:
            for row, col in itertools.product(rows, cols):
                offset, count = segments[row * -(-shape[1] // tile[1]) + col]
                file.seek(offset)
                y, x = (row - rows[0]) * tile[0], (col - cols[0]) * tile[1]
                samples[y : y + tile[0], x : x + tile[1]] = imagecodecs.ljpeg_decode(file.read(count))
        top, left = window.row0 - rows[0] * tile[0], window.col0 - cols[0] * tile[1]
        inside = samples[top : top + window.height, left : left + window.width]
        return _extract(inside, window, shape, polygon)

    return read_tiles if tile else read_pixels


def _extract(samples_dn: np.ndarray, window: Window, shape: tuple[int, ...], polygon: Polygon) -> Rows:
    frame = Frame(
        samples_dn=samples_dn,
        row0=window.row0,
        col0=window.col0,
        height_px=shape[0],
        width_px=shape[1],
        cfa=CAMERA.sensor.cfa,
        black_level_dn=(CAMERA.sensor.black_level_dn,) * 4,
        white_level_dn=(CAMERA.sensor.white_level_dn,) * 4,
    )
    return luminance.extract(frame, polygon)


def _slice(window: Window) -> tuple[slice, slice]:
    return slice(window.row0, window.row0 + window.height), slice(window.col0, window.col0 + window.width)
