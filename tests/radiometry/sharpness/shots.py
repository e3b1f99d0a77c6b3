"""Frames of simulated charts, and what the method makes of them."""

from dataclasses import replace

import numpy as np

from radiometry.fitting.evidence import FrameEvidence
from radiometry.frame.exposure import Exposure
from radiometry.sharpness import fit
from radiometry.sharpness.results import Target
from simulation.camera import change
from simulation.targets import CHART_STUDIO, Chart, Edge

CAMERA = CHART_STUDIO
SMALL = change(CHART_STUDIO, height_px=110, width_px=110)
EXPOSURE = Exposure(exposure_time_s=0.01, f_number=4.0, iso=100.0)
EDGES = Target()
STRAIGHT = Target(edge_order=1)


def seeded(seed=1):
    return np.random.default_rng(seed)


def edge(**changes):
    return Edge(**({"name": "centre", "row0": 3, "col0": 20} | changes))


def extract(frame, regions, *, camera=CAMERA, target=EDGES, header=None):
    header = header or camera.camera.describe()
    return fit.extract(frame, regions, header=header, exposure=None, target=target).features


def render_chart(studio, parts, random):
    return studio.photograph(Chart(parts), random)


def measure(one, *, camera=SMALL, random=None, target=EDGES):
    frame = render_chart(camera, [one], random or seeded())
    (region,) = extract(frame, [one.region], camera=camera, target=target).regions
    return {each.channel: each for each in region.edges}


def measure_only(one, **more):
    (response,) = measure(one, **more).values()
    return response


def row(name, features, *, exposure=EXPOSURE, camera=CAMERA, **changes):
    evidence = FrameEvidence(
        frame=name,
        role="chart",
        scene=None,
        header=camera.camera.describe(),
        exposure=exposure,
        statistics=(),
        features=features,
    )
    return replace(evidence, **changes)
