"""Measurements as people see them: the map's numbers under the pointer, cells, two dates, a new one."""

import csv
import io
import json
import re

import numpy as np
import pypdf
import pytest
import tifffile
from PIL import Image
from playwright.sync_api import expect

from tests.support.browser import Held, check_access, look, settle
from tests.support.nightwork import SHAPE
from worker.maps.picture import make_colours


@pytest.fixture
def plane(night):
    """The map that is downloaded."""
    with night.team.http() as http:
        content = http.get(f"/v1/measurements/{night.new.id}/map.tif").content
    return tifffile.imread(io.BytesIO(content))


@pytest.fixture
def shown(night_page, night):
    night_page.goto(f"/measurements/{night.new.id}")
    settle(night_page)
    return night_page


def point_at(page, row, col):
    """Put the pointer on the middle of a pixel, and say what the page reads there."""
    over = page.locator(".map-over").first
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    page.mouse.move(
        box["x"] + (col + 0.5) * box["width"] / SHAPE[1], box["y"] + (row + 0.5) * box["height"] / SHAPE[0]
    )
    said = page.locator(".map-said").first
    expect(said).to_contain_text(f"x {col}, y {row}")
    return said


@pytest.mark.parametrize("context", ["phone"], indirect=True)
def test_the_map_reads_what_the_tiff_holds(shown, plane):
    for row, col in ((100, 60), (40, 250), (190, 3)):
        said = point_at(shown, row, col)
        assert np.float32(said.get_attribute("data-value")) == plane[row, col]
        expect(said).to_contain_text("±")
        expect(said).to_contain_text("cd/m²")
    # the sign is saturated: the map knows no number there
    assert np.isnan(plane[10, 140])
    expect(point_at(shown, 10, 140)).to_contain_text("saturated")


def draw_isolines(shown):
    shown.get_by_role("button", name="Isolines").press("Enter")
    expect(shown.locator(".map-isolines path").first).to_be_attached()
    expect(shown.locator("#isolines")).to_contain_text("place ±")
    settle(shown)
    look(shown, "map-tools")
    check_access(shown)


def test_figures_cells_and_what_to_know_stand_there(shown, plane, night):
    check_large_map(shown, plane)
    check_colours(shown)
    read_with_keys(shown, plane)
    draw_isolines(shown)
    figures = shown.locator("#figures")
    for word in (
        "of the region drawn for this measurement",
        "On one simulated road U_o was 0.386 from above",
        "Mean",
        "Overall uniformity",
        "Illuminance",
        "Range of pixels",
    ):
        expect(figures).to_contain_text(word)
    expect(shown.locator("#grid").get_by_role("row")).to_have_count(1 + 3)
    expect(shown.locator("#with").get_by_role("link")).to_have_attribute(
        "href", f"/calibrations/{night.version.id}"
    )
    strip = shown.get_by_role("navigation", name="Measurements of the same night").get_by_role("link")
    expect(strip).to_have_count(2)
    expect(strip.and_(shown.locator("[aria-current]"))).to_have_attribute(
        "href", f"/measurements/{night.new.id}"
    )
    expect(shown.locator("#budget")).to_contain_text("f-number")
    expect(shown.locator("#better").get_by_role("listitem").first).to_be_visible()
    expect(shown.locator("#flags")).to_contain_text("not at the observer's position of EN 13201")
    shown.get_by_role("button", name="Linear").click()
    expect(shown.get_by_role("button", name="Linear")).to_have_attribute("aria-pressed", "true")


def check_large_map(shown, plane):
    """In squares first: then the readout is of the pixel all the same."""
    read = shown.evaluate(
        """async (id) => {
            const src = [...document.querySelectorAll("script[type=module]")].at(-1).src;
            const { MapValues } = await import(src.replace("page.js", "map.js"));
            const squares = await (await fetch(`/v1/measurements/${id}/map.json?step=8`)).json();
            const map = new MapValues(id, squares);
            return { square: map.square(101, 61), pixel: await map.pixel(101, 61) };
        }""",
        shown.url.rpartition("/")[2],
    )
    assert np.float32(read["pixel"]) == plane[101, 61]
    assert read["square"] == pytest.approx(plane[96:104, 56:64].mean(), rel=1e-6)


def check_colours(shown):
    """Those of the picture."""
    anchors = shown.evaluate(
        """async () => {
            const src = [...document.querySelectorAll("script[type=module]")].at(-1).src;
            return (await import(src.replace("page.js", "map.js"))).ANCHORS;
        }"""
    )
    assert anchors == ["#{:02x}{:02x}{:02x}".format(*colour) for colour in make_colours()[::15]]


def read_with_keys(shown, plane):
    shown.locator(".map-over").focus()
    for key in ("ArrowRight", "Shift+ArrowUp", "ArrowDown"):
        shown.keyboard.press(key)
    said = shown.locator(".map-said")
    row, col = SHAPE[0] // 2 - 9, SHAPE[1] // 2 + 1
    expect(said).to_contain_text(f"x {col}, y {row}")
    assert np.float32(said.get_attribute("data-value")) == plane[row, col]


def test_two_dates_are_chosen_and_compared(night_page, night):
    night_page.goto("/measurements")
    settle(night_page)
    expect(night_page.get_by_role("row").filter(has_text="road-june.DNG").first).to_contain_text("version 1")
    for name in ("road-may.DNG", "road-june.DNG"):
        night_page.get_by_role("checkbox", name=f"Compare {name}").first.check()
    night_page.get_by_role("region", name="Chosen to compare").get_by_role("link", name="Compare").click()
    night_page.wait_for_url("**/measurements/comparison?**")
    night_page.goto(f"/measurements/comparison?old={night.old.id}&new={night.new.id}")
    settle(night_page)
    expect(night_page.locator("#verdict")).to_contain_text("not a significant change")
    night_page.get_by_role("link", name="The same lamps lit both").click()
    settle(night_page)
    expect(night_page.locator("#verdict")).to_contain_text(": a significant change")
    expect(night_page.locator("#verdict")).to_contain_text("spectral mismatch")
    expect(night_page.locator("#verdict")).to_contain_text("fit of K")
    expect(night_page.locator(".map-over")).to_have_count(2)
    # the lamp in the middle fell out: only cells near it are marked
    cells = night_page.locator("#cells")
    expect(cells.get_by_role("row").nth(2).get_by_role("cell").nth(2)).to_contain_text("significant")
    look(night_page, "contrast")


def test_other_outlines_are_compared_only_if_asked_for(night_page, night):
    part = night.team.client.measure(night.field[0].id, polygon=[(40, 24), (90, 24), (90, 90)])
    night_page.goto(f"/measurements/comparison?old={part.id}&new={night.new.id}")
    settle(night_page)
    expect(night_page.locator("#verdict")).to_contain_text("The two outlines differ.")
    assert all("409" in said for said in night_page.context.complaints)
    night_page.context.complaints.clear()
    night_page.get_by_role("link", name="Compare nevertheless").click()
    settle(night_page)
    expect(night_page.locator("#verdict")).to_contain_text("The two regions differ")
    check_access(night_page)


def test_a_filter_says_so_when_nothing_is_left(night_page, night):
    night_page.goto("/measurements?camera_id=none")
    settle(night_page)
    expect(night_page.get_by_text("No measurements")).to_be_visible()
    night_page.get_by_label("Campaign").select_option(night.measured_id)
    settle(night_page)
    expect(night_page.get_by_role("row").filter(has_text="road-may.DNG").first).to_be_visible()


def test_a_frame_is_measured_from_the_page(night_page, night):
    night_page.goto(f"/measurements/new?frame={night.field[0].id}")
    settle(night_page)
    expect(night_page.get_by_label("Frame", exact=True)).to_have_value(night.field[0].id)
    # nothing is drawn yet: the campaign's region lies where the calibration was made
    expect(night_page.get_by_role("radio", name="New region")).to_be_checked()
    expect(night_page.get_by_role("textbox", name="Corners")).to_have_value("")
    expect(night_page.get_by_text("Drag a rectangle on the preview, or click")).to_be_visible()
    night_page.get_by_label("Average with").select_option(label="road-june.DNG")
    night_page.get_by_role("radio", name="Surface with cells").check()
    night_page.get_by_role("button", name="Rectangle", exact=True).click()
    corners = night_page.get_by_role("textbox", name="Corners")
    expect(corners).to_have_value(re.compile(r"^\d+,\d+( \d+,\d+){3}$"))
    corners.fill("40,24 250,24 276,168 12,168")
    corners.press("Tab")
    night_page.get_by_label("Rows of cells").fill("2")
    night_page.get_by_label("Columns of cells").fill("2")
    night_page.get_by_text("Light and surroundings").click()
    night_page.get_by_label("Light source", exact=True).fill("LED-B3")
    night_page.get_by_label("Distance [m]").fill("30")
    night_page.get_by_label("Kind of lamp").select_option("led_ripple")
    night_page.get_by_label("Mains frequency [Hz]").fill("47")
    night_page.get_by_label("Glare [%]").fill("2")
    look(night_page, "measurement-new")
    night_page.get_by_role("button", name="Measure").click()
    night_page.wait_for_url(re.compile("/measurements/msr_"))
    settle(night_page)
    expect(night_page.locator("#grid").get_by_role("row")).to_have_count(1 + 2)
    expect(night_page.locator("#figures")).to_contain_text("of the outline of the surface with cells")
    expect(night_page.locator("#made")).to_contain_text("averaged with 1 more")
    expect(night_page.locator("#flags")).to_contain_text("differ beyond their noise")
    # the campaign states no lamp; 2 % of the frame's mean is subtracted
    for said in (
        "the calibration's lamp, the camera's response not known",
        "2.00 % of the frame's mean",
        "47 Hz mains, LED with a simple or unknown driver: modulation assumed from 0 to 0.3",
    ):
        expect(night_page.locator("#with")).to_contain_text(said)
    measure_the_same_again(night_page)


def measure_the_same_again(page):
    """What was drawn and stated for a measurement stands there when it is repeated with another version."""
    page.get_by_role("link", name="Remeasure").click()
    expect(page.get_by_role("textbox", name="Corners")).to_have_value("40,24 250,24 276,168 12,168")
    expect(page.get_by_role("radio", name="Surface with cells")).to_be_checked()
    expect(page.get_by_label("Average with")).to_have_values([re.compile("frm_")])
    page.get_by_text("Light and surroundings").click()
    typed = {"Rows of cells": "2", "Light source": "LED-B3", "Distance [m]": "30", "Glare [%]": "2"}
    for label, stated in typed.items():
        expect(page.get_by_label(label, exact=True)).to_have_value(stated)
    expect(page.get_by_label("Kind of lamp")).to_have_value("led_ripple")
    # another frame of the night shows the same road
    page.get_by_label("Frame", exact=True).select_option(label="road-june.DNG")
    settle(page)
    expect(page.get_by_role("textbox", name="Corners")).to_have_value("40,24 250,24 276,168 12,168")


# the far end of the road is twice as far as the near one, and half as wide
LANES = "88,160 116,40 172,40 200,160"


def average_lanes(plane):
    """Mean of the map's green pixels in 6 x 10 cells, by hand: u along from the near end, v across."""
    row, col = np.mgrid[: SHAPE[0], : SHAPE[1]]
    up = (160.0 - (row + 0.5)) / 120.0
    u = up / (2.0 - up)
    v = ((col + 0.5 - 144.0) * (1.0 + u) / 56.0 + 1.0) / 2.0
    inside = (u > 0) & (u < 1) & (v > 0) & (v < 1)

    def average(site):
        cell = np.where(inside & site, np.floor(6 * v) * 10 + np.floor(10 * u), -1)
        return np.array([plane[cell == n].mean(dtype=float) for n in range(60)]).reshape(6, 10)

    # both greens have the same weight
    return np.mean(
        [average((row % 2 == 0) & (col % 2 == 1)), average((row % 2 == 1) & (col % 2 == 0))], axis=0
    )


def test_lanes_are_drawn_on_the_map_measured_and_saved(shown, plane, night):
    """With the keys alone; cells, their places and every file against values found by hand."""
    shown.get_by_role("button", name="Uncertainty").press("Enter")
    expect(shown.locator(".map-bar")).to_contain_text("expanded uncertainty of the value, 95 %")
    expect(shown.locator("#layer-notes")).to_contain_text("Vignetting is not corrected")
    shown.get_by_role("button", name="Draw a region").press("Enter")
    # the cells that were measured are there to be moved
    corners = shown.locator("#region").get_by_role("textbox", name="Corners")
    expect(corners).to_have_value("40,24 250,24 276,168 12,168")
    handle = shown.locator(".map-stage .roi-handle").first
    handle.focus()
    handle.press("Shift+ArrowLeft")
    handle.press("ArrowDown")
    expect(corners).to_have_value("30,25 250,24 276,168 12,168")
    look(shown, "map-region")
    shown.get_by_role("radio", name="Lane grid").check()
    shown.get_by_role("button", name="Rectangle", exact=True).press("Enter")
    # ten columns of six cells: nine lines and the end, and five
    expect(shown.locator(".roi-cells")).to_have_attribute("d", re.compile("^(M[^M]+){15}$"))
    shown.get_by_label("Spacing of luminaires [m]").fill("24")
    first, rest = LANES.split(" ", 1)
    corners.fill(f"{rest} {first}")
    corners.press("Tab")
    checked = shown.locator(".region-checked")
    expect(checked).to_contain_text("No camera sees a rectangle of the stated sides with these corners")
    corners.fill(LANES)
    corners.press("Tab")
    expect(checked.locator(".note")).to_have_count(0)
    expect(checked).to_contain_text("Points are known to")
    look(shown, "map-lanes")
    check_access(shown)
    shown.locator("#region").get_by_role("button", name="Measure").press("Enter")
    shown.wait_for_url(lambda url: "/measurements/msr_" in url and night.new.id not in url)
    settle(shown)
    expect(shown.locator("#grid").get_by_role("row")).to_have_count(1 + 6)
    look(shown, "measured-lanes")
    check_files(shown, average_lanes(plane))


def check_files(shown, cells):
    """Each file of the page of a measurement of lanes."""
    grid = shown.locator("#grid")
    rows = list(csv.DictReader(io.StringIO(save(shown, grid, "CSV").decode())))
    assert np.array([float(row["luminance_cd_m2"]) for row in rows]) == pytest.approx(cells.ravel(), rel=2e-3)
    first = [float(rows[0][name]) for name in ("x_m", "y_m", "x_px", "y_px")]
    # u = 1/20, v = 1/12: 160 - 120 (2 u / (1 + u)), 144 - 5/6 56 / (1 + u)
    assert first == pytest.approx([1.2, 7 / 12, 144 - 56 / 1.05 * 5 / 6, 160 - 120 * 0.1 / 1.05], abs=1e-6)
    told = json.loads(save(shown, grid, "GeoJSON"))
    assert told["coordinates_in"] == "road_m"
    last = np.array(told["features"][-1]["geometry"]["coordinates"][0])
    outline = [[21.6, 35 / 6], [24, 35 / 6], [24, 7], [21.6, 7], [21.6, 35 / 6]]
    assert last == pytest.approx(np.array(outline))
    with Image.open(io.BytesIO(save(shown, grid, "Picture"))) as picture:
        assert picture.size[0] > SHAPE[1]
    # which some browsers show and others download
    report = shown.locator("#go-on").get_by_role("link", name="Report (PDF)").get_attribute("href")
    first, _ = read_pages(shown.request.get(report).body())
    u_o = f"{cells.min() / cells.mean():.2f}"
    for said in ("Seen from above", "1.43°", "Neither values nor ratios carry over", f"U_o {u_o}"[:-1]):
        assert said.lower() in first.lower(), said


def save(page, place, name):
    with page.expect_download() as caught:
        place.get_by_role("link", name=name).click()
    return caught.value.path().read_bytes()


def read_pages(pdf):
    pages = pypdf.PdfReader(io.BytesIO(pdf)).pages
    return ["".join(" ".join(page.extract_text().split()).split("\u200b")) for page in pages]


def test_all_frames_of_a_night_are_measured_once_a_region_is_drawn(night_page, night):
    night_page.goto(f"/campaigns/{night.measured_id}")
    settle(night_page)
    night_page.get_by_role("link", name="Measure all frames").click()
    expect(night_page.get_by_label("Frame", exact=True)).to_have_value("all")
    settle(night_page)
    night_page.get_by_role("radio", name="New region").check()
    night_page.get_by_role("button", name="Redraw").click()
    night_page.get_by_role("button", name="Measure").click()
    expect(night_page.get_by_role("alert")).to_contain_text("Draw the region first")
    corners = night_page.get_by_role("textbox", name="Corners")
    corners.fill("40,24 120,24 120,90")
    corners.press("Tab")
    night_page.get_by_role("button", name="Measure").click()
    night_page.wait_for_url("**/campaigns/*#measure")
    expect(night_page.get_by_text("2 of 2 frames measured.")).to_be_visible()
    expect(night_page.get_by_role("link", name="GeoJSON")).to_be_visible()
    with night.team.http() as http:
        newest = http.get("/v1/measurements", params={"limit": 2}).json()["items"]
    assert {each["frame_id"] for each in newest} == {each.id for each in night.field}
    assert {tuple(map(tuple, each["region"])) for each in newest} == {((40, 24), (120, 24), (120, 90))}
    tell_of_refused_frames(night_page, night)


def tell_of_refused_frames(page, night):
    """They are not counted among those that wait, and each cause has its own line."""

    def refuse_one(route):
        grid = route.fetch().json()
        grid["frames"]["state"][0] = "refused"
        route.fulfill(json=grid)

    causes = {"a.DNG": "too small", "b.DNG": "another camera", "c.DNG": "too small"}
    left = [
        {"filename": name, "code": "frame_refused", "detail": f"Frame {name}: {cause}."}
        for name, cause in causes.items()
    ]
    page.route("**/grid?*", refuse_one)
    page.route("**/campaigns/*/measurements", lambda at: at.fulfill(json={"jobs": [], "not_measured": left}))
    page.goto(f"/campaigns/{night.measured_id}")
    expect(page.get_by_text("of 1 frame measured.")).to_be_visible()
    page.goto(f"/measurements/new?campaign={night.measured_id}&all")
    page.get_by_role("radio", name="Existing region").check()
    page.get_by_role("button", name="Measure").click()
    expect(page.get_by_text("1 frame not measured")).to_be_visible()
    expect(page.get_by_text("2 frames not measured")).to_be_visible()


def test_what_was_chosen_last_is_measured_on_a_slow_line_too(night_page, night):
    """Answers come late and in another order; nobody waits for them before they go on."""
    sent = []
    june = night.field[1].id

    def give_june_a_region(route):
        frames = route.fetch().json()
        for each in frames["items"]:
            each["roi_id"] = "roi_june" if each["id"] == june else None
        route.fulfill(json=frames)

    def refuse(route):
        sent.append(route.request.post_data_json)
        route.abort()

    night_page.route(f"**/campaigns/{night.measured_id}/frames*", give_june_a_region)
    frames = Held(night_page, f"**/campaigns/{night.campaign_id}/frames*")
    region = Held(night_page, f"**/frames/{june}/roi")
    night_page.route("**/v1/measurements", refuse)
    night_page.goto(f"/measurements/new?frame={night.field[0].id}")
    settle(night_page)
    campaign = night_page.get_by_label("Campaign", exact=True)
    campaign.select_option(night.campaign_id)
    campaign.select_option(night.measured_id)
    frame = night_page.get_by_label("Frame", exact=True)
    expect(frame.get_by_role("option")).to_have_count(3)
    late = frames.release()
    with night_page.expect_response(late.request.url):
        late.fulfill(json={"items": [], "next": None})
    night_page.evaluate("() => new Promise((done) => setTimeout(done, 200))")
    expect(frame.get_by_role("option")).to_have_count(3)
    expect(night_page.get_by_text("No field frames")).to_have_count(0)

    frame.select_option(june)
    night_page.get_by_role("button", name="Measure").click()
    own = [[40, 24], [120, 24], [120, 90]]
    region.release().fulfill(json={"id": "roi_june", "polygon": own})
    expect(night_page.get_by_role("alert")).to_contain_text("No connection")
    assert [each["frame_id"] for each in sent] == [june]
    # the region of the frame itself
    assert "roi" not in sent[0]
    night_page.context.complaints.clear()
