"""Vignetting, sharpness, geometry and noise over HTTP: from uploaded frames to published coefficients."""

import io
import json
import xml.etree.ElementTree as ET

import cv2
import numpy as np
import pytest
import tifffile

from simulation.camera import change, take
from simulation.targets import COUNTING_SENSOR, FALLOFFS, FAST_LENS, plan_flats, plan_series
from tests.support.data import data_file
from tests.support.frames import write_raw

pytestmark = pytest.mark.either_database

SERIAL = "0K1XE8"
F_NUMBERS = (2.0, 4.0)
EDGE_CAMERA = {"make": "Canon", "model": "EOS 5D", "serial": "1"}


def raw_bytes(house, samples, **told):
    path = house.folder / "optics.dng"
    return write_raw(path, samples, serial=SERIAL, lens_model="15mm", **told).read_bytes()


def begin(house, method, *, camera=None, roi=None, **more):
    camera = house.camera(**(camera or {}))
    campaign = house.post("/v1/campaigns", {"camera_id": camera["id"], "method": method, **more})
    if roi:
        answer = house.http.put(f"/v1/campaigns/{campaign['id']}/roi", json=roi)
        assert answer.status_code == 200, answer.text
    return campaign


def fit(house, campaign, **params):
    house.work()
    assert house.get(f"/v1/campaigns/{campaign['id']}")["missing"] == []
    return house.fit(campaign, **params)


def publish(house, version):
    publication = {"valid_from": "2026-01-01T00:00:00Z", "reason": "spring"}
    house.post(f"/v1/calibrations/{version['id']}/publish", publication, status=200)
    path = f"/v1/cameras/{version['camera_id']}/coefficients"
    return house.get(path, method=version["method"], at="2026-06-01T00:00:00Z")["items"]


def test_the_falloff_of_a_lens(house):
    lens = change(FAST_LENS, height_px=160, width_px=240, centre_px=(84.0, 110.0))
    random = np.random.default_rng(1)
    campaign = begin(house, "vignetting")
    for shot in plan_flats(lens, f_numbers=F_NUMBERS, flats=2, darks=2):
        samples = take(lens, shot, random).frame.samples_dn
        content = raw_bytes(house, samples, f_number=shot.settings.f_number)
        house.upload(campaign, content, role=shot.role, filename=f"{shot.frame}.DNG")
    version = fit(house, campaign)
    rows = {(row["name"], row["f_number"]): row for row in publish(house, version) if row["channel"] == "G1"}
    assert {key[0] for key in rows} == {
        *("k1", "k2", "k3", "centre_row_px", "centre_col_px", "corner_falloff")
    }
    for f_number in F_NUMBERS:
        corner = rows["corner_falloff", f_number]
        row, col = lens.centre_px
        radius = np.hypot(160, 240) / 2
        distances = [np.hypot(r - row, c - col) / radius for r in (0, 159) for c in (0, 239)]
        k1, k2, k3 = FALLOFFS[f_number]
        r2 = max(distances) ** 2
        truth = -(k1 * r2 + k2 * r2**2 + k3 * r2**3)
        assert abs(corner["value"] - truth) < 4 * corner["standard_uncertainty"]
    centre = rows["centre_col_px", 2.0]
    assert abs(centre["value"] - 110.0) < 4 * centre["standard_uncertainty"]

    # the light's plane is estimated from these few pixels, and the corners have most of its uncertainty
    corner = rows["corner_falloff", 2.0]
    within = 4 * corner["standard_uncertainty"] / (1 - corner["value"])
    check_falloff_exports(house, version, lens, within)


def check_falloff_exports(house, version, lens, within):
    base = f"/v1/calibrations/{version['id']}/exports"
    answer = house.http.get(f"{base}/correction.tif", params={"f_number": 2.0})
    with tifffile.TiffFile(io.BytesIO(answer.content)) as file:
        gains = file.asarray()
    assert (gains.dtype, gains.shape) == (np.float32, (160, 240))
    assert np.abs(gains * lens.share(2.0) - 1.0).max() < within < 0.04
    again = house.http.get(
        f"{base}/correction.tif", params={"f_number": 2.0}, headers={"If-None-Match": answer.headers["ETag"]}
    )
    assert again.status_code == 304
    refused = house.http.get(f"{base}/correction.tif", params={"f_number": 22.0})
    assert (refused.status_code, refused.json()["code"]) == (422, "vignetting_not_calibrated")
    check_residual_map(house, base, version)
    check_lensfun(house, base)
    other = house.http.get(f"{base}/opencv.yaml")
    assert (other.status_code, "correction.tif" in other.json()["detail"]) == (404, True)


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
    refused = house.http.get(f"{base}/residuals.tif", params={"f_number": 2.8, "channel": "R"})
    assert (refused.status_code, refused.json()["code"]) == (422, "vignetting_not_calibrated")
    assert "there are f/2 R, f/2 G1" in refused.json()["detail"]


def check_lensfun(house, base):
    """What the refusal tells the user to do, does."""
    query = {"focal_length_mm": 15.0, "mount": "djifixed"}
    refused = house.http.get(f"{base}/lensfun.xml", params=query)
    assert (refused.status_code, "pixel_pitch_um" in refused.json()["detail"]) == (422, True)
    house.camera(pixel_pitch_um=3.28)
    answer = house.http.get(f"{base}/lensfun.xml", params=query)
    assert answer.headers["Content-Type"].startswith("application/xml")
    root = ET.fromstring(answer.text)
    assert [child.tag for child in root] == ["mount", "camera", "lens"]
    diagonal_mm = np.hypot(160, 240) * 0.00328
    assert float(root.findtext("lens/cropfactor")) == pytest.approx(43.2666 / diagonal_mm, rel=1e-4)
    apertures = [each.get("aperture") for each in root.findall("lens/calibration/vignetting")]
    assert apertures == ["2", "4"]


def test_the_board_of_opencv(house):
    campaign = begin(house, "geometry", camera=EDGE_CAMERA)
    for number in (1, 3, 4, 5, 6, 7, 8, 9):
        name = f"left{number:02d}.jpg"
        house.upload(campaign, data_file(f"checkerboard/{name}").read_bytes(), role="chart", filename=name)
    check_that_frames_wait_for_their_board(house, campaign)
    target = {"kind": "checkerboard", "columns": 9, "rows": 6, "square_size_mm": 25.0}
    answer = house.http.patch(f"/v1/campaigns/{campaign['id']}", json={"target": target})
    assert answer.status_code == 200
    version = fit(house, campaign)
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
    distorted = house.http.get(f"{base}/lensfun-distortion.xml", params=asked)
    # no pixel pitch is registered
    assert (distorted.status_code, distorted.json()["code"]) == (422, "validation_failed")
    camera = house.get(f"{base}/camera.json")
    assert camera["parameters"]["k1"]["value"] == rows["k1"]["value"]
    house.camera(**EDGE_CAMERA, pixel_pitch_um=8.2)
    assert 'model="poly5"' in house.http.get(f"{base}/lensfun-distortion.xml", params=asked).text


def test_picture_without_its_board_is_flagged(house):
    campaign = begin(
        house, "geometry", target={"kind": "checkerboard", "columns": 9, "rows": 6, "square_size_mm": 25}
    )
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
    camera = house.camera()
    body = {"camera_id": camera["id"], "method": "geometry", "target": {}}
    problem = house.post("/v1/campaigns", body, status=422)
    assert "body.target.kind" in {error["field"] for error in problem["errors"]}
    body["target"] = {"kind": "checkerboard", "columns": 9, "rows": 6, "square_size_mm": 25, "colour": "red"}
    problem = house.post("/v1/campaigns", body, status=422)
    assert [error["field"] for error in problem["errors"]] == ["body.target.colour"]
    body["target"] = {"kind": "checkerboard", "columns": 9.5, "rows": 6, "square_size_mm": 25}
    problem = house.post("/v1/campaigns", body, status=422)
    assert problem["detail"] == "body.target.columns: must be a whole number"
    body = {"camera_id": camera["id"], "method": "luminance", "target": {"kind": "checkerboard"}}
    problem = house.post("/v1/campaigns", body, status=422)
    assert [error["field"] for error in problem["errors"]] == ["body.target"]


def test_the_edge_of_sfrmat(house):
    edge = {"name": "centre", "polygon": [[0, 0], [343, 0], [343, 124], [0, 124]]}
    campaign = begin(
        house, "sharpness", camera=EDGE_CAMERA, roi={"regions": [edge]}, target={"kind": "slanted_edge"}
    )
    house.upload(campaign, data_file("edge/Test_edge1.tif").read_bytes(), role="chart", filename="edge.tif")
    version = fit(house, campaign, pixel_pitch_um=5.0)
    rows = [row for row in publish(house, version) if row["name"] == "mtf50_cycles_per_pixel"]
    values = {row["channel"]: row["value"] for row in rows}
    assert values["luminance"] == pytest.approx(0.26981, abs=0.01)
    assert all(row["model"] == "slanted_edge:centre" for row in rows)
    (frame,) = house.get(f"/v1/campaigns/{campaign['id']}/frames")["items"]
    assert house.get(f"/v1/campaigns/{campaign['id']}/roi")["regions"] == [
        {"name": "centre", "polygon": [[0, 0], [343, 0], [343, 124], [0, 124]]}
    ]
    assert frame["state"] == "extracted"


def test_a_region_in_parts_that_changes_is_computed_anew(house):
    parts = [{"name": "a", "polygon": [[0, 0], [100, 0], [100, 124], [0, 124]]}]
    campaign = begin(house, "sharpness", camera=EDGE_CAMERA, roi={"regions": parts})
    house.upload(campaign, data_file("edge/Test_edge1.tif").read_bytes(), role="chart", filename="edge.tif")
    house.work()
    path = f"/v1/campaigns/{campaign['id']}"
    house.http.patch(path, json={"target": {"kind": "slanted_edge", "edge_order": 1}})
    assert house.work() == 1
    answer = house.http.patch(path, json={"target": {"kind": "slanted_edge", "edge_order": 9}})
    assert answer.status_code == 422


def test_the_noise_of_a_sensor(house):
    camera = change(COUNTING_SENSOR, cfa="RGGB", height_px=64, width_px=64)
    campaign = begin(house, "noise")
    random, times = np.random.default_rng(2), (0.002, 0.004, 0.008, 0.016, 0.03, 0.05)
    light = {"light_e_per_s": 500_000.0, "times_s": times, "dark_times_s": times, "role": "light"}
    for shot in plan_series(camera, **light):
        samples = take(camera, shot, random).frame.samples_dn
        time_s = shot.settings.exposure_time_s
        content = raw_bytes(house, samples, exposure_time_s=time_s, white_level_dn=16383)
        house.upload(campaign, content, role=shot.role, filename=f"{shot.frame}.DNG")
    version = fit(house, campaign)
    rows = {(row["name"], row["channel"]): row for row in publish(house, version)}
    gain = rows["system_gain_dn_per_e", "G1"]
    assert abs(gain["value"] - 0.5) < 4 * gain["standard_uncertainty"]
    assert gain["standard_uncertainty"] < 0.02
    noise = rows["read_noise_e", "G1"]
    assert abs(noise["value"] - 4.0) < 4 * noise["standard_uncertainty"]
