"""Recalls by cause: everything made with it is found, looked at and revoked as one step."""

import pytest

from store import impact as recalls
from store.software import FIT_CODE_VERSION
from tests.support.campaigns import calibrate
from tests.support.measuring import field_frame, measure
from tests.support.meters import CERTIFICATE, METER, enter_meter, metered_campaign

pytestmark = pytest.mark.either_database

APRIL = "2026-04-01T00:00:00Z"


def make_versions(house):
    bad, good = enter_meter(house, serial="bad"), enter_meter(house, serial="good", number="D-K-9")
    campaign = metered_campaign(house, bad)
    first = calibrate(house, campaign)
    house.publish(first, valid_from=APRIL)
    second = calibrate(house, campaign, model="affine")
    third = calibrate(house, metered_campaign(house, good))
    return {"bad": bad, "campaign": campaign, "by_bad": [first["id"], second["id"]], "by_good": third["id"]}


@pytest.fixture
def made(staged):
    """Two versions by one meter, the first one published, and one by another meter."""
    return staged(make_versions)


def propose(house, cause, *, status=201):
    return house.post("/v1/recalls", {"cause": cause, "reason": "meter fell"}, status=status)


def confirm(client, recall):
    return client.post(f"/v1/recalls/{recall['id']}/confirm")


def states(house, ids):
    return [house.get(f"/v1/calibrations/{each}")["state"] for each in ids]


def test_recall_lists_versions_and_revokes_them_when_confirmed(house, made):
    recall = propose(house, {"meter_id": made["bad"]})
    assert recall["state"] == "proposed"
    assert [v["calibration_id"] for v in recall["versions"]] == made["by_bad"] == recall["calibration_ids"]
    first, second = recall["versions"]
    assert (first["state"], first["in_force"], first["valid_from"]) == ("published", True, APRIL)
    assert (second["state"], second["in_force"]) == ("draft", False)
    assert first["camera"] == "DJI FC6520 0K1XE8"
    assert states(house, made["by_bad"]) == ["published", "draft"]
    key = house.post("/v1/keys", {"name": "reviewer", "scopes": ["publish"]})
    with house.with_key(key["secret"]) as reviewer:
        confirmed = confirm(reviewer, recall).json()
    assert confirmed["state"] == "confirmed"
    assert confirmed["created_by"] == recall["created_by"] != confirmed["confirmed_by"] == key["id"]
    assert [v["state"] for v in confirmed["versions"]] == ["revoked", "revoked"]
    assert [v["in_force"] for v in confirmed["versions"]] == [False, False]
    assert states(house, [made["by_good"]]) == ["draft"]
    reason = house.get(f"/v1/calibrations/{made['by_bad'][0]}")["revoked_reason"]
    assert reason == f"meter fell (recall {recall['id']})"
    assert house.get(f"/v1/recalls/{recall['id']}") == confirmed == confirm(house.http, recall).json()
    (listed,) = house.get("/v1/recalls")["items"]
    assert listed == {name: value for name, value in confirmed.items() if name != "versions"}


def test_what_goes_with_it_is_no_successor(house, made):
    frame = field_frame(house, made["campaign"]["id"])
    measured = measure(house, frame, {"id": made["by_bad"][1]})
    recall = propose(house, {"meter_id": made["bad"]})
    assert recall["versions"][0]["measurements"] == []
    (touched,) = recall["versions"][1]["measurements"]
    assert touched["measurement_id"] == measured["id"]
    assert "successor" not in touched
    # between the two of the recall, a version that stays takes the frame's day
    house.publish({"id": made["by_good"]}, valid_to="2026-05-02T00:00:00Z")
    (touched,) = house.get(f"/v1/recalls/{recall['id']}")["versions"][1]["measurements"]
    assert touched["successor"]["calibration_id"] == made["by_good"]


def test_a_certificate_replaced_after_the_fit_is_found(house, made):
    enter_meter(house, serial="bad", number="D-K-2")
    fourth = calibrate(house, made["campaign"])
    for version, number in ((made["by_bad"][0], "D-K-1"), (fourth["id"], "D-K-2")):
        (meter,) = house.get(f"/v1/calibrations/{version}")["inputs"]["meters"]
        assert meter == METER | {"serial": "bad", "certificate": CERTIFICATE | {"number": number}}
    assert calibrate(house, made["campaign"])["id"] == fourth["id"]
    assert propose(house, {"meter_certificate_number": "D-K-1"})["calibration_ids"] == made["by_bad"]
    assert propose(house, {"meter_certificate_number": "D-K-2"})["calibration_ids"] == [fourth["id"]]
    assert propose(house, {"meter_certificate_number": "D-K-9"})["calibration_ids"] == [made["by_good"]]


def test_all_that_a_version_of_the_software_fitted_is_found(house, made, stranger):
    found = propose(house, {"software": FIT_CODE_VERSION})["calibration_ids"]
    assert found == [*made["by_bad"], made["by_good"]]
    assert propose(house, {"software": "0.0.9"})["versions"] == []
    body = {"cause": {"software": FIT_CODE_VERSION}, "reason": "r"}
    assert stranger.post("/v1/recalls", json=body).json()["versions"] == []
    body["cause"] = {"meter_id": made["bad"]}
    assert stranger.post("/v1/recalls", json=body).status_code == 404


def test_a_recorder_is_found_under_a_name_that_was_corrected_since(house, made):
    for name in ("A. Meier", "B. Schulz"):
        house.patch(f"/v1/campaigns/{made['campaign']['id']}", {"recorder": name})
    for name in ("A. Meier", "B. Schulz"):
        assert propose(house, {"recorder": name})["calibration_ids"] == made["by_bad"]
    assert propose(house, {"recorder": "C. Weber"})["calibration_ids"] == []


def test_what_has_been_found_since_refuses_the_confirmation(house, made):
    recall = propose(house, {"meter_id": made["bad"]})
    later = calibrate(house, made["campaign"], model="power")
    refused = confirm(house.http, recall)
    assert (refused.status_code, refused.json()["code"]) == (409, "recall_outdated")
    assert "1 more, 0 fewer" in refused.json()["detail"]
    assert states(house, [*made["by_bad"], later["id"]]) == ["published", "draft", "draft"]
    assert confirm(house.http, propose(house, {"meter_id": made["bad"]})).status_code == 200
    assert states(house, [*made["by_bad"], later["id"]]) == ["revoked"] * 3


def test_all_are_revoked_or_none(house, made, monkeypatch):
    recall = propose(house, {"meter_id": made["bad"]})
    real, done = recalls.revoke, []

    def fails_at_the_second(session, calibration, **given):
        if done:
            raise RuntimeError("the light went out")
        done.append(calibration.id)
        real(session, calibration, **given)

    monkeypatch.setattr(recalls, "revoke", fails_at_the_second)
    with pytest.raises(RuntimeError, match="the light went out"):
        confirm(house.http, recall)
    assert states(house, made["by_bad"]) == ["published", "draft"]
    assert house.get(f"/v1/recalls/{recall['id']}")["state"] == "proposed"


def test_a_cause_is_exactly_one(house):
    for cause in (
        {},
        {"recorder": "A", "software": "1"},
        {"meter": "x"},
        {"recorder": ""},
        {"recorder": None},
    ):
        assert propose(house, cause, status=422)["code"] == "validation_failed"
