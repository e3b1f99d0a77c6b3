"""Noise: pairs of flat and dark frames of a sensor whose electrons are counted."""

import math

from demo.journey import Finding, Stage, begin, calibrate, conclude, register, take
from simulation.camera import Camera, change
from simulation.targets import COUNTING_SENSOR, find_variance_maximum, plan_series

_SEED = 20260502
_CHANNEL = "G1"
_CAMERA = change(
    COUNTING_SENSOR,
    serial="0K8TF1A0010044",
    cfa="RGGB",
    height_px=256,
    width_px=256,
    dark_current_e_s=40.0,
    dsnu_e=5.0,
    prnu_rel=0.01,
)
_LIGHT_E_PER_S = 30_000.0
_FLAT_TIMES_S = (0.02, 0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0, 1.5)
_DARK_TIMES_S = (0.02, 1.0, 4.0)


def run(stage: Stage) -> bool:
    """Characterise the sensor; return True if all agrees with its true values."""
    camera = change(_CAMERA, height_px=128, width_px=128) if stage.quick else _CAMERA
    camera_id = register(stage, camera)
    campaign_id = begin(stage, camera_id, "noise")
    shots = plan_series(
        camera, light_e_per_s=_LIGHT_E_PER_S, times_s=_FLAT_TIMES_S, dark_times_s=_DARK_TIMES_S, frames=3
    )
    take(stage, campaign_id, shots, camera=camera, seed=_SEED)
    calibration = calibrate(stage, campaign_id)
    rows = stage.client.coefficients(camera_id, method="noise")
    found = {row.name: row for row in rows if row.channel == _CHANNEL}
    truths = _compute_truths(camera)
    return conclude(
        stage, calibration, [Finding.of(name, found[name], truth=truth) for name, truth in truths.items()]
    )


def _compute_truths(camera: Camera) -> dict[str, float]:
    """Return the true figures; the shortest dark frames hold some electrons of the dark current."""
    sensor = camera.sensor
    gain = sensor.gain_dn_per_e
    read_e = math.hypot(sensor.read_noise_e, math.sqrt(sensor.dark_current_e_s * _DARK_TIMES_S[0]))
    full_well_e = find_variance_maximum(camera, prnu_rel=sensor.prnu_rel)
    # EMVA 1288: the smallest signal that stands out has a ratio of 1 to its noise
    smallest_e = math.sqrt(read_e**2 + 1.0 / 12.0 / gain**2) + 0.5
    return {
        "system_gain_dn_per_e": gain,
        "read_noise_e": read_e,
        "full_well_e": full_well_e,
        "dynamic_range_db": 20.0 * math.log10(full_well_e / smallest_e),
        "snr_max": math.sqrt(full_well_e),
        "dark_current_e_per_s": sensor.dark_current_e_s,
        "dsnu_e": sensor.dsnu_e,
        "prnu_rel": sensor.prnu_rel,
    }
