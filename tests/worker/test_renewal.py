"""Frames that an earlier version extracted are read again, and their campaign can be fitted."""

import pytest
from sqlalchemy import select

from store.tables import Job
from tests.support.campaigns import ROI
from worker.renewal import Renewal

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
    for user in ("store.queries.frames", "worker.renewal"):
        monkeypatch.setattr(f"{user}.EXTRACTOR", "extract-later")
    # kept reviews are of other code too, after an upgrade
    monkeypatch.setattr("store.reviews.hash_code", lambda: "later")
    assert "no statistics yet" in " ".join(house.get(path)["missing"])
    assert renewal.do_round() < 3600
    with house.database.reading() as session:
        queued = session.scalars(select(Job.lane).where(Job.state == "queued")).all()
    assert queued == ["renewal", "renewal"]
    assert renewal.do_round() < 3600, "they wait"
    house.work()
    assert "no statistics yet" not in " ".join(house.get(path)["missing"])
    assert renewal.do_round() > 3600
