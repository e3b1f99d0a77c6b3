"""The blur of a campaign's frames from the attitudes that their files record."""

import csv
import io

import pytest

from store.tables import FrameRow
from tests.support.data import data_file


@pytest.fixture(scope="module")
def house(sqlite_house):
    """One for all: each test takes a frame of its own."""
    return sqlite_house


def upload_with_attitudes(house, campaign=None, *, seed=7, serial="0K1XE8", **spectral):
    """A frame that says it is a Sequoia's: level, then 2 degrees of pitch and 4 of yaw in 0.2 s."""
    data = house.frame_bytes(seed=seed, serial=serial, exposure_time_s=0.01)
    frame = house.upload(campaign or house.campaign(), data, role="field", filename=f"{seed}.DNG")
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


def test_a_real_sequoia_in_the_air(house):
    path = data_file("sequoia/IMG_180413_080658_0000_GRE.TIF")
    header = house.worker.decoders.read_header(path)
    camera = house.camera(make=header.make, model=header.model, serial=header.serial or "1")
    campaign = house.campaign(camera_id=camera["id"])
    house.upload(campaign, path.read_bytes(), role="field", filename=path.name)
    house.work()
    (row,) = house.get(f"/v1/campaigns/{campaign['id']}/motion", **OPTICS)["rows"]
    # taken 0.14 s after the last record; from the one 0.2 s before that, pitch went up 0.0546 degrees,
    # roll down 0.0218, yaw down 0.0614, of which a roll of -8.1 degrees makes 0.0086 of pitch
    assert row["basis"] == "nearest"
    assert row["rotation_rate_deg_s"] == pytest.approx(0.335, abs=0.005)
    assert row["rotation_blur_px"] == pytest.approx(0.0186, abs=0.0003)


@pytest.fixture(scope="module")
def flight(house):
    """Turning by 10 degrees per second, not at all, without records, not yet read, and no picture."""
    campaign = house.campaign()
    upload_with_attitudes(house, campaign)
    still = [
        {"ch0": 1, "ch1": 1, "time_us": at_us, "yaw_deg": 0.0, "pitch_deg": 0.0, "roll_deg": 0.0}
        for at_us in (1_000_000, 1_200_000)
    ]
    counts = {"record_bytes": 28, "cut_short": False, "records": still, "gains": []}
    upload_with_attitudes(house, campaign, seed=8, counts=counts)
    house.upload(campaign, house.frame_bytes(seed=9, exposure_time_s=0.01), role="dark", filename="=9.DNG")
    house.upload(campaign, b"II*\0 no picture", role="field", filename="10.DNG")
    house.work()
    house.upload(campaign, house.frame_bytes(seed=11, exposure_time_s=0.01), role="field", filename="11.DNG")
    return campaign


def test_a_campaign_s_frames_in_one_table(house, flight):
    answer = house.get(f"/v1/campaigns/{flight['id']}/motion", **OPTICS)
    turned, still, dark, refused, waiting = answer["rows"]
    assert turned["basis"] == "during"
    assert turned["rotation_rate_deg_s"] == pytest.approx(10.0, rel=2e-3)
    # 0.1 degree of 3.75 / 3980 rad a pixel
    assert turned["rotation_blur_px"] == pytest.approx(1.852, rel=2e-3)
    assert turned["tolerable_rate_deg_s"] == pytest.approx(10.0 * 0.5 / 1.852, rel=2e-3)
    assert turned["theoretical_blur_px"] == turned["rotation_blur_px"] == 2 * turned["practical_blur_px"]
    assert turned["corner_blur_px"] - turned["rotation_blur_px"] == pytest.approx(0.2014, rel=2e-3)
    assert (turned["within_limit"], still["within_limit"]) == (False, True)
    assert "forward_blur_px" not in turned
    said = [(row["missing_code"], "within_limit" in row) for row in (dark, refused, waiting)]
    assert said == [("attitude_missing", False), ("frame_not_read", False), ("frame_not_read", False)]
    assert "refused (" in refused["missing"]
    assert "Enter the rotation rate" in dark["missing"]
    names = ("frames", "with_rates", "within_limit", "beyond_limit")
    assert [answer[name] for name in names] == [5, 2, 1, 1]


@pytest.mark.parametrize(("limit_px", "within"), [(1.84, False), (1.86, True)])
def test_the_limit_is_one_of_the_theoretical_motion(house, flight, limit_px, within):
    """The turned frame moved by 1.852 px."""
    answer = house.get(f"/v1/campaigns/{flight['id']}/motion", **OPTICS, limit_px=limit_px)
    assert answer["rows"][0]["within_limit"] is within


@pytest.mark.parametrize("speed", [{"ground_speed_m_s": 6}, {"ground_speed_km_h": 21.6}])
def test_speed_and_height_add_the_forward_motion(house, flight, speed):
    """3.75 / 3980 rad at 100 m are 94.2 mm a pixel, of which 6 m/s pass 60 mm in 10 ms."""
    path = f"/v1/campaigns/{flight['id']}/motion"
    turned, still, dark, *_ = house.get(path, **OPTICS, **speed, distance_m=100, limit_px=0.637)["rows"]
    assert still["forward_blur_px"] == dark["forward_blur_px"] == pytest.approx(0.6368)
    assert still["theoretical_blur_px"] == pytest.approx(0.6368)
    assert turned["theoretical_blur_px"] == pytest.approx(0.6368 + 1.852, rel=2e-3)
    assert still["within_limit"] is True
    assert "within_limit" not in dark
    # too fast for the exposure, however the aircraft turned
    dark = house.get(path, **OPTICS, **speed, distance_m=100, limit_px=0.636, role="dark")["rows"][0]
    assert dark["within_limit"] is False
    assert "theoretical_blur_px" not in dark


def test_the_table_as_csv(house, flight):
    answer = house.http.get(f"/v1/campaigns/{flight['id']}/motion", params=OPTICS | {"format": "csv"})
    assert answer.headers["Content-Type"].startswith("text/csv")
    rows = list(csv.DictReader(io.StringIO(answer.text)))
    assert [row["filename"] for row in rows] == ["7.DNG", "8.DNG", "'=9.DNG", "10.DNG", "11.DNG"]
    assert [row["within_limit"] for row in rows] == ["false", "true", "", "", ""]
    assert float(rows[0]["rotation_blur_px"]) == pytest.approx(1.852, rel=2e-3)


def test_the_camera_s_record_says_the_pitch(house):
    told = house.camera(serial="0K1XF2", pixel_pitch_um=7.5)
    campaign = house.campaign(camera_id=told["id"])
    upload_with_attitudes(house, campaign, serial="0K1XF2")
    path = f"/v1/campaigns/{campaign['id']}/motion"
    (row,) = house.get(path, focal_length_mm=3.98)["rows"]
    assert row["rotation_blur_px"] == pytest.approx(1.852 / 2, rel=2e-3)
    assert house.get(path, **OPTICS)["rows"][0]["rotation_blur_px"] == pytest.approx(1.852, rel=2e-3)


@pytest.mark.parametrize(
    ("query", "field", "said"),
    [
        ({"pixel_pitch_um": 3.75}, "query.focal_length_mm", "is missing"),
        ({"focal_length_mm": 4}, "query.pixel_pitch_um", "the camera's record does not say it"),
        (OPTICS | {"ground_speed_m_s": 5}, "query", "together or not at all"),
        (OPTICS | {"distance_m": 5}, "query", "together or not at all"),
        (OPTICS | {"distance_m": 5, "ground_speed_m_s": 5, "ground_speed_km_h": 18}, "query", "not both"),
        (OPTICS | {"limit_px": "nan"}, "query.limit_px", "must be a number"),
        (OPTICS | {"limit_px": "1e400"}, "query.limit_px", "must be a finite number"),
        (OPTICS | {"limit_px": 0}, "query.limit_px", "greater than or equal"),
        (OPTICS | {"speed": 5}, "query.speed", "is not known here"),
        (OPTICS | {"role": "sky"}, "query.role", "field"),
        (OPTICS | {"format": "xml"}, "query.format", "csv"),
    ],
)
def test_what_is_asked_wrongly_is_named(house, flight, query, field, said):
    problem = house.get(f"/v1/campaigns/{flight['id']}/motion", **query, status=422)
    assert problem["errors"][0]["field"] == field
    assert said in problem["errors"][0]["message"]
