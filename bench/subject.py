"""The frame and the region that the readers are measured on."""

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.exposure import Settings
from radiometry.frame.roi import Polygon
from simulation.camera import Camera
from simulation.dng import Compression, write_dng

CAMERA = Camera()
ROI_SHARE = 0.05


@dataclass(frozen=True, kw_only=True)
class Scale:
    """How large everything is: in earnest, or in a test."""

    rows: int = 3956
    cols: int = 5280
    rounds: int = 15
    uploads: int = 7
    frames: int = 1000


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
