"""A rig on its pages: registered from campaigns taken together, oriented, published and handed out."""

import re

import numpy as np
import pytest
from playwright.sync_api import expect

from simulation.boards import draw_boards
from tests.browser.test_every_method import Afar
from tests.browser.test_every_page import check_both
from tests.support.browser import check_access, look, settle
from tests.support.rigs import BOARD, RIG, photograph

SERIALS = ("R0", "R1")


@pytest.fixture
def made(team, tmp_path):
    """The campaign and the draft of each camera."""
    with Afar(team, tmp_path) as house:
        cameras = [house.camera(serial=serial) for serial in SERIALS]
        poses = draw_boards(RIG, BOARD, np.random.default_rng(4), count=4)
        scenes = [f"trigger-{number}" for number in range(4)]
        yield [
            photograph(house, camera, number, poses, scenes=scenes, publish=False)
            for number, camera in enumerate(cameras)
        ]


def test_a_rig_is_registered_oriented_and_handed_out(page, team, made):
    (campaign, _), _ = made
    page.goto(f"/campaigns/{campaign['id']}")
    settle(page)
    page.get_by_role("link", name="Rigs").click()
    settle(page)
    expect(page.get_by_text("No rigs yet")).to_be_visible()
    boxes = page.get_by_role("checkbox")
    expect(boxes).to_have_count(2)
    expect(page.get_by_role("radio", checked=True)).to_have_attribute("value", campaign["id"])
    check_access(page)
    look(page, "rigs-new")
    for place in range(2):
        boxes.nth(place).uncheck()
    page.get_by_label("Name").fill("Four Vision")
    page.get_by_role("button", name="Register the rig").click()
    expect(page.get_by_role("alert")).to_contain_text("two cameras or more")
    for place in range(2):
        boxes.nth(place).check()
    page.get_by_role("button", name="Register the rig").click()
    page.wait_for_url("**/rigs/rig_*calibration_id*")
    settle(page)
    expect(page.locator("#said")).to_contain_text("Made from drafts")
    expect(page.locator("#orientation").get_by_role("row")).to_have_count(2)
    check_published_rig(page, team, page.url.partition("?")[0], made)


def check_published_rig(page, team, address, made):
    for _, version in made:
        team.client.publish(version, valid_from="2026-01-01T00:00:00Z", reason="rig")

    page.goto(address)
    settle(page)
    expect(page.get_by_role("heading", level=1)).to_have_text("Four Vision")
    expect(page.locator("#said")).to_have_text("")
    expect(page.locator("#cameras").get_by_role("row").filter(has_text="R0")).to_contain_text("reference")
    expect(page.locator("#orientation")).to_contain_text("4 triggers")
    expect(page.locator("#orientation")).to_contain_text(re.compile(r"Yaw \[°\].*5\.\d+ ± 0\.\d+", re.DOTALL))
    # no quantity is cut off
    assert page.locator("#orientation table").evaluate(
        "table => table.parentElement.scrollWidth <= table.parentElement.clientWidth"
    )
    expect(page.locator("#flags")).to_contain_text("few_triggers".replace("_", " "))
    stability = page.locator("#stability").get_by_role("row")
    expect(stability).to_have_count(7)
    expect(stability.filter(has_text="yaw")).to_contain_text("cannot tell")
    expect(page.locator("#pictures").get_by_role("row")).to_have_count(9)
    page.get_by_label("Accepted change [°]").fill("0.5")
    with page.expect_request("**/orientation?*tolerance_deg=0.5*"):
        page.get_by_label("Accepted change [°]").blur()
    settle(page)
    check_both(page)
    look(page, "rig")
    check_exports(page)

    page.goto(f"/cameras/{made[0][0]['camera_id']}")
    settle(page)
    page.locator("#rigs").get_by_role("link", name="Four Vision").click()
    expect(page).to_have_url(address)
    page.goto("/rigs")
    settle(page)
    expect(page.get_by_role("row").filter(has_text="Four Vision")).to_contain_text("R1")
    look(page, "rigs")


def check_exports(page):
    with page.expect_download() as caught:
        page.locator("#exports").get_by_role("link", name="OpenCV").click()
    assert "covariance_1" in caught.value.path().read_text()
