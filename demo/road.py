"""A road: K, frames from 60 m, a plan's control points read with a lux meter, and the verdict on class C3."""

import math
from datetime import UTC, datetime
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import stilb
from demo import luminance
from demo.journey import Finding, Stage, as_table, begin, take
from radiometry.frame.exposure import Settings
from radiometry.frame.grid import map_plane
from radiometry.frame.roi import Window
from radiometry.records import Record
from simulation.camera import Camera, Lamp, Plane, Shot, change
from simulation.luminance import X5S

_SEED, _FRAMES = 20261112, 4
_TAKEN_AT = datetime(2026, 11, 12, 20, 42, tzinfo=UTC)
_CAMERA = change(X5S, seed=7, falloff=(0.0, 0.0, 0.0))
_SETTINGS = Settings(exposure_time_s=0.04, f_number=2.8, iso=3200.0)
_ISOS = (3200.0,)
_HEIGHT_M, _FLIGHT_M, _SPACING_M, _WIDTH_M, _PATCH_M = 10.0, 60.0, 35.0, 7.0, 0.5
_BLOCK_PX = 8  # squares of pixels that show the same light, 0.1 m on the road
_INTENSITY_CD, _RHO, _PATCHES_REL = 4500.0, 0.1, 0.05
_SITE = {
    "rows": [{"y_m": -1.0, "height_m": _HEIGHT_M, "spacing_m": _SPACING_M}],
    "strips": [{"name": str(n + 1), "kind": "lane", "y_m": 3.5 * n, "width_m": 3.5} for n in range(2)],
}
_ROAD: dict[str, Any] = {
    "name": "Harbour Street",
    "site": _SITE,
    "requirement": {"rule": "EN 13201-2:2015", "road_class": "C3", "confirmed": "the demo"},
    "conditions": {"surface": "dry", "mains_frequency_hz": 50, "power_w": 276, "reflectance": 0.11},
}


def illuminate(x_m: Plane, y_m: Plane) -> Plane:
    """Compute the illuminance of lamps with a wing to both sides along the road [lx]."""
    total = np.zeros(np.broadcast(x_m, y_m).shape)
    for pole in range(-3, 5):
        along, across = x_m - pole * _SPACING_M, y_m + 1.0
        away = along**2 + across**2
        gamma = np.degrees(np.arctan(np.sqrt(away) / _HEIGHT_M))
        wing = 0.6 * np.exp(-(((gamma - 55.0) / 18.0) ** 2)) * along**2 / (away + 1e-9)
        total += _INTENSITY_CD * (1.3 + wing) * _HEIGHT_M / (away + _HEIGHT_M**2) ** 1.5
    return total


def look(turn: int) -> Plane:
    """Return the homography from the road [m] to a frame [px], which leans by up to 6 degrees."""
    lean = Rotation.from_euler("YX", [4.0 * (turn % 4) - 6.0, 3.0 * (turn % 3) - 3.0], degrees=True)
    above = np.array([[1.0, 0.0, -_SPACING_M / 2], [0.0, 1.0, -_WIDTH_M / 2], [0.0, 0.0, _FLIGHT_M]])
    focal = 1e3 * _CAMERA.body.focal_length_mm / _CAMERA.body.pixel_pitch_um
    sensor = _CAMERA.sensor
    lens = np.array([[focal, 0, sensor.width_px / 2], [0, focal, sensor.height_px / 2], [0, 0, 1]])
    return np.asarray(lens @ lean.as_matrix() @ above, np.float64)


class _Pavement(Record):
    """The road as a frame sees it, its pavement in patches; drawn only when it is photographed."""

    turn: int

    def draw(self, camera: Camera, window: Window) -> Plane:  # noqa: ARG002  as every target
        """Return the luminance of each pixel [cd/m2]."""
        height, width = camera.sensor.height_px, camera.sensor.width_px
        middles = [np.arange(_BLOCK_PX / 2, size + _BLOCK_PX, _BLOCK_PX) for size in (height, width)]
        rows, cols = np.meshgrid(*middles, indexing="ij")
        back = np.asarray(np.linalg.inv(look(self.turn)), np.float64)
        x, y = np.moveaxis(map_plane(back, np.stack([cols, rows], axis=-1)), -1, 0)
        patches = np.random.default_rng(_SEED).standard_normal((400, 400))
        at = [np.clip((each / _PATCH_M).astype(np.intp) + 200, 0, 399) for each in (y, x)]
        blocks = illuminate(x, y) * _RHO / math.pi * np.exp(_PATCHES_REL * patches[at[0], at[1]])
        return np.kron(blocks, np.ones((_BLOCK_PX, _BLOCK_PX))).astype(np.float64)[:height, :width]


def run(stage: Stage) -> bool:
    """Calibrate K, state a road, read the planned points; return True if the figures agree with the truth."""
    client, display, count = stage.client, stage.display, 1 if stage.quick else _FRAMES
    calibration = luminance.carry_out(stage, luminance.plan(_SEED, camera=_CAMERA, isos=_ISOS), seed=_SEED)
    night = begin(
        stage, str(calibration.camera_id), "luminance", kind="measurement", project_number="DEMO-road"
    )
    lamp = Lamp(luminance_cd_m2=1.0)
    shots = [
        Shot(frame=f"road-{n + 1:02}", role="field", settings=_SETTINGS, lamp=lamp, target=_Pavement(turn=n))
        for n in range(count)
    ]
    sent = take(stage, night, shots, camera=_CAMERA, seed=_SEED, started_at=_TAKEN_AT)
    frames = [{"frame_id": each.id, "marks": _mark(turn)} for turn, each in enumerate(sent)]
    road = client.create_road(**_ROAD, frames=frames)
    planned = client.plan_road(road.id)["points"]
    certificate = luminance.certify("E-2026-0118", 0.02, year=2026)
    meter = client.create_meter("illuminance", "Konica Minolta", "T-10A", "40027732", certificate=certificate)
    client.set_road_points(road.id, _read(planned, meter.id))
    with display.stage(f"evaluating {count} frames"):
        result = client.evaluate_road(road.id)
    for name in ("report.pdf", "points.csv", "points.geojson", "map.png"):
        client.save_road(result, stage.folder / name)
    client.save_plan(road.id, stage.folder / "plan.pdf")
    findings = _compare(result.raw)
    display.show(as_table(f"road, {len(planned)} control points:", findings))
    verdict = f"{result.verdict} by {_ROAD['requirement']['road_class']}"
    display.say(f"{verdict}; KEEP=1 keeps the report in {stage.folder}")
    return all(each.agrees for each in findings)


def _mark(turn: int) -> list[dict[str, float]]:
    """Mark six points of the road in a frame, as well as a hand does."""
    random = np.random.default_rng([_SEED, 9, turn])
    places = np.array([(x, y) for x in (0.0, _SPACING_M / 2, _SPACING_M) for y in (0.0, _WIDTH_M)])
    seen = map_plane(look(turn), places) + random.normal(0.0, 1.0, places.shape)
    names = ("x_px", "y_px", "x_m", "y_m")
    return [dict(zip(names, each, strict=True)) for each in np.hstack([seen, places]).tolist()]


def _read(planned: list[dict[str, Any]], meter_id: str) -> list[dict[str, Any]]:
    """Read a lux meter at the planned points: 2 % are its scale's, 3 % a reading's own."""
    random = np.random.default_rng([_SEED, 1])
    scale, points = random.normal(1.0, 0.02), []
    for each in planned:
        x, y = each["x_m"], each["y_m"]
        value = float(illuminate(np.array(x), np.array(y))) * scale * random.normal(1.0, 0.03)
        stated = {"name": each["name"], "x_m": x, "y_m": y, "meter_id": meter_id}
        points.append(stated | {"quantity": "illuminance", "unit": "lx", "values": [float(f"{value:.3g}")]})
    return points


def _compare(raw: dict[str, Any]) -> list[Finding]:
    x, y = (np.array([each[name] for each in raw["points"]]) for name in ("x_m", "y_m"))
    light = illuminate(x, y)
    average, least = float(light.mean()), float(light.min())
    truths = {"e_av": average, "e_min": least, "u_0": least / average}
    truths["pdi"] = 276e3 / (average * _SPACING_M * _WIDTH_M)
    names = ("value", "standard_uncertainty", "unit")
    return [
        Finding.of(figure, stilb.Quantity(**{name: each[name] for name in names}), truth=truths[figure])
        for each in raw["figures"]
        if (figure := each["figure"]) in truths
    ]
