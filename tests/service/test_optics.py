"""Vignetting, sharpness and geometry over HTTP: from uploaded frames to published coefficients."""

import io
import json
import xml.etree.ElementTree as ET

import cv2
import numpy as np
import pytest
import tifffile

from simulation.camera import change
from simulation.targets import FALLOFFS, FAST_LENS
from tests.support.data import data_file
from tests.support.every_method import (
    BOARD,
    CANON,
    F_NUMBERS,
    begin,
    draw,
    fit_flats,
    make_version,
    raw_bytes,
    upload_views,
)
from tests.support.house import CAMERA

pytestmark = pytest.mark.either_database


def publish(house, version):
    house.publish(version)
    path = f"/v1/cameras/{version['camera_id']}/coefficients"
    return house.get(path, method=version["method"], at="2026-06-01T00:00:00Z")["items"]


def test_the_falloff_of_a_lens(house):
    lens = change(FAST_LENS, height_px=160, width_px=240, centre_px=(84.0, 110.0))
    version = fit_flats(house, CAMERA, lens)
    rows = {(row["name"], row["f_number"]): row for row in publish(house, version) if row["channel"] == "G1"}
    assert {name for name, _ in rows} == {
        *("k1", "k2", "k3", "centre_row_px", "centre_col_px", "corner_falloff")
    }
    (row, col), (height, width) = lens.centre_px, lens.share(2.0).shape
    for f_number in F_NUMBERS:
        corner = rows["corner_falloff", f_number]
        radius = np.hypot(height, width) / 2
        distances = [np.hypot(r - row, c - col) / radius for r in (0, height - 1) for c in (0, width - 1)]
        k1, k2, k3 = FALLOFFS[f_number]
        r2 = max(distances) ** 2
        truth = -(k1 * r2 + k2 * r2**2 + k3 * r2**3)
        assert abs(corner["value"] - truth) < 4 * corner["standard_uncertainty"]
    centre = rows["centre_col_px", 2.0]
    assert abs(centre["value"] - col) < 4 * centre["standard_uncertainty"]

    # the light's plane is estimated from these few pixels, and the corners have most of its uncertainty
    corner = rows["corner_falloff", 2.0]
    within = 4 * corner["standard_uncertainty"] / (1 - corner["value"])
    check_falloff_exports(house, version, lens, within)


def check_falloff_exports(house, version, lens, within):
    base = f"/v1/calibrations/{version['id']}/exports"
    answer = house.http.get(f"{base}/correction.tif", params={"f_number": 2.0})
    with tifffile.TiffFile(io.BytesIO(answer.content)) as file:
        gains = file.asarray()
    assert (gains.dtype, gains.shape) == (np.float32, lens.share(2.0).shape)
    assert np.abs(gains * lens.share(2.0) - 1.0).max() < within < 0.04
    again = house.http.get(
        f"{base}/correction.tif", params={"f_number": 2.0}, headers={"If-None-Match": answer.headers["ETag"]}
    )
    assert again.status_code == 304
    refused = house.get(f"{base}/correction.tif", f_number=22.0, status=422)
    assert refused["code"] == "vignetting_not_calibrated"
    check_residual_map(house, base, version)
    check_lensfun(house, base, lens)
    assert "correction.tif" in house.get(f"{base}/opencv.yaml", status=404)["detail"]


def check_residual_map(house, base, version):
    answer = house.http.get(f"{base}/residuals.tif", params={"f_number": 2.0, "channel": "R"})
    with tifffile.TiffFile(io.BytesIO(answer.content)) as file:
        residuals, said = file.asarray(), json.loads(file.pages.first.description)
    assert (residuals.dtype, residuals.shape, said["block_px"]) == (np.float32, (20, 30), 8)
    (fitted,) = (
        fit
        for fit in version["diagnostics"]["channel_fits"]
        if (fit["coefficient"]["f_number"], fit["coefficient"]["channel"]) == (2.0, "R")
    )
    assert np.sqrt(np.mean(residuals**2)) == pytest.approx(fitted["residual_rms_rel"], rel=1e-3)
    assert said["calibration_id"] == version["id"]
    refused = house.get(f"{base}/residuals.tif", f_number=2.8, channel="R", status=422)
    assert refused["code"] == "vignetting_not_calibrated"
    assert "there are f/2 R, f/2 G1" in refused["detail"]


def check_lensfun(house, base, lens):
    """What the refusal tells the user to do, does."""
    query = {"focal_length_mm": 15.0, "mount": "djifixed"}
    assert "pixel_pitch_um" in house.get(f"{base}/lensfun.xml", **query, status=422)["detail"]
    house.camera(pixel_pitch_um=3.28)
    answer = house.http.get(f"{base}/lensfun.xml", params=query)
    assert answer.headers["Content-Type"].startswith("application/xml")
    root = ET.fromstring(answer.text)
    assert [child.tag for child in root] == ["mount", "camera", "lens"]
    diagonal_mm = np.hypot(*lens.share(2.0).shape) * 0.00328
    assert float(root.findtext("lens/cropfactor")) == pytest.approx(43.2666 / diagonal_mm, rel=1e-4)
    apertures = [each.get("aperture") for each in root.findall("lens/calibration/vignetting")]
    assert apertures == ["2", "4"]


def test_the_board_of_opencv(house):
    campaign = begin(house, "geometry", CANON)
    upload_views(house, campaign, (1, 3, 4, 5, 6, 7, 8, 9))
    check_that_frames_wait_for_their_board(house, campaign)
    house.patch(f"/v1/campaigns/{campaign['id']}", {"target": BOARD})
    house.work()
    assert house.get(f"/v1/campaigns/{campaign['id']}")["missing"] == []
    version = house.fit(campaign)
    rows = {row["name"]: row for row in publish(house, version)}
    assert set(rows) == {"fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "k3", "p1", "p2", "rms_px"}
    # eight of the thirteen pictures: the published figures within their errors
    for name, published in (("fx_px", 535.9157), ("cx_px", 342.2832), ("cy_px", 235.5708)):
        assert abs(rows[name]["value"] - published) < 4 * rows[name]["standard_uncertainty"]
    assert version["parameters"]["fix_aspect_ratio"] is True

    base = f"/v1/calibrations/{version['id']}/exports"
    storage = cv2.FileStorage(
        house.http.get(f"{base}/opencv.yaml").text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY
    )
    assert storage.getNode("camera_matrix").mat()[0, 2] == rows["cx_px"]["value"]
    named = house.get(f"{base}/cameras.json", camera_id="v2 canon eos 5d 640 480 brown 0.8")
    assert named["v2 canon eos 5d 640 480 brown 0.8"]["focal_x"] == rows["fx_px"]["value"] / 640
    assert next(iter(house.get(f"{base}/cameras.json"))).startswith("v2 canon eos 5d 640 480 brown ")
    asked = {"focal_length_mm": 15.0, "mount": "canonfixed", "widest_f_number": 2.8}
    # no pixel pitch is registered
    refused = house.get(f"{base}/lensfun-distortion.xml", **asked, status=422)
    assert refused["code"] == "validation_failed"
    camera = house.get(f"{base}/camera.json")
    assert camera["parameters"]["k1"]["value"] == rows["k1"]["value"]
    house.camera(**CANON, pixel_pitch_um=8.2)
    assert 'model="poly5"' in house.http.get(f"{base}/lensfun-distortion.xml", params=asked).text


def test_picture_without_its_board_is_flagged(house):
    campaign = begin(house, "geometry", CAMERA, target=BOARD)
    grey = np.full((64, 96), 900, np.uint16)
    grey[::2] += 40
    frame = house.upload(campaign, raw_bytes(house, grey), role="chart", filename="nothing.DNG")
    house.work()
    frame = house.get(f"/v1/frames/{frame['id']}")
    assert (frame["state"], "board_not_found" in frame["warnings"]) == ("extracted", True)


def check_that_frames_wait_for_their_board(house, campaign):
    house.work()
    path = f"/v1/campaigns/{campaign['id']}"
    frames = house.get(f"{path}/frames")["items"]
    reasons = [reason for frame in frames for reason in frame["verdict"]["reasons"]]
    assert {frame["state"] for frame in frames} == {"read"}
    assert any(reason["detail"].startswith("Nobody has said what is photographed") for reason in reasons)
    assert "describe the board in the campaign's target" in house.get(path)["missing"][0]
    problem = house.post(f"{path}/calibrations", {}, status=422)
    assert (problem["code"], problem["missing"][0]) == ("campaign_incomplete", house.get(path)["missing"][0])


def test_a_board_that_cannot_be_says_which_field_is_wrong(house):
    camera_id = house.camera()["id"]
    for method, target, field in (
        ("geometry", {}, "body.target.kind"),
        ("geometry", BOARD | {"colour": "red"}, "body.target.colour"),
        ("geometry", BOARD | {"columns": 9.5}, "body.target.columns"),
        ("luminance", {"kind": "checkerboard"}, "body.target"),
    ):
        body = {"camera_id": camera_id, "method": method, "target": target}
        errors = {e["field"]: e["message"] for e in house.post("/v1/campaigns", body, status=422)["errors"]}
        assert field in errors
        assert errors.keys() == {field} or not target
        assert not field.endswith("columns") or errors[field] == "must be a whole number"


def test_the_edge_of_sfrmat(house):
    version = make_version(house, "sharpness")
    rows = [row for row in publish(house, version) if row["name"] == "mtf50_cycles_per_pixel"]
    values = {row["channel"]: row["value"] for row in rows}
    assert values["luminance"] == pytest.approx(0.26981, abs=0.01)
    assert all(row["model"] == "slanted_edge:centre" for row in rows)
    path = f"/v1/campaigns/{version['campaign_id']}"
    (frame,) = house.get(f"{path}/frames")["items"]
    assert house.get(f"{path}/roi")["regions"] == [
        {"name": "centre", "polygon": [[0, 0], [343, 0], [343, 124], [0, 124]]}
    ]
    assert frame["state"] == "extracted"


def test_a_region_in_parts_that_changes_is_computed_anew(house):
    parts = [{"name": "a", "polygon": [[0, 0], [100, 0], [100, 124], [0, 124]]}]
    campaign = begin(house, "sharpness", CANON)
    draw(house, campaign, {"regions": parts})
    house.upload(campaign, data_file("edge/Test_edge1.tif").read_bytes(), role="chart", filename="edge.tif")
    house.work()
    path = f"/v1/campaigns/{campaign['id']}"
    house.patch(path, {"target": {"kind": "slanted_edge", "edge_order": 1}})
    assert house.work() == 1
    house.patch(path, {"target": {"kind": "slanted_edge", "edge_order": 9}}, status=422)


def test_a_frame_that_was_refused_for_its_region_is_read_with_the_next(house):
    campaign = begin(house, "sharpness", CANON)
    content = data_file("edge/Test_edge1.tif").read_bytes()
    frame = house.upload(campaign, content, role="chart", filename="edge.tif")
    states = []
    for corner in ((120, 40), (343, 124)):
        draw(house, campaign, {"polygon": [[0, 0], [corner[0], 0], [*corner], [0, corner[1]]]})
        house.work()
        states.append(house.get(f"/v1/frames/{frame['id']}")["state"])
    assert states == ["refused", "extracted"]
