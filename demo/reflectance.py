"""Reflectance: a camera before, during and after a flight, while its K drifts and the light changes.

``CAMERA`` chooses it: a Sequoia, which counts light at several gains, or one that states its irradiance.
A panel is photographed before and after; K(t) runs between the two. The true reflectance of the panel differs
from its certificate, by the certificate's uncertainty, and the panel does not lie level. The field has four
surfaces side by side.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path

import numpy as np
import tifffile

import stilb
from demo.journey import Finding, Stage, begin, calibrate, conclude, send, write_files
from radiometry.frame import FrameHeader
from radiometry.records import Record
from simulation import camera, rigs, sequoia
from simulation.multispectral_files import name_file, name_rig_file, write_rig, write_sequoia

_SEED = 20180413
_START = datetime(2018, 4, 13, 8, 0, tzinfo=UTC)
_DRIFT_REL = 0.02  # of K, from the first to the last capture
_FLIGHT = timedelta(minutes=30)
_PANEL_CERTIFIED = {"blue": 0.184, "green": 0.183, "red": 0.181, "red_edge": 0.180, "nir": 0.178}
_PANEL_U = 0.002
_LEVEL_U_DEG = 2.0  # of the panel
_ZENITH_DEG = 62.0  # of the sun, at the place and time of the files
_SURFACES = {
    "meadow": {"blue": 0.04, "green": 0.09, "red": 0.05, "red_edge": 0.28, "nir": 0.48},
    "soil": {"blue": 0.10, "green": 0.14, "red": 0.20, "red_edge": 0.25, "nir": 0.30},
    "concrete": {"blue": 0.34, "green": 0.35, "red": 0.36, "red_edge": 0.37, "nir": 0.38},
    "water": {"blue": 0.07, "green": 0.06, "red": 0.04, "red_edge": 0.02, "nir": 0.01},
}

Corners = list[tuple[float, float]]


class _Capture(Record):
    """All bands at one moment; ``i_ss`` is its light, 4300 at noon, which the service is not told."""

    role: str
    after: timedelta
    i_ss: float
    gain_index: int = 1


_CAPTURES = (
    _Capture(role="panel", after=timedelta(0), i_ss=4300.0),
    _Capture(role="panel", after=timedelta(seconds=20), i_ss=4310.0),
    _Capture(role="field", after=timedelta(minutes=8), i_ss=3600.0, gain_index=2),
    _Capture(role="field", after=timedelta(minutes=22), i_ss=4100.0),
    _Capture(role="panel", after=_FLIGHT - timedelta(seconds=20), i_ss=4500.0),
    _Capture(role="panel", after=_FLIGHT, i_ss=4500.0),
)


_NOON = 4300.0


class _Kit(Record):
    """A camera, and how its files are named and written; ``aligned``: they say how the bands lie together."""

    whole: sequoia.Sequoia | rigs.Rig
    name: Callable[[int, FrameHeader], str]
    write: Callable[[Path, camera.Taken], None]
    aligned: bool = True


_KITS = {"sequoia": _Kit(whole=sequoia.SEQUOIA, name=name_file, write=write_sequoia)} | {
    name: _Kit(whole=rig, name=name_rig_file, write=write_rig, aligned=rig.system != "micasense")
    for name, rig in rigs.RIGS.items()
}
CAMERAS = tuple(_KITS)


def run(stage: Stage) -> bool:
    """Calibrate K of every band, measure the field; return True if all agrees with the truth."""
    kit = _KITS[stage.camera or CAMERAS[0]]
    if stage.quick:
        kit = replace(kit, whole=camera.change(kit.whole, height_px=120, width_px=160))
    body, sensor, bands = kit.whole.camera.body, kit.whole.camera.sensor, tuple(kit.whole.bands)
    taken = _simulate(kit.whole)
    files = write_files(
        stage, [partial(_write, stage.folder, kit, one, n // len(bands)) for n, one in enumerate(taken)]
    )
    roles = [each.role for each in _CAPTURES for _ in bands]
    uploads = {role: [path for path, its in zip(files, roles, strict=True) if its == role] for role in roles}
    camera_id = stage.client.create_camera(body.make, body.model, body.serial).id
    calibration = _calibrate(stage, camera_id, sensor, uploads["panel"])
    findings = [
        Finding.of(f"K, {row.band}, midway", row, truth=_find_k(kit.whole, row.band or "", 0.5))
        for row in stage.client.coefficients(camera_id, method="reflectance", at=_START)
    ]
    findings += _list_visits(kit.whole, calibration)
    findings += _measure(stage, camera_id, kit, uploads["field"])
    return conclude(stage, calibration, findings)


def _list_visits(whole: sequoia.Sequoia | rigs.Rig, calibration: stilb.Calibration) -> Iterator[Finding]:
    """List K of the panel before and after the flight, between which the version interpolates."""
    for fit in calibration.raw["diagnostics"]["band_fits"]:
        k = fit["coefficient"]
        for when, share, knot in zip(("before", "after"), (0.0, 1.0), k["knots"], strict=True):
            yield Finding(
                what=f"K, {k['band']}, panel {when} the flight",
                value=knot["reflectance_k"],
                standard_uncertainty=knot["reflectance_k"] * math.hypot(knot["u_rel"], k["shared_u_rel"]),
                truth=_find_k(whole, k["band"], share),
                unit=k["reflectance_k_unit"],
            )


def _find_k(whole: sequoia.Sequoia | rigs.Rig, band: str, time_share: float) -> float:
    """Return the true K after a share of the flight."""
    return whole.bands[band].reflectance_k * (1.0 + _DRIFT_REL * time_share)


def _simulate(whole: sequoia.Sequoia | rigs.Rig) -> list[camera.Taken]:
    random = np.random.default_rng(_SEED)
    panel = {band: _PANEL_CERTIFIED[band] + _PANEL_U * random.standard_normal() for band in whole.bands}
    # towards the sun, or away from it, a panel is brighter or darker than a level one
    tilt_deg = _LEVEL_U_DEG * random.standard_normal()
    level = math.cos(math.radians(_ZENITH_DEG - tilt_deg)) / math.cos(math.radians(_ZENITH_DEG))
    panel = {band: level * reflectance for band, reflectance in panel.items()}
    field = {band: _lay_out(whole.camera.sensor, band) for band in whole.bands}
    taken: list[camera.Taken] = []
    for number, each in enumerate(_CAPTURES):
        ks = {name: _find_k(whole, name, each.after / _FLIGHT) for name in whole.bands}
        surface: Mapping[str, float | camera.Plane] = panel if each.role == "panel" else field
        taken += _expose(whole, ks, each, random, surface, capture_id=f"demo-{number}").values()
    return taken


def _expose(
    whole: sequoia.Sequoia | rigs.Rig,
    ks: Mapping[str, float],
    each: _Capture,
    random: np.random.Generator,
    surface: Mapping[str, float | camera.Plane],
    *,
    capture_id: str,
) -> dict[str, camera.Taken]:
    taken_at = _START + each.after
    if isinstance(whole, rigs.Rig):
        channels = {name: replace(band, reflectance_k=ks[name]) for name, band in whole.bands.items()}
        rig, light = replace(whole, bands=channels), each.i_ss / _NOON
        return rigs.capture(
            rig, random, reflectance=surface, light=light, taken_at=taken_at, capture_id=capture_id
        )
    bands = {name: replace(band, reflectance_k=ks[name]) for name, band in whole.bands.items()}
    return sequoia.capture(
        replace(whole, bands=bands),
        random,
        reflectance=surface,
        i_ss=each.i_ss,
        gain_indices=(each.gain_index,) * 10,
        taken_at=taken_at,
        capture_id=capture_id,
    )


def _lay_out(sensor: camera.Sensor, band: str) -> camera.Plane:
    """Return the field's true reflectance, (row, col): the surfaces as stripes from left to right."""
    which = np.arange(sensor.width_px) * len(_SURFACES) // sensor.width_px
    stripes = np.array([surface[band] for surface in _SURFACES.values()])[which]
    return np.broadcast_to(stripes, (sensor.height_px, sensor.width_px))


def _bound(sensor: camera.Sensor, surface: str) -> Corners:
    """Return a rectangle well inside the stripe of a surface."""
    stripe = sensor.width_px // len(_SURFACES)
    left = list(_SURFACES).index(surface) * stripe
    return _draw(left + stripe // 4, sensor.height_px // 4, left + 3 * stripe // 4, 3 * sensor.height_px // 4)


def _draw(x0: float, y0: float, x1: float, y1: float) -> Corners:
    return [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]


def _write(folder: Path, kit: _Kit, one: camera.Taken, number: int) -> Path:
    path = folder / kit.name(number, one.header)
    kit.write(path, one)
    return path


def _calibrate(stage: Stage, camera_id: str, sensor: camera.Sensor, files: list[Path]) -> stilb.Calibration:
    panel = stage.client.create_panel(
        "P-18",
        measured_on="2018-03-01",
        bands=[
            {"band": band, "reflectance": value, "standard_uncertainty": _PANEL_U}
            for band, value in _PANEL_CERTIFIED.items()
        ],
    )
    campaign_id = begin(
        stage, camera_id, "reflectance", project_number="DEMO-PANEL", started_at=_START, panel_id=panel.id
    )
    row, col, high, wide = (
        size // share for share in (2, 16) for size in (sensor.height_px, sensor.width_px)
    )
    stage.client.set_roi(campaign_id, polygon=_draw(col - wide, row - high, col + wide, row + high))
    send(stage, [stilb.Upload(campaign_id=campaign_id, path=path, role="panel") for path in files])
    ends = _START + timedelta(days=1)
    return calibrate(stage, campaign_id, valid_from=_START, valid_to=ends)


def _measure(stage: Stage, camera_id: str, kit: _Kit, files: list[Path]) -> list[Finding]:
    """Measure the flight in one request, an index per capture, and one map."""
    client, sensor, bands = stage.client, kit.whole.camera.sensor, len(kit.whole.bands)
    campaign_id = begin(stage, camera_id, "reflectance", project_number="DEMO-FLIGHT", started_at=_START)
    client.set_roi(campaign_id, polygon=_bound(sensor, "meadow"))
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
            what = f"meadow, {band}, {number // bands + 1}"
            findings.append(Finding.of(what, _mean_of(found), truth=truth[band]))
        ndvi = (truth["nir"] - truth["red"]) / (truth["nir"] + truth["red"])
        reds = [frame for frame in frames if kit.aligned and frame.filename.endswith("_RED.TIF")]
        for number, frame in enumerate(reds):
            index = client.measure(frame.id, index="ndvi")
            findings.append(Finding.of(f"meadow, NDVI, {number + 1}", _mean_of(index), truth=ndvi))
    findings.append(_check_map(stage, sensor, frames[-1]))
    return findings


def _mean_of(found: stilb.Measurement) -> stilb.Quantity:
    if found.mean is None:
        raise ValueError(f"{found.filename} was measured without a figure")
    return found.mean


def _check_map(stage: Stage, sensor: camera.Sensor, frame: stilb.Frame) -> Finding:
    """Average a surface on a frame's map: its pixels share the uncertainty of the frame's K and light."""
    corners = _bound(sensor, "soil")
    with stage.display.stage("a map"):
        found = stage.client.measure(frame.id, with_map=True, polygon=corners)
        path = stage.client.save_map(found.id, stage.folder / "map.tif")
    (left, top), (right, bottom) = corners[0], corners[2]
    part = tifffile.imread(path)[round(top) : round(bottom), round(left) : round(right)]
    band, stated = found.raw["reflected"]["band"], _mean_of(found)
    mean = replace(stated, value=float(part.mean(dtype=np.float64)))
    return Finding.of(f"soil on the map, {band}", mean, truth=_SURFACES["soil"][band])
