"""Reflectance on the pages: from a card to what is in force for a day, and what files say of their panel."""

import re
import shutil

from playwright.sync_api import expect

from tests.service.test_found_panels import state_panel
from tests.support.browser import check_access, complete_certificate, look, settle
from tests.support.data import data_file

REGION = ((600, 440), (680, 440), (680, 520), (600, 520))
IMAGE = "0000SET_000_IMG_0000_1.tif"


def draw(page, corners):
    """Click the corners on the preview, and the first one again."""
    canvas = page.locator(".roi-canvas")
    expect(canvas.locator("image").first).to_be_visible()
    canvas.scroll_into_view_if_needed()
    across, down = canvas.evaluate("svg => [svg.viewBox.baseVal.width, svg.viewBox.baseVal.height]")
    box = canvas.bounding_box()
    scale = min(box["width"] / across, box["height"] / down)
    left, top = (box["width"] - across * scale) / 2, (box["height"] - down * scale) / 2
    for x, y in (*corners, corners[0]):
        canvas.click(position={"x": left + x * scale, "y": top + y * scale})


def test_a_card_of_a_multispectral_camera_becomes_what_is_in_force_for_its_day(page, team, tmp_path):
    panel = tmp_path / "card" / "panel"
    panel.mkdir(parents=True)
    for band in ("GRE", "RED"):
        shutil.copy(data_file(f"sequoia/IMG_180413_080658_0000_{band}.TIF"), panel)
    page.goto("/")
    with page.expect_file_chooser() as chooser:
        page.get_by_role("button", name="Choose folder").click()
    chooser.value.set_files(tmp_path / "card")
    page.get_by_role("radio", name="New reflectance calibration").check()
    page.get_by_label("Role of scene 1").select_option("panel")
    page.get_by_role("button", name="Create campaign and send").click()
    page.locator("#before").get_by_role("button", name="Choose panel…").click()
    dialog = page.get_by_role("dialog", name="Register a panel")
    for label, text in (
        ("Serial number", "P-18"),
        ("Measured on", "2018-03-01"),
        ("Reflectance", "green 0.183 0.002\nred 0.181 0.002"),
    ):
        dialog.get_by_label(label).fill(text)
    look(page, "reflectance-panel")
    dialog.get_by_role("button", name="Register").click()
    expect(dialog).to_have_count(0)
    draw(page, REGION)
    page.get_by_role("button", name="Use for all frames").click()
    expect(page.get_by_text("Nothing is missing.")).to_be_visible()
    page.get_by_role("button", name="Fit K").last.click()
    page.wait_for_url(re.compile("/calibrations/cal_"))
    settle(page)
    complete_certificate(page)
    page.get_by_role("button", name="Publish…").click()
    dialog = page.get_by_role("dialog", name="Publish version")
    for label, day in (("In force from", "2018-04-13"), ("Until", "2018-04-14")):
        dialog.get_by_label(re.compile(f"^{label}")).fill(f"{day}T00:00")
    dialog.get_by_label("Reason", exact=True).fill("panel before the flight")
    dialog.get_by_role("button", name="Publish", exact=True).click()
    expect(page.locator("#version-status")).to_contain_text("published")
    (version,) = team.client.history(team.client.find_camera("PI040378AA6C000181").id)
    page.goto(f"/cameras/{version.camera_id}")
    page.get_by_role("link", name="Coefficients in time").click()
    settle(page)
    page.get_by_role("textbox", name="In force at").fill("2018-04-13 12:00")
    page.keyboard.press("Enter")
    settle(page)
    page.get_by_label("Show", exact=True).select_option(label="Reflectance K, band red")
    expect(page.locator("#values-title")).to_contain_text("band red")
    in_force = re.compile(r"version 1 is in force. Reflectance K, band red.* = [\d.]+ ± [\d.]+")
    expect(page.locator("#answer")).to_contain_text(in_force)
    look(page, "reflectance-coefficients")
    page.goto("/")
    settle(page)
    expect(page.get_by_text("A camera is not calibrated")).to_have_count(0)


def test_the_panel_that_the_frames_show_is_named_by_one_click(page, team):
    camera = team.client.create_camera("MicaSense", "RedEdge", "1777777")
    campaign = team.client.create_campaign(camera.id, method="reflectance")
    content = state_panel(data_file(f"rededge/{IMAGE}").read_bytes(), 0.67)
    with team.http() as http:
        path = f"/v1/campaigns/{campaign.id}/frames?role=panel&filename={IMAGE}"
        assert http.post(path, content=content).status_code == 201
    team.client.wait_for(campaign.id, timeout_s=60)
    page.goto(f"/campaigns/{campaign.id}")
    settle(page)
    expect(page.get_by_text("Its files state blue 0.67.")).to_be_visible()
    page.get_by_role("button", name="Use panel RP02-1603036-SC").click()
    expect(page.get_by_role("button", name="Use panel")).to_have_count(0)
    panel = team.client.panel(team.client.campaign(campaign.id).raw["panel_id"])
    assert [band["origin"] for band in panel.raw["bands"]] == ["file"]


def test_a_region_that_was_found_says_so_and_gives_way_to_a_drawn_one(page, team, service):
    camera = team.client.create_camera("MicaSense", "RedEdge", "1777777")
    campaign = team.client.create_campaign(camera.id, method="reflectance")
    sent = team.client.push(campaign.id, data_file(f"rededge/{IMAGE}"), role="panel")
    service.wait_for_jobs([sent.id])
    page.goto(f"/campaigns/{campaign.id}")
    settle(page)
    expect(page.locator("#overview")).to_contain_text("1 frame found on the panel")
    page.locator(f'[data-id="{sent.id}"]').click()
    dialog = page.get_by_role("dialog")
    expect(dialog).to_contain_text("found by the code of panel RP02-1603036-SC")
    dialog.get_by_role("button", name="Draw another region").click()
    region = page.locator("#region")
    expect(region).to_contain_text("region is shown, found by the code of panel RP02-1603036-SC")
    expect(region.get_by_role("button", name="Corner 4 of 4")).to_be_visible()
    page.evaluate("scrollTo(0, 0)")
    check_access(page)
    look(page, "campaign-found")
    page.get_by_role("button", name="Rectangle").click()
    page.get_by_role("button", name="Use for this frame").click()
    expect(region).to_contain_text("own region is shown. To replace it")
    assert team.client.frame(sent.id).raw["roi_origin"] == "drawn"
    flown = team.client.push(
        campaign.id, data_file(f"rededge/{IMAGE.replace('0000_1', '0001_1')}"), role="field"
    )
    service.wait_for_jobs([flown.id])
    page.goto(f"/measurements/new?frame={flown.id}")
    settle(page)
    expect(page.get_by_role("radio", name="New region")).to_be_visible()
    # of what is lit by the sun nobody asks for lanes, and a grid would be refused
    expect(page.get_by_role("radio", name="Lane grid")).to_be_hidden()
