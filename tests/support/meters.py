"""Campaigns whose readings name a meter, read so much too high or too low."""

from tests.support.campaigns import list_readings, upload_campaign

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


def withdraw_readings(house, campaign):
    path = f"/v1/campaigns/{campaign['id']}/readings"
    for reading in house.get(path, limit=1000)["items"]:
        house.http.delete(f"/v1/readings/{reading['id']}").raise_for_status()


def add_readings(house, campaign, meter_id, *, factor=1.0):
    named = {"meter_id": meter_id} if meter_id else {}
    rows = list_readings(factors=(0.998 * factor, 1.002 * factor), **named)
    house.post(f"/v1/campaigns/{campaign['id']}/readings", rows)


def metered_campaign(house, meter_id, *, factor=1.0, isos=(3200,)) -> dict:
    campaign = upload_campaign(house, isos=isos, readings=False)
    add_readings(house, campaign, meter_id, factor=factor)
    return campaign
