"""Statistics of a region of a file on the disk, and its luminance map: ours, other ways, and the limit.

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
from radiometry.frame import Frame, FrameHeader, exposure, statistics
from radiometry.frame.roi import Polygon, Window, bounding_window
from radiometry.luminance import SPEC, maps
from radiometry.luminance import method as luminance
from simulation.dng import Compression
from worker.decode.pieces import keep_memory, share_one_arena
from worker.decode.pool import DecoderPool
from worker.maps.making import write_map
from worker.maps.tiff import LEVEL, ROUNDING_REL, TILE_PX, MapFacts
from worker.measuring.surface import make_subject

Rows = tuple[statistics.ChannelStatistics, ...]
_FASTER: dict[Compression, float] = {"none": 4.0, "ljpeg": 8.0}
_OF_LIMIT: dict[Compression, float] = {"none": 2.0, "ljpeg": 1.5}
_SCALE = maps.MapScale(slope_cd_m2_per_dn=0.00123, dark_signal_dn=256.3, channel="green")
_EXPOSURE = exposure.Exposure(exposure_time_s=0.01, f_number=4.0, iso=3200.0)


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
            verdicts += _make_map(scale, paths, pool)
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


def _make_map(scale: Scale, paths: list[Path], pool: DecoderPool) -> list[bool]:
    ours, plain = (paths[0].with_name(f"{name}.tif") for name in ("ours", "plain"))
    our_paths, plain_paths = itertools.cycle(paths), itertools.cycle(paths)
    seconds = take_turns(
        {
            "a map: ours, as the worker does it": lambda: _map_ours(pool, next(our_paths), ours),
            "a map: plain numpy over rawpy's full decode": lambda: _map_plainly(next(plain_paths), plain),
        },
        rounds=scale.rounds,
    )
    one, other = tifffile.imread(ours), tifffile.imread(plain)
    if not np.allclose(one, other, rtol=1e-5 + ROUNDING_REL, atol=1e-6, equal_nan=True):
        raise AssertionError("the maps differ")
    show_times(seconds)
    our, numpys = seconds.values()
    return [judge("a map, times faster than plain numpy", compare(numpys, our), at_least=3.0)]


def _map_ours(pool: DecoderPool, path: Path, target: Path) -> None:
    with pool.hold(path):
        header: FrameHeader = pool.read_header(path)
        facts = MapFacts(header=header, exposure=_EXPOSURE, software="stilb", description={"unit": "cd/m2"})
        write_map(pool, make_subject(SPEC.application, path, header, _SCALE), facts, target)


def _map_plainly(path: Path, target: Path) -> None:
    """Make the map as a script does, in single precision: decode all, interpolate green in whole arrays.

    The same tiles, compression and level, and the values as computed: ours are rounded to 12 bits first.
    """
    with rawpy.imread(str(path)) as raw:
        mosaic = raw.raw_image_visible.astype(np.float32)
    padded = np.pad(mosaic, 1, mode="reflect")
    around = padded[:-2, 1:-1] + padded[2:, 1:-1] + padded[1:-1, :-2] + padded[1:-1, 2:]
    green = np.zeros(mosaic.shape, bool)
    green[0::2, 1::2] = green[1::2, 0::2] = True
    signal = np.where(green, mosaic, around / 4)
    luminance_cd_m2 = (signal - np.float32(_SCALE.dark_signal_dn)) * np.float32(_SCALE.slope_cd_m2_per_dn)
    over = np.pad(mosaic >= CAMERA.sensor.white_level_dn, 1, mode="reflect")
    beside = over[:-2, 1:-1] | over[2:, 1:-1] | over[1:-1, :-2] | over[1:-1, 2:]
    luminance_cd_m2[np.where(green, over[1:-1, 1:-1], beside)] = np.nan
    tile, level = (TILE_PX, TILE_PX), {"level": LEVEL}
    tifffile.imwrite(target, luminance_cd_m2, tile=tile, compression="zlib", compressionargs=level)
