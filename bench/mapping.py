"""Luminance map of a file on the disk as TIFF: ours, and plain numpy over rawpy's decode."""

import itertools
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import rawpy

from bench.report import judge, say, show_times
from bench.subject import CAMERA, KINDS, Scale, measure_kinds, require_equal, save_plainly
from bench.timing import compare, take_turns
from radiometry.frame import FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.luminance import SPEC
from radiometry.luminance.maps import MapScale
from simulation.dng import Compression
from worker.decode.malloc import keep_memory, share_one_arena
from worker.decode.pool import DecoderPool
from worker.maps.making import write_map
from worker.maps.tiff import ROUNDING_REL, MapFacts
from worker.measuring.surface import make_subject

OURS = "ours, as the worker does it, without the picture"
PLAIN = "plain numpy over rawpy's full decode"
_SCALE = MapScale(slope_cd_m2_per_dn=0.00123, dark_signal_dn=256.3, channel="green")
_EXPOSURE = Exposure(exposure_time_s=0.01, f_number=4.0, iso=3200.0)


def run(scale: Scale) -> list[bool]:
    """Measure both kinds of file, in a process that keeps memory as the worker's does."""
    share_one_arena()
    keep_memory()
    return measure_kinds(scale, partial(_measure, scale))


def _measure(scale: Scale, compression: Compression, paths: list[Path], pool: DecoderPool) -> list[bool]:
    say(f"\na luminance map of {scale.cols} x {scale.rows} px, {KINDS[compression]}")
    ours, plain = (paths[0].with_name(f"{name}.tif") for name in ("ours", "plain"))
    our_paths, plain_paths = itertools.cycle(paths), itertools.cycle(paths)
    ways: dict[str, Callable[[], object]] = {
        OURS: lambda: map_ours(pool, next(our_paths), ours),
        PLAIN: lambda: map_plainly(next(plain_paths), plain),
    }
    seconds = take_turns(ways, rounds=scale.rounds)
    require_equal(ours, plain, rtol=1e-5 + ROUNDING_REL)
    show_times(seconds)
    say(f"  {'the TIFF':<54} {ours.stat().st_size / 1e6:8.1f} MB")
    for path in (ours, plain):
        path.unlink()
    return [judge("times faster than plain numpy", compare(seconds[PLAIN], seconds[OURS]), at_least=3.0)]


def map_ours(pool: DecoderPool, path: Path, target: Path) -> None:
    """Make the map as the worker does for one frame."""
    with pool.hold(path):
        header: FrameHeader = pool.read_header(path)
        facts = MapFacts(header=header, exposure=_EXPOSURE, software="stilb", description={"unit": "cd/m2"})
        write_map(pool, make_subject(SPEC.application, path, header, _SCALE), facts, target)


def map_plainly(path: Path, target: Path) -> None:
    """Make the map as a script does: decode all, interpolate green in whole arrays, hand them to tifffile.

    The same tiles, compression and level, and the values as computed: ours are rounded to 12 bits first.
    Single precision, as a script that cares for time.
    """
    with rawpy.imread(str(path)) as raw:
        mosaic = raw.raw_image_visible.astype(np.float32)
    padded = np.pad(mosaic, 1, mode="reflect")
    around = padded[:-2, 1:-1] + padded[2:, 1:-1] + padded[1:-1, :-2] + padded[1:-1, 2:]
    green = np.zeros(mosaic.shape, bool)
    green[0::2, 1::2] = green[1::2, 0::2] = True
    signal = np.where(green, mosaic, around / 4)
    luminance = (signal - np.float32(_SCALE.dark_signal_dn)) * np.float32(_SCALE.slope_cd_m2_per_dn)
    over = np.pad(mosaic >= CAMERA.sensor.white_level_dn, 1, mode="reflect")
    beside = over[:-2, 1:-1] | over[2:, 1:-1] | over[1:-1, :-2] | over[1:-1, 2:]
    luminance[np.where(green, over[1:-1, 1:-1], beside)] = np.nan
    save_plainly(target, luminance, unit="cd/m2")
