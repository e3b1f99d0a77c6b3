"""Every page that has an address, as the application lists them: on a phone, in the dark, for everyone."""

from string import Formatter

import pytest
from playwright.sync_api import expect

from service.http.app import PAGES
from service.tools.routes import describe_tools
from tests.support.browser import DIALOG, WIDTHS, check_access, launch, look, settle, sign_in, visit

NO_PAGES = ("/static/", "/plots/", "/docs/pictures/")
# what must be registered first, and what nobody sees who is signed in: their own tests look at them
ELSEWHERE = {"/rigs/{rig_id}", "/roads/{road_id}", "/sign-in", "/openapi.json"}


def list_pages() -> list[str]:
    paths = {route.path for router in PAGES for route in router.routes if "GET" in route.methods}
    return sorted(path for path in paths - ELSEWHERE if not path.startswith(NO_PAGES))


def list_addresses(path, night) -> list[str]:
    """The page of everything that its path can name; a new name fails until it is known here."""
    known = {
        "camera_id": [night.camera_id],
        "campaign_id": [night.campaign_id, night.measured_id],
        "calibration_id": [night.version.id],
        "measurement_id": [night.new.id],
        "tool": [*describe_tools()],
        "name": ["errors"],
    }
    query = f"?old={night.old.id}&new={night.new.id}" if path.endswith("/comparison") else ""
    names = [name for _, name, _, _ in Formatter().parse(path) if name]
    values = known[names[0]] if names else [""]
    return [path.format(**dict.fromkeys(names, value)) + query for value in values]


# What is typed or chosen, but for searches and what stands in a table under its head: each has a question
# mark, a hint or, in a bar of tools, a title. Forms in dialogs are refused by their own module.
UNEXPLAINED = """() => [...document.querySelectorAll("main :is(input, select, textarea)")]
    .filter(each => each.checkVisibility()
        && !["hidden", "search", "submit", "radio", "file"].includes(each.type)
        && !each.closest("td, th, [role=row]")
        && !each.closest(".field, fieldset, .inline-field")?.querySelector(".help, .hint")
        && !each.getAttribute("aria-describedby") && !each.title)
    .map(each => each.outerHTML.slice(0, 120))"""


@pytest.fixture(scope="module")
def phone(playwright, service, night):
    """Signed in once, in the dark, where scroll bars take room."""
    browser = launch(playwright, scroll_bars=True)
    with visit(browser, service.url, width="phone", color_scheme="dark") as context:
        yield sign_in(context, night.team.key)
    browser.close()


def check_both(page):
    """In the dark on a phone, and in the light at the width of a desk."""
    kept = page.viewport_size
    for scheme, width in (("dark", "phone"), ("light", "desktop")):
        page.set_viewport_size(dict(zip(("width", "height"), WIDTHS[width], strict=True)))
        check_access(page, scheme=scheme)
    page.set_viewport_size(kept)


def test_sign_in_is_accessible_on_a_phone_and_in_the_dark(browser, service):
    with visit(browser, service.url, color_scheme="dark") as context:
        page = context.new_page()
        page.goto("/sign-in")
        check_both(page)
        look(page, "every-sign-in")


@pytest.mark.parametrize("path", list_pages())
def test_page_is_accessible_on_a_phone_and_in_the_dark(phone, night, path):
    for address in list_addresses(path, night):
        phone.goto(address)
        expect(phone.get_by_role("heading", level=1).first).to_be_visible()
        settle(phone)
        assert phone.evaluate(UNEXPLAINED) == [], address
        check_both(phone)
        look(phone, f"every{address.partition('?')[0].replace('/', '-')}")
    if path.endswith("/coefficients"):
        phone.get_by_role("button", name="A measurement…").click()
        expect(phone.get_by_role("dialog", name="A measurement")).to_be_visible()
        check_access(phone, DIALOG)
