"""Kept reviews equal the ones computed from scratch, whatever is changed, by whom and in which order."""

import random

import pytest
from sqlalchemy import select, update
from sqlalchemy.exc import OperationalError

from store.codec import encode
from store.queries.checklist import read_checklist
from store.reviews import Reviews, assess
from store.tables import (
    Blob,
    Camera,
    Campaign,
    CampaignReview,
    Extraction,
    FrameRow,
    Meter,
    Reading,
    Revocation,
    Roi,
)
from tests.support.campaigns import ROI
from tests.support.house import CAMERA
from tests.support.meters import METER, enter_meter
from tests.support.versions import bare_version

pytestmark = pytest.mark.either_database

OTHER_ROI = {"polygon": [[10, 10], [86, 10], [86, 54], [10, 54]]}
PANEL = {"serial": "RP04", "measured_on": "2026-01-01", "bands": [{"band": "red", "reflectance": 0.5}]}


class Field:
    """A campaign that people and workers change."""

    def __init__(self, house, seed):
        self.house, self.random = house, random.Random(seed)
        self.campaign, self.count = house.campaign(), 0
        self.path = f"/v1/campaigns/{self.campaign['id']}"
        house.http.put(f"{self.path}/roi", json=ROI)
        for _ in range(4):
            self.upload()
        self.other = house.campaign(method="reflectance")
        self.meter = house.post("/v1/meters", METER)["id"]
        house.work()

    def pick(self, table):
        """One of the campaign's rows; the empty id where there is none."""
        with self.house.database.reading() as session:
            ids = session.scalars(select(table.id).where(table.campaign_id == self.campaign["id"]))
            return self.random.choice(sorted(ids) or [""])

    def patch_frame(self):
        said = self.random.choice(
            [
                {"role": self.random.choice(["light", "dark", "field", "flat"])},
                {"scene": self.random.choice(["level-1", "level-2", "level-9"])},
                {"iso": 6400},
                {"withdrawn": self.random.random() < 0.5},
                {"left_out": self.random.random() < 0.5},
            ]
        )
        self.house.http.patch(f"/v1/frames/{self.pick(FrameRow)}", json=said)

    def draw_frame(self):
        self.house.http.put(f"/v1/frames/{self.pick(FrameRow)}/roi", json=OTHER_ROI)

    def draw_campaign(self):
        self.house.http.put(f"{self.path}/roi", json=self.random.choice([ROI, OTHER_ROI]))

    def upload(self):
        self.count += 1
        role = self.random.choice(["light", "light", "dark"])
        signal = 100.0 * self.count * (role == "light")
        content = self.house.frame_bytes(signal_dn=signal, seed=self.count, f_number=2.8 + self.count % 3)
        name = f"{self.count % 3}.DNG"
        self.house.upload(self.campaign, content, role=role, scene="level-1", filename=name)

    def read_meter(self):
        body = {"scene": "level-2", "quantity": "luminance", "value": 20 + self.random.random()}
        named = self.random.choice([{}, {"meter_id": self.meter}])
        self.house.post(f"{self.path}/readings", body | {"unit": "cd/m2"} | named)

    def withdraw_reading(self):
        self.house.http.delete(f"/v1/readings/{self.pick(Reading)}")

    def certify_meter(self):
        enter_meter(self.house, number=str(self.count))

    def change_campaign(self):
        said = self.random.choice([{"recorder": "A. Person"}, {"mains_frequency_hz": 50.0}])
        self.house.http.patch(self.path, json=said)

    def register_panel(self):
        self.house.http.post("/v1/panels", json=PANEL | {"serial": f"RP{self.count}"})

    def know_camera(self):
        self.house.http.post("/v1/cameras", json=CAMERA | {"pixel_pitch_um": 3.3})

    def work(self):
        self.house.work()

    def review(self):
        renew_next(self.house.worker.reviews)


def renew_next(reviews):
    """What a worker does with a review that is stale; whether there was one."""
    campaign_id = reviews.claim_next()
    if campaign_id is not None:
        reviews.renew(campaign_id)
    return campaign_id is not None


ACTS = [
    *(Field.patch_frame, Field.draw_frame, Field.draw_campaign, Field.upload, Field.read_meter),
    *(Field.withdraw_reading, Field.certify_meter, Field.change_campaign, Field.register_panel),
    *(Field.know_camera, Field.work, Field.work, Field.work, Field.review),
]


def answers(house, campaign_id):
    campaign = house.get(f"/v1/campaigns/{campaign_id}")
    listed = house.get(f"/v1/campaigns/{campaign_id}/frames", limit=1000)["items"]
    for each in listed:
        if each["state"] == "received":
            assert house.get(f"/v1/frames/{each['id']}")["verdict"] == each["verdict"]
    items = house.get(f"/v1/campaigns/{campaign_id}/checklist")["items"]
    ticks = {each["key"]: (each.get("evidence"), each.get("missing")) for each in items}
    found = {}
    for each in listed:
        reasons = each["verdict"]["reasons"]
        found[each["id"]] = [(why["code"], why["outcome"], why["detail"]) for why in reasons]
    return campaign["missing"], campaign["advice"], ticks, found, campaign["findings"]


def scratch(house, campaign_id):
    """The same, computed from what is stored now."""
    with house.database.reading() as session:
        row = session.get_one(Campaign, campaign_id)
        state = assess(session, row)
        items = read_checklist(session, row, state.record)
    ticks = {each.key: (each.evidence, each.missing) for each in items}
    found = {}
    for frame_id, verdict in state.verdicts.items():
        found[frame_id] = [(why.code, why.outcome, why.detail) for why in verdict.reasons]
    missing = [said for each in state.missing for said in each.sentences]
    advice = [said for each in state.advice for said in each.sentences]
    return missing, advice, ticks, found, [encode(each) for each in state.findings]


def test_kept_reviews_equal_those_from_scratch(house):
    field = Field(house, seed=3)
    for step in range(24):
        act = field.random.choice(ACTS)
        act(field)
        for campaign in (field.campaign, field.other):
            assert answers(house, campaign["id"]) == scratch(house, campaign["id"]), (step, act)


def revisions(house, *campaigns):
    with house.database.reading() as session:
        return [session.get_one(CampaignReview, each["id"]).revision for each in campaigns]


def test_every_change_raises_the_revision_of_its_campaigns_alone(house):
    mine, other = house.campaign(), house.campaign(camera_id=house.camera(serial="2")["id"])
    meter = house.post("/v1/meters", METER)["id"]
    with house.database.writing("test") as session:
        row = session.get_one(Campaign, mine["id"])
        owner = {"organisation_id": row.organisation_id}
        session.add_all([Blob(sha256="f" * 64, size_bytes=1), Roi(id="roi", sha256="0", points=[], **owner)])
        version = bare_version(row, 1, id="cal")
    frame = {"id": "frm", "sha256": "f" * 64, "filename": "a", "role": "light"}
    reading = {"scene": "1", "quantity": "luminance", "value": 1.0}
    reading |= {"entered_value": 1, "entered_unit": "cd/m2"}
    changes = [
        lambda of: of.add(FrameRow(campaign_id=mine["id"], **frame)),
        lambda of: of.add(Extraction(frame_id="frm", roi_id="roi", extractor="e")),
        lambda of: of.add(Reading(campaign_id=mine["id"], meter_id=meter, **reading)),
        lambda of: setattr(of.get_one(Meter, meter), "certificate_number", "8"),
        lambda of: setattr(of.get_one(Camera, mine["camera_id"]), "pixel_pitch_um", 3.0),
        lambda of: setattr(of.get_one(Campaign, mine["id"]), "place", "Berlin"),
        lambda of: of.add(version),
        lambda of: of.add(Revocation(calibration_id="cal", revoked_by="k", reason="r")),
    ]
    for number, change in enumerate(changes):
        first, second = revisions(house, mine, other)
        with house.database.writing("test") as session:
            change(session)
        assert revisions(house, mine, other) == [first + 1, second], number
    first, second = revisions(house, mine, other)
    house.post("/v1/panels", PANEL)
    assert revisions(house, mine, other) == [first + 1, second + 1]
    house.http.patch("/v1/organisation", json={"time_zone": "Europe/Berlin"})
    assert revisions(house, mine, other) == [first + 2, second + 2]


def test_a_fresh_review_is_read_and_not_computed(house, monkeypatch):
    campaign = house.campaign()
    house.upload(campaign, b"no photograph", role="light")
    before = answers(house, campaign["id"])
    monkeypatch.setattr("store.reviews.assess", None)
    assert answers(house, campaign["id"]) == before
    assert not renew_next(house.worker.reviews)


def test_a_change_during_a_review_leaves_it_stale(house, monkeypatch):
    campaign = house.campaign()

    def change_meanwhile(session, row, _memory):
        found = assess(session, row)
        with house.database.writing("another") as writing:
            writing.get_one(Campaign, row.id).recorder = "A. Person"
        return found

    monkeypatch.setattr("store.reviews.assess", change_meanwhile)
    assert renew_next(house.worker.reviews)
    monkeypatch.undo()
    assert answers(house, campaign["id"]) == scratch(house, campaign["id"])
    assert answers(house, campaign["id"])[2]["general_recorder"][0] == "A. Person."


def test_another_code_keeps_no_older_verdict(house, monkeypatch):
    campaign = house.campaign()
    house.get(f"/v1/campaigns/{campaign['id']}")
    monkeypatch.setattr("store.reviews.hash_code", lambda: "another")
    asked = []
    monkeypatch.setattr("store.reviews.assess", lambda *given: asked.append(1) or assess(*given))
    house.get(f"/v1/campaigns/{campaign['id']}")
    house.get(f"/v1/campaigns/{campaign['id']}")
    assert len(asked) == 1


def test_one_worker_reviews_a_campaign_and_rests_after_it(house, monkeypatch):
    house.campaign()
    first, second = Reviews(house.database), Reviews(house.database)
    begun = []

    def find_another_at_it(session, row, _memory):
        begun.append(renew_next(second))
        return assess(session, row)

    monkeypatch.setattr("store.reviews.assess", find_another_at_it)
    monkeypatch.setattr("store.reviews._PAUSE", 1e6)
    assert renew_next(first)
    assert begun == [False]
    with house.database.writing("another") as session:
        session.execute(update(CampaignReview).values(revision=CampaignReview.revision + 1))
    assert not renew_next(second)


def test_a_review_that_cannot_be_kept_is_answered_all_the_same(house, monkeypatch):
    def fail(*_, **__):
        raise OperationalError("UPDATE", {}, Exception("disk full"))

    campaign = house.campaign()
    monkeypatch.setattr("store.reviews._keep", fail)
    assert house.get(f"/v1/campaigns/{campaign['id']}")["missing"]
