"""Whole simulated campaigns, drawn in one call."""

import dataclasses

import numpy as np

from radiometry.luminance.rows import FrameRow, Reading
from simulation.luminance import Campaign, Errors, Sensor, simulate_campaign, simulate_row

TRUE_K = 30.0


@dataclasses.dataclass(frozen=True)
class Drawn:
    campaign: Campaign
    rows: tuple[FrameRow, ...]
    readings: tuple[Reading, ...]


def draw(seed, *, errors=None, isos=(3200.0,), pixels=20000, sensor=None):
    """Simulate a campaign's statistics."""
    random = np.random.default_rng(seed)
    campaign = simulate_campaign(sensor or Sensor(), random, errors=errors or Errors(), isos=isos)
    rows = tuple(simulate_row(campaign, s, random, true_k=TRUE_K, pixels=pixels) for s in campaign.shots)
    return Drawn(campaign, rows, campaign.readings)
