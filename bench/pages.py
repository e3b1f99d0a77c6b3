"""A campaign of a thousand frames in a real browser: from the navigation until a click is answered."""

import os
import shutil
from pathlib import Path

from playwright.sync_api import Browser, StorageState, ViewportSize, sync_playwright

from bench.filling import copy_frame, read_frame
from bench.report import judge_seconds, say, show_times
from bench.subject import Scale
from bench.timing import Seconds
from bench.upload import KEY, Service
from worker.context import Context

PAGE = "the campaign's page, nothing cached"
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
SIZE: ViewportSize = {"width": 1440, "height": 900}
_LIMIT_S = 1.0
_SMALL = Scale(rows=480, cols=640)
# The first frame that is drawn is clicked; what the click opens must have been drawn as well.
_ANSWERED = """() => new Promise((done) => {
    const look = () => {
        document.querySelector("#frame-list .cell")?.click();
        if (document.querySelector("dialog[open]")) {
            requestAnimationFrame(() => setTimeout(() => done(performance.now())));
        } else requestAnimationFrame(look);
    };
    look();
})"""


def run(scale: Scale, service: Service, worker: Context, folder: Path) -> list[bool]:
    """Open the page in a new browser profile each round: scripts and styles are loaded and compiled again."""
    say(f"\nopening a campaign of {scale.frames:,} frames in a browser")
    chromium = find_chromium()
    if chromium is None:
        say("  skipped: there is no Chromium on the path; STILB_CHROMIUM names one")
        return []
    with sync_playwright() as playwright:
        frame = read_frame(_SMALL, service, worker, folder)
        copy_frame(worker, frame.id, scale.frames)
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        seconds = _open_pages(
            browser, f"{service.url}/campaigns/{frame.raw['campaign_id']}", service, scale.rounds
        )
        browser.close()
    show_times({PAGE: seconds})
    return [judge_seconds("from the navigation to a frame's answer", seconds, at_most_s=_LIMIT_S)]


def find_chromium() -> str | None:
    named = os.environ.get("STILB_CHROMIUM")
    return named or shutil.which("chromium-headless-shell") or shutil.which("chromium")


def _open_pages(browser: Browser, address: str, service: Service, rounds: int) -> Seconds:
    session = sign_in(browser, service)
    return [_open_page(browser, address, session) for _ in range(rounds + 1)][1:]


def sign_in(browser: Browser, service: Service) -> StorageState:
    with browser.new_context(base_url=service.url) as context:
        page = context.new_page()
        page.goto("/sign-in")
        page.get_by_label("Key").fill(KEY)
        page.get_by_role("button", name="Sign in").click()
        page.wait_for_url("**/")
        return context.storage_state()


def _open_page(browser: Browser, address: str, session: StorageState) -> float:
    with browser.new_context(storage_state=session, viewport=SIZE) as context:
        page = context.new_page()
        page.goto(address, wait_until="commit")
        return float(page.evaluate(_ANSWERED)) / 1e3
