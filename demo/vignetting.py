"""Vignetting: flat fields at six f-numbers of a lens whose axis does not meet the middle of the sensor."""

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import tifffile
from numpy.typing import NDArray

import stilb
from demo.dng import Camera
from demo.findings import Finding
from demo.journey import calibrate, conclude
from demo.shots import STARTED_AT, Expose, Shot, begin, register, take
from demo.stage import Stage
from radiometry.vignetting.curve import evaluate_curve, find_farthest_corner
from radiometry.vignetting.grid import Grid
from simulation.vignetting import (
    FALLOFFS,
    SimulatedFrame,
    SimulatedLens,
    simulate_dark,
    simulate_flat,
)

_SEED = 20260501
_CHANNEL = "G1"
_CAMERA = Camera(black_level_dn=256, white_level_dn=4095, serial="0K8TF1A0010043")
_LENS = SimulatedLens(height_px=480, width_px=720, centre_px=(228.0, 379.0))
_QUICK_LENS = SimulatedLens(height_px=160, width_px=240, centre_px=(76.0, 126.0))
_FRAMES = 3
_LENSFUN: dict[str, str | float] = {"focal_length_mm": 15.0, "mount": "djimft", "widest_f_number": 1.7}


def run(stage: Stage) -> bool:
    """Fit the falloff, export it; whether all agrees with the lens."""
    lens = _QUICK_LENS if stage.quick else _LENS
    f_numbers = (2.0, 4.0) if stage.quick else tuple(FALLOFFS)
    camera_id = register(stage, _CAMERA)
    campaign_id = begin(stage, camera_id, "vignetting")
    take(stage, campaign_id, _plan(lens, f_numbers), camera=_CAMERA, seed=_SEED)
    calibration = calibrate(stage, campaign_id, valid_from=STARTED_AT)
    found = {
        (row.f_number, row.name): row
        for row in stage.client.coefficients(camera_id, method="vignetting")
        if row.channel == _CHANNEL
    }
    row_px, col_px = lens.true_centre_px
    findings = [
        Finding.of(
            f"f/{f_number:g}, corner falloff",
            found[f_number, "corner_falloff"],
            truth=_true_falloff(lens, f_number),
        )
        for f_number in f_numbers
    ]
    widest = f_numbers[0]
    for name, truth in (("centre_row_px", row_px), ("centre_col_px", col_px)):
        findings.append(Finding.of(f"f/{widest:g}, {name}", found[widest, name], truth=truth))
    findings += _export(stage, calibration, lens, widest, found[widest, "corner_falloff"])
    return conclude(stage, calibration, findings)


def _plan(lens: SimulatedLens, f_numbers: tuple[float, ...]) -> list[Shot]:
    def flat(f_number: float) -> Expose:
        return _samples(lambda random: simulate_flat(lens, random, f_number=f_number))

    dark = _samples(lambda random: simulate_dark(lens, random))
    shots = [
        Shot(name=f"flat-f{f_number:g}-{n}", role="flat", expose=flat(f_number), f_number=f_number)
        for f_number in f_numbers
        for n in range(1, _FRAMES + 1)
    ]
    return shots + [Shot(name=f"dark-{n}", role="dark", expose=dark) for n in range(1, _FRAMES + 1)]


def _samples(simulate: Callable[[np.random.Generator], SimulatedFrame]) -> Expose:
    return lambda random: simulate(random).frame.samples_dn


def _true_falloff(lens: SimulatedLens, f_number: float) -> float:
    """Give what is lost in the frame's farthest corner, half a pixel beyond the last pixel's centre."""
    height, width, centre = lens.height_px, lens.width_px, lens.true_centre_px
    farthest = math.dist(find_farthest_corner(height, width, centre_px=centre), centre)
    radius = Grid.over(height, width).half_diagonal_px
    return 1.0 - float(evaluate_curve(np.array((farthest / radius) ** 2), lens.falloffs[f_number]))


def _corner(lens: SimulatedLens, plane: NDArray[np.floating]) -> float:
    """Give a plane's value in the corner pixel that lies farthest from the lens's axis."""
    row, col = lens.true_centre_px
    at = (0 if row > (lens.height_px - 1) / 2 else -1, 0 if col > (lens.width_px - 1) / 2 else -1)
    return float(plane[at])


def _export(
    stage: Stage,
    calibration: stilb.Calibration,
    lens: SimulatedLens,
    f_number: float,
    falloff: stilb.Coefficient,
) -> list[Finding]:
    """Save the forms of other programs, and correct the farthest corner by two of them: 1 is left."""
    share = _corner(lens, lens.share(f_number))
    u = falloff.standard_uncertainty / (1.0 - falloff.value)

    def save(name: str, **query: str | float) -> Path:
        return stage.client.save_form(calibration.id, stage.folder / name, **query)

    gains = tifffile.imread(save("correction.tif", f_number=f_number))
    dng = json.loads(save("dng.json", f_number=f_number).read_text(encoding="utf-8"))
    save("lensfun.xml", **_LENSFUN)
    left = {
        "correction.tif": (_corner(lens, gains) * share, u),
        # FixVignetteRadial counts the radius from its centre to the farthest corner
        "dng.json": ((1.0 + sum(dng["k"])) * share, math.hypot(u, dng["largest_error_rel"])),
    }
    return [
        Finding(what=f"f/{f_number:g}, {name}", value=value, standard_uncertainty=u, truth=1.0, unit="1")
        for name, (value, u) in left.items()
    ]
