"""Quick looks: a region that nobody has set, all verdicts at once, a list without the bulk."""

import pytest
from sqlalchemy import func, select

from store.tables import Extraction

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
    job = house.post(f"/v1/frames/{frame['id']}/region", {"polygon": CORNERS}, status=202)
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


def test_all_verdicts_come_in_one_answer(house, campaign, frame):
    path = f"/v1/campaigns/{campaign['id']}"
    (verdict,) = house.get(f"{path}/verdicts")["items"]
    (listed,) = house.get(f"{path}/frames")["items"]
    assert verdict == {"frame_id": frame["id"], **listed["verdict"]}


@pytest.mark.usefixtures("frame")
def test_a_brief_list_leaves_out_the_bulk_and_nothing_else(house, campaign):
    path = f"/v1/campaigns/{campaign['id']}/frames"
    (whole,), (brief,) = house.get(path)["items"], house.get(path, brief=True)["items"]
    assert whole.keys() - brief.keys() == {"metadata", "verdict"}
    assert brief.items() <= whole.items()
