"""A frame's undistorted picture over HTTP: pixels, metadata, the camera that made it."""

import io

import cv2
import numpy as np
import pytest
from PIL import Image

from tests.support.campaigns import calibrate
from tests.support.data import data_file
from tests.support.every_method import BOARD, CANON, begin, upload_views
from tests.support.frames import write_raw
from tests.support.measuring import measure, read_map

SHAPE = (480, 640)


@pytest.fixture(scope="module")
def calibrated(sqlite_house):
    """OpenCV's camera, of a few of its pictures."""
    house = sqlite_house
    campaign = begin(house, "geometry", CANON, target=BOARD)
    upload_views(house, campaign, (1, 3, 4, 5, 6))
    version = calibrate(house, campaign)
    house.publish(version)
    return house, campaign, version


def matrix_of(version):
    rows = {row["name"]: row["value"] for row in version["coefficients"]}
    matrix = np.array([[rows["fx_px"], 0, rows["cx_px"]], [0, rows["fy_px"], rows["cy_px"]], [0, 0, 1]])
    return matrix, np.array([rows[name] for name in ("k1", "k2", "p1", "p2", "k3")])


def test_a_chart_without_exposure_as_opencv_undistorts_it(calibrated):
    house, campaign, version = calibrated
    frames = house.get(f"/v1/campaigns/{campaign['id']}/frames")["items"]
    frame = next(frame for frame in frames if frame["filename"] == "left01.jpg")
    found = measure(house, frame, version, products=["map"])
    picture, said, known = read_map(house, found)
    # a picture without EXIF gets none
    assert not {"ExifTag", "Make"} & set(known)
    source = cv2.imread(str(data_file("checkerboard/left01.jpg")), cv2.IMREAD_UNCHANGED)
    expected = cv2.undistort(source, *matrix_of(version))
    assert (picture.dtype, picture.shape) == (np.uint16, SHAPE)
    # where the camera did not see, and in its last half pixel, ours is 0 and not a fading rim
    seen = picture > 0
    assert seen.mean() > 0.95
    assert np.abs(picture.astype(int) - expected)[seen & (expected > 0)].max() <= 8
    assert np.abs(picture.astype(int) - expected)[10:-10, 10:-10].mean() < 0.2
    undistorted = found["undistorted"]
    assert (undistorted["planes"], undistorted["linear"]) == (["grey"], False)
    fx = next(row for row in version["coefficients"] if row["name"] == "fx_px")
    assert undistorted["parameters"]["fx_px"] == {
        name: fx[name] for name in ("value", "standard_uncertainty", "unit")
    }
    assert set(undistorted["parameters"]) == {
        *("fx_px", "fy_px", "cx_px", "cy_px"),
        *("k1", "k2", "k3"),
        "p1",
        "p2",
    }
    assert said["parameters"] == undistorted["parameters"]
    assert said["calibration"]["content_sha256"] == version["content_sha256"]
    assert ("mean" in found, found["region_origin"]) == (False, "whole_frame")
    preview = Image.open(io.BytesIO(house.http.get(found["links"]["map_png"]).content))
    assert (preview.mode, preview.size) == ("L", (640, 480))
    assert measure(house, frame, version, products=["map"])["id"] == found["id"]


def test_a_raw_field_frame_gives_its_grey_plane_in_raw_numbers(calibrated, tmp_path):
    house, campaign, version = calibrated
    rows, cols = np.indices(SHAPE)
    mosaic = (1000 + 3 * rows + 2 * cols + 400 * ((rows % 2) ^ (cols % 2))).astype(np.uint16)
    names = {"make": "Canon", "model": "EOS 5D", "serial": "1", "lens_make": "Canon", "lens_model": "15mm"}
    path = write_raw(tmp_path / "field.dng", mosaic, **names)
    frame = house.upload(campaign, path.read_bytes(), role="field", filename="field.DNG")
    house.work()
    found = measure(house, frame, version, products=["map"])
    picture, said, known = read_map(house, found)
    assert (found["undistorted"]["planes"], found["undistorted"]["linear"]) == (["grey"], True)
    assert (known["Make"], known["ExifTag"]["FNumber"]) == ("Canon", (4, 1))
    assert (said["black_level_dn"][0], said["exposure"]["iso"]) == (256.0, 100.0)
    # the pattern is gone and the plane of the light is left, moved by the distortion: 3 and 2 DN a pixel
    smooth = 1200.0 + 3 * rows + 2 * cols
    expected = cv2.undistort(smooth.astype(np.float32), *matrix_of(version))
    seen = (picture > 0) & (expected > 0)
    seen[:2] = seen[-2:] = seen[:, :2] = seen[:, -2:] = False
    assert np.abs(picture - expected)[60:-60, 80:-80].max() < 1.0
    assert seen.mean() > 0.9
    moved = np.abs(expected - smooth)[60:-60, 80:-80].max()
    assert moved > 10.0


def test_what_an_undistorted_picture_cannot_be_asked_for(calibrated):
    house, campaign, version = calibrated
    frame = house.get(f"/v1/campaigns/{campaign['id']}/frames")["items"][0]
    named = {"frame_id": frame["id"], "calibration_id": version["id"]}
    assert house.post("/v1/measurements", named, status=422)["code"] == "option_not_of_method"
    for more in ({"reflectance": 0.2}, {"roi": {"polygon": [[0, 0], [9, 0], [9, 9]]}}):
        problem = house.post("/v1/measurements", named | {"products": ["map"]} | more, status=422)
        assert problem["code"] == "option_not_of_method"
    small = np.zeros((64, 96), np.uint8)
    content = cv2.imencode(".png", small)[1].tobytes()
    other = house.upload(campaign, content, role="chart", filename="small.png")
    house.work()
    problem = house.post(
        "/v1/measurements",
        {"frame_id": other["id"], "calibration_id": version["id"], "products": ["map"]},
        status=422,
    )
    assert (problem["code"], "640 x 480" in problem["detail"]) == ("wrong_camera", True)


def test_a_picture_is_no_map_of_values_and_has_no_figure_to_compare(calibrated):
    house, campaign, version = calibrated
    frame = house.get(f"/v1/campaigns/{campaign['id']}/frames")["items"][0]
    found = measure(house, frame, version, products=["map"])
    assert house.get(f"/v1/measurements/{found['id']}/map.json", status=404)["code"] == "not_found"
    house.get(f"/v1/measurements/{found['id']}/comparison", status=422, old=found["id"])
    assert found["id"] in {row["id"] for row in house.get("/v1/measurements")["items"]}
    lines = house.http.get(f"/v1/series/measurements?campaign_id={campaign['id']}&format=csv").text
    assert found["id"] in lines
