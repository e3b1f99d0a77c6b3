"""Sharpness: slanted edges in the middle and the corners of a frame that is blurred differently in each."""

import math

from demo.journey import Finding, Stage, begin, calibrate, conclude, register, take
from simulation.camera import Camera, change
from simulation.targets import CHART_STUDIO, Chart, Edge

_SEED = 20260503
_CHANNEL = "G"
# Blur [px] and angle [deg] of each edge.
_EDGES = {
    "centre": (0.70, 5.0),
    "top-left": (0.95, 7.0),
    "top-right": (0.90, 4.5),
    "bottom-left": (1.00, 6.0),
    "bottom-right": (0.92, 8.0),
}
_SHORT = {"mtf50_cycles_per_pixel": "mtf50", "edge_rise_10_90_px": "edge rise", "lsf_fwhm_px": "lsf fwhm"}
_FRAMES = 4
_STUDIO = change(
    CHART_STUDIO,
    serial="0K8TF1A0010045",
    height_px=720,
    width_px=960,
    cfa="RGGB",
    gain_dn_per_e=0.5,
    read_noise_e=6.0,
    photon_noise=True,
)


def run(stage: Stage) -> bool:
    """Measure the edges; return True if all agrees with their blurs."""
    studio = change(_STUDIO, height_px=360, width_px=480) if stage.quick else _STUDIO
    edges = _lay_out(studio.camera)
    camera_id = register(stage, studio.camera)
    campaign_id = begin(stage, camera_id, "sharpness", target={"kind": "slanted_edge"})
    stage.client.set_roi(campaign_id, regions={edge.name: edge.region.polygon.points for edge in edges})
    shots = [studio.plan(Chart(edges), name=f"chart-{n}") for n in range(1, _FRAMES + 1)]
    take(stage, campaign_id, shots, camera=studio.camera, seed=_SEED)
    calibration = calibrate(stage, campaign_id, pixel_pitch_um=studio.camera.body.pixel_pitch_um)
    rows = stage.client.coefficients(camera_id, method="sharpness")
    found = {(row.model, row.name): row for row in rows if row.channel == _CHANNEL}
    findings = [
        Finding.of(f"{name}, {_SHORT[figure]}", found[f"slanted_edge:{name}", figure], truth=truth)
        for name, (blur_px, _) in _EDGES.items()
        for figure, truth in _compute_truths(blur_px).items()
    ]
    # MTF50 is proportional to one over the blur
    sharpness = {name: 1.0 / blur_px for name, (blur_px, _) in _EDGES.items()}
    centre = sharpness.pop("centre")
    truth = 1.0 - sum(sharpness.values()) / len(sharpness) / centre
    findings.append(Finding.of("corner_falloff", found["slanted_edge", "corner_falloff"], truth=truth))
    return conclude(stage, calibration, findings)


def _lay_out(camera: Camera) -> list[Edge]:
    """Return a box with an edge in the middle and in each corner."""
    sensor = camera.sensor
    high, wide = (100, 64) if sensor.height_px < 400 else (160, 100)
    rows = {"top": 8, "bottom": sensor.height_px - high - 8, "centre": (sensor.height_px - high) // 2}
    cols = {"left": 8, "right": sensor.width_px - wide - 8, "centre": (sensor.width_px - wide) // 2}
    return [
        Edge(
            name=name,
            row0=rows[name.split("-")[0]],
            col0=cols[name.split("-")[-1]],
            height=high,
            width=wide,
            blur_px=blur_px,
            angle_deg=angle_deg,
        )
        for name, (blur_px, angle_deg) in _EDGES.items()
    ]


def _compute_truths(blur_px: float) -> dict[str, float]:
    """Return the figures of an edge with a Gaussian blur of that standard deviation."""
    return {
        "mtf50_cycles_per_pixel": math.sqrt(math.log(2.0) / 2.0) / math.pi / blur_px,
        "edge_rise_10_90_px": 2.563103 * blur_px,
        "lsf_fwhm_px": 2.0 * math.sqrt(2.0 * math.log(2.0)) * blur_px,
    }
