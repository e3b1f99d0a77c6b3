"""Campaigns whose readings name a meter, read so much too high or too low."""

from tests.support.campaigns import LEVELS, upload_campaign

METER = {"kind": "luminance", "make": "Gossen", "model": "Starlite 2", "serial": "8F0042"}
CERTIFICATE = {
    "number": "D-K-1",
    "laboratory": "PTB",
    "issued_on": "2026-04-02",
    "due_on": "2027-04-02",
    "expanded_uncertainty_rel": 0.02,
    "coverage_factor": 2,
}


def enter_meter(house, *, serial=METER["serial"], **changes) -> str:
    answer = house.http.post(
        "/v1/meters", json=METER | {"serial": serial, "certificate": CERTIFICATE | changes}
    )
    assert answer.status_code in {200, 201}, answer.text
    return answer.json()["id"]


def add_readings(house, campaign, meter_id, *, factor=1.0):
    rows = [
        {"scene": scene, "quantity": "luminance", "value": value * factor * nudge, "unit": "cd/m2"}
        for scene, value in LEVELS.items()
        for nudge in (0.998, 1.002)
    ]
    named = {"meter_id": meter_id} if meter_id else {}
    house.post(f"/v1/campaigns/{campaign['id']}/readings", [row | named for row in rows])


def metered_campaign(house, meter_id, *, factor=1.0, isos=(3200,)) -> dict:
    campaign = upload_campaign(house, isos=isos, readings=False)
    add_readings(house, campaign, meter_id, factor=factor)
    return campaign
