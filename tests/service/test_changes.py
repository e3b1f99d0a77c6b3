"""Every change leaves who, when, what, before and after; no secret among it."""

from datetime import UTC, datetime, timedelta

from sqlalchemy import select

from store.tables import ApiKey
from store.tables.audit import AuditEntry
from tests.support.campaigns import calibrated_campaign
from tests.support.house import CAMERA


def entries(house, subject_id):
    with house.database.reading() as session:
        found = session.scalars(select(AuditEntry).where(AuditEntry.subject_id == subject_id))
        return sorted(found, key=lambda entry: entry.seq)


def own_key(house):
    return next(key for key in house.get("/v1/keys")["items"] if key["name"] == "bootstrap")["id"]


def test_a_camera_and_a_campaign(house):
    camera = house.camera()
    (made,) = entries(house, camera["id"])
    assert (made.action, made.actor, made.before) == ("camera.create", own_key(house), {})
    assert {name: made.after[name] for name in CAMERA} == CAMERA
    assert datetime.now(UTC) - made.at < timedelta(minutes=5)
    campaign = house.campaign(recorder="A. Meier")
    house.http.patch(f"/v1/campaigns/{campaign['id']}", json={"recorder": "B. Schulz", "comments": "rain"})
    _, changed = entries(house, campaign["id"])
    assert (changed.action, changed.actor) == ("campaign.change", own_key(house))
    assert changed.before == {"recorder": "A. Meier", "comments": None}
    assert changed.after == {"recorder": "B. Schulz", "comments": "rain"}
    house.http.patch(f"/v1/campaigns/{campaign['id']}", json={"recorder": "B. Schulz"})
    assert len(entries(house, campaign["id"])) == 2


def test_a_reading_and_its_withdrawal(house):
    reading = {"scene": "s", "quantity": "luminance", "value": 5, "unit": "cd/m2"}
    reading = house.post(f"/v1/campaigns/{house.campaign()['id']}/readings", reading)
    house.http.delete(f"/v1/readings/{reading['id']}")
    made, withdrawn = entries(house, reading["id"])
    assert (made.action, made.after["value"]) == ("reading.create", 5)
    assert (withdrawn.action, withdrawn.before["withdrawn_at"]) == ("reading.change", None)
    assert withdrawn.after["withdrawn_at"]


def test_a_frame_and_its_correction(house):
    frame = house.upload(house.campaign(), house.frame_bytes(), role="dark")
    house.work()
    house.http.patch(f"/v1/frames/{frame['id']}", json={"role": "light", "scene": "a"})
    made, read, corrected = entries(house, frame["id"])
    assert (made.action, made.actor) == ("frame.create", own_key(house))
    assert (read.actor, read.before["state"], read.after["state"]) == ("worker", "received", "read")
    assert (corrected.actor, corrected.before["role"], corrected.after["role"]) == (
        own_key(house),
        "dark",
        "light",
    )


def test_what_is_decided_of_a_version(house, staged):
    version = staged(calibrated_campaign, isos=(3200,))
    path = f"/v1/calibrations/{version['id']}"
    house.post(f"{path}/publish", {"valid_from": "2026-05-01T00:00:00Z", "reason": "spring"}, status=200)
    house.post(f"{path}/revoke", {"reason": "the meter was out of calibration"}, status=200)
    with house.database.reading() as session:
        found = session.scalars(select(AuditEntry).where(AuditEntry.actor == own_key(house))).all()
    actions = {entry.action: entry for entry in found}
    published, revoked = actions["publication.create"].after, actions["revocation.create"].after
    assert (published["calibration_id"], published["reason"]) == (version["id"], "spring")
    assert revoked["reason"] == "the meter was out of calibration"
    assert actions["publication.change"].after["known_to"]


def test_a_key_without_its_secret(house):
    made = house.post("/v1/keys", {"name": "dashboard", "scopes": ["read"]})
    house.http.delete(f"/v1/keys/{made['id']}")
    created, revoked = entries(house, made["id"])
    assert (created.action, created.after["scopes"]) == ("api_key.create", ["read"])
    assert (revoked.action, revoked.before["revoked_at"]) == ("api_key.change", None)
    with house.database.reading() as session:
        sha256 = session.get_one(ApiKey, made["id"]).sha256
        whole = str([(e.before, e.after) for e in session.scalars(select(AuditEntry))])
    assert made["secret"] not in whole
    assert sha256 not in whole
