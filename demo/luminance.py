"""Luminance: a night's campaign at four ISO values, two meters, a target of the procedure."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
from rich import box
from rich.table import Table

import stilb
from demo.journey import Finding, Stage, begin, calibrate, register, take
from radiometry.frame.roi import Polygon, Window
from radiometry.records import Record
from simulation.camera import Camera, Meter, Shot, change
from simulation.luminance import ISOS, X5S, Errors, find_k, plan_campaign
from stilb.records import Reading

_SEED = 20250301
_STARTED_AT = datetime(2025, 3, 1, 20, 30, tzinfo=UTC)
_TOLERANCE_REL = 0.04  # the procedure's
_SURFACE_REFLECTANCE = 0.18  # of the grey target
_CAMERA = change(X5S, seed=7)
# Even corners, so that a readout begins with the same colour as the sensor.
_READOUT = Window(row0=1500, col0=2900, height=480, width=640)
# The taped rectangle as a hand draws it: (x, y) [px] of the whole sensor.
ROI = Polygon.from_points([(2976.0, 1560.0), (3460.0, 1571.0), (3455.0, 1902.0), (2971.0, 1891.0)])
_STRIP_ROWS = 256  # a full frame at once would take more than a gigabyte
_ERRORS = Errors(repeatability=0.01, calibration=0.01, f_number=0.01, exposure_time=0.003)
_LUMINANCE_READINGS, _MONITOR_READINGS = 5, 4
_MONITOR_REPEATABILITY_REL, _MONITOR_CALIBRATION_REL = 0.003, 0.01
# By quantity: model, serial, certificate number, standard uncertainty.
_METERS = {
    "luminance": ("LS-150", "30011942", "L-2025-0117", _ERRORS.calibration),
    "illuminance": ("T-10A", "40027731", "E-2025-0118", _MONITOR_CALIBRATION_REL),
}


class Campaign(Record):
    """Frames and readings of a field team, with the truth that it never knows: K by ISO value."""

    camera: Camera
    shots: tuple[Shot, ...]
    readings: tuple[Reading, ...]
    true_luminance_k: Mapping[int, float]


def plan(seed: int, *, camera: Camera = _CAMERA, isos: Sequence[float] = ISOS) -> Campaign:
    """Plan the frames, draw the readings. The same seed gives the same campaign, and the same files."""
    random = np.random.default_rng(seed)
    simulated = plan_campaign(
        camera, random, errors=_ERRORS, isos=isos, readings_per_scene=_LUMINANCE_READINGS
    )
    shown = [(reading.scene, "luminance", reading.value, "cd/m2") for reading in simulated.readings]
    # An illuminance meter beside the target watches the lamp: E = pi L / rho.
    monitor = Meter(
        scale=float(random.normal(1.0, _MONITOR_CALIBRATION_REL)), repeatability=_MONITOR_REPEATABILITY_REL
    )
    shown += [
        (scene, "illuminance", monitor.read(math.pi * luminance / _SURFACE_REFLECTANCE, random), "lx")
        for scene, luminance in simulated.truth_cd_m2.items()
        for _ in range(_MONITOR_READINGS)
    ]
    return Campaign(
        camera=simulated.camera,
        shots=_choose(simulated.shots),
        readings=tuple(
            {"scene": scene, "quantity": quantity, "value": float(f"{value:.4g}"), "unit": unit}
            for scene, quantity, value, unit in shown
        ),
        true_luminance_k={round(shot.settings.iso): find_k(camera, ROI) for shot in simulated.shots},
    )


def _choose(planned: Sequence[Shot]) -> tuple[Shot, ...]:
    """Choose every second aperture, of one level the first, third, ..., of the next the others.

    The first frame of each ISO value is a full one, the rest are readouts.
    """
    chosen: list[Shot] = []
    for iso in sorted({shot.settings.iso for shot in planned}):
        own = [shot for shot in planned if shot.settings.iso == iso]
        light: list[Shot] = []
        for turn, scene in enumerate(sorted({shot.scene for shot in own if shot.scene is not None})):
            light += [shot for shot in own if shot.scene == scene][turn % 2 :: 2]
        for number, shot in enumerate([*light, *(shot for shot in own if shot.scene is None)]):
            name = f"DJI_{len(chosen) + 1:04}"
            window = None if number == 0 else _READOUT
            chosen.append(replace(shot, frame=name, window=window, rows_at_once=_STRIP_ROWS))
    return tuple(chosen)


def run(stage: Stage) -> bool:
    """Calibrate K; return True if every K agrees with its truth."""
    client, campaign = stage.client, plan(_SEED)
    calibration = carry_out(stage, campaign, seed=_SEED)
    camera_id = str(calibration.camera_id)
    found = compare(
        client.coefficients(camera_id, method="luminance"),
        client.series(camera_id=camera_id, method="luminance"),
        truth=campaign.true_luminance_k,
    )
    stage.display.show(as_table(found, find_largest_errors(calibration), tolerance_rel=_TOLERANCE_REL))
    stage.display.say(f"version {calibration.version} is {calibration.state}")
    return all(finding.agrees for finding in found.values())


def carry_out(stage: Stage, campaign: Campaign, *, seed: int) -> stilb.Calibration:
    """Send a campaign, fit it and put the version in force."""
    client = stage.client
    campaign_id = begin(
        stage,
        register(stage, campaign.camera, sensor_width_mm=17.3),
        "luminance",
        project_number=f"DEMO-{seed}",
        started_at=_STARTED_AT,
        surface_reflectance=_SURFACE_REFLECTANCE,
    )
    client.set_roi(campaign_id, polygon=ROI.points)
    if not any(client.readings(campaign_id)):
        _read_meters(client, campaign_id, campaign.readings)
    camera, shots = campaign.camera, campaign.shots
    take(stage, campaign_id, shots, camera=camera, seed=seed, started_at=_STARTED_AT, roi=ROI)
    return calibrate(
        stage, campaign_id, valid_from=_STARTED_AT, model="proportional", tolerance=_TOLERANCE_REL
    )


def certify(number: str, u_rel: float, *, year: int) -> dict[str, Any]:
    """Return the certificate of a meter, of January of a year."""
    return {
        "number": number,
        "laboratory": "Photometry Laboratory, Demo",
        "issued_on": f"{year}-01-17",
        "due_on": f"{year + 1}-01-17",
        "expanded_uncertainty_rel": 2 * u_rel,
        "coverage_factor": 2.0,
    }


def _read_meters(client: stilb.Client, campaign_id: str, readings: Sequence[Reading]) -> None:
    ids = {
        kind: client.create_meter(
            kind, "Konica Minolta", model, serial, certificate=certify(number, u_rel, year=_STARTED_AT.year)
        ).id
        for kind, (model, serial, number, u_rel) in _METERS.items()
    }
    client.add_readings(campaign_id, [{**each, "meter_id": ids[each["quantity"]]} for each in readings])


def compare(
    in_force: Sequence[stilb.Coefficient], series: Sequence[dict[str, Any]], *, truth: Mapping[int, float]
) -> dict[int, Finding]:
    """Compare the K that a dashboard reads with the truth; a missing or different value is an error."""
    found = {row.iso: row for row in in_force if row.name == "luminance_k"}
    general = [row for row in series if row.get("f_number") is None]
    shown = {row["iso"]: row["value"] for row in general if row["name"] == "luminance_k"}
    for iso in truth:
        if shown[iso] != found[iso].value:
            message = f"iso {iso}: the series says {shown[iso]}, the coefficients say {found[iso].value}"
            raise ValueError(message)
    return {iso: Finding.of(str(iso), found[iso], truth=true_k) for iso, true_k in truth.items()}


def find_largest_errors(calibration: stilb.Calibration) -> dict[int, float]:
    """Return the largest relative error of the points in use, by ISO value."""
    largest: dict[int, float] = {}
    for point in calibration.raw["points"]:
        if point["used"]:
            largest[point["iso"]] = max(largest.get(point["iso"], 0.0), abs(float(point["residual_rel"])))
    return largest


def as_table(found: Mapping[int, Finding], errors: Mapping[int, float], *, tolerance_rel: float) -> Table:
    """Lay each K out beside its truth and the procedure's verdict."""
    table = Table(title="luminance K [DN*m2/(cd*s)] beside the simulated truth", box=box.SIMPLE_HEAD)
    for heading in ("ISO", "K", "u(K)", "truth", "(K-truth)/u(K)", "largest error"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("verdict")
    for iso, one in found.items():
        verdict = f"{'within' if errors[iso] <= tolerance_rel else 'beyond'} {tolerance_rel:.0%}"
        table.add_row(
            str(iso),
            *(f"{figure:.3f}" for figure in (one.value, one.standard_uncertainty, one.truth)),
            f"{one.difference:+.2f}",
            f"{errors[iso]:.2%} of L",
            verdict if one.agrees else f"{verdict}, far from the truth",
        )
    return table
