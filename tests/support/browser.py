"""A browser that looks at the pages as people do: its console is quiet, its pictures are kept, axe asked."""

import os
import re
import shutil
import subprocess
import time
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path

from axe_playwright_python.base import AXE_SCRIPT
from PIL import Image
from playwright._impl._driver import compute_driver_executable
from playwright.sync_api import Browser, BrowserContext, Locator, Page, Playwright, Response, Route, expect

from tests.support.processes import wait_until

WIDTHS = {"desktop": (1440, 900), "phone": (390, 844)}
CHROMIUM = (
    os.environ.get("STILB_CHROMIUM")
    or shutil.which("chromium-headless-shell")
    or shutil.which("chromium")
    or "/usr/bin/chromium-headless-shell"
)
PICTURES = os.environ.get("STILB_PICTURES")
ILLUSTRATIONS = os.environ.get("STILB_ILLUSTRATIONS")
_ARGUMENTS = [
    *("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
]
# a loaded machine is slow, and not wrong: this passes as soon as what is expected is there
_PATIENCE_MS = 30_000
DIALOG = "dialog[open]"
_COLOURS = {"type": "rule", "values": ["color-contrast"]}
_LINES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]

expect.set_options(timeout=_PATIENCE_MS)


def find_missing() -> str:
    """Return what this machine lacks to show pages, and how it gets it; empty if nothing."""
    if not Path(CHROMIUM).is_file():
        return f"no Chromium at {CHROMIUM}: apt-get install chromium-headless-shell, or set STILB_CHROMIUM"
    driver = [compute_driver_executable()[0], "--version"]
    started = subprocess.run(driver, check=False, capture_output=True).returncode == 0
    return "" if started else "Playwright does not start: apt-get install libatomic1"


def launch(playwright: Playwright, *, scroll_bars: bool = False) -> Browser:
    """Start a browser; with ``scroll_bars`` they take room, except in pictures, which they would cut."""
    shown = ["--hide-scrollbars"] if scroll_bars and not PICTURES else []
    return playwright.chromium.launch(
        executable_path=CHROMIUM, args=_ARGUMENTS, headless=True, ignore_default_args=shown
    )


@contextmanager
def visit(browser: Browser, url: str, *, width: str = "desktop", **settings):
    """A browser context of its own at one of the widths; an error in the console of any of its pages fails.

    What a test provokes on purpose it takes off ``context.complaints`` itself.
    """
    across, down = WIDTHS[width]
    size = {"width": across, "height": down}
    context = browser.new_context(base_url=url, viewport=size, reduced_motion="reduce", **settings)
    context.complaints = []
    context.on("console", lambda said: said.type == "error" and context.complaints.append(said.text))
    context.on("weberror", lambda raised: context.complaints.append(str(raised.error)))
    failing = []
    context.on("response", lambda answer: answer.status >= 400 and failing.append(_name_answer(answer)))
    context.set_default_timeout(_PATIENCE_MS)
    try:
        yield context
        assert context.complaints == [], f"{context.complaints}, answers: {failing}"
    finally:
        context.close()


def _name_answer(answer: Response) -> str:
    return f"{answer.request.method} {answer.url}: {answer.status}"


def sign_in(context: BrowserContext, key: str, at: str = "") -> Page:
    """A page of who has sent the form, which test_signing_in.py fills in; empty, or at an address."""
    answer = context.request.post("/sign-in", form={"key": key}, max_redirects=0)
    assert answer.status == 303, answer.text()
    page = context.new_page()
    if at:
        page.goto(at)
    return page


# those in which a scroll bar takes room
SCROLL_BARS = """elements => elements
    .filter(each => {
        const { borderTopWidth, borderBottomWidth, display } = getComputedStyle(each);
        const borders = parseFloat(borderTopWidth) + parseFloat(borderBottomWidth);
        return display !== "inline" && each.offsetHeight - each.clientHeight > borders + 1;
    })
    .map(each => each.outerHTML.slice(0, 80))"""

# those whose size is not that of their drawing, as a rule for another element of their class would have it
MISDRAWN = """parts => parts
    .filter(each => Math.abs(each.getBBox().width - each.getAttribute("width")) > 1)
    .map(each => each.outerHTML.slice(0, 80))"""


def settle(page: Page) -> None:
    """Wait until nothing on the page says that it loads."""
    expect(page.locator("[aria-busy=true]")).to_have_count(0)


def open_folds(page: Page) -> None:
    """Open all that a page folds, as somebody does who reads it whole."""
    page.locator("main details").evaluate_all("folds => folds.forEach((each) => (each.open = true))")
    settle(page)


def complete_certificate(page: Page) -> None:
    """Enter what a certificate needs and a draft still lacks: who signs, once, and the customer."""
    needed = page.locator("#lacking").get_by_role("listitem").filter(has_text="needed")
    for button, typed in (
        ("State your name", {"Person": "A. Meier", "Role": "physicist"}),
        ("Fill in", {"Customer": "City of Mill", "Place": "Photometry lab"}),
    ):
        if (mends := needed.get_by_role("button", name=button)).count():
            mends.click()
            for label, text in typed.items():
                page.get_by_role("dialog").get_by_label(label).fill(text)
            page.get_by_role("dialog").get_by_role("button", name="Save").click()
            expect(mends).to_have_count(0)


class Held(list[Route]):
    """Requests that are held back, in the order in which they were made."""

    def __init__(self, page: Page, address: str | re.Pattern[str], **times: int):
        self._page = page
        page.route(address, lambda route: self.append(route), **times)  # noqa: PLW0108 (its handlers keep marks)

    def release(self) -> Route:
        """Wait for the next one, which the test then answers."""
        deadline = time.monotonic() + _PATIENCE_MS / 1000
        while not self:
            assert time.monotonic() < deadline, f"{self._page.url} never asked for what is held back"
            self._page.wait_for_timeout(20)
        return self.pop(0)


def look(page: Page, name: str, folder: Path | None = None) -> None:
    """Nothing sticks out at either width; with STILB_PICTURES, a folder, the pictures are kept there.

    ``folder`` is for a test that wants them itself.
    """
    into = folder or (Path(PICTURES) if PICTURES else None)
    before = page.viewport_size
    for label, (width, height) in WIDTHS.items():
        page.set_viewport_size({"width": width, "height": height})
        across, room = page.evaluate(
            "(({ scrollWidth, clientWidth }) => [scrollWidth, clientWidth])(document.documentElement)"
        )
        assert across <= room, f"{name} is {across} px wide in {room} px"
        assert page.locator("header.top, header.top *, .tabs").evaluate_all(SCROLL_BARS) == [], name
        # a chart is drawn anew a moment after its place has another width
        wait_until(lambda: page.locator(".chart rect[width]").evaluate_all(MISDRAWN) == [], name)
        if into is not None:
            into.mkdir(parents=True, exist_ok=True)
            page.screenshot(path=into / f"{name}-{label}.png", full_page=True)
    page.set_viewport_size(before)


# every picture in a place has come, and every chart has the width that its place has
ALL_DRAWN = """place => [...place.querySelectorAll("img")].every(img => img.complete && img.naturalWidth)
    && [...place.querySelectorAll(".chart")].every(chart =>
        Math.abs(chart.getAttribute("width") - chart.parentElement.clientWidth) < 60)"""


def illustrate(page: Page, name: str, what: Locator | None = None) -> None:
    """With STILB_ILLUSTRATIONS, a folder: keep what is seen, or one part of it, small enough to ship."""
    if ILLUSTRATIONS is None:
        return
    page.wait_for_function(
        ALL_DRAWN, arg=what.element_handle() if what else page.locator("body").element_handle()
    )
    shown = Image.open(BytesIO((what or page).screenshot()))
    shown.thumbnail((1100, 1100))
    Path(ILLUSTRATIONS).mkdir(parents=True, exist_ok=True)
    shown.convert("RGB").save(Path(ILLUSTRATIONS) / f"{name}.webp", quality=70, method=6)


def drop(page: Page, place: Locator, paths: list[Path]) -> None:
    """Drag files and folders from the desktop onto a place, as the window system does."""
    place.scroll_into_view_if_needed()
    box = place.bounding_box()
    where = {"x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2}
    data = {"items": [], "files": [str(path) for path in paths], "dragOperationsMask": 1}
    session = page.context.new_cdp_session(page)
    for kind in ("dragEnter", "dragOver", "drop"):
        session.send("Input.dispatchDragEvent", {"type": kind, **where, "data": data})
    session.detach()


def check_access(page: Page, part: str | None = None, *, scheme: str | None = None) -> None:
    """Axe has no finding on the page or a part, in the light and, of a page that is dark, in the dark.

    A dialog is looked at in both widths. ``scheme`` looks in one scheme alone.
    """
    before = page.viewport_size
    sizes = WIDTHS.values() if part == DIALOG else [(before["width"], before["height"])]
    kept = "dark" if page.evaluate("matchMedia('(prefers-color-scheme: dark)').matches") else "light"
    # of all rules one depends on the colours
    runs = {scheme: _LINES} if scheme else {kept: _COLOURS, "light": _LINES}
    told = []
    for width, height in sizes:
        page.set_viewport_size({"width": width, "height": height})
        told += [found for each, rules in runs.items() for found in _ask_axe(page, part, each, rules)]
    page.set_viewport_size(before)
    page.emulate_media(color_scheme=kept, reduced_motion="reduce")
    assert told == [], told


def _ask_axe(
    page: Page, part: str | None, scheme: str, rules: list[str] | dict[str, object]
) -> list[tuple[str, str, list[str]]]:
    page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
    # what it would load before it looks, it would load in ways that the page's policy refuses
    more = {"label-content-name-mismatch": {"enabled": rules is _LINES}}
    options = {"resultTypes": ["violations"], "preload": False, "runOnly": rules, "rules": more}
    if not page.evaluate("'axe' in window"):
        page.evaluate(AXE_SCRIPT)
    answer = page.evaluate("([part, options]) => axe.run(part ?? document, options)", [part, options])
    return [
        (scheme, each["id"], [node["html"][:200] for node in each["nodes"]]) for each in answer["violations"]
    ]
