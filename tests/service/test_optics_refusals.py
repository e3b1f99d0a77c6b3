"""What a field team reads when a campaign of optics is not as it should be."""

import dataclasses

import numpy as np
import pytest

from radiometry.geometry.camera import CameraModel
from radiometry.geometry.target import Target
from simulation.boards import View, draw_poses, set_up
from simulation.camera import change
from simulation.targets import CHART_STUDIO, Chart, Picture, Star, true_mtf
from tests.service.test_optics import publish
from tests.support.campaigns import calibrate
from tests.support.every_method import begin, draw, raw_bytes
from tests.support.house import CAMERA


@pytest.fixture(scope="module")
def house(sqlite_house):
    """One for all: refusals store nothing that another test could see."""
    return sqlite_house


@pytest.mark.parametrize(
    ("method", "target", "params", "said"),
    [
        ("sharpness", {"kind": "slanted_edge"}, {"pixel_pitch_um": 0.00465}, "greater than or equal to 0.1"),
        ("sharpness", {"kind": "slanted_edge"}, {"star_contrast": 0.95}, "less than or equal to 0.9"),
        ("noise", None, {"linearity_range_share": [0.9, 0.1]}, "two numbers, the lower first"),
    ],
)
def test_a_parameter_that_cannot_be_is_named(house, method, target, params, said):
    campaign = begin(house, method, CAMERA, **({"target": target} if target else {}))
    problem = house.post(f"/v1/campaigns/{campaign['id']}/calibrations", params, status=422)
    assert problem["code"] == "validation_failed"
    assert said in problem["detail"]
    assert next(iter(params)) in problem["detail"]


def test_a_target_that_cannot_be_says_what_it_may_be(house):
    body = {"camera_id": house.camera()["id"], "method": "sharpness"}
    problem = house.post(
        "/v1/campaigns", body | {"target": {"kind": "slanted_edge", "edge_order": 7}}, status=422
    )
    assert problem["detail"] == "body.target: edge_order must lie between 1 and 5"


@pytest.mark.parametrize(
    "wrong", [{"columns": "9"}, {"columns": True}, {"square_size_mm": "25"}, {"legacy_pattern": "yes"}]
)
def test_a_number_of_a_target_is_a_number(house, wrong):
    board = {"kind": "checkerboard", "columns": 9, "rows": 6, "square_size_mm": 25.0}
    body = {"camera_id": house.camera()["id"], "method": "geometry"}
    (name,) = wrong
    problem = house.post("/v1/campaigns", body | {"target": board | wrong}, status=422)
    assert f"body.target.{name}: must be" in problem["detail"]
    whole = house.post("/v1/campaigns", body | {"target": board | {"columns": 9.0}})
    assert whole["target"]["columns"] == 9


def test_what_nobody_said_of_a_sensor_can_be_said_later(house):
    camera = house.camera(serial="later")
    again = house.camera(serial="later", pixel_pitch_um=3.28, sensor_width_mm=17.3)
    assert (again["id"], again["pixel_pitch_um"], again["sensor_width_mm"]) == (camera["id"], 3.28, 17.3)
    assert house.camera(serial="later", pixel_pitch_um=4.0)["pixel_pitch_um"] == 3.28
    assert house.get(f"/v1/cameras/{camera['id']}")["pixel_pitch_um"] == 3.28


@pytest.mark.parametrize(
    ("method", "role", "outcome", "codes"),
    [
        ("vignetting", "chart", "warn", ["role_unused"]),
        ("vignetting", "field", "pass", []),
        ("noise", "chart", "warn", ["role_unused"]),
        ("noise", "field", "pass", []),
        ("geometry", "light", "warn", ["role_unused"]),
        ("geometry", "field", "pass", []),
    ],
)
def test_a_frame_that_no_fit_sees_is_not_waited_for(house, method, role, outcome, codes):
    """It is read and never extracted: "ask again in a few seconds" would be for ever."""
    board = {"kind": "checkerboard", "columns": 9, "rows": 6, "square_size_mm": 25}
    campaign = begin(house, method, CAMERA, **({"target": board} if method == "geometry" else {}))
    content = raw_bytes(house, np.full((32, 48), 1000, np.uint16))
    frame = house.upload(campaign, content, role=role, filename="frame.DNG")
    house.work()
    verdict = house.get(f"/v1/frames/{frame['id']}")["verdict"]
    assert (verdict["outcome"], [reason["code"] for reason in verdict["reasons"]]) == (outcome, codes)


@pytest.mark.parametrize(
    ("roi", "state", "code"),
    [(None, "refused", "refused"), ({"polygon": [[2, 2], [12, 2], [12, 12], [2, 12]]}, "read", "roi_unfit")],
)
def test_too_few_pixels_for_noise_are_no_matter_of_waiting(house, roi, state, code):
    campaign = begin(house, "noise", CAMERA)
    if roi:
        draw(house, campaign, roi)
    content = raw_bytes(house, np.full((20, 20), 1000, np.uint16))
    frame = house.upload(campaign, content, role="flat", filename="frame.DNG")
    house.work()
    found = house.get(f"/v1/frames/{frame['id']}")
    assert (found["state"], found["verdict"]["outcome"]) == (state, "fail")
    assert found["verdict"]["reasons"][0]["code"] == code
    assert "draw it larger" in found["verdict"]["reasons"][0]["detail"].lower()


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


def test_a_charuco_board_of_which_parts_are_hidden(house):
    said = {name: value for name, value in dataclasses.asdict(BOARD).items() if name != "legacy_pattern"}
    campaign = begin(house, "geometry", CAMERA, target=said)
    random = np.random.default_rng(11)
    for number, pose in enumerate(draw_poses(LENS, BOARD, random, count=6)):
        shares = View(board=BOARD, pose=pose).draw(STUDIO.camera, STUDIO.camera.window)
        shares[:, : 30 * number] = 1.0
        frame = STUDIO.photograph(Picture(shares), random)
        house.upload(campaign, raw_bytes(house, frame.samples_dn), role="chart", filename=f"{number}.DNG")
    version = calibrate(house, campaign, radial_terms=1, tangential=False)
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
    campaign = begin(house, "sharpness", CAMERA, target=target)
    draw(house, campaign, roi)
    for take in (1, 2):
        samples = STAR_STUDIO.photograph(Chart([STAR]), np.random.default_rng(take)).samples_dn
        house.upload(
            campaign,
            raw_bytes(house, samples, white_level_dn=16383),
            role="chart",
            filename=f"star-{take}.DNG",
        )
    version = calibrate(house, campaign, star_contrast=0.5)
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
