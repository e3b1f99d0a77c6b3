"""A version of every method, fitted from frames: its page, and what its camera's page then draws."""

import pytest
from playwright.sync_api import expect

from radiometry.methods import get_method
from tests.support.browser import check_access, look, open_folds, settle, sign_in, visit
from tests.support.every_method import make_version
from tests.support.house import House

METHODS = ("reflectance", "vignetting", "sharpness", "geometry", "noise")


class Afar(House):
    """The same calls to a running service, whose worker works by itself."""

    def __init__(self, team, folder):
        self.client, self.http, self.folder = team.client, team.http(), folder

    def __enter__(self):
        self.http.__enter__()
        return self

    def __exit__(self, *error):
        self.http.__exit__(*error)

    def work(self):
        for job in self.client.jobs():
            self.client.wait(job)


@pytest.mark.parametrize("method", METHODS)
def test_a_version_is_shown_and_published_and_stands_on_its_camera_s_page(service, browser, tmp_path, method):
    label = get_method(method).label
    with service.team() as team, Afar(team, tmp_path) as house:
        version = make_version(house, method)
        published = {"valid_from": "2018-01-01T00:00:00Z", "reason": "first"}
        with visit(browser, service.url) as context:
            page = sign_in(context, team.key)
            page.goto(f"/calibrations/{version['id']}")
            settle(page)
            expect(page.get_by_role("heading", level=1)).to_have_text(f"{label} version 1")
            for figure in version["key_figures"]:
                expect(page.locator(".key-figures")).to_contain_text(figure["label"])
            expect(page.locator("#coefficients table")).to_be_hidden()
            open_folds(page)
            shown = page.locator(".plot-card .chart")
            expect(shown.first).to_be_visible()
            # those that this version has nothing for are gone: linearity
            assert shown.count() in {len(get_method(method).plots), len(get_method(method).plots) - 1}
            certificate = (
                page.locator("#version-status").get_by_role("link", name="PDF").get_attribute("href")
            )
            assert page.request.get(certificate).body().startswith(b"%PDF-")
            expect(page.locator("#points").get_by_role("row")).not_to_have_count(0)
            if version["inputs"].get("panels"):
                reflecting = page.locator("#made").get_by_role(
                    "row", name=version["inputs"]["panels"][0]["serial"]
                )
                expect(reflecting.first).to_contain_text(version["inputs"]["panels"][0]["measured_on"])
                expect(reflecting.first.get_by_role("cell").last).to_have_text("yes")
            check_access(page)
            look(page, f"calibration-{method}")
            house.post(f"/v1/calibrations/{version['id']}/publish", published, status=200)
            page.goto(f"/cameras/{version['camera_id']}")
            settle(page)
            expect(page.locator("#in-force")).to_contain_text(label)
            look(page, f"camera-{method}")
            page.goto(f"/campaigns/{version['campaign_id']}")
            settle(page)
            expect(page.get_by_role("heading", name="Checklist")).to_have_count(0)
            expect(page.locator("#frame-list").get_by_role("row")).not_to_have_count(0)
            look(page, f"campaign-{method}")
