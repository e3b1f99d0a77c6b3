"""Sharpness: slanted edges in the middle and the corners of a frame that is blurred differently in each."""

import math

from demo.dng import Camera
from demo.findings import Finding
from demo.journey import calibrate, conclude
from demo.shots import STARTED_AT, Shot, begin, register, take
from demo.stage import Stage
from simulation.sharpness import SimulatedCamera, SimulatedEdge, render_chart

_SEED = 20260503
_CHANNEL = "G"
_BLURS_PX = {"centre": 0.70, "top-left": 0.95, "top-right": 0.90, "bottom-left": 1.00, "bottom-right": 0.92}
_ANGLES_DEG = {"centre": 5.0, "top-left": 7.0, "top-right": 4.5, "bottom-left": 6.0, "bottom-right": 8.0}
_SHORT = {
    "mtf50_cycles_per_pixel": "mtf50",
    "edge_rise_10_90_px": "edge rise",
    "lsf_fwhm_px": "lsf fwhm",
}
_FRAMES = 4
_PITCH_UM = 3.28


def run(stage: Stage) -> bool:
    """Measure the edges; whether all agrees with their blurs."""
    taken = SimulatedCamera(
        height_px=360 if stage.quick else 720,
        width_px=480 if stage.quick else 960,
        cfa="RGGB",
        gain_dn=0.5,
        read_noise_dn=3.0,
    )
    camera = Camera(
        black_level_dn=round(taken.black_level_dn),
        white_level_dn=round(taken.white_level_dn),
        serial="0K8TF1A0010045",
        cfa=taken.cfa,
    )
    chart = _lay_out(taken)
    camera_id = register(stage, camera)
    campaign_id = begin(stage, camera_id, "sharpness", target={"kind": "slanted_edge"})
    stage.client.set_roi(campaign_id, regions={edge.name: edge.region.polygon.points for edge in chart})
    shots = [
        Shot(
            name=f"chart-{n}",
            role="chart",
            expose=lambda random: render_chart(taken, chart, random).samples_dn,
        )
        for n in range(1, _FRAMES + 1)
    ]
    take(stage, campaign_id, shots, camera=camera, seed=_SEED)
    calibration = calibrate(stage, campaign_id, valid_from=STARTED_AT, pixel_pitch_um=_PITCH_UM)
    rows = stage.client.coefficients(camera_id, method="sharpness")
    found = {(row.model, row.name): row for row in rows if row.channel == _CHANNEL}
    findings = [
        Finding.of(f"{name}, {_SHORT[figure]}", found[f"slanted_edge:{name}", figure], truth=truth)
        for name, blur_px in _BLURS_PX.items()
        for figure, truth in _truths(blur_px).items()
    ]
    falloff = found["slanted_edge", "corner_falloff"]
    findings.append(Finding.of("corner_falloff", falloff, truth=_true_falloff()))
    return conclude(stage, calibration, findings)


def _lay_out(camera: SimulatedCamera) -> list[SimulatedEdge]:
    """Give the chart: a box of an edge in the middle and in each corner."""
    high, wide = (100, 64) if camera.height_px < 400 else (160, 100)
    bottom, right = camera.height_px - high - 8, camera.width_px - wide - 8
    places = {
        "centre": ((camera.height_px - high) // 2, (camera.width_px - wide) // 2),
        "top-left": (8, 8),
        "top-right": (8, right),
        "bottom-left": (bottom, 8),
        "bottom-right": (bottom, right),
    }
    return [
        SimulatedEdge(
            name=name,
            row0=row,
            col0=col,
            height=high,
            width=wide,
            blur_px=_BLURS_PX[name],
            angle_deg=_ANGLES_DEG[name],
        )
        for name, (row, col) in places.items()
    ]


def _truths(blur_px: float) -> dict[str, float]:
    """Give what a Gaussian blur of a standard deviation makes of an edge."""
    return {
        "mtf50_cycles_per_pixel": math.sqrt(math.log(2.0) / 2.0) / math.pi / blur_px,
        "edge_rise_10_90_px": 2.563103 * blur_px,
        "lsf_fwhm_px": 2.0 * math.sqrt(2.0 * math.log(2.0)) * blur_px,
    }


def _true_falloff() -> float:
    """MTF50 goes as one over the blur."""
    corners = [1.0 / blur for name, blur in _BLURS_PX.items() if name != "centre"]
    return 1.0 - sum(corners) / len(corners) * _BLURS_PX["centre"]
