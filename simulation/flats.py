"""Flat and dark frames: of a lens whose falloff is known, and of a sensor whose electrons are counted."""

import math
from collections.abc import Sequence

import numpy as np

from radiometry.frame.exposure import Settings
from simulation.camera import Camera, Shot, change
from simulation.light import Lamp
from simulation.targets import Surface

# A fast wide-angle lens: half of the light is left in the corner wide open, 3 % are lost when stopped down.
FALLOFFS: dict[float, tuple[float, float, float]] = {
    1.4: (-0.62, 0.20, -0.08),
    2.0: (-0.38, 0.13, -0.06),
    2.8: (-0.20, 0.06, -0.04),
    4.0: (-0.085, 0.02, -0.015),
    5.6: (-0.045, 0.01, -0.005),
    8.0: (-0.032, 0.005, -0.003),
}
FAST_LENS = change(
    Camera(),
    height_px=480,
    width_px=720,
    falloffs=FALLOFFS,
    gain_dn_per_e=0.25,
    read_noise_e=8.0,
    colours={"R": 0.6, "G": 1.0, "B": 0.7},
)
DARK = Lamp(luminance_cd_m2=0.0)
# At f/4 the luminance is the number of electrons per second that the strongest colour collects.
COUNTING_SENSOR = change(Camera(), cfa="grey", sensitivity_e=16.0, read_noise_e=4.0, white_level_dn=16383.0)


def plan_flat(camera: Camera, *, f_number: float, surface: Surface | None = None, name: str = "flat") -> Shot:
    """Plan a flat; the surface's share is that of the span from black to white, 70 % if None."""
    settings = Settings(exposure_time_s=0.01, f_number=f_number, iso=100.0)
    span_dn = camera.sensor.white_level_dn - camera.sensor.black_level_dn
    lamp = Lamp(luminance_cd_m2=camera.find_luminance(span_dn, settings))
    return Shot(frame=name, role="flat", settings=settings, lamp=lamp, target=surface or Surface(share=0.7))


def plan_dark(*, name: str = "dark", iso: float = 100.0) -> Shot:
    """Plan a frame with the lens covered."""
    settings = Settings(exposure_time_s=0.01, f_number=8.0, iso=iso)
    return Shot(frame=name, role="dark", settings=settings, lamp=DARK, target=Surface())


def plan_flats(
    camera: Camera, *, f_numbers: Sequence[float] = tuple(FALLOFFS), flats: int = 3, darks: int = 3
) -> list[Shot]:
    """Plan a number of flats at each f-number, and a number of dark frames."""
    lit = [
        plan_flat(camera, f_number=f_number, name=f"flat-f{f_number:g}-{n}")
        for f_number in f_numbers
        for n in range(1, flats + 1)
    ]
    return lit + [plan_dark(name=f"dark-{n}") for n in range(1, darks + 1)]


def plan_series(
    camera: Camera,
    *,
    light_e_per_s: float,
    times_s: Sequence[float],
    dark_times_s: Sequence[float],
    frames: int = 2,
    role: str = "flat",
) -> list[Shot]:
    """Plan ``frames`` flat and dark frames at each time, for a camera like ``COUNTING_SENSOR``."""
    iso = camera.sensor.base_iso
    return [
        Shot(
            frame=f"{role}-{iso:g}-{time:g}-{number}",
            role=role,
            settings=Settings(exposure_time_s=time, f_number=4.0, iso=iso),
            lamp=lamp,
            target=Surface(),
        )
        for role, times, lamp in (
            (role, times_s, Lamp(luminance_cd_m2=light_e_per_s)),
            ("dark", dark_times_s, DARK),
        )
        for time in times
        for number in range(frames)
    ]


def find_variance_maximum(camera: Camera, *, end_e: float | None = None, prnu_rel: float = 0.0) -> float:
    """Return the electrons at which the temporal variance is greatest: the full well of EMVA 1288.

    ``end_e`` : electrons at which a pixel ends sharply, the white level if None; ``prnu_rel`` : its spread
    """
    sensor = camera.sensor
    end_e = end_e or (sensor.white_level_dn - sensor.black_level_dn) / sensor.gain_dn_per_e
    z, spread = np.linspace(-6.0, 6.0, 601), np.linspace(-3.0, 3.0, 31)
    weights, shares = (np.exp(-(each**2) / 2.0) for each in (z, spread))
    weights /= weights.sum()
    width_e = math.hypot(math.sqrt(end_e), prnu_rel * end_e)
    means_e = end_e - np.linspace(0.0, 6.0, 241) * width_e
    variances = []
    for mean_e in means_e:
        pixels_e = mean_e * (1.0 + prnu_rel * spread)
        noise_e = np.sqrt(pixels_e + sensor.read_noise_e**2)
        drawn_e = np.minimum(pixels_e[:, None] + noise_e[:, None] * z, end_e)
        own = drawn_e**2 @ weights - (drawn_e @ weights) ** 2
        variances.append(float(own @ shares / shares.sum()))
    return float(means_e[int(np.argmax(variances))])
