"""A campaign whose certificate lacks nothing, and a connection of the client to a house without a socket."""

from pathlib import Path

from stilb.export import export
from stilb.transport import Transport
from tests.support.campaigns import LEVELS, calibrate, upload_campaign
from tests.support.house import House

METER = {
    "kind": "luminance",
    "make": "Gossen",
    "model": "Starlite 2",
    "serial": "8F0042",
    "certificate": {
        "number": "D-K-15070-2026-04",
        "laboratory": "PTB Braunschweig",
        "issued_on": "2026-04-02",
        "due_on": "2027-04-02",
        "expanded_uncertainty_rel": 0.02,
        "coverage_factor": 2,
    },
}
WORK = {
    "project_number": "P-17",
    "recorder": "A. Meier",
    "customer": "City of Lansing",
    "place": "Dark room 2, Lansing",
    "conditions": "21 °C, lamp on for 30 min, no daylight",
    "started_at": "2026-05-01T19:00:00Z",
}


LABORATORY = {"name": "Lansing Light Laboratory", "address": "Main Street 1"}
PERSON = {"person": "A. Meier", "role": "physicist"}


def name_person(house: House, **changes) -> None:
    """State who uses the key of the tests."""
    own = house.get("/v1/keys/own")["id"]
    assert house.http.patch(f"/v1/keys/{own}", json=PERSON | changes).status_code == 200


def complete_version(house: House, *, meter=METER, work=WORK, taken_at="2026-05-01T20:00:00Z", isos=(3200,)):
    """A version of a camera with its lens, its meter and certificate, its checklist signed."""
    house.camera(lens={"make": "DJI", "model": "MFT 15mm F1.7 ASPH", "serial": "L1"})
    assert house.http.patch("/v1/organisation", json=LABORATORY).status_code == 200
    name_person(house)
    campaign = upload_campaign(house, readings=False, isos=isos)
    path = f"/v1/campaigns/{campaign['id']}"
    assert house.http.patch(path, json=work).status_code == 200
    answer = house.http.post("/v1/meters", json=meter)
    assert answer.status_code in {200, 201}, answer.text
    rows = [
        {
            "scene": scene,
            "quantity": "luminance",
            "value": value * factor,
            "unit": "cd/m2",
            "meter_id": answer.json()["id"],
            **({"taken_at": taken_at} if taken_at else {}),
        }
        for scene, value in LEVELS.items()
        for factor in (0.998, 1.002)
    ]
    house.post(f"{path}/readings", rows)
    version = calibrate(house, campaign)
    items = [item for item in house.get(f"{path}/checklist")["items"] if "done_by" not in item]
    ticks = {
        "items": [{"key": item["key"], "done": True} for item in items],
        "signature": {"name": "B. Operator"},
    }
    answer = house.http.patch(f"{path}/checklist", json=ticks)
    assert answer.status_code == 200, answer.text
    return version


def certificate_of(house: House, version: dict) -> dict:
    return house.get(f"/v1/calibrations/{version['id']}/certificate.json")


class InHouse(Transport):
    """The client's transport over the test's own HTTP client."""

    def __init__(self, house: House):
        super().__init__("http://house", "", timeout_s=60.0, retries=2, backoff_s=0.0)
        self.close()
        self._house = house
        self.asked: list[str] = []

    def send(self, call):
        self.asked.append(call.path)
        answer = self._house.http.request(call.method, call.path, params=call.query)
        assert answer.status_code == 200, answer.text
        return answer

    def _save(self, call, _headers, file):
        file.write(self.send(call).content)


def export_version(house: House, version: dict, folder: Path) -> Path:
    return export(InHouse(house), version["id"], folder, None)
