"""What a field team reads when a campaign of optics is not as it should be."""

import numpy as np
import pytest

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
