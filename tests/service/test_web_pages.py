"""What the pages are sent with: the policy, the files that they stand on, and problems as pages."""

import gzip
import re
from pathlib import Path
from urllib.parse import urljoin

import numpy as np
import pytest

from service.pages.rendering import describe_fields
from tests.support.house import KEY

STATIC = Path(__file__).parents[2] / "service" / "pages" / "static"
TEMPLATES = STATIC.parent / "templates"
PAGE = {"Accept": "text/html,application/xhtml+xml;q=0.9,*/*;q=0.8"}


@pytest.fixture
def house(sqlite_house):
    """One for all: nothing here depends on the database."""
    return sqlite_house


@pytest.fixture
def visitor(house, visitor):
    """A browser that is signed in."""
    visitor.post("/sign-in", data={"key": KEY}, headers=PAGE, follow_redirects=False)
    assert house.app.state.context.sessions.cookie in visitor.cookies
    return visitor


def test_a_page_runs_and_loads_only_what_is_ours(visitor):
    answer = visitor.get("/jobs", headers=PAGE)
    policy = dict(part.split(" ", 1) for part in answer.headers["content-security-policy"].split("; "))
    assert policy["default-src"] == "'none'"
    assert policy["script-src"] == policy["style-src"] == policy["connect-src"] == "'self'"
    assert policy["frame-ancestors"] == policy["base-uri"] == "'none'"
    assert "unsafe" not in answer.headers["content-security-policy"]
    assert answer.headers["cache-control"] == "no-store"
    assert answer.headers["referrer-policy"] == "same-origin"
    assert answer.headers["x-frame-options"] == "DENY"
    assert "https:" not in answer.text


def test_every_answer_forbids_guessing_its_kind(visitor):
    for path in ("/", "/v1/cameras", "/docs", "/livez", "/nowhere", "/static/x/y"):
        assert visitor.get(path).headers["x-content-type-options"] == "nosniff", path


def test_no_template_holds_what_the_policy_refuses():
    for path in TEMPLATES.rglob("*.html"):
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"<style|\sstyle=|\son\w+=|javascript:|<script(?![^>]*\ssrc=)", text), path
        assert not re.search(r"\|\s*safe\b", text), path


def test_no_module_reads_html_or_asks_another_host():
    for path in STATIC.rglob("*.js"):
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(", text), path
        assert not re.search(r"""["'`](https?:)?//""", text.replace("http://www.w3.org/2000/svg", "")), path


def test_question_marks_lead_to_places_that_the_manual_has(visitor):
    texts = [path.read_text(encoding="utf-8") for path in (*STATIC.rglob("*.js"), *TEMPLATES.rglob("*.html"))]
    named = {found for text in texts for found in re.findall(r"/docs/([a-z-]+)#([\w-]+)[\"'`]", text)}
    assert len(named) > 15
    for page in {page for page, _ in named}:
        places = set(re.findall(r' id="([^"]+)"', visitor.get(f"/docs/{page}", headers=PAGE).text))
        assert {place for of, place in named if of == page} <= places, page


def test_files_are_kept_for_ever_under_the_address_of_their_release(visitor):
    (style,) = re.findall(r'rel="stylesheet" href="([^"]+)"', visitor.get("/jobs", headers=PAGE).text)
    answer = visitor.get(style)
    assert answer.text == (STATIC / "stilb.css").read_text(encoding="utf-8")
    assert answer.headers["content-type"] == "text/css; charset=utf-8"
    assert answer.headers["cache-control"] == "public, max-age=31536000, immutable"
    again = visitor.get(style, headers={"If-None-Match": answer.headers["etag"]})
    assert (again.status_code, again.headers["etag"]) == (304, answer.headers["etag"])
    plain = visitor.get(style, headers={"Accept-Encoding": "identity"})
    assert "content-encoding" not in plain.headers
    assert plain.headers["vary"] == "Accept-Encoding"
    assert plain.content == answer.content


def test_a_page_asks_for_all_its_modules_at_once(visitor):
    """Each one by its own way from the page's: a browser would find the last only after all before it."""
    html = visitor.get("/jobs", headers=PAGE).text
    (first,) = re.findall(r'<script type="module" src="([^"]+)"', html)
    early = re.findall(r'<link rel="modulepreload" href="([^"]+)"', html)
    seen, waiting = {first}, [first]
    while waiting:
        address = waiting.pop()
        for named in re.findall(r'from "(\.[^"]+)"', visitor.get(address).text):
            found = urljoin(address, named)
            waiting += [found] if found not in seen else []
            seen.add(found)
    assert sorted(early) == sorted(seen - {first})
    assert len(early) > 3


def test_no_import_is_written_so_that_it_is_not_found(house):
    assets = house.app.state.assets
    for path in STATIC.rglob("*.js"):
        imported = assets.imported(path.relative_to(STATIC).as_posix())
        for name in re.findall(r'from "(\.[^"]+)"', path.read_text(encoding="utf-8")):
            target = (path.parent / name).resolve().relative_to(STATIC.resolve()).as_posix()
            assert f"/static/{assets.release}/{target}" in imported, path


def test_own_scripts_are_served_packed(house):
    with house.http.stream("GET", house.app.state.assets.url("plots.js")) as answer:
        packed = b"".join(answer.iter_raw())
    assert answer.headers["content-encoding"] == "gzip"
    plain = (STATIC / "plots.js").read_bytes()
    assert gzip.decompress(packed) == plain
    assert len(packed) < 0.5 * len(plain)


@pytest.mark.parametrize(
    "name", ["../__init__.py", "%2e%2e/__init__.py", "/etc/passwd", "pages", "", "stilb.css/"]
)
def test_nothing_else_is_served(house, name):
    release = house.app.state.assets.release
    assert house.http.get(f"/static/{release}/{name}").status_code == 404
    assert house.http.get("/static/0000/stilb.css").status_code == 404


def test_a_browser_gets_a_problem_as_a_page_and_a_program_as_json(visitor):
    page = visitor.get("/nowhere", headers=PAGE)
    assert (page.status_code, page.headers["content-type"]) == (404, "text/html; charset=utf-8")
    assert "<h1>Not found</h1>" in page.text
    for path, accept in (("/nowhere", "*/*"), ("/v1/nowhere", PAGE["Accept"])):
        answer = visitor.get(path, headers={"Accept": accept})
        assert answer.headers["content-type"] == "application/problem+json", path


def test_what_is_not_taken_says_what_is(visitor):
    answer = visitor.post("/docs", headers=PAGE)
    assert (answer.status_code, answer.headers["allow"]) == (405, "GET, HEAD")
    assert "<h1>Method not allowed</h1>" in answer.text


def test_our_own_fault_is_a_page_too(visitor, monkeypatch):
    def fail(*_, **__):
        raise RuntimeError("on purpose")

    monkeypatch.setattr("service.pages.routes.show_calculator.__code__", fail.__code__)
    answer = visitor.get("/tools/motion", headers=PAGE)
    assert answer.status_code == 500
    assert "on purpose" not in answer.text
    assert "<h1>Internal error</h1>" in answer.text
    assert 'href="/tools/motion">Try again' in answer.text


def test_every_field_of_a_form_that_a_page_shows_has_a_sentence():
    silent = [
        (form, name) for form, said in describe_fields().items() for name, text in said.items() if not text
    ]
    assert silent == []


# how linear sRGB is seen without one kind of cones (Machado and others 2009, doi:10.1109/TVCG.2009.113)
SEEN = {
    "all": np.eye(3),
    "no green": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.01182, 0.04294, 0.968881],
    ],
    "no red": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "no blue": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.3039],
    ],
}
XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def linear(colours):
    parts = np.array([[int(each[at : at + 2], 16) / 255 for at in (1, 3, 5)] for each in colours])
    return np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)


def lab(rgb):
    xyz = (np.clip(rgb, 0, 1) @ XYZ.T) / XYZ.sum(axis=1)
    x, y, z = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116).T
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def test_series_of_a_chart_differ_for_eyes_that_confuse_colours():
    style = (STATIC / "stilb.css").read_text(encoding="utf-8")
    surfaces = re.findall(r"--surface: (#\w{6})", style)
    palettes = [re.findall(r"--s\d: (#\w{6})", line) for line in style.splitlines() if "--s0:" in line]
    assert [len(each) for each in palettes] == [6, 6]
    for surface, palette in zip(surfaces, palettes, strict=True):
        colours, (ground,) = linear(palette), linear([surface]) @ XYZ[1]
        light = np.sort([colours @ XYZ[1], np.full(6, ground)], axis=0) + 0.05
        assert min(light[1] / light[0]) > 3, surface
        for eyes, matrix in SEEN.items():
            seen = lab(colours @ np.array(matrix).T)
            apart = np.linalg.norm(seen[:, None] - seen, axis=-1) + 1e3 * np.eye(6)
            assert apart.min() > 18, (surface, eyes)
