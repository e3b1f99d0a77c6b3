"""A campaign whose certificate lacks nothing, and a connection of the client to a house without a socket."""

import io
import math
import re
from pathlib import Path

import pypdf

from radiometry.methods import get_method
from stilb.export import export
from stilb.transport import Transport
from tests.support import meters
from tests.support.campaigns import calibrate, list_readings, upload_campaign
from tests.support.house import House

METER = meters.METER | {
    "certificate": meters.CERTIFICATE | {"number": "D-K-15070-2026-04", "laboratory": "PTB Braunschweig"}
}
WORK = {
    "project_number": "P-17",
    "recorder": "A. Meier",
    "customer": "City of Lansing",
    "place": "Dark room 2, Lansing",
    "conditions": "21 °C, lamp on for 30 min, no daylight",
    "started_at": "2026-05-01T19:00:00Z",
}
TAKEN_AT = "2026-05-01T20:00:00Z"
LABORATORY = {"name": "Lansing Light Laboratory", "address": "Main Street 1"}
PERSON = {"person": "A. Meier", "role": "physicist"}


def name_person(house: House, **changes) -> None:
    """State who uses the key of the tests."""
    own = house.get("/v1/keys/own")["id"]
    house.patch(f"/v1/keys/{own}", PERSON | changes)


def complete_version(house: House, *, meter=METER, work=WORK, taken_at=TAKEN_AT, isos=(3200,)) -> dict:
    """A version of a camera with its lens, its meter and certificate, its checklist signed."""
    house.camera(lens={"make": "DJI", "model": "MFT 15mm F1.7 ASPH", "serial": "L1"})
    house.patch("/v1/organisation", LABORATORY)
    name_person(house)
    campaign = upload_campaign(house, readings=False, isos=isos)
    house.patch(f"/v1/campaigns/{campaign['id']}", work)
    return fit_with(house, campaign, meter, taken_at=taken_at)


def fit_with(house: House, campaign: dict, meter: dict, *, taken_at: str | None = TAKEN_AT) -> dict:
    """The version of a campaign whose readings are of this meter, with its checklist signed."""
    answer = house.http.post("/v1/meters", json=meter)
    assert answer.status_code in {200, 201}, answer.text
    named = {"meter_id": answer.json()["id"]} | ({"taken_at": taken_at} if taken_at else {})
    path = f"/v1/campaigns/{campaign['id']}"
    house.post(f"{path}/readings", list_readings(**named))
    version = calibrate(house, campaign)
    items = house.get(f"{path}/checklist")["items"]
    ticks = [{"key": item["key"], "done": True} for item in items]
    house.patch(f"{path}/checklist", {"items": ticks, "signature": {"name": "B. Operator"}})
    return version


def read_pages(pdf: bytes) -> list[str]:
    """The text of each page, without the places where a word may break."""
    pages = pypdf.PdfReader(io.BytesIO(pdf)).pages
    return [page.extract_text().replace("\u200b", "").replace("\u2212", "-") for page in pages]


def certificate_of(house: House, version: dict) -> dict:
    return house.get(f"/v1/calibrations/{version['id']}/certificate.json")


def check_frames(house: House, certificate: dict) -> None:
    """Each frame of a certificate is as the service has it."""
    for frame in certificate["frames"]:
        row = house.get(f"/v1/frames/{frame['id']}")
        for name in ("sha256", "role", "scene"):
            assert row.get(name) == frame.get(name)
        stored, stated = (
            {each["channel"]: each["mean_dn"] for each in told["statistics"]} for told in (row, frame)
        )
        assert stored == stated


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
        super().__init__("http://house", "key", timeout_s=60.0, retries=2, backoff_s=0.0)
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
