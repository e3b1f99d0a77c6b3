"""A version of every method but luminance: as documented, certified, printed, published, compared."""

import io
import math

import pypdf
import pytest
from jsonschema import Draft202012Validator

from radiometry import methods
from radiometry.fitting.curve import coverage_factor
from service.documents import dcc
from service.documents.dcc import write_dcc
from service.documents.rendered import render_apart
from service.documents.schemas import CertificateAnswer, list_gaps
from tests.support.campaigns import calibrate
from tests.support.certificates import certificate_of, check_frames, find_misprints, leaves, read_pages
from tests.support.dcc import read_dcc
from tests.support.every_method import BOARD, PANEL_REFLECTANCE, PANEL_U, make_version, register_panel
from tests.support.frames import empty_lower_half
from tests.support.press import COMMAND

OTHERS = [spec.name for spec in methods.METHODS if spec.name != "luminance"]


@pytest.fixture(scope="module")
def version_of(sqlite_house):
    """Makes a method's version when a test first asks for it."""
    made = {}

    def bring(method):
        if method not in made:
            made[method] = make_version(sqlite_house, method)
        return made[method]

    return bring


@pytest.fixture
def certificate_by(sqlite_house, version_of):
    return lambda method: certificate_of(sqlite_house, version_of(method))


@pytest.mark.parametrize("method", OTHERS)
def test_a_stored_version_is_as_the_document_describes_it(sqlite_house, version_of, method):
    version, document = version_of(method), sqlite_house.app.openapi()
    assert None not in leaves(version)
    stated = {each.name: each.units for each in methods.get_method(method).coefficients}
    assert all(each["unit"] in stated[each["name"]] for each in version["coefficients"])
    for part, kind in (("parameters", "Params"), ("diagnostics", "Fit"), ("points", "Point")):
        named = {"$ref": f"#/components/schemas/{method.capitalize()}{kind}"}
        schema = {"type": "array", "items": named} if part == "points" else named
        validator = Draft202012Validator({**schema, "components": document["components"]})
        assert [error.message for error in validator.iter_errors(version[part])] == []


@pytest.mark.parametrize("method", OTHERS)
def test_it_carries_what_the_version_rests_on(sqlite_house, version_of, certificate_by, method):
    version, certificate = version_of(method), certificate_by(method)
    CertificateAnswer.model_validate(certificate)
    assert None not in leaves(certificate)
    assert certificate["number"].endswith(f"-{method}-1")
    assert certificate["content_sha256"] == version["content_sha256"]
    assert certificate["configuration"] == version["configuration"]
    assert certificate["procedure"] != ""
    frames = certificate["frames"]
    assert {point["frame"] for point in version["points"]} <= {frame["frame"] for frame in frames}
    regions = {region["sha256"] for region in certificate["regions"]}
    assert {frame["roi_sha256"] for frame in frames} <= regions
    check_frames(sqlite_house, certificate)
    columns = {column.name for column in methods.get_method(method).certificate.columns}
    assert columns <= methods.get_method(method).point.__dataclass_fields__.keys()
    assert certificate["traceability"]
    assert certificate["checklist"] == {"items": []}


@pytest.mark.parametrize("method", OTHERS)
def test_its_coefficients_are_the_versions_with_their_coverage(version_of, certificate_by, method):
    version, certificate = version_of(method), certificate_by(method)
    stated = certificate["coefficients"]
    for row, plain in zip(stated, version["coefficients"], strict=True):
        assert plain.items() <= row.items()
        assert row.keys() - plain.keys() <= {"expanded_uncertainty", "coverage_factor", "effective_dof"}
        factor, u = row["coverage_factor"], row["standard_uncertainty"]
        assert 1.9 < factor < 13.0
        assert row["expanded_uncertainty"] == pytest.approx(factor * u, rel=1e-12)
        if "effective_dof" in row:
            assert factor == coverage_factor(row["effective_dof"])
        else:
            assert row["standard_uncertainty"] == 0.0 or method == "reflectance"
    assert methods.get_method(method).certificate.headlines & {row["name"] for row in stated}
    shares = {row["expanded_uncertainty"] / abs(row["value"]) for row in stated if row["value"]}
    for figure in version["key_figures"]:
        share = figure["expanded_uncertainty"] / figure["value"]
        assert min(abs(share / each - 1.0) for each in shares if each) < 1e-9


@pytest.mark.parametrize("method", OTHERS)
def test_a_dcc_has_its_coefficients_in_units_of_d_si(sqlite_house, version_of, certificate_by, method):
    path = f"/v1/calibrations/{version_of(method)['id']}/certificate.xml"
    assert "enter its customer" in sqlite_house.get(path, status=422, country="DE")["detail"]
    certificate = certificate_by(method)
    certificate["work"] |= {"customer": "A & <B>\x01", "first_day": "2026-05-01", "last_day": "2026-05-02"}
    root = read_dcc(write_dcc(certificate, country="DE", state="draft", document=b"{}"))
    assert root.findtext(".//respPerson/mainSigner") == "false"  # nobody has signed the checklist
    assert root.findtext("administrativeData/customer/name/content") == "A & <B>\ufffd"
    stated = [
        [each.findtext(f"data/quantity/real/{name}") for name in ("value", "expandedUnc/uncertainty")]
        for each in root.iter("result")
    ]
    rows = certificate["coefficients"]
    assert stated == [[repr(row["value"]), repr(row["expanded_uncertainty"])] for row in rows]
    names = [each.findtext("name/content") for each in root.iter("result")]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize(
    ("unit", "written"),
    [
        ("DN*m2/(cd*s)", r"\metre\tothe{2}\candela\tothe{-1}\second\tothe{-1}"),
        ("m2*sr*nm/W", r"\metre\tothe{2}\steradian\nano\metre\watt\tothe{-1}"),
        ("lp/mm", r"\milli\metre\tothe{-1}"),
        ("LW/PH", r"\one"),
    ],
)
def test_a_unit_is_written_as_d_si_has_it(unit, written):
    assert dcc.write_unit(unit) == written


def test_every_unit_of_a_coefficient_is_written():
    units = {unit for spec in methods.METHODS for each in spec.coefficients for unit in each.units}
    assert all(dcc.write_unit(unit) for unit in units)


def test_a_panel_takes_the_place_of_meters(certificate_by):
    certificate = certificate_by("reflectance")
    (panel,) = certificate["panels"]
    assert (panel["serial"], panel["measured_on"]) == ("P-18", "2018-03-01")
    assert panel["bands"][0]["reflectance"] == PANEL_REFLECTANCE
    assert (certificate["meters"], certificate["readings"]) == ([], [])
    assert "panel P-18, measured on 2018-03-01" in certificate["traceability"]
    ks = {row["band"]: row for row in certificate["coefficients"]}
    for budget in certificate["budgets"]:
        k = ks[budget["band"]]
        total = math.hypot(*(line["u"] for line in budget["lines"]))
        assert total == pytest.approx(k["standard_uncertainty"], rel=1e-9)
        panel_line = next(line for line in budget["lines"] if line["source"] == "panel reflectance")
        assert panel_line["u_rel"] == pytest.approx(PANEL_U / PANEL_REFLECTANCE, rel=1e-12)


def test_what_was_photographed_is_stated(certificate_by):
    stated = certificate_by("geometry")["target"]
    assert {name: stated[name] for name in BOARD} == BOARD
    (region,) = certificate_by("sharpness")["regions"]
    assert [part["name"] for part in region["parts"]] == ["centre"]


@pytest.mark.parametrize("method", OTHERS)
def test_every_number_on_paper_is_one_of_the_jsons(
    sqlite_house, version_of, certificate_by, method, monkeypatch
):
    path = f"/v1/calibrations/{version_of(method)['id']}"
    with monkeypatch.context() as apart:
        # shut in as in production: nothing of any method is loaded late
        apart.setattr("service.documents.rendered.render_apart", render_apart)
        apart.setattr("service.documents.rendered.build_command", lambda _module: COMMAND)
        answer = sqlite_house.http.get(f"{path}/certificate.pdf")
    assert (answer.status_code, answer.headers["Content-Type"]) == (200, "application/pdf")
    attached = pypdf.PdfReader(io.BytesIO(answer.content)).attachments["certificate.json"]
    assert attached == [sqlite_house.http.get(f"{path}/certificate.json").content]
    pages = read_pages(answer.content)
    certificate = certificate_by(method)
    plot = sqlite_house.http.get(f"{path}/plot.svg")
    assert (plot.status_code, plot.headers["Content-Type"]) == (200, "image/svg+xml")
    count, misprints = find_misprints(certificate, plot.text, pages)
    assert (count > 20, misprints) == (True, [])
    first, whole = " ".join(pages[0].split()), "".join("".join(pages).split())
    headlines = methods.get_method(method).certificate.headlines
    labels = {each.name: each.label for each in methods.get_method(method).coefficients}
    for name in headlines & {row["name"] for row in certificate["coefficients"]}:
        assert "".join(labels[name].split()) in "".join(first.split())
    assert "Draft: nobody has signed" in first
    assert [raw for raw in ("red_edge", "rmspx", "pixelpitchum") if raw in whole] == []
    for frame in certificate["frames"]:
        assert frame["sha256"] in whole
    for statement in certificate["statements"]:
        assert "".join(statement.split()) in whole


@pytest.mark.parametrize("method", OTHERS)
def test_it_is_published_with_the_gaps_it_has_or_not_at_all(sqlite_house, version_of, method):
    house, version = sqlite_house, version_of(method)
    expected = {
        *("approver_missing", "author_missing", "laboratory_name_missing", "laboratory_address_missing"),
        *("customer_missing", "place_missing", "conditions_missing", "recorder_missing"),
        *(["lens_missing"] if method in ("sharpness", "geometry") else []),
    }
    try:
        house.patch("/v1/organisation", {"refuses_incomplete_certificates": True})
        assert house.publish(version, status=409)["code"] == "certificate_incomplete"
    finally:
        house.patch("/v1/organisation", {"refuses_incomplete_certificates": False})
    found = {warning["code"] for warning in house.publish(version)["warnings"]}
    # a picture without its metadata does not say its day either
    assert found - {"date_missing"} == expected
    assert certificate_of(house, version)["validity"]["state"] == "published"
    # against itself every coefficient finds its own, none that of another channel
    compared = house.get(f"/v1/calibrations/{version['id']}/impact", at="2026-06-01T00:00:00Z")[
        "coefficients"
    ]
    assert len(compared) == len(version["coefficients"])
    assert {row["difference"]["value"] for row in compared} == {0.0}


def test_the_points_of_a_fit_are_flat(sqlite_house, version_of):
    version = version_of("vignetting")
    text = sqlite_house.http.get(f"/v1/calibrations/{version['id']}/points.csv").text
    head, *rows = text.splitlines()
    assert "spots_count" in head.split(",")
    assert "spots" not in head.split(",")
    assert len(rows) == len(version["points"])
    assert "[" not in text


@pytest.mark.parametrize("method", ["vignetting", "reflectance"])
def test_a_frame_with_an_empty_half_is_left_out(sqlite_house, version_of, method):
    house, version = sqlite_house, version_of(method)
    used = [house.get(f"/v1/frames/{point['frame_id']}") for point in version["points"] if point["used"]]
    light = next(frame for frame in used if frame["role"] != "dark")
    content = house.http.get(f"/v1/frames/{light['id']}/content").content
    campaign = {"id": version["campaign_id"]}
    house.upload(campaign, empty_lower_half(content), role=light["role"], filename="cut.DNG")
    again = calibrate(house, campaign)
    cut = [point["left_out"] for point in again["points"] if point["frame"] == "cut.DNG"]
    assert cut
    assert all("the image is empty in rows" in left_out for left_out in cut)
    found, before = (
        {tuple(c.get(part) for part in ("name", "f_number", "channel", "band")): c["value"] for c in each}
        for each in (again["coefficients"], version["coefficients"])
    )
    assert found == before


def test_a_panel_without_its_uncertainty_is_a_gap(sqlite_house, version_of):
    campaign = {"id": version_of("reflectance")["campaign_id"]}
    panel = register_panel(sqlite_house, serial="P-unsure", u=None)
    certificate = certificate_of(sqlite_house, calibrate(sqlite_house, campaign, panel_id=panel["id"]))
    (gap,) = [gap for gap in certificate["gaps"] if gap["code"].startswith("panel")]
    assert gap["code"] == "panel_uncertainty_missing"
    assert "P-unsure" in gap["message"]
    assert "green, red" in gap["message"]


def test_a_panel_that_only_the_files_name_is_a_gap(certificate_by):
    certificate = certificate_by("reflectance") | {"panels": []}
    codes = [gap.code for gap in list_gaps(CertificateAnswer.model_validate(certificate))]
    assert "panel_unknown" in codes
    assert "panel_uncertainty_missing" not in codes


def test_a_campaign_without_a_checklist_says_so(sqlite_house, version_of):
    path = f"/v1/campaigns/{version_of('noise')['campaign_id']}/checklist"
    answer = sqlite_house.get(path)
    assert (answer["items"], answer["open"], answer["done"]) == ([], 0, 0)
    assert answer["said"].startswith("The printed checklist is that of the luminance procedure")
    for body in (
        {"signature": {"name": "B. Operator"}},
        {"items": [{"key": "equipment_lamp", "done": True}]},
    ):
        assert sqlite_house.patch(path, body, status=409)["code"] == "no_checklist"
