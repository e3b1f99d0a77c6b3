"""Lateral colour from edges: the scale of red and blue that the lens has, wherever an edge is."""

from dataclasses import replace

import numpy as np
import pytest

from radiometry.fitting.curve import coverage_factor
from radiometry.sharpness import fit as sharpness
from radiometry.sharpness.fit import list_coefficients
from radiometry.sharpness.results import Params
from simulation.camera import change
from simulation.targets import CHART_STUDIO, Chart, Edge
from tests.radiometry.sharpness.shots import extract, row, seeded

CAMERA = change(CHART_STUDIO, cfa="RGGB", read_noise_e=40.0)
SCALES = {"R": 1.004, "B": 0.998}
SIZE = np.array([240.0, 320.0])
EDGES = (
    Edge(name="centre", row0=80, col0=130, height=80, width=60, blur_px=0.8),
    Edge(name="top-left", row0=2, col0=2, height=60, width=90, blur_px=0.8, horizontal=True),
    Edge(name="right", row0=80, col0=255, height=80, width=60, blur_px=0.8, angle_deg=8.0, rising=False),
)


def shoot(random, scales, *, camera=CAMERA):
    frame = camera.photograph(Chart(EDGES, scales), random)
    return extract(frame, [each.region for each in EDGES], camera=camera)


@pytest.fixture(scope="module")
def rows():
    random = seeded(3)
    return [row(f"frame-{number}", shoot(random, SCALES)) for number in range(3)]


def test_shift_and_radial_part_are_those_of_the_lens(rows):
    """Fifteen sets by hand: 97 % of 112 within U."""
    fit = sharpness.fit(rows, Params())
    parts = {each.name: each for each in EDGES}
    assert len(fit.lateral_colour) == 6
    for each in fit.lateral_colour:
        part = parts[each.position]
        middle = np.array([part.row0 + part.height / 2, part.col0 + part.width / 2]) - SIZE / 2
        scale = SCALES[each.channels[0]] - 1.0
        u = each.shift.standard_uncertainty
        assert u < 0.02
        truth = scale * abs(part.normal @ middle)
        assert each.shift.value == pytest.approx(truth, abs=1.5 * coverage_factor(each.effective_dof) * u)
        if each.position == "centre":
            assert each.radial is None
        else:
            truth = scale * np.hypot(*middle)
            assert each.radial.value == pytest.approx(truth, abs=0.1 * abs(truth) + 0.03)
    listed = [each for each in list_coefficients(fit) if each.name == "lateral_colour_px"]
    assert {(each.channel, each.model) for each in listed} == {
        (pair, f"slanted_edge:{position}") for pair in ("R-G", "B-G") for position in ("top-left", "right")
    }
    assert "lateral_colour_large" not in {each.flag for each in fit.flags}


def test_flag_of_a_large_shift_names_the_position_and_old_features_have_none():
    far = [row("far", shoot(seeded(4), {"R": 1.012}))]
    fit = sharpness.fit(far, Params())
    (flag,) = [each for each in fit.flags if each.flag == "lateral_colour_large"]
    assert flag.where == "position right"
    assert flag.detail.startswith("R-G is +1.")
    regions = [
        replace(region, edges=tuple(replace(each, place=None) for each in region.edges))
        for region in far[0].features.regions
    ]
    old = replace(far[0].features, regions=tuple(regions))
    assert sharpness.fit([row("old", old)], Params()).lateral_colour is None
