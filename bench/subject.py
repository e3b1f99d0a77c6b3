"""The frame and the region that the readers are measured on."""

import json
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import tifffile
from numpy.typing import NDArray

from radiometry.frame.exposure import Settings
from radiometry.frame.roi import Polygon
from simulation.camera import Camera
from simulation.dng import Compression, write_dng
from worker.decode.pool import DecoderPool
from worker.maps.tiff import LEVEL, TILE_PX

CAMERA = Camera()
ROI_SHARE = 0.05
KINDS: dict[Compression, str] = {"none": "uncompressed", "ljpeg": "lossless JPEG in tiles"}
NAMES = 6  # more than the decoding process keeps open


@dataclass(frozen=True, kw_only=True)
class Scale:
    """How large everything is: in earnest, or in a test."""

    rows: int = 3956
    cols: int = 5280
    rounds: int = 7
    uploads: int = 5
    frames: int = 1000
    grown: int = 10_000
    certificates: int = 31
    coefficients: tuple[int, ...] = (2_000, 20_000)
    """How many there are, one after the other."""
    measurements: int = 10_000
    lookups: int = 400
    """Look-ups of one turn."""
    series: int = 7
    """Turns of a series."""
    every_series: bool = False
    """Series are measured on PostgreSQL too."""
    starts: int = 2
    rests_s: float = 12.0
    workers: int = 20
    rounds_of_jobs: int = 2
    jobs_each: int = 3
    """Simulated jobs of a worker in a round."""
    job_s: float = 1.0
    jobs: int = 100_000
    waiting_jobs: int = 20_000
    waits_s: float = 5.0
    """How long they wait without a worker, and as long again beside one that may take none."""
    card: int = 500
    """Jobs of an organisation before which another's one comes."""
    restarts: int = 7
    freezes_s: float = 12.0

    @classmethod
    def named(cls, name: str) -> "Scale":
        """Return the usual scale, or with `full` the one of a large organisation."""
        if name == "full":
            coefficients = (10_000, 100_000, 1_000_000)
            return cls(coefficients=coefficients, measurements=100_000, series=3, every_series=True)
        return cls()


def make_mosaic(scale: Scale) -> NDArray[np.uint16]:
    """A surface lit from one side with the noise of photons: it compresses as a real frame does [DN]."""
    random = np.random.default_rng(1)
    light = np.linspace(600.0, 2400.0, scale.cols, dtype=np.float32)[None, :]
    black_dn = CAMERA.sensor.black_level_dn
    mosaic = np.empty((scale.rows, scale.cols), np.uint16)
    for row in range(scale.rows):
        noise = random.standard_normal(scale.cols, np.float32)
        mosaic[row] = np.rint(black_dn + light[0] + np.sqrt(light[0] * 0.5 + 16.0) * noise)
    return mosaic


def draw_roi(scale: Scale) -> Polygon:
    """A taped rectangle as a hand draws it, 5 % of the frame, off every border of a tile."""
    height, width = scale.rows * ROI_SHARE**0.5, scale.cols * ROI_SHARE**0.5
    x, y, tilt = scale.cols * 0.41, scale.rows * 0.37, 0.02
    return Polygon.from_points(
        [
            (x, y),
            (x + width, y + tilt * width),
            (x + width - tilt * height, y + tilt * width + height),
            (x - tilt * height, y + height),
        ]
    )


def measure_kinds(
    scale: Scale, measure: Callable[[Compression, list[Path], DecoderPool], list[bool]]
) -> list[bool]:
    """Measure both kinds of file."""
    verdicts: list[bool] = []
    with tempfile.TemporaryDirectory(prefix="stilb-bench-") as folder, DecoderPool() as pool:
        mosaic = make_mosaic(scale)
        for compression in KINDS:
            paths = write_copies(Path(folder), mosaic, compression, names=NAMES)
            verdicts += measure(compression, paths, pool)
            for path in paths:
                path.unlink()
    return verdicts


def write_copies(
    folder: Path, mosaic: NDArray[np.uint16], compression: Compression, *, names: int
) -> list[Path]:
    """One file under several names: a reader that keeps files open meets a new one each time."""
    first = folder / f"{compression}-0.dng"
    settings = Settings(exposure_time_s=0.01, f_number=4.0, iso=3200)
    taken_at = datetime(2026, 5, 1, 20, 0, tzinfo=UTC)
    write_dng(first, mosaic, camera=CAMERA, settings=settings, taken_at=taken_at, compression=compression)
    return link_copies(first, names)


def link_copies(first: Path, names: int) -> list[Path]:
    others = [first.with_stem(f"{first.stem}-{number}") for number in range(1, names)]
    for other in others:
        other.hardlink_to(first)
    return [first, *others]


def save_plainly(target: Path, plane: NDArray[np.float32], *, unit: str) -> None:
    """As a script does with tifffile: our tiles, compression and level."""
    tifffile.imwrite(
        target,
        plane,
        tile=(TILE_PX, TILE_PX),
        compression="zlib",
        compressionargs={"level": LEVEL},
        description=json.dumps({"unit": unit}),
        metadata=None,
    )


def require_equal(ours: Path, plain: Path, *, rtol: float) -> None:
    """A quick way that gives another map is no way; single precision differs in the last digits."""
    one, other = tifffile.imread(ours), tifffile.imread(plain)
    if not np.allclose(one, other, rtol=rtol, atol=1e-6, equal_nan=True):
        raise AssertionError("the maps differ")
