"""Whole simulated campaigns, drawn in one call."""

import math
from dataclasses import asdict, dataclass, replace

import numpy as np
from scipy.special import ndtr

from radiometry.frame.exposure import Exposure
from radiometry.frame.statistics import ChannelStatistics
from radiometry.luminance.rows import FrameRow, Reading
from simulation.luminance import X5S, Campaign, Errors, clock, plan_campaign

TRUE_K = 30.0


@dataclass(frozen=True)
class Drawn:
    campaign: Campaign
    rows: tuple[FrameRow, ...]
    readings: tuple[Reading, ...]


def draw(seed, *, errors=None, isos=(3200.0,), pixels=20000, camera=X5S, timed=False, **planned):
    random = np.random.default_rng(seed)
    campaign = plan_campaign(camera, random, errors=errors or Errors(), isos=isos, **planned)
    rows = tuple(draw_row(campaign.camera, s, random, pixels=pixels) for s in campaign.shots)
    readings = campaign.readings
    if timed:
        rows = tuple(
            replace(row, taken_at=row.scene and clock(row.scene, shot.after_s))
            for row, shot in zip(rows, campaign.shots, strict=True)
        )
    else:
        readings = tuple(replace(reading, taken_at=None) for reading in readings)
    return Drawn(campaign, rows, readings)


def draw_row(camera, shot, random, *, pixels, true_k=TRUE_K):
    """The statistics of a region's greens without its pixels, of which each channel has so many."""
    sensor, true = camera.sensor, camera.set_truly(shot.settings)
    gain = sensor.gain(true.iso)
    light_dn = true_k * true.exposure_time_s * true.iso * shot.lamp.shine(shot.after_s) / true.f_number**2
    dark_dn = gain * sensor.dark_current_e_s * true.exposure_time_s
    mean = sensor.black_level_dn + light_dn + dark_dn
    variance = gain * (light_dn + dark_dn) + (gain * sensor.read_noise_e) ** 2 + 1 / 12
    spread = math.sqrt(variance + (sensor.prnu_rel * light_dn) ** 2)
    greens = tuple(
        _green(name, mean + math.sqrt(variance / pixels) * random.standard_normal(), spread, pixels, sensor)
        for name in ("G1", "G2")
    )
    exposure = Exposure(**asdict(shot.settings))
    return FrameRow(frame=shot.frame, role=shot.role, scene=shot.scene, exposure=exposure, statistics=greens)


def _green(name, mean_dn, spread_dn, pixels, sensor):
    """One row of statistics; the tails of a normal distribution are cut at the levels that clip it."""
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
