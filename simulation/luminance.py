"""A simulated sensor and campaign whose true K is known, for tests and for the demonstration."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from radiometry.frame import Frame
from radiometry.frame.exposure import Exposure, Settings, compute_rhs
from radiometry.frame.roi import Polygon, bounding_window, mask
from radiometry.frame.statistics import ChannelStatistics
from radiometry.luminance.rows import FrameRow, Reading

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

_USABLE_SHARES = (0.02, 0.8)
_COLOURS = {"R": 0.55, "G": 1.0, "B": 0.7}


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """A sensor like the Zenmuse X5S's: a 12-bit Bayer mosaic that obeys N = D + K X up to its white level.

    ``centre_k`` : K of a green site at the optical centre [DN*m2/(cd*s)]; red and blue see less
    ``gain_dn_per_e_iso100`` : system gain at ISO 100, in proportion to ISO above
    ``corner_share`` : what the lens keeps at the corner; falling with the radius squared, at every f-number
    ``seed`` : of the fixed pattern, one and the same for every window
    """

    height_px: int = 3956
    width_px: int = 5280
    cfa: str = "RGGB"
    black_level_dn: float = 256.0
    white_level_dn: float = 4095.0
    centre_k: float = 33.0
    gain_dn_per_e_iso100: float = 0.15
    read_noise_e: float = 1.6
    prnu_rel: float = 0.008
    dark_current_e_s: float = 0.4
    corner_share: float = 0.45
    seed: int = 0

    def falloff(self, *, row0: int, col0: int, height: int, width: int) -> NDArray[np.float64]:
        """Give the lens's share of light, 1 at the frame's centre, (row, col)."""
        y = np.arange(row0, row0 + height) + 0.5 - self.height_px / 2
        x = np.arange(col0, col0 + width) + 0.5 - self.width_px / 2
        radius_sq = (y[:, None] ** 2 + x[None, :] ** 2) / ((self.height_px**2 + self.width_px**2) / 4)
        return np.asarray(1.0 - (1.0 - self.corner_share) * radius_sq, np.float64)

    def colour(self, *, row0: int, col0: int, height: int, width: int) -> NDArray[np.float64]:
        """Give each site's sensitivity relative to green, (row, col)."""
        pattern = np.array([_COLOURS[letter] for letter in self.cfa]).reshape(2, 2)
        rows, cols = np.arange(row0, row0 + height) % 2, np.arange(col0, col0 + width) % 2
        return pattern[rows[:, None], cols[None, :]]

    def pattern(self, *, row0: int, col0: int, height: int, width: int) -> NDArray[np.float64]:
        """Give the pixels' fixed gain errors, (row, col): a pixel has the same in every window."""
        rows = [
            np.random.default_rng([self.seed, row]).standard_normal(self.width_px)[col0 : col0 + width]
            for row in range(row0, row0 + height)
        ]
        return 1.0 + self.prnu_rel * np.array(rows)

    def gain_dn_per_e(self, iso: float) -> float:
        """Give the system gain at an ISO value [DN/e]."""
        return self.gain_dn_per_e_iso100 * iso / 100.0

    def true_k(self, polygon: Polygon) -> float:
        """Give the K of a region's green pixels, the lens's falloff averaged in [DN*m2/(cd*s)]."""
        window = bounding_window(polygon, height_px=self.height_px, width_px=self.width_px)
        here = {"row0": window.row0, "col0": window.col0, "height": window.height, "width": window.width}
        green = mask(polygon, window) & (self.colour(**here) == _COLOURS["G"])
        return self.centre_k * float(np.mean(self.falloff(**here)[green]))


@dataclass(frozen=True, kw_only=True)
class Errors:
    """Relative standard uncertainties of what a campaign takes for granted; each error is drawn once.

    ``repeatability`` : a meter reading's own; ``calibration`` : the meter's, common to all its readings
    ``f_number``, ``exposure_time`` : of the true value behind each marking
    """

    repeatability: float = 0.01
    calibration: float = 0.01
    f_number: float = 0.015
    exposure_time: float = 0.005


@dataclass(frozen=True, kw_only=True)
class Shot:
    """One exposure: what its file says, and what is true. A dark frame has no scene and no light."""

    frame: str
    role: str
    scene: str | None
    stated: Settings
    true: Settings
    luminance_cd_m2: float


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """All shots and readings of a campaign, with the meter's certificate on every reading."""

    sensor: Sensor
    shots: tuple[Shot, ...]
    readings: tuple[Reading, ...]
    truth_cd_m2: dict[str, float] = field(default_factory=dict)


def simulate_campaign(
    sensor: Sensor,
    random: np.random.Generator,
    *,
    errors: Errors,
    isos: Sequence[float] = ISOS,
    luminances_cd_m2: Sequence[float] = LUMINANCES_CD_M2,
    readings_per_scene: int = 1,
) -> Campaign:
    """Plan a campaign as the procedure asks for, and draw its errors.

    Per scene and ISO value: every aperture of f/1.7 to f/16 that gives 2 % to 80 % of full scale, at the one
    of two times at which more of them do. Three dark frames per time.
    """
    times = sorted({time for iso in isos for time in TIMES_S[iso]})
    f_error = dict(zip(F_NUMBERS, random.normal(1.0, errors.f_number, len(F_NUMBERS)), strict=True))
    t_error = dict(zip(times, random.normal(1.0, errors.exposure_time, len(times)), strict=True))
    scenes = {f"level-{n}": luminance for n, luminance in enumerate(luminances_cd_m2, start=1)}
    shots: list[Shot] = []
    for iso in isos:
        stated = [(scene, s) for scene, lum in scenes.items() for s in _settings(sensor, iso, lum)]
        darks = [
            (None, Settings(exposure_time_s=time, f_number=f_number, iso=iso))
            for time in sorted({settings.exposure_time_s for _, settings in stated})
            for f_number in (1.7, 5.6, 16.0)
        ]
        for scene, settings in [*stated, *darks]:
            true = Settings(
                exposure_time_s=settings.exposure_time_s * float(t_error[settings.exposure_time_s]),
                f_number=settings.f_number * float(f_error[settings.f_number]),
                iso=iso,
            )
            shots.append(_shot(scene, settings, true, scenes))
    readings = _read_meter(scenes, random, errors, readings_per_scene)
    return Campaign(sensor=sensor, shots=tuple(shots), readings=readings, truth_cd_m2=scenes)


def render_frame(
    sensor: Sensor, shot: Shot, random: np.random.Generator, *, row0: int, col0: int, height: int, width: int
) -> Frame:
    """Expose a window: photon, read and rounding noise, fixed pattern, clipping at both ends."""
    here = {"row0": row0, "col0": col0, "height": height, "width": width}
    gain = sensor.gain_dn_per_e(shot.stated.iso)
    light_e = sensor.centre_k * compute_rhs(shot.true, luminance_cd_m2=shot.luminance_cd_m2) / gain
    electrons = light_e * sensor.falloff(**here) * sensor.colour(**here) * sensor.pattern(**here)
    electrons += sensor.dark_current_e_s * shot.true.exposure_time_s
    noisy = random.poisson(electrons) + sensor.read_noise_e * random.standard_normal((height, width))
    numbers = np.round(sensor.black_level_dn + gain * noisy)
    return Frame(
        samples_dn=np.clip(numbers, 0, sensor.white_level_dn).astype(np.uint16),
        row0=row0,
        col0=col0,
        height_px=sensor.height_px,
        width_px=sensor.width_px,
        cfa=sensor.cfa,
        black_level_dn=(sensor.black_level_dn,) * 4,
        white_level_dn=(sensor.white_level_dn,) * 4,
    )


def simulate_row(
    campaign: Campaign, shot: Shot, random: np.random.Generator, *, true_k: float, pixels: int
) -> FrameRow:
    """Draw the statistics of a region's greens without its pixels.

    Takes
      true_k : of the region; pixels : per green channel
    """
    sensor = campaign.sensor
    gain = sensor.gain_dn_per_e(shot.stated.iso)
    light_dn = true_k * compute_rhs(shot.true, luminance_cd_m2=shot.luminance_cd_m2)
    dark_dn = gain * sensor.dark_current_e_s * shot.true.exposure_time_s
    mean = sensor.black_level_dn + light_dn + dark_dn
    variance = gain * (light_dn + dark_dn) + (gain * sensor.read_noise_e) ** 2 + 1 / 12
    spread = math.sqrt(variance + (sensor.prnu_rel * light_dn) ** 2)
    greens = tuple(
        _green(name, mean + math.sqrt(variance / pixels) * random.standard_normal(), spread, pixels, sensor)
        for name in ("G1", "G2")
    )
    exposure = Exposure(
        exposure_time_s=shot.stated.exposure_time_s, f_number=shot.stated.f_number, iso=shot.stated.iso
    )
    return FrameRow(frame=shot.frame, role=shot.role, scene=shot.scene, exposure=exposure, statistics=greens)


def _settings(sensor: Sensor, iso: float, luminance_cd_m2: float) -> list[Settings]:
    """Choose the time and the apertures for a light level."""
    span = sensor.white_level_dn - sensor.black_level_dn
    low, high = (share * span / (sensor.centre_k * iso * luminance_cd_m2) for share in _USABLE_SHARES)
    series = [
        [
            Settings(exposure_time_s=time, f_number=f_number, iso=iso)
            for f_number in F_NUMBERS
            if low <= time / f_number**2 <= high
        ]
        for time in TIMES_S[iso]
    ]
    return max(series, key=len)


def _shot(scene: str | None, stated: Settings, true: Settings, scenes: dict[str, float]) -> Shot:
    name = f"{scene or 'dark'}-iso{stated.iso:g}-f{stated.f_number:g}-t{stated.exposure_time_s:g}"
    return Shot(
        frame=name,
        role="light" if scene else "dark",
        scene=scene,
        stated=stated,
        true=true,
        luminance_cd_m2=scenes[scene] if scene else 0.0,
    )


def _read_meter(
    scenes: dict[str, float], random: np.random.Generator, errors: Errors, readings_per_scene: int
) -> tuple[Reading, ...]:
    calibration = random.normal(1.0, errors.calibration)
    return tuple(
        Reading(
            scene=scene,
            quantity="luminance",
            value=float(luminance * calibration * random.normal(1.0, errors.repeatability)),
            meter="simulated luminance meter",
            expanded_uncertainty_rel=2 * errors.calibration,
            coverage_factor=2.0,
        )
        for scene, luminance in scenes.items()
        for _ in range(readings_per_scene)
    )


def _green(name: str, mean_dn: float, spread_dn: float, pixels: int, sensor: Sensor) -> ChannelStatistics:
    """Make one row of statistics; the tails of a normal distribution stand at the levels that clip it."""
    clipped = min(max(mean_dn, 0.0), sensor.white_level_dn)
    return ChannelStatistics(
        channel=name,
        n=pixels,
        min_dn=max(0, round(clipped - 4 * spread_dn)),
        max_dn=min(int(sensor.white_level_dn), round(clipped + 4 * spread_dn)),
        mean_dn=clipped,
        median_dn=float(round(clipped)),
        std_dn=spread_dn,
        saturated_share=float(ndtr((mean_dn + 0.5 - sensor.white_level_dn) / spread_dn)),
        zero_share=float(ndtr((0.5 - mean_dn) / spread_dn)),
        black_level_dn=sensor.black_level_dn,
        white_level_dn=sensor.white_level_dn,
    )
