"""A rig over HTTP: registered, photographed in front of one board, oriented, exported and compared."""

import io
import json

import cv2
import numpy as np
import pypdf
import pytest
import yaml

from radiometry.fitting.curve import coverage_factor
from simulation.boards import draw_boards
from stilb.export import export
from tests.support.certificates import InHouse
from tests.support.house import KEY
from tests.support.live import serving
from tests.support.printed import link_checkout, read_blocks, type_in
from tests.support.rigs import BOARD, RIG, photograph
from tests.verify.changing import nudge, run

pytestmark = pytest.mark.either_database


def test_a_rig_is_oriented_from_pictures_taken_together(house, tmp_path, capsys):
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
    exported = house.get(f"{path}/exports/rig.json")
    assert [each["serial"] for each in exported["cameras"]] == ["R0", "R1"]

    check_certificate(house, path, pose)
    check_given_versions(house, path, made)
    check_recomputed(house, path, made, tmp_path, capsys)
    check_printed(house, rig, made, tmp_path / "checkout")
    check_wrong_scene(house, path, made)


def check_certificate(house, path, pose):
    certificate = house.get(f"{path}/certificate.json")
    assert [each["item"]["serial"] for each in certificate["cameras"]] == ["R0", "R1"]
    assert (certificate["state"], certificate["orientation"]["poses"]) == ("published", [pose])
    rows = {each["name"]: each for each in certificate["coefficients"]}
    assert rows.keys() == {"yaw", "pitch", "roll", "boresight", "x", "y", "z"}
    for name, row in rows.items():
        assert row["coverage_factor"] == coverage_factor(pose["effective_dof"][name]) > 1.95
        assert row["expanded_uncertainty"] == row["coverage_factor"] * pose[name]["standard_uncertainty"]
    assert "laboratory_address_missing" in {each["code"] for each in certificate["gaps"]}
    again = house.http.get(f"{path}/certificate.json")
    tag = {"If-None-Match": again.headers["etag"]}
    assert house.http.get(f"{path}/certificate.json", headers=tag).status_code == 304
    pdf = house.http.get(f"{path}/certificate.pdf").content
    reader = pypdf.PdfReader(io.BytesIO(pdf))
    assert json.loads(reader.attachments["certificate.json"][0]) == house.get(f"{path}/certificate.json")
    text = "".join(page.extract_text() for page in reader.pages)
    assert certificate["number"] in text
    assert "Certificate of orientation" in text
    assert {"R0-geometry-1", "R1-geometry-1", "boresight"} <= set(text.split())


def check_recomputed(house, path, made, folder, capsys):
    """From an export per camera: a last digit is rounding, a changed angle is found, nothing else differs."""
    for _, version in made:
        export(InHouse(house), version, folder / version, None)
    certificate = house.get(f"{path}/certificate.json")
    nudge(("orientation", "poses", 0, "rotation", 0), 1e-12)(certificate)
    nudge(("coefficients", 0, "value"))(certificate)
    (folder / "certificate.json").write_text(json.dumps(certificate))
    code, said = run(capsys, folder)
    assert code == 1
    assert " 1 of " in said


def check_printed(house, rig, made, folder):
    """The commands of docs/rigs.md, with the line of each camera once for both."""
    folder.mkdir()
    link_checkout(folder)
    exported, *others = "".join(read_blocks("docs/rigs.md")).splitlines()
    each = "; ".join(f'CAL="{version}"; {exported.partition("#")[0]}' for _, version in made)
    with serving(house) as live:
        address = {"STILB": live.url, "STILB_URL": live.url, "KEY": KEY, "STILB_KEY": KEY, "RIG": rig["id"]}
        told = type_in(folder, "\n".join([each, *others]), **address)
    assert told.count("the same to the last bit") == 2


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
    answer = house.http.patch(f"/v1/frames/{wrong['id']}", json={"scene": "nothing"})
    assert answer.status_code == 200, answer.text
    (one,) = house.get(f"{path}/orientation")["sets"]
    left_out = {each["frame"]: each["left_out"] for each in one["orientation"]["points"] if not each["used"]}
    assert left_out["R1-trigger-2.DNG"] == "no other camera has a picture of trigger nothing"
    assert one["orientation"]["triggers"] == 4
