"""Noise: pairs of flat and dark frames of a sensor whose electrons are counted."""

import math
from dataclasses import replace

from demo.dng import Camera
from demo.findings import Finding
from demo.journey import calibrate, conclude
from demo.shots import STARTED_AT, Expose, Shot, begin, register, take
from demo.stage import Stage
from simulation.noise import SimulatedSensor, expose

_SEED = 20260502
_CHANNEL = "G1"
_DARK_CURRENT_E_PER_S = 40.0
_SENSOR = SimulatedSensor(
    cfa="RGGB",
    rows=256,
    cols=256,
    system_gain_dn_per_e=0.5,
    read_noise_e=4.0,
    dark_current_e_per_s=_DARK_CURRENT_E_PER_S,
    dsnu_e=5.0,
    prnu_rel=0.01,
)
_LIGHT_E_PER_S = 30_000.0
_FLAT_TIMES_S = (0.02, 0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0, 1.5)
_DARK_TIMES_S = (0.02, 1.0, 4.0)
_FRAMES = 3


def run(stage: Stage) -> bool:
    """Characterise the sensor; whether all agrees with what it was made of."""
    sensor = replace(_SENSOR, rows=96, cols=96) if stage.quick else _SENSOR
    camera = Camera(
        black_level_dn=round(sensor.black_level_dn),
        white_level_dn=round(sensor.white_level_dn),
        serial="0K8TF1A0010044",
        cfa=sensor.cfa,
    )
    camera_id = register(stage, camera)
    campaign_id = begin(stage, camera_id, "noise")
    take(stage, campaign_id, _plan(sensor), camera=camera, seed=_SEED)
    calibration = calibrate(stage, campaign_id, valid_from=STARTED_AT)
    truths = _truths(sensor)
    rows = stage.client.coefficients(camera_id, method="noise")
    found = {row.name: row for row in rows if row.channel == _CHANNEL}
    return conclude(
        stage, calibration, [Finding.of(name, found[name], truth=truth) for name, truth in truths.items()]
    )


def _plan(sensor: SimulatedSensor) -> list[Shot]:
    def light(light_e_per_s: float, time_s: float) -> Expose:
        return lambda random: (
            expose(sensor, random, light_e_per_s=light_e_per_s, exposure_time_s=time_s).samples_dn
        )

    return [
        Shot(
            name=f"{role}-{time_s:g}-{n}",
            role=role,
            expose=light(light_e_per_s, time_s),
            exposure_time_s=time_s,
            iso=round(sensor.iso),
        )
        for role, light_e_per_s, times in (
            ("flat", _LIGHT_E_PER_S, _FLAT_TIMES_S),
            ("dark", 0.0, _DARK_TIMES_S),
        )
        for time_s in times
        for n in range(1, _FRAMES + 1)
    ]


def _truths(sensor: SimulatedSensor) -> dict[str, float]:
    """Give what the figures must be; the shortest dark frames hold some electrons of the dark current."""
    gain = sensor.system_gain_dn_per_e
    read_e = math.hypot(sensor.read_noise_e, math.sqrt(_DARK_CURRENT_E_PER_S * _DARK_TIMES_S[0]))
    full_well_e = (sensor.white_level_dn - sensor.black_level_dn) / gain
    # EMVA 1288: the smallest signal that stands out has a ratio of 1 to its noise
    smallest_e = math.sqrt(read_e**2 + 1.0 / 12.0 / gain**2) + 0.5
    return {
        "system_gain_dn_per_e": gain,
        "read_noise_e": read_e,
        "full_well_e": full_well_e,
        "dynamic_range_db": 20.0 * math.log10(full_well_e / smallest_e),
        "snr_max": math.sqrt(full_well_e),
        "dark_current_e_per_s": _DARK_CURRENT_E_PER_S,
        "dsnu_e": sensor.dsnu_e,
        "prnu_rel": sensor.prnu_rel,
    }
