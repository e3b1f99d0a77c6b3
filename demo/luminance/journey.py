"""A campaign's way through the service, as a field team and then a dashboard go it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import stilb
from demo.journey import calibrate, ensure_campaign, send
from demo.luminance.campaign import SURFACE_REFLECTANCE, TOLERANCE_REL, Campaign, Meter, Shot
from demo.luminance.frames import LENS_MAKE, LENS_MODEL, LENS_SERIAL
from demo.stage import Stage
from stilb.records import Certificate, Reading


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What came of it: the version, and what a dashboard is told about it."""

    camera_id: str
    calibration: stilb.Calibration
    in_force: list[stilb.Coefficient]
    series: list[dict[str, Any]]


def travel(stage: Stage, campaign: Campaign, paths: list[Path]) -> Outcome:
    """Go the whole way. Going it again, with the same files, changes nothing and ends the same."""
    client = stage.client
    camera = client.create_camera(
        campaign.camera.make,
        campaign.camera.model,
        campaign.camera.serial,
        lens={"make": LENS_MAKE, "model": LENS_MODEL, "serial": LENS_SERIAL},
        pixel_pitch_um=3.28,
        sensor_width_mm=17.3,
    )
    campaign_id = ensure_campaign(
        client,
        camera.id,
        "luminance",
        project_number=campaign.project_number,
        started_at=campaign.started_at,
        surface_reflectance=SURFACE_REFLECTANCE,
    )
    client.set_roi(campaign_id, polygon=campaign.roi)
    _read_meters(client, campaign_id, campaign)
    shots = zip(campaign.shots, paths, strict=True)
    send(stage, [_upload(campaign_id, shot, path) for shot, path in shots])
    calibration = calibrate(
        stage, campaign_id, valid_from=campaign.started_at, model="proportional", tolerance=TOLERANCE_REL
    )
    return Outcome(
        camera_id=camera.id,
        calibration=calibration,
        in_force=client.coefficients(camera.id, method="luminance"),
        series=client.series(camera_id=camera.id, method="luminance"),
    )


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


def _upload(campaign_id: str, shot: Shot, path: Path) -> stilb.Upload:
    exposed = shot.exposed
    return stilb.Upload(
        campaign_id=campaign_id, path=path, role=exposed.role, scene=exposed.scene, roi=shot.own_roi
    )
