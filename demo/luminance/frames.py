"""The campaign's frames as files: the simulated sensor's numbers, written as the camera writes them."""

from datetime import timedelta
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from demo.dng import write_dng
from demo.exif import Exposure
from demo.luminance.campaign import Campaign, Shot
from radiometry.frame.roi import Window
from simulation.luminance import render_frame

LENS_MAKE = "DJI"
LENS_MODEL = "DJI MFT 15mm F1.7 ASPH"
LENS_SERIAL = "L0042"

_FOCAL_LENGTH_MM = 15.0
_BETWEEN_SHOTS = timedelta(seconds=20)
_STRIP_ROWS = 256  # a full frame at once would take more than a gigabyte


def write_frame(campaign: Campaign, number: int, folder: Path) -> Path:
    """Expose and write one shot."""
    shot = campaign.shots[number]
    path = folder / shot.filename
    write_dng(
        path, expose(campaign, number), camera=campaign.camera, exposure=_exposure(campaign, number, shot)
    )
    return path


def expose(campaign: Campaign, number: int) -> NDArray[np.uint16]:
    """Expose one shot: its window's mosaic (row, col) [DN]. Its noise is its own, whatever came before."""
    shot = campaign.shots[number]
    random = np.random.default_rng([campaign.seed, number])
    strips = [
        render_frame(
            campaign.sensor,
            shot.exposed,
            random,
            row0=strip.row0,
            col0=strip.col0,
            height=strip.height,
            width=strip.width,
        )
        for strip in _strips(shot.window)
    ]
    return np.concatenate([strip.samples_dn for strip in strips])


def _exposure(campaign: Campaign, number: int, shot: Shot) -> Exposure:
    stated = shot.exposed.stated
    return Exposure(
        exposure_time_s=stated.exposure_time_s,
        f_number=stated.f_number,
        iso=round(stated.iso),
        taken_at=campaign.started_at + number * _BETWEEN_SHOTS,
        body_serial=campaign.camera.serial,
        lens_make=LENS_MAKE,
        lens_model=LENS_MODEL,
        lens_serial=LENS_SERIAL,
        focal_length_mm=_FOCAL_LENGTH_MM,
    )


def _strips(window: Window) -> list[Window]:
    """Cut a window into strips of whole rows; the last one may be lower."""
    return [
        Window(
            row0=window.row0 + row,
            col0=window.col0,
            height=min(_STRIP_ROWS, window.height - row),
            width=window.width,
        )
        for row in range(0, window.height, _STRIP_ROWS)
    ]
