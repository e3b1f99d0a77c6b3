"""A road on its page: verdict, map, control points that are left out, and another class."""

import re

import pytest
from playwright.sync_api import expect

from tests.browser.test_every_method import Afar
from tests.browser.test_every_page import check_both
from tests.support.browser import DIALOG, check_access, look, settle, sign_in
from tests.support.campaigns import published_campaign
from tests.support.roads import (
    CONDITIONS,
    MARGIN_M,
    MARKS,
    PX_PER_M,
    REQUIREMENT,
    SITE,
    SPACING_M,
    evaluate,
    list_points,
    state_road,
)


@pytest.fixture(scope="module")
def house(service, tmp_path_factory):
    """One organisation with a K that is in force."""
    with service.team() as team, Afar(team, tmp_path_factory.mktemp("roads")) as opened:
        published_campaign(opened, isos=(3200,))
        yield opened


@pytest.fixture(scope="module")
def road(house):
    """A road that is evaluated, for those who look and leave it as it is."""
    stated = state_road(house, publish=False)
    evaluate(house, stated)
    return stated


@pytest.fixture
def road_page(context, house):
    """Signed in where the road is."""
    return sign_in(context, house.key)


def state_another(house, road):
    """A road with the same frames, to be changed."""
    stated = {"name": "Harbour Street", "site": SITE, "requirement": REQUIREMENT, "conditions": CONDITIONS}
    frames = [{"frame_id": each["frame_id"], "marks": MARKS} for each in road["frames"]]
    return house.post("/v1/roads", stated | {"frames": frames})


@pytest.fixture
def spoilt(team, tmp_path):
    """A road of which P3 reads twice the light that is there, evaluated with a K of its own."""
    with Afar(team, tmp_path) as house:
        stated = state_road(house, frames=1)
        points = house.get(f"/v1/roads/{stated['id']}/points")["items"]
        points[2]["values"] = [2 * each for each in points[2]["values"]]
        assert house.http.put(f"/v1/roads/{stated['id']}/points", json=points).status_code == 200
        evaluate(house, stated)
        yield stated


def test_a_road_is_judged_on_its_page(page, team, spoilt):
    page.goto("/measurements")
    settle(page)
    page.get_by_role("link", name="Roads").click()
    settle(page)
    check_access(page)
    page.get_by_role("link", name=spoilt["name"]).click()
    settle(page)
    expect(page.locator("#verdict")).to_contain_text("Conforms to class C4")
    expect(page.locator("#verdict")).to_contain_text("P3 differs from the map")
    expect(page.locator("#figures")).to_contain_text(re.compile(r"Average Eav\s*\d\d\.\d+ ± \d\.?\d*\s*lx"))
    expect(page.locator(".road-map")).to_have_js_property("complete", value=True)
    expect(page.locator("#points").get_by_role("row")).to_have_count(9)
    expect(page.locator("#grid strong.lowest")).to_have_count(1)
    check_both(page)
    look(page, "road")
    page.get_by_role("button", name="Leave out P3…").click()
    check_access(page, DIALOG)
    page.get_by_label("Reason").fill("receiver in shadow")
    page.get_by_role("dialog").get_by_role("button", name="Leave out").click()
    row = page.locator("#points").get_by_role("row").filter(has_text="P3")
    expect(row).to_contain_text("left out receiver in shadow")
    expect(page.locator("#verdict")).not_to_contain_text("P3")
    page.get_by_label("Class").select_option("C1")
    expect(page.locator("#verdict")).to_contain_text("Does not conform to class C1")
    expect(page.locator("#decide")).to_be_hidden()
    with team.http() as http:
        path = f"/v1/roads/{spoilt['id']}"
        found = http.get(http.get(path).json()["results"][-1]["link"]).json()["figures"]
        limit = {
            "figure": "e_av",
            "at_least": next(each["value"] for each in found if each["figure"] == "e_av"),
        }
        http.patch(path, json={"requirement": spoilt["requirement"] | {"criteria": [limit]}})
    page.get_by_role("button", name="Hidden points…").click()
    page.get_by_role("textbox", name="Points").fill("2/3-10, 2/3-9")
    page.get_by_role("dialog").get_by_role("button", name="Save").click()
    expect(page.locator("#map")).to_contain_text("58 of 60 points visible")
    expect(page.locator("#prospects").get_by_role("row").last).to_contain_text("40 more")
    for name in ("Report (PDF)", "Plan card (PDF)"):
        address = page.get_by_role("link", name=name).get_attribute("href")
        assert page.request.get(address).body().startswith(b"%PDF")
    used = page.request.get(f"/v1/roads/{spoilt['id']}/results/1").json()["frames"][0]
    page.goto(f"/calibrations/{used['calibration_id']}")
    settle(page)
    page.get_by_role("button", name="Revoke…").click()
    page.get_by_label("Reason").fill("lamp aged")
    page.get_by_role("button", name="Revoke permanently").click()
    expect(
        page.get_by_text(f"Roads that were evaluated with it: {spoilt['name']} (evaluation 1)")
    ).to_be_visible()


def read_map(page, road):
    """Wherever it is pointed at, and a step of the keys from there."""
    page.goto(f"/roads/{road['id']}")
    settle(page)
    over = page.get_by_role("application", name="Map of the road")
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    over.click(position={"x": box["width"] / 2, "y": box["height"] / 2})
    said = page.locator("#map output")
    expect(said).to_contain_text(
        re.compile(r"\d+\.\d+ ± \d\.?\d* lx \(k = 2, .*L 0\.\d+ cd/m² at 15.0 m along, 3.0 m across")
    )
    page.keyboard.press("Shift+ArrowDown")
    expect(said).not_to_contain_text("15.0 m along, 3.0 m across")


@pytest.mark.parametrize("context", ["phone"], indirect=True)
def test_on_a_telephone_the_road_runs_upward_and_the_result_comes_first(road_page, road):
    page = road_page
    read_map(page, road)
    shown = page.locator(".road-map")
    box = shown.bounding_box()
    assert box["height"] > box["width"]
    assert page.locator("#figures").bounding_box()["y"] < box["y"]
    expect(page.locator("#verdict sub").first).to_have_text("av")
    drawn = page.request.get(shown.get_attribute("src")).text()
    assert all(f">{words}</text>" in drawn for words in ("S = 30 m", "10 m", "Lane 1", "Lane 2"))
    check_access(page)
    look(page, "road-phone")


def test_the_map_shows_its_uncertainty_and_its_picture(road_page, road):
    page = road_page
    read_map(page, road)
    for name in ("Uncertainty", "Picture"):
        layer = page.locator("#layers").get_by_role("button", name=name)
        layer.click()
        expect(layer).to_have_attribute("aria-pressed", "true")
        painted = """({canvas = document.querySelector("#map .map-stage canvas")}) =>
            new Set(canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data).size > 20"""
        page.wait_for_function(painted, arg={})
        look(page, f"road-{name.lower()}")
    check_both(page)


def drag(page, x, y, *, down):
    """Drag from a place downwards: with a finger where the screen takes one, else with the mouse."""
    if not page.evaluate("navigator.maxTouchPoints"):
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x, y + down, steps=5)
        return page.mouse.up()
    session = page.context.new_cdp_session(page)
    moves = [("touchMove", [{"x": x, "y": y + down * step / 5}]) for step in range(1, 6)]
    for kind, points in (("touchStart", [{"x": x, "y": y}]), *moves, ("touchEnd", [])):
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    return session.detach()


@pytest.mark.parametrize("context", ["desktop", "phone"], indirect=True)
def test_the_site_is_drawn_and_changed_over_the_picture(road_page, house, road):
    page, road = road_page, state_another(house, road)
    page.goto(f"/roads/{road['id']}")
    settle(page)
    site = page.locator("#site")
    told = site.get_by_role("status")
    expect(told).to_contain_text("Placed by 6 marks")
    lamps = site.locator(".site-lamp").evaluate_all(
        "all => all.map(({cx, cy}) => [cx, cy].map((each) => each.baseVal.value))"
    )
    expected = [((x + MARGIN_M) * PX_PER_M, (-1.0 + MARGIN_M) * PX_PER_M) for x in (0.0, SPACING_M)]
    assert lamps == [pytest.approx(each, abs=0.1) for each in expected]
    fields = site.get_by_role("group", name="Mark 1")
    column, row = fields.get_by_label("column [px]"), fields.get_by_label("row [px]")
    page.get_by_role("button", name=re.compile("^Mark 1:")).focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Shift+ArrowDown")
    expect(column).to_have_value(str(int(MARKS[0]["x_px"]) + 1))
    expect(row).to_have_value(str(int(MARKS[0]["y_px"]) + 10))
    expect(told).not_to_contain_text("± 0.03")
    site.get_by_role("button", name="Undo").click()
    expect(row).to_have_value(str(int(MARKS[0]["y_px"])))
    site.get_by_role("button", name="Undo").click()
    page.get_by_role("button", name="Site", exact=True).click()
    site.get_by_role("button", name="Add a walkway").click()
    walkway = site.get_by_role("group", name="walkway 1")
    expect(walkway.get_by_label("near edge [m]")).to_have_value("6")
    edge = page.get_by_role("button", name="Edge of walkway 1: 8 m")
    edge.scroll_into_view_if_needed()
    box, canvas = edge.bounding_box(), site.locator(".roi-canvas").bounding_box()
    per_m = PX_PER_M * canvas["width"] / 608
    drag(page, box["x"] + box["width"] / 2, box["y"] + box["height"] / 2, down=per_m)
    assert float(walkway.get_by_label("width [m]").input_value()) == pytest.approx(3.0, abs=2.0 / per_m)
    site.get_by_role("button", name="Add an area").click()
    outline = [(5.0, -3.0), (25.0, -3.0), (22.0, 9.5)]
    for x, y in outline:
        place = {"x": (x + MARGIN_M) * per_m, "y": (y + MARGIN_M) * per_m}
        site.locator(".roi-canvas").click(position=place)
    expect(site.get_by_role("group", name="area 1, corner 3")).to_be_visible()
    check_access(page)
    look(page, "road-site")
    site.get_by_role("button", name="Save").click()
    expect(page.get_by_text("Saved. Evaluate the road")).to_be_visible()
    kept = house.get(f"/v1/roads/{road['id']}")["site"]
    assert [each["name"] for each in kept["strips"]] == ["1", "2", "walkway 1"]
    corners = kept["areas"][0]["corners_m"]
    assert corners == [pytest.approx(each, abs=2.0 / per_m) for each in outline]


@pytest.mark.usefixtures("road")
def test_a_road_is_stated_by_hand_with_marks_on_its_picture(road_page):
    page = road_page
    page.goto("/roads")
    settle(page)
    page.get_by_role("button", name="New road…").click()
    check_access(page, DIALOG)
    for label, value in (
        ("Name", "Mill Road"),
        ("Lane width [m]", "3"),
        ("Row of luminaires from the kerb [m]", "-1"),
        ("Power of one spacing [W]", "90"),
    ):
        page.get_by_label(label, exact=True).fill(value)
    page.get_by_label("Class").select_option("EN 13201-2:2015|C4")
    page.get_by_label("Lamps", exact=True).select_option("led")
    page.get_by_role("button", name="Register").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("Mill Road")
    settle(page)
    expect(page.locator("#flags")).to_have_text("No flags yet")
    page.get_by_role("button", name="Add a frame…").click()
    adds = page.get_by_role("dialog").get_by_role("button", name="Add", exact=True).first
    expect(adds).to_be_visible()
    check_access(page, DIALOG)
    adds.click()
    site = page.locator("#site")
    expect(site.get_by_role("status")).to_contain_text("4 of 4 are left")
    expect(site.get_by_role("button", name="Save")).to_be_disabled()
    for number, (x, y) in enumerate(((0, 0), (30, 0), (30, 6), (0, 6)), start=1):
        fields = site.get_by_role("group", name=f"Mark {number}")
        expect(fields.get_by_label("along [m]")).to_have_value(str(x))
        mark = next(each for each in MARKS if (each["x_m"], each["y_m"]) == (x, y))
        fields.get_by_label("column [px]").press("ControlOrMeta+a")
        page.keyboard.type(str(mark["x_px"]))
        page.keyboard.press("Tab")
        page.keyboard.type(str(mark["y_px"]))
        page.keyboard.press("Tab")
    expect(site.get_by_role("status")).to_contain_text(re.compile(r"Placed by 4 marks, to ± 0\.\d+ m"))
    page.get_by_role("button", name="Enter readings…").click()
    lines = [f"{p['name']},{p['x_m']},{p['y_m']},illuminance,lx,{p['values'][0]}" for p in list_points(None)]
    page.get_by_label("Table").fill("\n".join(["name,x_m,y_m,quantity,unit,value", *lines]))
    page.get_by_role("dialog").get_by_role("button", name="Save").click()
    expect(page.locator("#points").get_by_role("row")).to_have_count(9)
    page.get_by_role("button", name="Evaluate").click()
    expect(page.locator("#verdict")).to_contain_text("class C4")
    expect(page.locator("#figures")).to_contain_text("Power density")
    expect(page.locator("#under")).to_contain_text("LED, dry")


def test_lanes_that_were_measured_become_a_road(road_page, house, road):
    page, frame_id = road_page, road["frames"][0]["frame_id"]
    corners = [MARKS[at] for at in (0, 4, 5, 1)]
    grid = {
        "corners": [[each["x_px"], each["y_px"]] for each in corners],
        "lanes": 2,
        "lane_width_m": 3.0,
        "spacing_m": SPACING_M,
    }
    made = house.finish("/v1/measurements", {"frame_id": frame_id, "grid": grid})
    page.goto(f"/measurements/{made['measurement_id']}")
    settle(page)
    page.get_by_role("link", name="Evaluate as a road").click()
    for label, value in (("Lanes", "2"), ("Lane width [m]", "3"), ("Spacing of luminaires [m]", "30")):
        expect(page.get_by_label(label, exact=True)).to_have_value(value)
    page.get_by_label("Name", exact=True).fill("Mill Road")
    page.get_by_role("button", name="Register").click()
    expect(page.locator("#site").get_by_role("status")).to_contain_text("Placed by 4 marks")
    newest = house.get("/v1/roads")["items"][0]
    placed = [
        {name: each[name] for name in ("x_px", "y_px", "x_m", "y_m")} for each in newest["frames"][0]["marks"]
    ]
    assert (newest["frames"][0]["frame_id"], placed) == (frame_id, corners)
