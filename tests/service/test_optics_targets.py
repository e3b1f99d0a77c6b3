"""The other targets over HTTP: a ChArUco board of which parts are seen, and a Siemens star by direction."""

import dataclasses

import numpy as np
import pytest

from radiometry.geometry.camera import CameraModel
from radiometry.geometry.target import Target
from simulation.boards import View, draw_poses, set_up
from simulation.camera import change
from simulation.targets import CHART_STUDIO, Chart, Picture, Star, true_mtf
from tests.service.test_optics import begin, fit, publish, raw_bytes

LENS = CameraModel(height_px=240, width_px=320, fx_px=300.0, fy_px=300.0, cx_px=163.0, cy_px=117.0, k1=-0.2)
BOARD = Target(
    kind="charuco", columns=7, rows=5, square_size_mm=30.0, marker_size_mm=22.0, dictionary="DICT_4X4_50"
)
STUDIO = set_up(LENS, dark_dn=400.0, bright_dn=3000.0, noise_dn=8.0, cfa="RGGB")
STAR = Star(
    name="centre", row0=3, col0=15, size=184, centre_row_px=95.3, centre_col_px=107.7, cycles=36, blur_px=1.0
)
STAR_STUDIO = change(
    CHART_STUDIO, height_px=190, width_px=210, cfa="RGGB", gain_dn_per_e=0.25, photon_noise=True
)


@pytest.fixture(scope="module")
def house(sqlite_house):
    return sqlite_house


def test_a_charuco_board_of_which_parts_are_hidden(house):
    said = {name: value for name, value in dataclasses.asdict(BOARD).items() if name != "legacy_pattern"}
    campaign = begin(house, "geometry", target=said)
    random = np.random.default_rng(11)
    for number, pose in enumerate(draw_poses(LENS, BOARD, random, count=6)):
        shares = View(board=BOARD, pose=pose).draw(STUDIO.camera, STUDIO.camera.window)
        shares[:, : 30 * number] = 1.0
        frame = STUDIO.photograph(Picture(shares), random)
        house.upload(campaign, raw_bytes(house, frame.samples_dn), role="chart", filename=f"{number}.DNG")
    version = fit(house, campaign, corner_window="fitted", radial_terms=1, tangential=False)
    rows = {row["name"]: row for row in publish(house, version)}
    for name in ("fx_px", "cx_px", "cy_px", "k1"):
        found = rows[name]
        assert abs(found["value"] - getattr(LENS, name)) < 4 * found["standard_uncertainty"], name
    assert rows["fx_px"]["standard_uncertainty"] < 3.0
    assert version["diagnostics"]["corners"] < 6 * BOARD.corners


def test_a_star_has_its_resolving_power_by_direction(house):
    target = {"kind": "siemens_star", "cycles": STAR.cycles}
    box = [[15, 3], [199, 3], [199, 187], [15, 187]]
    roi = {"regions": [{"name": "centre", "polygon": box}]}
    campaign = begin(house, "sharpness", target=target, roi=roi)
    for take in (1, 2):
        samples = STAR_STUDIO.photograph(Chart([STAR]), np.random.default_rng(take)).samples_dn
        house.upload(
            campaign,
            raw_bytes(house, samples, white_level_dn=16383),
            role="chart",
            filename=f"star-{take}.DNG",
        )
    version = fit(house, campaign, star_contrast=0.5)
    rows = {row["name"]: row for row in publish(house, version) if row["channel"] == "G"}
    power = rows["resolving_power_cycles_per_pixel"]
    (green,) = (each for each in version["diagnostics"]["positions"] if each["channel"] == "G")
    curves = {each.get("direction_deg"): each for each in green["curves"]}
    assert None in curves
    assert len(curves) == 1 + 8
    # relative to the outermost rings, whose own contrast the blur has lowered already
    frequency = np.array(curves[None]["frequency"])
    reference = true_mtf(frequency, blur="gaussian", blur_px=STAR.blur_px)[:6].mean()
    expected = np.sqrt(-np.log(0.5 * reference) / 2) / (np.pi * STAR.blur_px)
    assert power["value"] == pytest.approx(expected, rel=0.02)
    assert rows["unresolved_diameter_px"]["value"] == pytest.approx(36 / (np.pi * power["value"]), rel=1e-9)
