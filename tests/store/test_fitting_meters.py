"""A version remembers the meters as they were when it was fitted."""

from tests.support.campaigns import LEVELS, calibrate, upload_campaign

METER = {"kind": "luminance", "make": "Gossen", "model": "Starlite 2", "serial": "8F0042"}
CERTIFICATE = {
    "number": "D-K-1",
    "laboratory": "PTB",
    "issued_on": "2026-04-02",
    "due_on": "2027-04-02",
    "expanded_uncertainty_rel": 0.02,
    "coverage_factor": 2,
}


def enter_meter(house, **changes):
    answer = house.http.post("/v1/meters", json=METER | {"certificate": CERTIFICATE | changes})
    assert answer.status_code in {200, 201}, answer.text
    return answer.json()["id"]


def campaign_with_meter(house, meter_id):
    campaign = upload_campaign(house, isos=(3200,), readings=False)
    rows = [
        {"scene": scene, "quantity": "luminance", "value": value, "unit": "cd/m2", "meter_id": meter_id}
        for scene, value in LEVELS.items()
    ]
    house.post(f"/v1/campaigns/{campaign['id']}/readings", rows)
    return campaign


def test_a_version_keeps_the_certificate_that_it_was_made_with(house):
    meter_id = enter_meter(house)
    campaign = campaign_with_meter(house, meter_id)
    version = calibrate(house, campaign)
    assert version["inputs"]["meters"] == [METER | {"certificate": CERTIFICATE}]
    assert meter_id not in str(version["inputs"])
    assert calibrate(house, campaign)["id"] == version["id"]
    enter_meter(house, number="D-K-2")
    again = calibrate(house, campaign)
    assert again["id"] != version["id"]
    assert again["inputs"]["meters"][0]["certificate"]["number"] == "D-K-2"
    kept = house.get(f"/v1/calibrations/{version['id']}")
    assert kept["inputs"]["meters"][0]["certificate"]["number"] == "D-K-1"


def test_readings_without_a_meter_name_none(house):
    assert calibrate(house, upload_campaign(house, isos=(3200,)))["inputs"]["meters"] == []
