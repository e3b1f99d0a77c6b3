"""A rig over HTTP: registered, photographed in front of one board, oriented, exported and compared."""

import cv2
import numpy as np
import pytest
import yaml

from simulation.boards import draw_boards
from tests.support.rigs import BOARD, RIG, photograph

pytestmark = pytest.mark.either_database


def test_a_rig_is_oriented_from_pictures_taken_together(house):
    cameras = [house.camera(serial=f"R{number}") for number in range(2)]
    body = {"name": "null ", "camera_ids": [camera["id"] for camera in cameras]}
    rig = house.post("/v1/rigs", body)
    assert house.post("/v1/rigs", body, status=200)["id"] == rig["id"]
    assert [each["id"] for each in house.get("/v1/rigs")["items"]] == [rig["id"]]
    assert house.get(f"/v1/rigs/{rig['id']}")["camera_ids"] == body["camera_ids"]
    turned = house.post("/v1/rigs", body | {"camera_ids": body["camera_ids"][::-1]}, status=409)
    assert turned["code"] == "rig_differs"
    path = f"/v1/rigs/{rig['id']}"
    assert house.get(f"{path}/orientation")["sets"] == []
    assert house.http.get(f"{path}/exports/rig.json").status_code == 404

    poses = draw_boards(RIG, BOARD, np.random.default_rng(4), count=5)
    scenes = [f"trigger-{number}" for number in range(5)]
    made = [photograph(house, camera, number, poses, scenes=scenes) for number, camera in enumerate(cameras)]
    found = house.get(f"{path}/orientation", tolerance_deg=0.1)
    (one,) = found["sets"]
    assert one["calibration_ids"] == [version for _, version in made]
    (pose,) = one["orientation"]["poses"]
    # corners of rendered pictures share errors: a rigid rig is not called loose for them
    assert {each["flag"] for each in one["orientation"]["flags"]} == {"few_triggers"}
    truth = np.degrees(RIG[1].pose[:3])
    assert (pose["camera"], one["orientation"]["reference"]) == ("R1", "R0")
    error = np.degrees(np.array(pose["rotation"])) - truth
    u = np.degrees(np.sqrt(np.diag(pose["covariance"])))[:3]
    assert np.all(np.abs(error) < 4 * u)
    assert pose["yaw"]["unit"] == "deg"
    assert {(each["name"], each["verdict"]) for each in found["stability"]} == {
        (name, "cannot_tell") for name in ("yaw", "pitch", "roll", "x", "y", "z")
    }

    written = house.http.get(f"{path}/exports/opencv.yaml")
    storage = cv2.FileStorage(written.text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    plain = yaml.safe_load(written.text.partition("---\n")[2].replace("!!opencv-matrix", ""))
    assert storage.getNode("rig").string() == plain["rig"] == body["name"]
    assert storage.getNode("serial_1").string() == plain["serial_1"] == "R1"
    np.testing.assert_allclose(storage.getNode("R_1").mat(), pose["matrix"], atol=1e-12)
    np.testing.assert_allclose(storage.getNode("T_1").mat().ravel(), pose["translation_m"], atol=1e-12)
    kept = {"If-None-Match": written.headers["ETag"]}
    assert house.http.get(f"{path}/exports/opencv.yaml", headers=kept).status_code == 304
    exported = house.get(f"{path}/exports/rig.json")
    assert [each["serial"] for each in exported["cameras"]] == ["R0", "R1"]

    check_given_versions(house, path, made)
    check_wrong_scene(house, path, made)


def check_given_versions(house, path, made):
    versions = [version for _, version in made]
    given = house.http.get(
        f"{path}/orientation", params=[("calibration_id", each) for each in versions[::-1]]
    )
    assert [each["calibration_ids"] for each in given.json()["sets"]] == [versions]
    refused = house.http.get(f"{path}/orientation", params={"calibration_id": versions[0]})
    assert (refused.status_code, "of each of the rig's 2 cameras" in refused.json()["detail"]) == (422, True)


def check_wrong_scene(house, path, made):
    """A frame's scene is corrected by hand: the pairing follows."""
    campaign, _ = made[1]
    frames = house.get(f"/v1/campaigns/{campaign['id']}/frames")["items"]
    wrong = next(each for each in frames if each["scene"] == "trigger-2")
    house.patch(f"/v1/frames/{wrong['id']}", {"scene": "nothing"})
    (one,) = house.get(f"{path}/orientation")["sets"]
    left_out = {each["frame"]: each["left_out"] for each in one["orientation"]["points"] if not each["used"]}
    assert left_out["R1-trigger-2.DNG"] == "no other camera has a picture of trigger nothing"
    assert one["orientation"]["triggers"] == 4
