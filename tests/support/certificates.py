"""A campaign whose certificate lacks nothing, and a connection of the client to a house without a socket."""

import math
import re
from pathlib import Path

from radiometry.methods import get_method
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


# with a point, and no part of a name, a version or a date
_LOWERED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+\.\d+(?:e[-+]?\d+)?(?![\w]|\.\d)")


def leaves(value):
    members = value.values() if isinstance(value, dict) else value if isinstance(value, list) else None
    return [value] if members is None else [leaf for member in members for leaf in leaves(member)]


def numbers_of(certificate: dict) -> list[float]:
    """Every number of a certificate, and what its first page makes of them: U and u over the value."""
    found = [float(leaf) for leaf in leaves(certificate) if type(leaf) in (int, float)]
    rows = [row for row in certificate["coefficients"] if row["value"]]
    names = ("expanded_uncertainty", "standard_uncertainty")
    found += [abs(row[name] / row["value"]) for row in rows for name in names if name in row]
    for budget in certificate["budgets"][:1]:
        parts = sorted((line["u"] for line in budget["lines"]), reverse=True)
        headlines = get_method(certificate["method"]).certificate.headlines
        value = next(abs(row["value"]) for row in rows if row["name"] in headlines)
        found += [part / value for part in [*parts, math.hypot(*parts[3:])]]
    return found + [100 * value for value in found]  # percent


def is_printed(token: str, numbers: list[float]) -> bool:
    """Whether a printed number is one of these, rounded to the digits that are printed."""
    mantissa, _, exponent = token.lstrip("+").partition("e")
    digits, kind = len(mantissa.partition(".")[2]), "e" if exponent else "f"
    # the sign of a zero is not printed by everybody
    return any(abs(float(f"{n:.{digits}{kind}}") - float(token)) <= 1e-12 * abs(n) for n in numbers)


def _find_numbers(text: str) -> list[str]:
    """Find what is printed as 2.4 x 10 with a raised -8 as 2.4e-8."""
    power = re.compile("\\s*\u00d7\\s*10\\s*([\u207b\u2070\u00b9\u00b2\u00b3\u2074-\u2079]+)")
    return _NUMBER.findall(power.sub(lambda found: f"e{found[1].translate(_LOWERED)}", text))


def find_misprints(certificate: dict, plot: str, pages: list[str]) -> tuple[int, list[str]]:
    """How many numbers stand on the pages, and those that are neither the certificate's nor the plot's."""
    texts = [
        *(leaf for leaf in leaves(certificate) if isinstance(leaf, str)),
        *re.findall(r">([^<]*)<", plot),
    ]
    # the clause of the standard stands over the gaps
    quoted = {"7.8"} | set(_find_numbers(" ".join(texts)))
    numbers = numbers_of(certificate)
    tokens = [token for page in pages for token in _find_numbers(page)]
    return len(tokens), [token for token in tokens if token not in quoted and not is_printed(token, numbers)]


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
