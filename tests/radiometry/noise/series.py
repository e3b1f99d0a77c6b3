"""Exposure series of known sensors, and how a found figure is compared with the truth."""

from dataclasses import replace

import numpy as np
import pytest

from radiometry.fitting.evidence import Region
from radiometry.frame.packing import pack, unpack
from radiometry.frame.roi import Polygon
from radiometry.noise.results import Features, FrameRow, Params, extract_features
from simulation.camera import change
from simulation.camera import take as expose
from simulation.targets import COUNTING_SENSOR, plan_series

PARAMS = Params()
TIMES = (0.02, 0.05, 0.1, 0.2, 0.3, 0.45, 0.6)
LIGHT = 30_000.0
SMALL = change(COUNTING_SENSOR, height_px=32, width_px=32, read_noise_e=6.0)


def shoot(camera, seed, *, times=TIMES, dark_times=(0.02,), light=LIGHT, frames=2):
    rng = np.random.default_rng(seed)
    shots = plan_series(camera, light_e_per_s=light, times_s=times, dark_times_s=dark_times, frames=frames)
    return [expose(camera, shot, rng) for shot in shots]


def take(camera, seed, **series):
    return tuple(make_row(taken) for taken in shoot(camera, seed, **series))


def make_row(taken):
    """A frame as the fit sees it, its whole picture the region."""
    height, width = taken.frame.height_px, taken.frame.width_px
    corners = [(0, 0), (width, 0), (width, height), (0, height)]
    region = Region(name="", polygon=Polygon.from_points(corners))
    extracted = extract_features(taken.frame, [region], header=taken.header)
    return FrameRow(
        frame=taken.name,
        role=taken.role,
        scene=None,
        header=taken.header,
        exposure=taken.exposure,
        statistics=extracted.statistics,
        features=extracted.features,
    )


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
    return replace(row, features=Features(blocks=(changed,)))


def brightened(rows, by_dn, wanted):
    """The frames, with so much more light on those that are wanted."""

    def change(samples, block):
        return replace(block, samples_dn=pack(samples + by_dn, dtype="<u2"))

    return [repack(row, change) if wanted(row) else row for row in rows]
