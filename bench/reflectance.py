"""Reflectance maps of a four-band capture on the disk: ours, and plain numpy in one process."""

import itertools
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import tifffile

from bench.memory import measure_growth
from bench.report import judge, say, show_times
from bench.subject import NAMES, Scale, link_copies, require_equal, save_plainly
from bench.timing import compare, take_turns
from radiometry.frame import Frame
from radiometry.frame.exposure import Exposure
from radiometry.reflectance import application as reflectance_application
from simulation.camera import Taken, change
from simulation.sequoia import FULL_SCALE_DN, LENS, SEQUOIA, Sequoia, capture
from simulation.sequoia import Band as SimulatedBand
from simulation.sequoia_file import name_file, write_sequoia
from worker.decode.pool import DecoderPool
from worker.maps.making import Subject, write_map
from worker.maps.tiff import ROUNDING_REL, MapFacts, Plane

OURS = "ours, as the worker does it, without the pictures"
PLAIN = "plain numpy and tifffile"
_SURFACE = {"green": 0.12, "red": 0.08, "red_edge": 0.3, "nir": 0.45}
_I_SS = 4300.0


@dataclass(frozen=True, kw_only=True)
class Band:
    """One band's file under several names, what its sensor's model and K are, and how it was exposed."""

    paths: list[Path]
    sensor: SimulatedBand
    exposure: Exposure
    scale: reflectance_application.Scale

    def target(self, way: str) -> Path:
        return self.paths[0].with_name(f"{self.scale.band}-{way}.tif")


def run(scale: Scale) -> list[bool]:
    """Measure one capture; the camera's own 1280 x 960 unless the scale is a test's."""
    height, width = min(960, scale.rows), min(1280, scale.cols)
    camera = change(SEQUOIA, height_px=height, width_px=width)
    say(f"\nreflectance maps of a capture of four bands, {width} x {height} px each")
    with tempfile.TemporaryDirectory(prefix="stilb-bench-") as name:
        bands = _write_bands(Path(name), camera)
        with open_ours(bands) as (ours, _), open_plain(bands) as (plain, _):
            seconds = take_turns({OURS: ours, PLAIN: plain}, rounds=scale.rounds)
        for band in bands:
            require_equal(band.target("ours"), band.target("plain"), rtol=1e-4 + ROUNDING_REL)
        show_times(seconds)
        say(f"  {'memory, ours with its decoders':<54} {measure_growth(partial(open_ours, bands))}")
        say(f"  {'memory, plain numpy':<54} {measure_growth(partial(open_plain, bands))}")
    return [judge("times faster than plain numpy", compare(seconds[PLAIN], seconds[OURS]), at_least=1.0)]


@contextmanager
def open_ours(bands: Sequence[Band]) -> Iterator[tuple[Callable[[], None], list[int]]]:
    """Open each band of a capture as the worker does."""
    turns = itertools.cycle(range(NAMES))
    with DecoderPool() as pool:
        pool.read_header(bands[0].paths[0])

        def work() -> None:
            number = next(turns)
            for band in bands:
                map_ours(pool, band, band.paths[number])

        yield work, pool.pids()


@contextmanager
def open_plain(bands: Sequence[Band]) -> Iterator[tuple[Callable[[], None], list[int]]]:
    """Open each band of a capture as a script does."""
    turns = itertools.cycle(range(NAMES))

    def work() -> None:
        number = next(turns)
        for band in bands:
            map_plainly(band, band.paths[number])

    yield work, []


def map_ours(pool: DecoderPool, band: Band, path: Path) -> None:
    """Read the header with its XMP, and map the frame strip by strip."""
    header = pool.read_header(path)

    def compute(frame: Frame) -> Plane:
        return reflectance_application.scale_pixels(
            frame, header=header, exposure=band.exposure, factor=band.scale.factor
        )

    facts = MapFacts(header=header, exposure=band.exposure, software="stilb", description={"unit": "1"})
    write_map(pool, Subject(file=path, header=header, compute=compute), facts, band.target("ours"))


def map_plainly(band: Band, path: Path) -> None:
    """Read whole arrays, and reckon in single precision; the XMP's figures need not be looked for.

    The same tiles, compression and level.
    """
    samples = tifffile.imread(path)
    height, width = samples.shape
    x = (np.arange(width, dtype=np.float32) / width)[None, :]
    y = (np.arange(height, dtype=np.float32) / height)[:, None]
    share = np.zeros(samples.shape, np.float32)
    for (power_x, power_y), coefficient in zip(LENS.exponents, LENS.coefficients, strict=True):
        share += np.float32(coefficient) * x**power_x * y**power_y
    model, exposure = band.sensor.model, band.exposure
    response = model.a * exposure.exposure_time_s * exposure.iso + model.c
    factor = exposure.f_number**2 / response * band.sensor.reflectance_k / _I_SS
    reflected = (samples.astype(np.float32) - np.float32(model.b)) / share * np.float32(factor)
    reflected[samples >= FULL_SCALE_DN] = np.nan
    save_plainly(band.target("plain"), reflected, unit="1")


def _write_bands(folder: Path, camera: Sequoia) -> list[Band]:
    taken = capture(camera, np.random.default_rng(1), reflectance=_SURFACE, i_ss=_I_SS)
    return [_write_band(folder, name, camera.bands[name], shot) for name, shot in taken.items()]


def _write_band(folder: Path, name: str, sensor: SimulatedBand, shot: Taken) -> Band:
    first = folder / name_file(0, shot.header)
    write_sequoia(first, shot)
    k = sensor.reflectance_k
    scale = reflectance_application.Scale(
        band=name, factor=k / _I_SS, u_rel=0.0, sources=(), reflectance_k=k, i_ss=_I_SS, flags=()
    )
    return Band(paths=link_copies(first, NAMES), sensor=sensor, exposure=shot.exposure, scale=scale)
