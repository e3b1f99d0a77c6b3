"""Exposure series of known sensors, and how a found figure is compared with the truth."""

import dataclasses

import numpy as np
import pytest

from radiometry.frame.packing import pack, unpack
from radiometry.noise import method as noise
from simulation.noise import SimulatedSensor, shoot

PARAMS = noise.Params()
TIMES = (0.02, 0.05, 0.1, 0.2, 0.3, 0.45, 0.6)
LIGHT = 30_000.0
SMALL = SimulatedSensor(rows=32, cols=32, read_noise_e=6.0)


def take(sensor, seed, *, times=TIMES, dark_times=(0.02,), light=LIGHT, frames=2):
    rng = np.random.default_rng(seed)
    return shoot(sensor, rng, light_e_per_s=light, times_s=times, dark_times_s=dark_times, frames=frames)


def only(fit):
    (channel,) = fit.channel_fits
    return channel


def flags_of(fit):
    return {raised.flag for raised in fit.flags}


def agrees(quantity, truth, *, errors=3.5):
    assert quantity.value == pytest.approx(truth, abs=errors * quantity.standard_uncertainty)


def repack(row, change):
    """The same frame with its block changed."""
    (block,) = row.features.blocks
    changed = change(unpack(block.samples_dn), block)
    return dataclasses.replace(row, features=noise.Features(blocks=(changed,)))


def brightened(rows, by_dn, wanted):
    """The frames, with so much more light on those that are wanted."""

    def change(samples, block):
        return dataclasses.replace(block, samples_dn=pack(samples + by_dn, dtype="<u2"))

    return [repack(row, change) if wanted(row) else row for row in rows]
