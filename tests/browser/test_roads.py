"""A road on its page: verdict, map, control points that are left out, and another class."""

import re

import pytest
from playwright.sync_api import expect

from tests.browser.test_every_method import Afar
from tests.browser.test_every_page import check_both
from tests.support.browser import DIALOG, check_access, look, settle
from tests.support.campaigns import published_campaign
from tests.support.roads import MARKS, evaluate, list_points, state_road, write_road_frame


@pytest.fixture
def road(team, tmp_path):
    """A road of which P3 reads twice the light that is there, evaluated."""
    with Afar(team, tmp_path) as house:
        stated = state_road(house)
        points = house.get(f"/v1/roads/{stated['id']}/points")["items"]
        points[2]["values"] = [2 * each for each in points[2]["values"]]
        assert house.http.put(f"/v1/roads/{stated['id']}/points", json=points).status_code == 200
        evaluate(house, stated)
        yield stated


def test_a_road_is_judged_on_its_page(page, road):
    page.goto("/measurements")
    settle(page)
    page.get_by_role("link", name="Roads").click()
    settle(page)
    check_both(page)
    page.get_by_role("link", name=road["name"]).click()
    settle(page)
    expect(page.locator("#verdict")).to_contain_text("Conforms against class C4")
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
    expect(page.locator("#verdict")).to_contain_text("Does not conform against class C1")
    page.get_by_role("button", name="Hidden points…").click()
    page.get_by_role("textbox", name="Points").fill("2/3-10, 2/3-9")
    page.get_by_role("dialog").get_by_role("button", name="Save").click()
    expect(page.locator("#map")).to_contain_text("58 of 60 points visible")
    for name in ("Report (PDF)", "Plan card (PDF)"):
        address = page.get_by_role("link", name=name).get_attribute("href")
        assert page.request.get(address).body().startswith(b"%PDF")


@pytest.mark.parametrize("context", ["phone"], indirect=True)
def test_on_a_telephone_the_road_runs_upward_and_the_result_comes_first(page, road):
    page.goto(f"/roads/{road['id']}")
    settle(page)
    shown = page.locator(".road-map")
    expect(shown).to_be_visible()
    box = shown.bounding_box()
    assert box["height"] > box["width"]
    assert page.locator("#figures").bounding_box()["y"] < box["y"]
    check_access(page)
    look(page, "road-phone")


def test_a_road_is_stated_by_hand_with_marks_on_its_picture(page, team, tmp_path):
    with Afar(team, tmp_path) as house:
        published_campaign(house, isos=(3200,))
        night = house.campaign(kind="measurement")
        house.upload(night, write_road_frame(tmp_path).read_bytes(), role="field")
        house.work()
    page.goto("/roads")
    settle(page)
    page.get_by_role("button", name="New road…").click()
    check_access(page, DIALOG)
    for label, value in (
        ("Name", "Mill Road"),
        ("Width of a lane [m]", "3"),
        ("Row of luminaires from the kerb [m]", "-1"),
        ("Power of one spacing [W]", "90"),
        ("Remarks", "lamps of 2024, 6 °C"),
    ):
        page.get_by_label(label, exact=True).fill(value)
    page.get_by_label("Class").select_option("EN 13201-2:2015|C4")
    page.get_by_label("Lamps", exact=True).select_option("led")
    page.get_by_role("button", name="Register").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("Mill Road")
    settle(page)
    page.get_by_role("button", name="Add a frame…").click()
    dialog = page.get_by_role("dialog", name="Frame of the road")
    picture = dialog.get_by_role("img")
    expect(picture).to_have_js_property("complete", value=True)
    check_access(page, DIALOG)
    for mark in MARKS:
        dialog.get_by_label("Along [m]").fill(str(mark["x_m"]))
        dialog.get_by_label("Across [m]").fill(str(mark["y_m"]))
        picture.scroll_into_view_if_needed()
        box = picture.bounding_box()
        share = mark["x_px"] / 608, mark["y_px"] / 224
        picture.click(position={"x": share[0] * box["width"], "y": share[1] * box["height"]})
    expect(dialog.get_by_role("listitem")).to_have_count(len(MARKS))
    dialog.get_by_role("button", name="Save").click()
    expect(dialog).to_be_hidden()
    page.get_by_role("button", name="Enter readings…").click()
    lines = [f"{p['name']},{p['x_m']},{p['y_m']},illuminance,lx,{p['values'][0]}" for p in list_points(None)]
    page.get_by_label("Table").fill("\n".join(["name,x_m,y_m,quantity,unit,value", *lines]))
    page.get_by_role("dialog").get_by_role("button", name="Save").click()
    expect(page.locator("#points").get_by_role("row")).to_have_count(9)
    page.get_by_role("button", name="Evaluate").click()
    expect(page.locator("#verdict")).to_contain_text("against class C4")
    expect(page.locator("#figures")).to_contain_text("Power density")
    expect(page.locator("#under")).to_contain_text("led, dry")
