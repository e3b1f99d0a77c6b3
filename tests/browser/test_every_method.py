"""A version of every method: its page, and what the pages of its camera and campaign show."""

from functools import cache, partial

import pytest
from playwright.sync_api import expect

from radiometry.methods import get_method
from tests.support.browser import check_access, look, open_folds, settle, sign_in
from tests.support.every_method import make_version
from tests.support.house import House

METHODS = ("reflectance", "vignetting", "sharpness", "geometry", "noise")


class Afar(House):
    """The same calls to a running service, whose worker works by itself."""

    def __init__(self, team, folder):
        self.client, self.http, self.folder = team.client, team.http(), folder
        self.key = team.key

    def __enter__(self):
        self.http.__enter__()
        return self

    def __exit__(self, *error):
        self.http.__exit__(*error)

    def work(self):
        for job in self.client.jobs():
            self.client.wait(job)


@pytest.fixture(scope="module")
def house(service, tmp_path_factory):
    """One organisation for all methods."""
    with service.team() as team, Afar(team, tmp_path_factory.mktemp("methods")) as opened:
        yield opened


@pytest.fixture(scope="module")
def make(house):
    """Return the version of a method, which is fitted once."""
    return cache(partial(make_version, house))


@pytest.fixture
def page(context, house):
    return sign_in(context, house.key)


@pytest.mark.parametrize("method", METHODS)
def test_a_version_is_shown_with_the_plots_of_its_method(page, make, method):
    version, spec = make(method), get_method(method)
    page.goto(f"/calibrations/{version['id']}")
    settle(page)
    expect(page.get_by_role("heading", level=1)).to_have_text(f"{spec.label} version 1")
    for figure in version["key_figures"]:
        expect(page.locator(".key-figures")).to_contain_text(figure["label"])
    expect(page.locator("#coefficients table")).to_be_hidden()
    open_folds(page)
    shown = page.locator(".plot-card .chart")
    expect(shown.first).to_be_visible()
    # those that this version has nothing for are gone: linearity
    assert shown.count() in {len(spec.plots), len(spec.plots) - 1}
    expect(page.locator("#points").get_by_role("row")).not_to_have_count(0)
    for panel in version["inputs"].get("panels", [])[:1]:
        reflecting = page.locator("#made").get_by_role("row", name=panel["serial"]).first
        expect(reflecting).to_contain_text(panel["measured_on"])
        expect(reflecting.get_by_role("cell").last).to_have_text("yes")
    check_access(page)
    look(page, f"calibration-{method}")


def test_what_is_published_stands_on_the_page_of_its_camera(page, house, make):
    """One camera with two methods; their campaigns have no checklist."""
    for method in ("sharpness", "geometry"):
        version = make(method)
        published = {"valid_from": "2018-01-01T00:00:00Z", "reason": "first"}
        house.post(f"/v1/calibrations/{version['id']}/publish", published, status=200)
        page.goto(f"/campaigns/{version['campaign_id']}")
        settle(page)
        expect(page.get_by_role("heading", name="Checklist")).to_have_count(0)
        expect(page.locator("#frame-list").get_by_role("row")).not_to_have_count(0)
        look(page, f"campaign-{method}")
    page.goto(f"/cameras/{version['camera_id']}")
    settle(page)
    for label in ("Sharpness", "Geometry"):
        expect(page.locator("#in-force")).to_contain_text(label)
    plot = page.get_by_role("img", name="Plot of geometry version 1")
    plot.scroll_into_view_if_needed()
    expect(plot).not_to_have_js_property("naturalWidth", 0)
    look(page, "camera-methods")
