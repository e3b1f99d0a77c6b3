"""Reflectance: a Sequoia before, during and after a flight, while its K drifts and the light changes.

A panel is photographed before and after; K(t) runs between the two. What the panel really reflects differs
from its certificate, by the certificate's uncertainty. The field is of four surfaces side by side.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path

import numpy as np
import tifffile
from numpy.typing import NDArray

import stilb
from demo.findings import Finding
from demo.journey import calibrate, conclude, ensure_campaign, send, write_files
from demo.sequoia import name_file, write_sequoia
from demo.stage import Stage
from simulation.reflectance import (
    BANDS,
    SimulatedFrame,
    SimulatedSequoia,
    simulate_sequoia_capture,
)

_SEED = 20180413
_START = datetime(2018, 4, 13, 8, 0, tzinfo=UTC)
_DRIFT_REL = 0.02  # of K, from the first to the last capture
_FLIGHT = timedelta(minutes=30)
_PANEL_CERTIFIED = {"green": 0.183, "red": 0.181, "red_edge": 0.180, "nir": 0.178}
_PANEL_U = 0.002
_SURFACES = {
    "meadow": {"green": 0.09, "red": 0.05, "red_edge": 0.28, "nir": 0.48},
    "soil": {"green": 0.14, "red": 0.20, "red_edge": 0.25, "nir": 0.30},
    "concrete": {"green": 0.35, "red": 0.36, "red_edge": 0.37, "nir": 0.38},
    "water": {"green": 0.06, "red": 0.04, "red_edge": 0.02, "nir": 0.01},
}
_LOW_GAIN, _HIGH_GAIN = (1,) * 10, (2,) * 10

Corners = list[tuple[float, float]]


@dataclass(frozen=True, kw_only=True)
class Capture:
    """Four bands at one moment; ``i_ss`` : its light [counts/s], which nobody knows."""

    role: str
    after: timedelta
    i_ss: float
    gain_indices: tuple[int, ...] = _LOW_GAIN

    @property
    def time_share(self) -> float:
        """How much of the flight is over, 0..1."""
        return self.after / _FLIGHT


_CAPTURES = (
    Capture(role="panel", after=timedelta(0), i_ss=4300.0),
    Capture(role="panel", after=timedelta(seconds=20), i_ss=4310.0),
    Capture(role="field", after=timedelta(minutes=8), i_ss=3600.0, gain_indices=_HIGH_GAIN),
    Capture(role="field", after=timedelta(minutes=22), i_ss=4100.0),
    Capture(role="panel", after=_FLIGHT - timedelta(seconds=20), i_ss=4500.0),
    Capture(role="panel", after=_FLIGHT, i_ss=4500.0),
)


def run(stage: Stage) -> bool:
    """Calibrate K of four bands, measure the field; whether all agrees with the truth."""
    camera = SimulatedSequoia()
    if stage.quick:
        camera = replace(camera, height_px=120, width_px=160)
    shots = _simulate(camera)
    files = write_files(stage, [partial(_write, stage.folder, shot, n // 4) for n, shot in enumerate(shots)])
    roles = [capture.role for capture in _CAPTURES for _ in BANDS]
    by_role = {
        role: [path for path, its in zip(files, roles, strict=True) if its == role]
        for role in ("panel", "field")
    }
    camera_id = stage.client.create_camera("Parrot", "Sequoia", camera.camera_serial).id
    calibration = _calibrate(stage, camera_id, camera, by_role["panel"])
    findings = [
        Finding.of(f"K, {row.band}", row, truth=_k_at(row.band or "", 0.5))
        for row in stage.client.coefficients(camera_id, method="reflectance", at=_START)
    ]
    findings += _measure(stage, camera_id, camera, by_role["field"])
    return conclude(stage, calibration, findings)


def _k_at(band: str, time_share: float) -> float:
    return BANDS[band].reflectance_k * (1.0 + _DRIFT_REL * time_share)


def _simulate(camera: SimulatedSequoia) -> list[SimulatedFrame]:
    random = np.random.default_rng(_SEED)
    panel = {band: value + _PANEL_U * random.standard_normal() for band, value in _PANEL_CERTIFIED.items()}
    field = {band: _lay_out(camera, band) for band in BANDS}
    shots: list[SimulatedFrame] = []
    for number, capture in enumerate(_CAPTURES):
        bands = {
            name: replace(band, reflectance_k=_k_at(name, capture.time_share)) for name, band in BANDS.items()
        }
        surface: Mapping[str, float | NDArray[np.float64]] = panel if capture.role == "panel" else field
        exposed = simulate_sequoia_capture(
            replace(camera, bands=bands),
            random,
            reflectance=surface,
            i_ss=capture.i_ss,
            gain_indices=capture.gain_indices,
            taken_at=_START + capture.after,
            capture_id=f"demo-{number}",
        )
        shots += exposed.values()
    return shots


def _lay_out(camera: SimulatedSequoia, band: str) -> NDArray[np.float64]:
    """Give the field's true reflectance, (row, col): the surfaces as stripes from left to right."""
    names = list(_SURFACES)
    which = np.arange(camera.width_px) * len(names) // camera.width_px
    stripes = np.array([_SURFACES[name][band] for name in names])[which]
    return np.broadcast_to(stripes, (camera.height_px, camera.width_px))


def _inside(camera: SimulatedSequoia, surface: str) -> Corners:
    """Give a rectangle well inside of a surface's stripe."""
    stripe = camera.width_px // len(_SURFACES)
    left = list(_SURFACES).index(surface) * stripe
    x0, x1 = left + stripe // 4, left + 3 * stripe // 4
    y0, y1 = camera.height_px // 4, 3 * camera.height_px // 4
    return [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]


def _write(folder: Path, shot: SimulatedFrame, capture: int) -> Path:
    path = folder / name_file(capture, shot.header)
    write_sequoia(path, shot)
    return path


def _calibrate(
    stage: Stage, camera_id: str, camera: SimulatedSequoia, files: list[Path]
) -> stilb.Calibration:
    client = stage.client
    panel = client.create_panel(
        "P-18",
        measured_on="2018-03-01",
        bands=[
            {"band": band, "reflectance": value, "standard_uncertainty": _PANEL_U}
            for band, value in _PANEL_CERTIFIED.items()
        ],
    )
    campaign_id = ensure_campaign(
        client, camera_id, "reflectance", project_number="DEMO-PANEL", started_at=_START, panel_id=panel.id
    )
    row, col = camera.height_px // 2, camera.width_px // 2
    high, wide = camera.height_px // 16, camera.width_px // 16
    client.set_roi(
        campaign_id,
        polygon=[
            (col - wide, row - high),
            (col + wide, row - high),
            (col + wide, row + high),
            (col - wide, row + high),
        ],
    )
    send(stage, [stilb.Upload(campaign_id=campaign_id, path=path, role="panel") for path in files])
    return calibrate(
        stage,
        campaign_id,
        valid_from=_START,
        valid_to=_START + timedelta(days=1),
        interpolation="linear",
    )


def _measure(stage: Stage, camera_id: str, camera: SimulatedSequoia, files: list[Path]) -> list[Finding]:
    """Measure the flight in one request, an index a capture, and one map."""
    client = stage.client
    campaign_id = ensure_campaign(
        client, camera_id, "reflectance", project_number="DEMO-FLIGHT", started_at=_START
    )
    client.set_roi(campaign_id, polygon=_inside(camera, "meadow"))
    frames = send(stage, [stilb.Upload(campaign_id=campaign_id, path=path, role="field") for path in files])
    findings: list[Finding] = []
    truth = _SURFACES["meadow"]
    with stage.display.stage("measuring the flight"):
        measured, left_out = client.measure_campaign(campaign_id)
        if left_out:
            raise ValueError(f"not measured: {left_out}")
        order = [path.name for path in files]
        for number, found in enumerate(sorted(measured, key=lambda one: order.index(one.filename))):
            band = found.raw["reflected"]["band"]
            what = f"meadow, {band}, {number // len(BANDS) + 1}"
            findings.append(Finding.of(what, _mean_of(found), truth=truth[band]))
        ndvi = (truth["nir"] - truth["red"]) / (truth["nir"] + truth["red"])
        for number, frame in enumerate(frame for frame in frames if frame.filename.endswith("_RED.TIF")):
            index = client.measure(frame.id, index="ndvi")
            findings.append(Finding.of(f"meadow, NDVI, {number + 1}", _mean_of(index), truth=ndvi))
    findings.append(_check_map(stage, camera, frames[-1]))
    return findings


def _mean_of(found: stilb.Measurement) -> stilb.Quantity:
    if found.mean is None:
        raise ValueError(f"{found.filename} was measured without a figure")
    return found.mean


def _check_map(stage: Stage, camera: SimulatedSequoia, frame: stilb.Frame) -> Finding:
    """Average a surface on a frame's map: its pixels share the uncertainty of the frame's K and light."""
    corners = _inside(camera, "soil")
    with stage.display.stage("a map"):
        found = stage.client.measure(frame.id, with_map=True, polygon=corners)
        path = stage.client.save_map(found.id, stage.folder / "map.tif")
    plane = tifffile.imread(path)
    (left, top), (right, bottom) = corners[0], corners[2]
    mean = float(plane[round(top) : round(bottom), round(left) : round(right)].mean(dtype=np.float64))
    band, stated = found.raw["reflected"]["band"], _mean_of(found)
    return Finding(
        what=f"soil on the map, {band}",
        value=mean,
        standard_uncertainty=stated.standard_uncertainty,
        truth=_SURFACES["soil"][band],
        unit=stated.unit,
    )
