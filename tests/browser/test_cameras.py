"""Cameras as people see them: what is in force, drift, history, and whether several can share."""

import re

import pytest
from playwright.sync_api import expect

from tests.support.browser import Held, check_access, look, settle
from tests.support.furnishing import SERIALS, furnish


@pytest.fixture
def cameras(service, team):
    return furnish(service.database, team.key)


def test_the_list_says_what_is_in_force_and_leads_on(page, cameras):
    page.goto("/cameras")
    settle(page)
    rows = page.get_by_role("row")
    expect(rows).to_have_count(1 + len(SERIALS))
    newest = rows.filter(has_text=SERIALS[0])
    expect(newest).to_contain_text("2026-05-03")
    expect(newest).to_contain_text("1 flag")
    expect(newest).to_contain_text("ISO 100 31.70 ± 0.42")
    untraced = rows.filter(has_text=SERIALS[1])
    expect(untraced).to_contain_text("relative only")
    expect(untraced).not_to_contain_text("±")
    expect(rows.filter(has_text=SERIALS[2])).to_contain_text("none")
    newest.get_by_role("link", name="DJI FC6520").click()
    expect(page).to_have_url(re.compile(f"/cameras/{cameras[0]}$"))


def test_a_camera_shows_its_coefficients_its_drift_and_who_decided(page, cameras):
    page.goto(f"/cameras/{cameras[0]}")
    settle(page)
    expect(page.get_by_role("heading", level=1)).to_have_text(f"FC6520 {SERIALS[0]}")
    in_force = page.locator("#in-force").get_by_role("row")
    expect(in_force).to_have_count(5)
    expect(in_force.filter(has_text="ISO 100")).to_contain_text("31.70 ± 0.21 DN·m²/(cd·s)")
    expect(in_force.filter(has_text="ISO 6400")).to_contain_text("noise high")
    expect(page.locator("#drift-plot .chart")).to_be_visible()
    stability = page.locator("#drift-said").get_by_role("row")
    expect(stability).to_have_count(5)
    expect(stability.filter(has_text="ISO 1600")).to_contain_text(re.compile("stable|drifts|cannot tell"))
    decisions = page.locator("#history").get_by_role("row")
    expect(decisions).to_have_count(7)
    expect(decisions.filter(has_text="after the lens was cleaned")).to_contain_text("first")
    look(page, "camera")


def test_what_was_in_force_is_told_as_known_then_and_the_address_holds_it(page, cameras, team):
    page.goto(f"/cameras/{cameras[0]}")
    page.get_by_role("link", name="Coefficients in time").click()
    answer, at, known = (
        page.locator("#answer"),
        page.get_by_label("In force at").first,
        page.get_by_label("Known at").first,
    )
    expect(answer).to_contain_text("version 3 is in force")
    at.fill("2025-08-20 22:00")
    at.press("Enter")
    expect(answer).to_contain_text("version 2 is in force. Luminance K, ISO 100 = 32.25 ± 0.21")
    settle(page)
    page.locator("#values .cursor:not(.known)").press("ArrowRight")
    expect(at).to_have_value("2025-08-21 22:00")
    page.locator("h1").click()
    page.keyboard.press("]")
    expect(at).to_have_value("2026-05-03 20:00")
    page.keyboard.press("[")
    expect(at).to_have_value("2025-05-03 20:00")
    expect(answer).to_contain_text("version 2 is in force")
    before = page.locator("#request").inner_text().split("known_at=")[1]
    version = team.client.history(cameras[0], state="superseded")
    team.client.revoke(next(each.id for each in version if each.version == 2), reason="the lamp drifted")
    page.reload()
    expect(answer).to_contain_text("no version is in force. Version 2 was revoked on")
    expect(answer).to_contain_text("the lamp drifted")
    expect(answer).to_contain_text("Nearest: version 1 (until 2025-05-03) and version 3 (from 2026-05-03)")
    expect(page.locator("#lives .point.s5").first).to_be_visible()
    check_access(page)
    look(page, "coefficients")
    known.fill(before)
    known.press("Enter")
    expect(answer).to_contain_text("version 2 is in force")
    kept = page.url
    page.goto("/cameras")
    page.goto(kept)
    expect(known).to_have_value(before)
    expect(answer).to_contain_text("version 2 is in force")


def test_a_time_typed_before_the_page_has_loaded_is_kept(page, cameras):
    slow = Held(page, "**/decisions", times=1)
    page.goto(f"/cameras/{cameras[0]}/coefficients")
    at, later = page.get_by_label("In force at").first, page.get_by_label("Known at").first
    at.fill("2024-12-01 12:00")
    at.press("Enter")
    later.type("now-1")
    slow.release().continue_()
    expect(page.locator("#answer")).to_contain_text("On 2024-12-01 12:00 UTC, as known now")
    expect(later).to_have_value("now-1")


@pytest.mark.parametrize("context", ["phone"], indirect=True)
def test_a_point_of_the_drift_tells_its_value_where_it_is_touched(page, cameras):
    page.goto(f"/cameras/{cameras[0]}")
    settle(page)
    page.locator("#drift-plot").scroll_into_view_if_needed()
    box = page.locator('#drift-plot .point.s0[data-told^="version 2"]').bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    tip = page.locator(".tip").filter(has_text="ISO 100 ")
    expect(tip).to_contain_text("version 2, ISO 100")
    expect(tip).to_contain_text("32.25 ± 0.21 DN·m²/(cd·s)")


def test_a_camera_is_registered_from_the_page(page, service):
    page.goto("/cameras")
    settle(page)
    expect(page.get_by_text("No cameras yet")).to_be_visible()
    page.locator("#add-camera").click()
    dialog = page.get_by_role("dialog")
    check_access(page)
    for label, value in {"Make": "DJI", "Model": "FC6520", "Serial number": "0K1XE8"}.items():
        dialog.get_by_label(label, exact=True).fill(value)
    dialog.get_by_label("Pixel pitch [µm]").fill("3,28")
    dialog.get_by_role("button", name="Register").click()
    expect(page.get_by_role("row").filter(has_text="0K1XE8")).to_contain_text("none")

    # what is wrong is told in the dialog, and nothing that was typed is lost
    page.locator("#add-camera").click()
    for label in ("Make", "Model", "Serial number", "Lens make"):
        dialog.get_by_label(label, exact=True).fill("x")
    dialog.get_by_role("button", name="Register").click()
    expect(dialog.get_by_role("alert")).to_contain_text("lens.model: is missing")
    expect(dialog.get_by_label("Make", exact=True)).to_have_value("x")
    page.keyboard.press("Escape")
    expect(dialog).to_have_count(0)

    # the camera of another organisation is not there
    with service.team() as other:
        (foreign, *_) = furnish(service.database, other.key)
    page.goto(f"/cameras/{foreign}")
    expect(page.get_by_role("heading", level=1)).to_have_text("Not found")
    # the browser itself notes the 422 and the 404
    page.context.complaints.clear()


@pytest.mark.usefixtures("cameras")
def test_the_fleet_is_judged_and_the_answer_is_said_in_words(page):
    page.goto("/fleet")
    settle(page)
    page.get_by_role("checkbox", name=SERIALS[2]).uncheck()
    page.get_by_label("Accepted deviation").fill("5")
    page.get_by_role("button", name="Compare").click()
    answer = page.locator("#fleet-answer")
    expect(answer.get_by_role("heading", level=2)).to_have_text("Verdict")
    expect(answer.get_by_role("row")).to_have_count(5)
    # two cameras with three and two versions, each coefficient a part
    expect(answer.locator(".chart .point[data-told]")).to_have_count(5)
    answer.get_by_role("button", name="Luminance K, ISO 6400").click()
    expect(answer.get_by_role("button", name="Luminance K, ISO 6400")).to_have_attribute(
        "aria-pressed", "true"
    )
    settle(page)
    check_access(page)
    look(page, "fleet")
    # what stands beside another question answers that one
    page.get_by_label("Accepted deviation").fill("0.01")
    expect(answer).to_be_empty()
    page.get_by_role("button", name="Compare").click()
    expect(answer.locator(".note")).to_contain_text("Luminance K at ISO")
