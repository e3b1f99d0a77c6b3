"""The certificate on paper: the numbers are those of certificate.json, and nothing is lost on the way."""

import copy
import io
import json
import re
from pathlib import Path

import cv2
import numpy as np
import pypdf
import pytest
import typst
import zxingcpp

from radiometry.drawing.text import in_step
from service.documents import rendering
from service.documents.pages import lay_out
from service.documents.rendered import (
    find_rendered,
    name_source,
    render_and_keep,
    render_apart,
    write_order,
)
from service.documents.rendering import add_code, typeset
from service.documents.sheets import draw_region
from tests.support.blobs import files
from tests.support.certificates import certificate_of, complete_version, find_misprints, read_pages


@pytest.fixture(scope="module")
def printed(sqlite_house):
    """The certificate as JSON, its plots, and the pages of the PDF: all as they are fetched."""
    house = sqlite_house
    version = complete_version(house, isos=(3200, 6400))
    path = f"/v1/calibrations/{version['id']}"
    answer = house.http.get(f"{path}/certificate.pdf")
    assert (answer.status_code, answer.headers["Content-Type"]) == (200, "application/pdf")
    plot = house.http.get(f"{path}/plot.svg").text
    return certificate_of(house, version), plot, read_pages(answer.content)


@pytest.fixture(scope="module")
def certificate(printed):
    return printed[0]


def test_every_number_on_paper_is_one_of_the_jsons(printed):
    count, misprints = find_misprints(*printed)
    assert (count > 200, misprints) == (True, [])
    assert find_misprints(printed[0], "", ["2.718281"]) == (1, ["2.718281"])


def test_a_laboratory_can_sign_the_first_page_and_the_annex_has_two(printed):
    certificate, _, pages = printed
    first, whole = " ".join(pages[0].split()), " ".join(" ".join(pages).split())
    for fit in certificate["result"]["iso_fits"]:
        c = fit["coefficient"]
        stated = " ± ".join(in_step(c["luminance_k"], c["expanded_uncertainty"]))
        assert re.search(rf"ISO {c['iso']:g}, green {stated} [\d.]+ % {c['coverage_factor']:.2f}", first)
    for said in (
        *("0K1XE8-luminance-1", "A. Meier", "City of Lansing", "Main Street 1", "PTB Braunschweig"),
        *("Draft: nobody has signed", "page 1 of 3", "Fitted by: A. Meier, physicist", "Approved by name"),
    ):
        assert said in first
    assert f"stilb export {certificate['calibration_id']} calibration && stilb-verify" in first
    assert not re.search(r"/v1/|\bkey_|\d\.\d{8,}", whole), (
        "routes, keys and raw floats are no words for people"
    )


def test_the_code_on_the_first_page_holds_the_command(certificate):
    sheets = add_code(lay_out(certificate, ""))
    template = Path(rendering.__file__).parent / "certificate.typ"
    page, *_ = typst.compile(template, format="png", ppi=200, sys_inputs={"certificate": json.dumps(sheets)})
    seen = cv2.imdecode(np.frombuffer(page, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert [code.text for code in zxingcpp.read_barcodes(seen)] == [sheets["verify"]]


def test_every_frame_reading_section_and_share_is_printed(printed):
    certificate, _, pages = printed
    text = "".join("".join(page.split()) for page in pages)
    for frame in certificate["frames"]:
        assert frame["sha256"] in text
        assert in_step(frame["signal_dn"], frame["signal_standard_uncertainty_dn"])[0] in text
    for reading in certificate["readings"]:
        assert f"{reading['entered_value']:.6g}" in text
    for point in certificate["result"]["points"]:
        assert f"{100 * point['residual_rel']:.2f}%" in text
    for item in certificate["checklist"]["items"]:
        assert "".join(item["section"].split()) in text
    for budget in certificate["budgets"]:
        for line in budget["lines"]:
            assert f"{100 * line['variance_share']:.2f}%" in text
    for statement in certificate["statements"]:
        assert "".join(statement.split()) in text
    assert certificate["content_sha256"] in text


def test_tables_go_on_over_pages_and_words_are_text(certificate):
    """Heads are repeated, long names stay inside, and a letter that no font can show does no harm."""
    hostile = '#eval("1") *bold* $x$ <b> \\ "quoted" #include "/etc/passwd"'
    long = copy.deepcopy(certificate)
    long["coefficients"][0]["value"] = 77.77
    long["work"]["place"] = f"Gate \U00074823 {hostile}"
    long["work"]["customer"] = hostile
    long["frames"] = [
        frame | {"frame": f"{'N' * 60}-{i}.DNG"} for i in range(4) for frame in certificate["frames"]
    ]
    long["meters"][0]["serial"] = "S" * 80
    pages = read_pages(typeset(lay_out(long, "")))
    with_frames = [page for page in pages if "NNNNNNNNNN" in page]
    assert len(with_frames) > 3
    for page in with_frames:
        assert "SHA-256" in page
    text = "".join("".join(pages).split())
    assert text.count("".join(hostile.split())) == 2
    assert "Gate" in text
    assert "77.77" in pages[0]
    total = len(pages)
    for number, page in enumerate(pages, start=1):
        assert f"page {number} of {total}" in " ".join(page.split())
        assert "This certificate relates only to the item named on it" in " ".join(page.split())


def test_the_same_certificate_gives_the_same_bytes_of_pdf_a_3(certificate):
    pdf = typeset(lay_out(certificate, ""))
    assert pdf == render_apart(write_order("certificate", certificate=certificate, preview=""))
    reader = pypdf.PdfReader(io.BytesIO(pdf))
    root = reader.trailer["/Root"]
    metadata = root["/Metadata"].get_data()
    assert (b"<pdfaid:part>3<" in metadata, b"<pdfaid:conformance>B<" in metadata) == (True, True)
    assert [intent["/S"] for intent in root["/OutputIntents"]] == ["/GTS_PDFA1"]
    (file,) = (each.get_object() for each in root["/AF"])
    assert (file["/UF"], file["/AFRelationship"]) == ("certificate.json", "/Source")
    content = file["/EF"]["/UF"].get_object()
    assert content["/Subtype"] == "/application/json"
    assert json.loads(content.get_data()) == certificate
    fonts = [font for page in reader.pages for font in page["/Resources"]["/Font"].values()]
    embedded = [font["/DescendantFonts"][0]["/FontDescriptor"].keys() for font in fonts]
    assert all({"/FontFile2", "/FontFile3"} & keys for keys in embedded)


def test_a_long_table_is_cut_with_a_sentence_and_the_json_is_whole(certificate):
    long = copy.deepcopy(certificate)
    long["frames"] = certificate["frames"] * 9
    light = [frame for frame in long["frames"] if frame["role"] == "light"]
    sections = {each["title"]: each["blocks"][-1] for each in lay_out(long, "")["sections"]}
    assert len(sections["Light frames"]["rows"]) == 200 < len(light)
    assert (
        f"The first 200 of {len(light):,} rows; all are in the JSON certificate."
        in (sections["Light frames"]["caption"])
    )
    assert "The first" not in sections["Dark frames"]["caption"]


def test_a_file_is_rendered_once_and_again_if_it_is_lost(sqlite_house, monkeypatch):
    rendered = []
    monkeypatch.setattr(
        "service.documents.rendered.render_apart",
        lambda _, **__: rendered.append(1) or b"%PDF" + bytes(rendered),
    )
    context = sqlite_house.app.state.context

    def find(content):
        source = name_source(content)
        return find_rendered(context, source) or render_and_keep(context, source, content)

    first = find(b"a")
    assert find(b"a") == first
    assert find(b"b") != first
    for path in files(sqlite_house.folder / "blobs"):
        path.unlink()
    assert find(b"a") == b"%PDF" + bytes([1, 1, 1])
    assert len(rendered) == 3
    monkeypatch.setattr("store.software.RENDERER", "another")
    assert find_rendered(context, name_source(b"a")) is None


def test_the_region_is_drawn_where_it_lies():
    svg = draw_region(b"png", 400, 300, [[[10, 20], [110.5, 20], [110, 80]]])
    assert 'viewBox="0 0 400 300"' in svg
    assert 'points="10,20 110.5,20 110,80"' in svg


@pytest.mark.parametrize(
    ("value", "uncertainty", "expected"),
    [
        (2.0002046, 0.043026, ("2.000", "0.043")),
        (31.99, 0.0996, ("31.99", "0.10")),
        (31.99, 9.96, ("32", "10")),
        (1234.5, 120.0, ("1230", "120")),
        (-0.5, 0.001, ("-0.5000", "0.0010")),
        (0.25, 0.0, ("0.25", "0")),
    ],
)
def test_a_value_is_rounded_as_its_uncertainty_is(value, uncertainty, expected):
    assert in_step(value, uncertainty) == expected
