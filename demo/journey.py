"""A campaign's way through the service, as a field team and then a dashboard go it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import stilb
from demo.campaign import SURFACE_REFLECTANCE, TOLERANCE_REL, Campaign, Meter, Shot
from demo.display import Display
from demo.frames import LENS_MAKE, LENS_MODEL, LENS_SERIAL
from stilb.records import Certificate, Reading


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What came of it: the version, and what a dashboard is told about it."""

    camera_id: str
    calibration: stilb.Calibration
    in_force: list[stilb.Coefficient]
    series: list[dict[str, Any]]


def travel(client: stilb.Client, campaign: Campaign, paths: list[Path], display: Display) -> Outcome:
    """Go the whole way. Going it again, with the same files, changes nothing and ends the same."""
    camera = client.create_camera(
        campaign.camera.make,
        campaign.camera.model,
        campaign.camera.serial,
        lens={"make": LENS_MAKE, "model": LENS_MODEL, "serial": LENS_SERIAL},
        pixel_pitch_um=3.28,
        sensor_width_mm=17.3,
    )
    campaign_id = _find_or_create(client, camera.id, campaign)
    client.set_roi(campaign_id, polygon=campaign.roi)
    _read_meters(client, campaign_id, campaign)
    frames = _push(client, campaign_id, campaign, paths, display)
    _wait_for_statistics(client, frames, display)
    with display.stage("fitting"):
        calibration = client.calibrate(campaign_id, model="proportional", tolerance=TOLERANCE_REL)
        if calibration.state == "draft":
            calibration = client.publish(
                calibration.id,
                valid_from=campaign.started_at,
                reason="simulated campaign, checked by the demo",
            )
    return Outcome(
        camera_id=camera.id,
        calibration=client.calibration(calibration.id),
        in_force=client.coefficients(camera.id, method="luminance"),
        series=client.series(camera_id=camera.id, method="luminance"),
    )


def _find_or_create(client: stilb.Client, camera_id: str, campaign: Campaign) -> str:
    """A campaign has no natural key: the project's number tells an earlier run's from others."""
    for known in client.campaigns():
        if (known.camera_id, known.project_number) == (camera_id, campaign.project_number):
            return known.id
    made = client.create_campaign(
        camera_id,
        method="luminance",
        project_number=campaign.project_number,
        recorder="the demo",
        started_at=campaign.started_at,
        surface_reflectance=SURFACE_REFLECTANCE,
    )
    return made.id


def _read_meters(client: stilb.Client, campaign_id: str, campaign: Campaign) -> None:
    if any(client.readings(campaign_id)):
        return
    ids = {meter.kind: _register(client, meter) for meter in campaign.meters}
    readings: list[Reading] = [
        {
            "scene": reading.scene,
            "quantity": reading.quantity,
            "value": reading.value,
            "unit": reading.unit,
            "meter_id": ids[reading.quantity],
        }
        for reading in campaign.readings
    ]
    client.add_readings(campaign_id, readings)


def _register(client: stilb.Client, meter: Meter) -> str:
    certificate: Certificate = {
        "number": meter.certificate_number,
        "laboratory": "Photometry Laboratory, Demo",
        "issued_on": "2025-01-17",
        "due_on": "2026-01-17",
        "expanded_uncertainty_rel": meter.expanded_uncertainty_rel,
        "coverage_factor": meter.coverage_factor,
    }
    return client.create_meter(meter.kind, meter.make, meter.model, meter.serial, certificate=certificate).id


def _push(
    client: stilb.Client, campaign_id: str, campaign: Campaign, paths: list[Path], display: Display
) -> list[stilb.Frame]:
    uploads = [_upload(campaign_id, shot, path) for shot, path in zip(campaign.shots, paths, strict=True)]
    size_mb = sum(path.stat().st_size for path in paths) / 1e6
    with display.stage(f"sending {len(paths)} frames, {size_mb:.0f} MB") as advance:
        return client.push_all(
            uploads, on_progress=lambda progress: advance(progress.bytes_sent / progress.bytes_total)
        )


def _upload(campaign_id: str, shot: Shot, path: Path) -> stilb.Upload:
    exposed = shot.exposed
    return stilb.Upload(
        campaign_id=campaign_id, path=path, role=exposed.role, scene=exposed.scene, roi=shot.own_roi
    )


def _wait_for_statistics(client: stilb.Client, frames: list[stilb.Frame], display: Display) -> None:
    """A frame of an earlier run has its statistics, and no job to wait for."""
    with display.stage("reading the frames") as advance:
        for done, frame in enumerate(frames, start=1):
            if frame.job_id is not None:
                client.wait(frame.job_id)
            advance(done / len(frames))
