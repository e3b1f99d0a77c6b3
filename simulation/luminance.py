"""Luminance campaigns of a simulated camera."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np

from radiometry.frame.exposure import Settings
from radiometry.frame.roi import Polygon, bounding_window, mask
from radiometry.luminance.rows import Reading
from radiometry.records import Record
from simulation.camera import Camera, Lamp, Meter, Shot, change
from simulation.targets import Surface

# The luminances of the procedure's own illustration.
LUMINANCES_CD_M2 = (54.4, 2.94, 1.28, 1.2, 0.26, 0.24)
ISOS = (3200.0, 6400.0, 12800.0, 25600.0)
F_NUMBERS = (1.7, 2.8, 4.0, 5.6, 8.0, 11.0, 16.0)
# Per ISO value one time for most light levels and, four stops shorter, one for the brightest.
TIMES_S = {
    3200.0: (1 / 8, 1 / 125),
    6400.0: (1 / 15, 1 / 250),
    12800.0: (1 / 30, 1 / 500),
    25600.0: (1 / 60, 1 / 1000),
}
# A 12-bit mosaic with N = D + K X up to white: K = 33 DN m2/(cd s) on the axis, 45 % of it at the corner.
X5S = change(
    Camera(),
    height_px=3956,
    width_px=5280,
    sensitivity_e=22_000.0,
    gain_dn_per_e=0.15,
    read_noise_e=1.6,
    prnu_rel=0.008,
    dark_current_e_s=0.4,
    falloff=(-0.55, 0.0, 0.0),
)

SCENE_S = 600.0  # duration of a light level, from its first reading to its last frame

_USABLE_SHARES = (0.02, 0.8)


class Errors(Record):
    """Relative standard uncertainties of a campaign's assumptions; each error is drawn once."""

    # Of one meter reading, and of the meter's scale, which all its readings share
    repeatability: float = 0.01
    calibration: float = 0.01
    f_number: float = 0.015  # Of the true value behind each marking
    exposure_time: float = 0.005


class Campaign(Record):
    """Camera with its true settings, shots, readings, and the true luminance of each scene [cd/m2]."""

    camera: Camera
    shots: tuple[Shot, ...]
    readings: tuple[Reading, ...]
    truth_cd_m2: dict[str, float]


def find_k(camera: Camera, polygon: Polygon | None = None) -> float:
    """Return the true K of the green pixels of a region, or on the axis [DN*m2/(cd*s)]."""
    sensor = camera.sensor
    centre = camera.lens.transmission * sensor.sensitivity_e * sensor.gain_dn_per_e / sensor.base_iso
    if polygon is None:
        return centre
    window = bounding_window(polygon, height_px=sensor.height_px, width_px=sensor.width_px)
    green = mask(polygon, window) & (sensor.filter_light(window) == sensor.colours["G"])
    return centre * float(np.mean(camera.share(0.0, window)[green]))


def plan_campaign(
    camera: Camera,
    random: np.random.Generator,
    *,
    errors: Errors,
    isos: Sequence[float] = ISOS,
    luminances_cd_m2: Sequence[float] = LUMINANCES_CD_M2,
    readings_per_scene: int = 1,
    dark_times_s: Sequence[float] | None = None,
    drift_rel: float = 0.0,
) -> Campaign:
    """Plan a campaign as the procedure asks for, and draw its errors.

    Per scene and ISO value: every aperture of f/1.7 to f/16 that gives 2 % to 80 % of full scale, at the one
    of two times at which more of them do. Three dark frames per time, or per each of ``dark_times_s``. The
    lamp changes by ``drift_rel`` from the first reading of a scene to its last frame; further readings are
    spread evenly over that time.
    """
    times = sorted({time for iso in isos for time in TIMES_S[iso]})
    f_errors = dict(zip(F_NUMBERS, random.normal(1.0, errors.f_number, len(F_NUMBERS)).tolist(), strict=True))
    t_errors = dict(zip(times, random.normal(1.0, errors.exposure_time, len(times)).tolist(), strict=True))
    scenes = {f"level-{n}": luminance for n, luminance in enumerate(luminances_cd_m2, start=1)}
    shots: list[Shot] = []
    for iso in isos:
        lit = [_plan(camera, iso, scene, luminance) for scene, luminance in scenes.items()]
        shots += [
            _age(shot, (n + 1) / len(series), drift_rel) for series in lit for n, shot in enumerate(series)
        ]
        shots += [
            _shoot(None, 0.0, Settings(exposure_time_s=time, f_number=f_number, iso=iso))
            for time in dark_times_s or sorted({s.settings.exposure_time_s for series in lit for s in series})
            for f_number in (1.7, 5.6, 16.0)
        ]
    meter = Meter(scale=float(random.normal(1.0, errors.calibration)), repeatability=errors.repeatability)
    readings = tuple(
        Reading(
            scene=scene,
            quantity="luminance",
            value=meter.read(luminance * (1.0 + drift_rel * n / max(readings_per_scene - 1, 1)), random),
            meter="simulated luminance meter",
            expanded_uncertainty_rel=2 * errors.calibration,
            coverage_factor=2.0,
            taken_at=clock(scene, SCENE_S * n / max(readings_per_scene - 1, 1)),
        )
        for scene, luminance in scenes.items()
        for n in range(readings_per_scene)
    )
    camera = change(camera, f_number_errors=f_errors, time_errors=t_errors)
    return Campaign(camera=camera, shots=tuple(shots), readings=readings, truth_cd_m2=scenes)


def clock(scene: str, after_s: float) -> str:
    """Return the time of day of a frame or reading of a scene, one scene an hour."""
    start = datetime(2026, 3, 2, tzinfo=UTC) + timedelta(hours=int(scene.rpartition("-")[2]))
    return (start + timedelta(seconds=after_s)).isoformat()


def _age(shot: Shot, share: float, drift_rel: float) -> Shot:
    lamp = replace(shot.lamp, drift_rel_per_s=drift_rel / SCENE_S)
    return replace(shot, lamp=lamp, after_s=share * SCENE_S)


def _plan(camera: Camera, iso: float, scene: str, luminance_cd_m2: float) -> list[Shot]:
    """Choose the time and the apertures for a light level."""
    span = camera.sensor.white_level_dn - camera.sensor.black_level_dn
    low, high = (share * span / (find_k(camera) * iso * luminance_cd_m2) for share in _USABLE_SHARES)
    series = [
        [
            _shoot(scene, luminance_cd_m2, Settings(exposure_time_s=time, f_number=f_number, iso=iso))
            for f_number in F_NUMBERS
            if low <= time / f_number**2 <= high
        ]
        for time in TIMES_S[iso]
    ]
    return max(series, key=len)


def _shoot(scene: str | None, luminance_cd_m2: float, settings: Settings) -> Shot:
    return Shot(
        frame=f"{scene or 'dark'}-iso{settings.iso:g}-f{settings.f_number:g}-t{settings.exposure_time_s:g}",
        role="light" if scene else "dark",
        scene=scene,
        settings=settings,
        lamp=Lamp(luminance_cd_m2=luminance_cd_m2),
        target=Surface(),
    )
