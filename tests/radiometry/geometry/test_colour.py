"""Red and blue are found where the lens puts them, with an honest uncertainty."""

import dataclasses

import numpy as np
import pytest

from radiometry.fitting.evidence import FrameEvidence
from radiometry.geometry.camera import CameraModel
from radiometry.geometry.fit import check_colours, fit_geometry, list_coefficients
from radiometry.geometry.results import ColourView, Params, fit_colour
from radiometry.methods import get_method
from simulation.boards import View, draw_poses, set_up
from simulation.camera import change
from store.codec import encode
from tests.radiometry.geometry.boards import BOARD, extract, make_header, raised

LENS = CameraModel(height_px=240, width_px=320, fx_px=260, fy_px=260, cx_px=166, cy_px=114, k1=-0.25)
BOARD_NEAR = dataclasses.replace(BOARD, columns=5, rows=4)
HALF_PX = 200.0
# of the focal length: 0.8 px outwards and 0.6 px inwards in the corner
RED, BLUE = 0.004, -0.003


def magnify(share):
    return dataclasses.replace(LENS, fx_px=LENS.fx_px * (1 + share), fy_px=LENS.fy_px * (1 + share))


def photograph(count, *, seed=3, **colours):
    studio = set_up(LENS, dark_dn=200.0, bright_dn=3500.0, noise_dn=15.0, cfa="RGGB")
    studio = change(studio, projections={name: magnify(share) for name, share in colours.items()})
    random = np.random.default_rng(seed)
    header = make_header(LENS, cfa="RGGB")
    rows = []
    for number, pose in enumerate(draw_poses(LENS, BOARD_NEAR, random, count=count)):
        frame = studio.photograph(View(board=BOARD_NEAR, pose=pose), random)
        found = extract(frame, target=BOARD_NEAR, bits=12)
        evidence = (f"view-{number}", "chart", None, header, None, found.statistics, found.features)
        names = ("frame", "role", "scene", "header", "exposure", "statistics", "features")
        rows.append(FrameEvidence(**dict(zip(names, evidence, strict=True))))
    return rows


@pytest.fixture(scope="module")
def fitted():
    return fit_geometry(photograph(6, R=RED, B=BLUE), Params(radial_terms=1, tangential=False))


def test_each_colour_is_where_its_lens_puts_it(fitted):
    """The sites of red and blue are two pixels apart, and a corner is placed to a twentieth of that."""
    for found, channels, share in zip(fitted.lateral_colour, ("B-G", "R-G"), (BLUE, RED), strict=True):
        assert (found.channels, found.views, found.corners) == (channels, 6, 120)
        assert found.corner.value == pytest.approx(share * HALF_PX, abs=0.2)
        for place in (4, 6, 8):
            point = found.curve[place]
            assert point.radius_px == pytest.approx(place / 10 * HALF_PX)
            assert not point.extrapolated
            assert 0.0 < point.standard_uncertainty_px < 0.12
            away = abs(point.displacement_px - share * point.radius_px)
            assert away < 3.5 * point.standard_uncertainty_px


def test_coefficients_plot_and_flag(fitted):
    listed = [each for each in list_coefficients(fitted) if each.name == "lateral_colour_px"]
    assert [(each.channel, each.unit) for each in listed] == [("B-G", "px"), ("R-G", "px")]
    assert "R-G" in get_method("geometry").draw(encode(fitted))
    assert "lateral_colour_large" not in raised(fitted)


def test_a_fit_of_grey_pictures_is_stored_as_before(simulated):
    fit = fit_geometry(simulated, Params())
    assert fit.lateral_colour is None
    assert "lateral_colour" not in encode(fit)
    assert "colours" not in encode(simulated[0].features)


def simulate_views(random, *, count, noise_px, shared_px):
    """Corners with noise of their own, and with an error that those of one picture share."""
    views = []
    for _ in range(count):
        seen = random.uniform([0, 0], [240, 320], (20, 2))
        q = (seen - [LENS.cy_px, LENS.cx_px]) / HALF_PX
        moved = q * (0.6 + 0.3 * (q**2).sum(axis=1, keepdims=True)) + [0.05, -0.02]
        moved = moved + random.normal(0, noise_px, moved.shape) + random.normal(0, shared_px, 2)
        views.append(ColourView(seen, moved))
    return views


@pytest.mark.parametrize("shared_px", [0.0, 0.05])
def test_intervals_hold_the_truth(shared_px):
    """95 % intervals of 300 sets of ten views, by Student's t of nine degrees of freedom."""
    random, inside = np.random.default_rng(5), 0
    for _ in range(300):
        views = simulate_views(random, count=10, noise_px=0.1, shared_px=shared_px)
        corner = fit_colour(views, LENS, channel="R").corner
        inside += abs(corner.value - 0.9) < 2.262 * corner.standard_uncertainty
    # 95 % of 300 with a standard deviation of 3.8
    assert 272 <= inside <= 298


def test_a_large_aberration_is_flagged():
    random = np.random.default_rng(6)
    views = [
        dataclasses.replace(view, moved_px=3.0 * view.moved_px)
        for view in simulate_views(random, count=6, noise_px=0.05, shared_px=0.0)
    ]
    (flag,) = check_colours([fit_colour(views, LENS, channel="R")])
    assert (flag.flag, flag.where) == ("lateral_colour_large", "R-G")
    assert fit_colour(views[:2], LENS, channel="R") is None
