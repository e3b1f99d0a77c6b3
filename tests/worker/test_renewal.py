"""Frames that an earlier version extracted are read again, and their campaign can be fitted."""

import pytest
from sqlalchemy import select

from store.tables import Job
from tests.support.campaigns import ROI
from worker.background import Renewal

pytestmark = pytest.mark.either_database


def test_frames_of_an_earlier_extractor_are_read_again_once(house, monkeypatch):
    campaign = house.campaign()
    path = f"/v1/campaigns/{campaign['id']}"
    house.http.put(f"{path}/roi", json=ROI)
    for seed in (1, 2):
        house.upload(campaign, house.frame_bytes(seed=seed), role="dark")
    house.work()
    renewal = Renewal(house.database)
    assert renewal.do_round() > 3600
    monkeypatch.setattr("store.software.EXTRACTOR", "extract-later")
    # kept reviews are of other code too, after an upgrade
    monkeypatch.setattr("store.reviews.hash_code", lambda: "later")
    (said,) = house.get(path)["missing"]
    assert said.startswith("2 of 2 frames are read again")
    assert house.get(path)["advice"] == []
    assert renewal.do_round() < 3600
    with house.database.reading() as session:
        queued = session.scalars(select(Job.lane).where(Job.state == "queued")).all()
    assert queued == ["renewal", "renewal"]
    assert renewal.do_round() < 3600, "they wait"
    # a fit waits for the rest, which goes before what nobody waits for
    refused = house.http.post(f"{path}/calibrations", json={"method": "luminance"})
    assert (refused.status_code, refused.json()["code"]) == (422, "campaign_incomplete")
    assert (refused.json()["retryable"], refused.json()["missing"]) == (True, [said])
    with house.database.reading() as session:
        assert {*session.scalars(select(Job.lane).where(Job.state == "queued"))} == {"extract"}
    house.work()
    assert "read again" not in " ".join(house.get(path)["missing"])
    assert renewal.do_round() > 3600


def test_a_fit_has_frames_read_again_that_nobody_has_queued(house, monkeypatch):
    campaign = house.campaign()
    path = f"/v1/campaigns/{campaign['id']}"
    house.http.put(f"{path}/roi", json=ROI)
    house.upload(campaign, house.frame_bytes(seed=1), role="dark")
    house.work()
    monkeypatch.setattr("store.software.EXTRACTOR", "extract-later")
    for _ in range(2):
        refused = house.http.post(f"{path}/calibrations", json={})
        assert refused.json()["missing"][0].startswith("1 of 1 frames are read again")
        assert house.get(path)["frames"]["being_read"] == 1
    house.work()
    refused = house.http.post(f"{path}/calibrations", json={})
    assert (refused.json()["code"], refused.json()["retryable"]) == ("campaign_incomplete", False)
    assert "read again" not in refused.json()["detail"]
