"""Quick looks: a region that nobody has set, all verdicts at once, a list without the bulk."""

import io

import numpy as np
import pytest
from PIL import Image
from sqlalchemy import func, select

from store.queries import campaigns as crops
from store.tables import Crop, Extraction
from tests.support.blobs import zero
from tests.support.reader import read_window

pytestmark = pytest.mark.either_database

CORNERS = [[8, 8], [60, 8], [60, 40]]


@pytest.fixture
def campaign(house):
    return house.campaign()


@pytest.fixture
def frame(house, campaign):
    sent = house.upload(
        campaign, house.frame_bytes(signal_dn=3835.0, noise_dn=8.0), role="light", scene="l", filename="a.dng"
    )
    house.work()
    return sent


def test_a_region_is_looked_at_without_being_set(house, campaign, frame):
    with house.with_scopes("read") as viewer:
        job = viewer.post(f"/v1/frames/{frame['id']}/region", json={"polygon": CORNERS}).json()
    house.work()
    looked = house.get(f"/v1/jobs/{job['id']}")["result"]
    assert house.get(f"/v1/campaigns/{campaign['id']}/roi", status=404)
    with house.database.reading() as session:
        assert session.scalar(select(func.count()).select_from(Extraction)) == 0
    # what a fit would see of the same region is the same
    house.http.put(f"/v1/campaigns/{campaign['id']}/roi", json={"polygon": CORNERS})
    house.work()
    rows = house.get(f"/v1/frames/{frame['id']}")["statistics"]
    kept = {row["channel"]: row for row in rows}
    for row in looked["statistics"]:
        assert row.items() <= kept[row["channel"]].items()
    assert {each["channel"]: sum(each["counts"]) for each in looked["histogram"]["channels"]} == {
        name: row["n"] for name, row in kept.items() if name != "grey"
    }
    # the noise reaches white in places: 4091 + 8 DN against 4095
    assert 0.2 < kept["grey"]["saturated_share"] < 0.5
    cell = looked["clipping"]["cells"][0]
    assert looked["clipping"]["col0_px"] == 8
    assert 0 < cell["share"] <= 1


def test_a_region_that_leaves_the_frame_is_refused_at_once(house, frame):
    problem = house.post(
        f"/v1/frames/{frame['id']}/region", {"polygon": [[0, 0], [500, 0], [9, 9]]}, status=422
    )
    assert problem["code"] == "roi_outside_frame"


def test_a_frame_that_is_not_read_cannot_be_looked_at(house, campaign):
    sent = house.upload(campaign, house.frame_bytes(seed=9), role="light")
    problem = house.post(f"/v1/frames/{sent['id']}/region", {"polygon": CORNERS}, status=409)
    assert (problem["code"], problem["retryable"]) == ("frame_not_read", True)


@pytest.mark.usefixtures("frame")
def test_a_brief_list_leaves_out_the_bulk_and_nothing_else(house, campaign):
    path = f"/v1/campaigns/{campaign['id']}/frames"
    (whole,), (brief,) = house.get(path)["items"], house.get(path, brief=True)["items"]
    assert whole.keys() - brief.keys() == {"metadata", "verdict"}
    assert brief.items() <= whole.items()


WINDOW = {"row0_px": 3, "col0_px": 5, "height_px": 20, "width_px": 30}


def _crop(house, frame, *, status=202, **changes):
    return house.post(f"/v1/frames/{frame['id']}/crops", WINDOW | changes, status=status)


def test_a_crop_shows_each_pixel_and_marks_the_clipped(house, frame):
    job = _crop(house, frame, low_dn=3800, high_dn=4095)
    house.work()
    drawn = house.get(f"/v1/jobs/{job['id']}")["result"]
    answer = house.http.get(drawn["picture"])
    assert answer.headers["content-type"] == "image/png"
    raw = read_window(house.folder / "frame.dng", 3, 5, 20, 30).samples_dn
    shown = np.asarray(Image.open(io.BytesIO(answer.content)).convert("RGB")).astype(int)
    clipped = raw >= 4095
    assert drawn["clipped_px"] == clipped.sum() > 0
    assert (shown[clipped] == (230, 30, 45)).all()
    grey = 255 * np.clip((raw - 3800) / 295, 0, 1) ** (1 / 2.2)
    assert np.abs(shown[~clipped, 0] - grey[~clipped]).max() < 1.5
    # asked for again it is the same, without another job
    assert _crop(house, frame, status=200, low_dn=3800, high_dn=4095)["id"] == job["id"]
    cached = house.http.get(drawn["picture"], headers={"If-None-Match": answer.headers["etag"]})
    assert cached.status_code == 304


def test_a_crop_is_its_organisations_own_and_must_lie_in_the_frame(house, stranger, frame):
    assert _crop(house, frame, status=422, col0_px=70)["code"] == "roi_outside_frame"
    assert _crop(house, frame, status=422, width_px=1025)["code"] == "validation_failed"
    assert _crop(house, frame, status=422, low_dn=9, high_dn=9)["code"] == "validation_failed"
    job = _crop(house, frame)
    house.work()
    picture = house.get(f"/v1/jobs/{job['id']}")["result"]["picture"]
    assert stranger.get(picture).status_code == 404
    assert stranger.post(f"/v1/frames/{frame['id']}/crops", json=WINDOW).status_code == 404


def test_the_newest_crops_are_kept_and_no_others(house, frame, monkeypatch):
    monkeypatch.setattr(crops, "MOST_KEPT", 3)
    for row in range(5):
        _crop(house, frame, row0_px=row, height_px=1)
    house.work()
    with house.database.reading() as session:
        assert session.scalar(select(func.count()).select_from(Crop)) == 3
    # the oldest is drawn again, the newest is there
    assert _crop(house, frame, row0_px=0, height_px=1)["state"] == "queued"
    _crop(house, frame, status=200, row0_px=4, height_px=1)


def test_no_crop_of_a_damaged_file_is_shown(house, frame):
    _crop(house, frame)
    house.work()
    _crop(house, frame, status=200)
    zero(house.folder, frame["sha256"], first=900, count=2000)
    for _ in range(2):
        job = _crop(house, frame, row0_px=4)
        house.work()
        assert house.get(f"/v1/jobs/{job['id']}")["error"]["code"] == "stored_file_damaged"
    # one that was drawn before the damage is not shown either
    assert _crop(house, frame)["state"] == "queued"
