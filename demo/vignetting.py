"""Vignetting: flat fields at six f-numbers of a lens whose axis does not meet the middle of the sensor."""

import math
from pathlib import Path

import numpy as np
import tifffile

import stilb
from demo.journey import Finding, Stage, begin, calibrate, conclude, register, take
from radiometry.vignetting.blocks import Grid
from radiometry.vignetting.falloff import evaluate_curve, find_farthest_corner
from simulation.camera import Camera, Plane, change
from simulation.targets import FALLOFFS, FAST_LENS, plan_flats

_SEED = 20260501
_CHANNEL = "G1"
_CAMERA = change(FAST_LENS, serial="0K8TF1A0010043", centre_px=(228.0, 379.0))
_QUICK_CAMERA = change(_CAMERA, height_px=160, width_px=240, centre_px=(76.0, 126.0))
_LENSFUN: dict[str, str | float] = {"focal_length_mm": 15.0, "mount": "djimft", "widest_f_number": 1.7}


def run(stage: Stage) -> bool:
    """Fit the falloff, export it; return True if all agrees with the lens."""
    camera = _QUICK_CAMERA if stage.quick else _CAMERA
    f_numbers = (2.0, 4.0) if stage.quick else tuple(FALLOFFS)
    camera_id = register(stage, camera)
    campaign_id = begin(stage, camera_id, "vignetting")
    take(stage, campaign_id, plan_flats(camera, f_numbers=f_numbers), camera=camera, seed=_SEED)
    calibration = calibrate(stage, campaign_id)
    found = {
        (row.f_number, row.name): row
        for row in stage.client.coefficients(camera_id, method="vignetting")
        if row.channel == _CHANNEL
    }
    findings = [
        Finding.of(
            f"f/{f_number:g}, corner falloff",
            found[f_number, "corner_falloff"],
            truth=_find_true_falloff(camera, f_number),
        )
        for f_number in f_numbers
    ]
    widest = f_numbers[0]
    for name, truth in zip(("centre_row_px", "centre_col_px"), camera.centre_px, strict=True):
        findings.append(Finding.of(f"f/{widest:g}, {name}", found[widest, name], truth=truth))
    findings += _export(stage, calibration, camera, widest, found[widest, "corner_falloff"])
    return conclude(stage, calibration, findings)


def _find_true_falloff(camera: Camera, f_number: float) -> float:
    """Return the loss in the frame's farthest corner, half a pixel beyond the last pixel's centre."""
    height, width, centre = camera.sensor.height_px, camera.sensor.width_px, camera.centre_px
    farthest = math.dist(find_farthest_corner(height, width, centre_px=centre), centre)
    radius = Grid.over(height, width).half_diagonal_px
    return 1.0 - float(evaluate_curve(np.array((farthest / radius) ** 2), camera.lens.falloffs[f_number]))


def _corner(camera: Camera, plane: Plane) -> float:
    """Return a plane's value in the corner pixel that is farthest from the lens's axis."""
    (row, col), sensor = camera.centre_px, camera.sensor
    at = (0 if row > (sensor.height_px - 1) / 2 else -1, 0 if col > (sensor.width_px - 1) / 2 else -1)
    return float(plane[at])


def _export(
    stage: Stage, calibration: stilb.Calibration, camera: Camera, f_number: float, falloff: stilb.Coefficient
) -> list[Finding]:
    """Save the forms of other programs; the correction map corrects the farthest corner to 1."""
    share = _corner(camera, camera.share(f_number))
    u = falloff.standard_uncertainty / (1.0 - falloff.value)

    def save(name: str, **query: str | float) -> Path:
        return stage.client.save_form(calibration.id, stage.folder / name, **query)

    gains = tifffile.imread(save("correction.tif", f_number=f_number))
    save("lensfun.xml", **_LENSFUN)
    what, value = f"f/{f_number:g}, correction.tif", _corner(camera, gains) * share
    return [Finding(what=what, value=value, standard_uncertainty=u, truth=1.0, unit="1")]
