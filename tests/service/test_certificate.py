"""What is on a certificate: who, what, with what, how sure; its gaps; its tag; publishing with it."""

import base64
import copy
import json
import math
import re

import pytest
from sqlalchemy import event

from radiometry.findings import interface
from radiometry.methods.findings import FINDINGS
from service.documents.dcc import write_dcc
from service.documents.pages import lay_out
from service.documents.schemas import CertificateAnswer, list_gaps
from store.tables import FrameRow
from tests.support.campaigns import LEVELS, ROI, SETTINGS, calibrate, calibrated_campaign
from tests.support.certificates import (
    LABORATORY,
    METER,
    WORK,
    certificate_of,
    check_frames,
    complete_version,
    fit_with,
    leaves,
    name_person,
)
from tests.support.dcc import read_dcc
from tests.support.house import PUBLICATION
from tests.support.meters import withdraw_readings

pytestmark = pytest.mark.either_database


@pytest.fixture
def version(staged):
    return staged(complete_version)


def codes(certificate):
    return [gap["code"] for gap in certificate["gaps"]]


def test_it_names_the_item_the_work_and_the_meter(house, version):
    certificate = certificate_of(house, version)
    assert certificate["number"] == "0K1XE8-luminance-1"
    assert certificate["item"]["lens"] == {"make": "DJI", "model": "MFT 15mm F1.7 ASPH", "serial": "L1"}
    assert certificate["laboratory"] == LABORATORY
    work = certificate["work"]
    assert {name: work[name] for name in WORK} == WORK
    assert (work["first_day"], work["last_day"], work["days_from"]) == (
        "2026-05-01",
        "2026-05-01",
        "readings",
    )
    (meter,) = certificate["meters"]
    assert meter["certificate"] == METER["certificate"]
    assert meter["readings"] == 2 * len(LEVELS)
    assert "certificate D-K-15070-2026-04 of PTB Braunschweig" in certificate["traceability"]


def test_it_carries_what_the_version_rests_on(house, version):
    # frames are read in columns: ten thousand entities with their headers take hundreds of megabytes
    loaded = []
    event.listen(FrameRow, "load", note := lambda row, _: loaded.append(row))
    certificate = certificate_of(house, version)
    event.remove(FrameRow, "load", note)
    assert loaded == []
    assert certificate["content_sha256"] == version["content_sha256"]
    assert [region["points"] for region in certificate["regions"]] == [ROI["polygon"]]
    frames = certificate["frames"]
    assert len(frames) == len(SETTINGS) * (len(LEVELS) + 1)
    check_frames(house, certificate)
    for frame in frames:
        means = {row["channel"]: row["mean_dn"] for row in frame["statistics"]}
        assert frame["signal_dn"] == (means["G1"] + means["G2"]) / 2
    expected = [(value * factor, "cd/m2") for value in LEVELS.values() for factor in (0.998, 1.002)]
    assert sorted((r["value"], r["entered_unit"]) for r in certificate["readings"]) == sorted(expected)
    assert certificate["parameters"]["model"] == "proportional"
    assert certificate["software"] | version["software"] == certificate["software"]


def test_a_lens_need_not_have_a_serial_number(house, staged):
    version = staged(calibrated_campaign, isos=(3200,))
    camera, campaign = f"/v1/cameras/{version['camera_id']}", f"/v1/campaigns/{version['campaign_id']}"
    lens = {"make": "DJI", "model": "MFT 15mm F1.7 ASPH"}
    assert house.patch(camera, {"lens": lens})["lens"] == lens
    version = calibrate(house, {"id": version["campaign_id"]}, tolerance=0.05)
    assert certificate_of(house, version)["item"]["lens"] == lens
    assert house.publish(version)["state"] == "published"
    # another lens on the camera, or in the campaign, is none of the version's
    other = {"lens": {"make": "Olympus", "model": "M.Zuiko 45mm F1.8"}}
    for path in (camera, campaign):
        assert house.patch(path, other)["lens"] == other["lens"]
    assert certificate_of(house, version)["item"]["lens"]["make"] == "DJI"
    assert "lens" not in house.patch(campaign, {"lens": ""})
    days = {"started_at": "2026-05-02T20:00:00Z", "ended_at": "2026-05-01T23:00:00Z"}
    assert house.patch(campaign, days, status=422)["errors"][0]["field"] == "body.ended_at"


def test_its_dcc_says_the_same(house, version):
    house.publish(version)
    issued = house.http.get(f"/v1/calibrations/{version['id']}/certificate.json")
    certificate = issued.json()
    answer = house.http.get(f"/v1/calibrations/{version['id']}/certificate.xml", params={"country": "US"})
    assert (answer.status_code, answer.headers["Content-Type"]) == (200, "application/xml")
    root = read_dcc(answer.content)
    assert base64.b64decode(root.findtext("document/dataBase64")) == issued.content
    assert root.findtext(".//respPerson/person/name/content") == "A. Meier"
    values = [float(each.text) for each in root.iterfind(".//real/value")]
    assert values == [row["value"] for row in certificate["coefficients"]]
    assert root.findtext(".//respPerson/mainSigner") == "true"
    said = [each.text for each in root.iterfind(".//measuringEquipment//value")]
    assert said == [meter["serial"] for meter in certificate["meters"]]
    path = f"/v1/calibrations/{version['id']}"
    for country in ("Germany", "de"):
        house.get(f"{path}/certificate.xml", country=country, status=422)
    # what was decided since is no part of the document, and stands in what is derived from it
    house.revoke(version)
    revoked = read_dcc(house.http.get(f"{path}/certificate.xml?country=US").content)
    assert revoked.findtext(".//statement/declaration/content") == "Revoked."
    assert revoked.findtext("document/dataBase64") == root.findtext("document/dataBase64")


def test_its_figures_are_the_versions_and_its_budget_adds_up(house, version):
    certificate = certificate_of(house, version)
    assert None not in leaves(certificate)
    stated = {fit["coefficient"]["iso"]: fit["coefficient"] for fit in certificate["result"]["iso_fits"]}
    for row in version["coefficients"]:
        coefficient = stated[row["iso"]]
        if "f_number" in row:
            coefficient = next(a for a in coefficient["apertures"] if a["f_number"] == row["f_number"])
        name, u = {
            "luminance_k": ("luminance_k", "luminance_k_standard_uncertainty"),
            "dark_signal_dn": ("dark_signal_dn", "dark_signal_standard_uncertainty_dn"),
        }[row["name"]]
        assert (coefficient[name], coefficient[u]) == (row["value"], row["standard_uncertainty"])
    for coefficient in stated.values():
        expanded = coefficient["coverage_factor"] * coefficient["luminance_k_standard_uncertainty"]
        assert coefficient["expanded_uncertainty"] == pytest.approx(expanded, rel=1e-12)
    for budget, fit in zip(certificate["budgets"], certificate["result"]["iso_fits"], strict=True):
        u = fit["coefficient"]["luminance_k_standard_uncertainty"]
        assert sum(line["u"] ** 2 for line in budget["lines"]) == pytest.approx(u**2, rel=1e-9)
        assert sum(line["variance_share"] for line in budget["lines"]) == pytest.approx(1.0)
        by_source = {line["source"]: line for line in budget["lines"]}
        assert by_source["meter calibration"]["sensitivity"] == pytest.approx(1.0)
        assert by_source["meter calibration"]["input_uncertainty"] == 0.01
        # two f-numbers, each of weight w and 1 - w: between 2 / sqrt(2) and 2
        assert 2**0.5 - 1e-9 <= by_source["f-number"]["sensitivity"] <= 2.0
        for line in budget["lines"]:
            if "sensitivity" in line:
                assert line["sensitivity"] * line["input_uncertainty"] == pytest.approx(line["u_rel"])


def test_who_fitted_and_who_approved_sign_it_by_name_and_role(house, version):
    head = {"name": "laptop 4", "scopes": ["read", "publish"], "person": "B. Head", "role": "head"}
    client = house.with_key(house.post("/v1/keys", head)["secret"])
    draft = certificate_of(house, version)
    assert draft["fitted_by"] == {"name": "A. Meier", "role": "physicist"}
    assert draft["validity"] == {"state": "draft"}
    assert {"approved_by", "issued"}.isdisjoint(draft)
    path = f"/v1/calibrations/{version['id']}"
    assert client.post(f"{path}/publish", json=PUBLICATION).status_code == 200
    certificate = certificate_of(house, version)
    assert (certificate["author"], certificate["fitted_by"]) == ("A. Meier", draft["fitted_by"])
    assert certificate["approved_by"] == {"name": "B. Head", "role": "head"}
    (act,) = certificate["published"]
    assert (act["by"], act["reason"]) == ("B. Head", "first")
    assert certificate["validity"] == {"state": "published", "valid_from": "2026-05-01T00:00:00Z"}
    page = lay_out(certificate, "")
    assert page["stamp"] == ""
    (fitted, _), (approved, _) = page["signatures"]
    assert (fitted, approved) == ("Fitted by: A. Meier, physicist", "Approved by: B. Head, head")
    assert "laptop 4" not in json.dumps(certificate)


def test_a_key_without_a_person_signs_nothing(house, staged):
    version = staged(calibrated_campaign, isos=(3200,))
    house.publish(version)
    path = f"/v1/calibrations/{version['id']}"
    unsigned = house.http.get(f"{path}/certificate.json").content
    certificate = json.loads(unsigned)
    assert {"approved_by", "fitted_by"}.isdisjoint(certificate)
    assert {"approver_missing", "author_missing", "laboratory_name_missing"} <= set(codes(certificate))
    page = lay_out(certificate, "")
    assert page["stamp"] == "Draft: nobody has signed"
    assert page["signatures"] == [[who, "name, date and signature"] for who in ("Fitted by", "Approved by")]
    for raw in ("bootstrap", '"operator"', "/v1/"):
        assert raw not in json.dumps(page | {"attached": ""})
    ordered = certificate | {"work": certificate["work"] | {"customer": "Lansing"}}
    root = read_dcc(write_dcc(ordered, country="US", state="draft", document=unsigned))
    assert root.findtext(".//respPerson/mainSigner") == "false"
    # named afterwards, the person signs an amendment
    name_person(house)
    assert house.publish(version, reason="signed")["certificates"][1]["approved_by"]["name"] == "A. Meier"
    assert house.http.get(f"{path}/certificate.json").content == unsigned
    assert lay_out(house.get(f"{path}/certificate.json", amendment=1), "")["stamp"] == ""


def test_who_left_a_frame_out_is_told_by_name(house, version):
    """Of a key whose id says nothing to who reads the record."""
    point = version["points"][0]
    said = [{"frame_id": point["frame_id"], "reason": "a hand in the picture"}]
    certificate = certificate_of(
        house, calibrate(house, {"id": version["campaign_id"]}, exclude=said, tolerance=0.06)
    )
    assert certificate["parameters"]["exclude"] == [
        {"frame": point["frame"], "reason": "a hand in the picture", "by": "A. Meier"}
    ]
    left_out = next(row for row in certificate["result"]["points"] if row["frame"] == point["frame"])
    assert left_out["left_out"] == "excluded by A. Meier: a hand in the picture"


def test_neither_a_meters_later_certificate_nor_a_withdrawn_reading_changes_it(house, version):
    before = certificate_of(house, version)
    newer = copy.deepcopy(METER)
    newer["certificate"] |= {"number": "NEW", "expanded_uncertainty_rel": 0.5, "due_on": "2030-01-01"}
    house.post("/v1/meters", newer, status=200)
    rows = house.get(f"/v1/campaigns/{version['campaign_id']}/readings")["items"]
    assert house.http.delete(f"/v1/readings/{rows[0]['id']}").status_code == 200
    after = certificate_of(house, version)
    assert [after[name] for name in ("meters", "readings")] == [
        before[name] for name in ("meters", "readings")
    ]


def test_a_drafts_tag_follows_it_and_what_is_issued_keeps_its_own(house, version):
    base = f"/v1/calibrations/{version['id']}/certificate"
    drafts = {form: house.http.get(f"{base}.{form}") for form in ("json", "pdf")}
    for form, draft in drafts.items():
        assert "immutable" not in draft.headers["Cache-Control"]
        tag = draft.headers["ETag"]
        again = house.http.get(f"{base}.{form}", headers={"If-None-Match": tag})
        assert (again.status_code, again.content, again.headers["ETag"]) == (304, b"", tag)
        assert house.http.get(f"{base}.{form}").content == draft.content
    house.publish(version)
    issued = {}
    for form, draft in drafts.items():
        issued[form] = house.http.get(f"{base}.{form}", headers={"If-None-Match": draft.headers["ETag"]})
        assert issued[form].status_code == 200
        assert "immutable" in issued[form].headers["Cache-Control"]
    campaign = f"/v1/campaigns/{version['campaign_id']}"
    house.patch(campaign, {"comments": "somebody coughed"})
    for form, before in issued.items():
        again = house.http.get(f"{base}.{form}")
        assert (again.headers["ETag"], again.content) == (before.headers["ETag"], before.content)


def test_a_bare_campaign_is_published_with_every_warning_or_not_at_all(house, staged):
    version = staged(calibrated_campaign, isos=(3200,))
    expected = [
        *("author_missing", "laboratory_name_missing", "laboratory_address_missing", "customer_missing"),
        *("place_missing", "conditions_missing", "recorder_missing", "lens_missing", "meter_unknown"),
        *("checklist_incomplete", "checklist_unsigned"),
    ]
    assert codes(certificate_of(house, version)) == expected
    expected = ["approver_missing", *expected]
    impact = house.get(f"/v1/calibrations/{version['id']}/impact")
    assert [warning["code"] for warning in impact["warnings"]] == expected
    assert [warning["code"] for warning in house.publish(version)["warnings"]] == expected
    answer = house.patch("/v1/organisation", {"refuses_incomplete_certificates": True})
    assert answer["refuses_incomplete_certificates"] is True
    before = certificate_of(house, version)
    problem = house.publish(version, status=409, reason="again")
    assert problem["code"] == "certificate_incomplete"
    assert [gap["code"] for gap in problem["gaps"]] == expected
    assert certificate_of(house, version) == before


def test_a_meters_certificate_holds_on_its_first_and_last_day(house, version):
    complete = certificate_of(house, version)
    assert [(each["first_day"], each["last_day"]) for each in complete["meters"]] == [("2026-05-01",) * 2]
    for certified, day, expected in (
        ({"due_on": "2026-05-01"}, "2026-05-01", []),
        ({"due_on": "2026-05-01"}, "2026-05-02", ["meter_certificate_expired"]),
        ({"issued_on": "2026-05-01"}, "2026-05-01", []),
        ({"issued_on": "2026-05-02"}, "2026-05-01", ["meter_certificate_not_yet_issued"]),
    ):
        certificate = copy.deepcopy(complete)
        (meter,) = certificate["meters"]
        meter |= {"certificate": meter["certificate"] | certified, "first_day": day, "last_day": day}
        found = list_gaps(CertificateAnswer.model_validate(certificate))
        assert [each.code for each in found] == expected, (certified, day)


@pytest.mark.parametrize(
    ("changes", "taken_at", "expected"),
    [
        # without the time of the readings, the days of the campaign
        ({"due_on": "2026-04-30"}, None, ["meter_certificate_expired"]),
        (None, "2026-05-01T20:00:00Z", ["meter_certificate_missing"]),
    ],
)
def test_a_meter_has_a_certificate_that_holds(house, version, changes, taken_at, expected):
    campaign = {"id": version["campaign_id"]}
    withdraw_readings(house, campaign)
    meter = METER | {"serial": "another", "certificate": METER["certificate"] | (changes or {})}
    if changes is None:
        del meter["certificate"]
    version = fit_with(house, campaign, meter, taken_at=taken_at)
    certificate = certificate_of(house, version)
    assert codes(certificate) == expected
    stated = {row["name"]: row for row in certificate["coefficients"]}
    scope = "traceable" if changes else "relative_only"
    assert scope == certificate["uncertainty_scope"] == version["uncertainty_scope"]
    assert stated["luminance_k"]["uncertainty_scope"] == scope
    # without a certificate no U of K is stated; the dark signal depends on no meter
    assert ("expanded_uncertainty" in stated["luminance_k"]) is (scope == "traceable")
    assert "expanded_uncertainty" in stated["dark_signal_dn"]
    assert ("expanded_uncertainty" in version["key_figures"][0]) is (scope == "traceable")
    page = lay_out(certificate, "")
    assert ("relative only" in page["results"]["rows"][0]) is (scope == "relative_only")
    blocks = [block for section in page["sections"] for block in section["blocks"]]
    (further,) = (block["rows"] for block in blocks if "valid for" in block.get("head", ()))
    apertures = [row for row in further if row[0] == "Luminance K"]
    assert apertures
    assert all(("relative only" in row) is (scope == "relative_only") for row in apertures)
    assert certificate["traceability"].startswith("Relative only.") is (scope == "relative_only")
    (flag,) = [each for each in certificate["flags"] if each["flag"] == "meter_certificate_missing"] or [None]
    assert (flag is None) is (scope == "traceable")
    if flag is not None:
        lacking, with_it = map(float, re.findall(r"([\d.]+)%(?: at|, traceable)", flag["detail"]))
        factor = certificate["result"]["iso_fits"][0]["coefficient"]["coverage_factor"]
        assert with_it == pytest.approx(math.hypot(lacking, factor * 1.5), abs=0.06)


def certificate_without(complete, place):
    stripped = copy.deepcopy(complete)
    *path, last = place
    node = stripped
    for name in path:
        node = node[name]
    del node[last]
    return CertificateAnswer.model_validate(stripped)


def test_every_gap_is_found_by_its_rule_and_filled_alone(house, version):
    """Take one thing away from a complete certificate: exactly its gap opens."""
    assert certificate_of(house, version)["gaps"] == []
    house.patch("/v1/organisation", {"refuses_incomplete_certificates": True})
    assert house.publish(version)["warnings"] == []
    complete = certificate_of(house, version)
    assert list_gaps(CertificateAnswer.model_validate(complete)) == []
    removals = {
        interface.AUTHOR_MISSING: ("fitted_by",),
        interface.APPROVER_MISSING: ("approved_by",),
        interface.LABORATORY_ADDRESS_MISSING: ("laboratory", "address"),
        interface.CUSTOMER_MISSING: ("work", "customer"),
        interface.PLACE_MISSING: ("work", "place"),
        interface.CONDITIONS_MISSING: ("work", "conditions"),
        interface.DATE_MISSING: ("work", "first_day"),
        interface.RECORDER_MISSING: ("work", "recorder"),
        interface.LENS_MISSING: ("item", "lens"),
        interface.METER_UNKNOWN: ("readings", 0, "meter"),
        "meter_certificate_missing": ("meters", 0, "certificate"),
        interface.CHECKLIST_INCOMPLETE: ("checklist", "items", 5, "done_by"),
        interface.CHECKLIST_UNSIGNED: ("checklist", "signature"),
    }
    dates = {interface.METER_CERTIFICATE_EXPIRED, interface.METER_CERTIFICATE_NOT_YET_ISSUED}
    dates |= {interface.LABORATORY_NAME_MISSING}
    of_panels = {"panel_unknown", "panel_uncertainty_missing"}
    assert {
        code for code, finding in FINDINGS.items() if "certificate" in finding.where
    } == removals.keys() | dates | of_panels, "dates and panels have tests of their own"
    for code, place in removals.items():
        (found,) = list_gaps(certificate_without(complete, place))
        assert found.code == code
        assert len(found.message) > 30
        assert "/v1/" not in found.message, "people read it, on pages and on paper"
