"""Small DNG files as the demo's camera writes them, with a given signal."""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from demo.dng import Camera, write_dng
from demo.exif import Exposure

BLACK, WHITE = 256, 4095


def write_frame(
    path: Path,
    *,
    signal_dn: float = 1000.0,
    noise_dn: float = 4.0,
    exposure_time_s: float = 0.01,
    f_number: float = 4.0,
    iso: int = 3200,
    serial: str = "0K1XE8",
    seed: int = 1,
    shape: tuple[int, int] = (64, 96),
) -> Path:
    """A mosaic of black + signal with normal noise, rounded and clipped as a converter does."""
    noise = np.random.default_rng(seed).normal(BLACK + signal_dn, noise_dn, shape)
    mosaic = np.clip(np.rint(noise), 0, WHITE).astype(np.uint16)
    exposure = Exposure(
        exposure_time_s=exposure_time_s,
        f_number=f_number,
        iso=iso,
        taken_at=datetime(2026, 5, 1, 20, 0, tzinfo=UTC),
        body_serial=serial,
        lens_make="DJI",
        lens_model="DJI MFT 15mm F1.7 ASPH",
        lens_serial="L1",
        focal_length_mm=15.0,
    )
    camera = Camera(black_level_dn=BLACK, white_level_dn=WHITE, serial=serial)
    write_dng(path, mosaic, camera=camera, exposure=exposure)
    return path
