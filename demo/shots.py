"""Frames of a camera with a lens: exposed by a simulation, written as DNG, sent with their roles."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import stilb
from demo.dng import Camera, write_dng
from demo.exif import Exposure
from demo.journey import ensure_campaign, send, write_files
from demo.stage import Stage
from stilb.records import CampaignDetails

STARTED_AT = datetime(2026, 5, 1, 12, 0, tzinfo=UTC)

_LENS_MAKE, _LENS_MODEL, _LENS_SERIAL = "DJI", "DJI MFT 15mm F1.7 ASPH", "L0042"
_FOCAL_LENGTH_MM = 15.0
_PIXEL_PITCH_UM = 3.28
_BETWEEN_SHOTS = timedelta(seconds=20)

Expose = Callable[[np.random.Generator], NDArray[np.uint16]]


@dataclass(frozen=True, kw_only=True)
class Shot:
    """One frame to take; ``expose`` gives its mosaic, (row, col) [DN], from a generator of its own."""

    name: str
    role: str
    expose: Expose
    exposure_time_s: float = 0.01
    f_number: float = 4.0
    iso: int = 100


def register(stage: Stage, camera: Camera) -> str:
    """Give the camera's id."""
    return stage.client.create_camera(
        camera.make,
        camera.model,
        camera.serial,
        lens={"make": _LENS_MAKE, "model": _LENS_MODEL, "serial": _LENS_SERIAL},
        pixel_pitch_um=_PIXEL_PITCH_UM,
    ).id


def begin(stage: Stage, camera_id: str, method: str, *, target: dict[str, Any] | None = None) -> str:
    """Give the id of the method's campaign; ``target`` is what is photographed, where the method asks."""
    details: CampaignDetails = {} if target is None else {"target": target}
    details["project_number"] = f"DEMO-{method}"
    details["started_at"] = STARTED_AT
    return ensure_campaign(stage.client, camera_id, method, **details)


def take(
    stage: Stage, campaign_id: str, shots: Sequence[Shot], *, camera: Camera, seed: int
) -> list[stilb.Frame]:
    """Expose, write and send every shot, and wait until all are read."""
    paths = write_files(
        stage,
        [partial(_write, stage.folder, shot, number, camera, seed) for number, shot in enumerate(shots)],
    )
    return send(
        stage,
        [
            stilb.Upload(campaign_id=campaign_id, path=path, role=shot.role)
            for shot, path in zip(shots, paths, strict=True)
        ],
    )


def _write(folder: Path, shot: Shot, number: int, camera: Camera, seed: int) -> Path:
    path = folder / f"{shot.name}.DNG"
    exposure = Exposure(
        exposure_time_s=shot.exposure_time_s,
        f_number=shot.f_number,
        iso=shot.iso,
        taken_at=STARTED_AT + number * _BETWEEN_SHOTS,
        body_serial=camera.serial,
        lens_make=_LENS_MAKE,
        lens_model=_LENS_MODEL,
        lens_serial=_LENS_SERIAL,
        focal_length_mm=_FOCAL_LENGTH_MM,
    )
    samples = shot.expose(np.random.default_rng([seed, number]))
    write_dng(path, samples, camera=camera, exposure=exposure)
    return path
