"""The blur of a frame from the attitudes that its file records."""

import pytest

from store.tables import FrameRow
from tests.service.test_tools import DATA


@pytest.fixture(scope="module")
def house(sqlite_house):
    """One for all: each test takes a frame of its own."""
    return sqlite_house


def upload_with_attitudes(house, **spectral):
    """A frame that says it is a Sequoia's: level, then 2 degrees of pitch and 4 of yaw in 0.2 s."""
    frame = house.upload(house.campaign(), house.frame_bytes(seed=7, exposure_time_s=0.01), role="field")
    house.work()
    level = {"ch0": 1, "ch1": 1, "pitch_deg": 0.0, "roll_deg": 0.0}
    records = [
        level | {"time_us": 1_000_000, "yaw_deg": 359.0},
        level | {"time_us": 1_200_000, "yaw_deg": 3.0, "pitch_deg": 2.0},
    ]
    said = {
        "system": "sequoia",
        "band": "red",
        "band_name": "Red",
        "counts": {"record_bytes": 28, "cut_short": False, "records": records, "gains": []},
        "exposed_at_us": 1_100_000,
    } | spectral
    with house.database.writing("test") as session:
        row = session.get_one(FrameRow, frame["id"])
        row.header = {**row.header, "multispectral": said}
    return frame


OPTICS = {"pixel_pitch_um": 3.75, "focal_length_mm": 3.98}


def test_the_blur_of_a_frame_from_its_attitudes(house):
    frame = upload_with_attitudes(house)
    answer = house.get(f"/v1/frames/{frame['id']}/motion", **OPTICS)
    assert answer["basis"] == "during"
    assert answer["rotation_rate_deg_s"] == pytest.approx(10.0, rel=2e-3)
    assert answer["rotation_blur_px"] == pytest.approx(
        1.852, rel=2e-3
    )  # 0.1 degree of 3.75 / 3980 rad a pixel
    assert answer["practical_blur_px"] == answer["rotation_blur_px"] / 2
    # 64 x 96 pixels: the corner lies 57.7 px out, and turns by 0.2 degrees
    assert answer["corner_blur_px"] - answer["rotation_blur_px"] == pytest.approx(0.2014, rel=2e-3)
    assert answer["tolerable_rate_deg_s"] == pytest.approx(10.0 * 0.5 / 1.852, rel=2e-3)
    assert len(answer["turns"]) == 1


def test_a_frame_without_attitudes_says_what_to_do(house):
    frame = house.upload(house.campaign(), house.frame_bytes(seed=8), role="field")
    path = f"/v1/frames/{frame['id']}/motion"
    assert house.get(path, **OPTICS, status=422)["code"] == "frame_not_read"
    house.work()
    problem = house.get(path, **OPTICS, status=422)
    assert problem["code"] == "attitude_missing"
    assert "/v1/tools/motion" in problem["detail"]
    assert house.get(path, pixel_pitch_um=3.75, status=422)["errors"][0]["field"] == "query.focal_length_mm"


def test_the_blur_of_another_organisations_frame_does_not_exist(house, stranger):
    frame = upload_with_attitudes(house, band="green")
    assert stranger.get(f"/v1/frames/{frame['id']}/motion", params=OPTICS).status_code == 404


def test_a_real_sequoia_in_the_air(house):
    path = DATA / "sequoia" / "IMG_180413_080658_0000_GRE.TIF"
    if not path.is_file():
        pytest.skip(f"no real data: {path} does not exist (set STILB_TEST_DATA)")
    header = house.worker.decoders.read_header(path)
    camera = house.camera(make=header.make, model=header.model, serial=header.serial or "1")
    campaign = house.campaign(camera_id=camera["id"])
    frame = house.upload(campaign, path.read_bytes(), role="field", filename=path.name)
    house.work()
    answer = house.get(f"/v1/frames/{frame['id']}/motion", **OPTICS)
    # taken 0.14 s after the last record; from the one 0.2 s before that, pitch went up 0.0546 degrees,
    # roll down 0.0218, yaw down 0.0614, of which a roll of -8.1 degrees makes 0.0086 of pitch
    assert answer["basis"] == "nearest"
    assert answer["rotation_rate_deg_s"] == pytest.approx(0.335, abs=0.005)
    assert answer["rotation_blur_px"] == pytest.approx(0.0186, abs=0.0003)
    assert len(answer["turns"]) == 9
