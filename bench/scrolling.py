"""A campaign of ten thousand frames in a real browser: opened over a slow line, scrolled, and followed."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, Page, Request, StorageState, sync_playwright
from sqlalchemy import bindparam, select, update

from bench.filling import copy_frame, read_frame, review_all
from bench.pages import FLAGS, SIZE, find_chromium, sign_in
from bench.report import judge, judge_seconds, say
from bench.subject import Scale
from bench.timing import Ratio
from bench.upload import Service, open_http
from store.tables import FrameRow
from worker.context import Context

_PREVIEWED = Scale(rows=1188, cols=1584)
"""As large as the preview of any camera's frame."""
_APERTURES, _ISOS, _REPEATS = (2.8, 4.0, 5.6, 8.0), (100.0, 400.0, 1600.0), 4
_SLOW = {"offline": False, "latency": 150, "downloadThroughput": 1.6e6 / 8, "uploadThroughput": 0.75e6 / 8}
_USABLE_S, _LONGEST_MS, _MOST_NODES, _MOST_REQUESTS = 3.0, 100.0, 6000, 12
_PATIENCE_MS = 120_000

# of all that is in view, and of what is drawn around it
_PICTURES = """() => {
    const drawn = [...document.querySelectorAll(".grid img.picture")];
    return drawn.length > 0 && drawn.every((img) => img.complete && img.naturalWidth);
}"""
_FIRST = """() => new Promise((done) => {
    const look = () => {
        const img = document.querySelector(".grid img.picture");
        if (img?.complete && img.naturalWidth) done(performance.now());
        else requestAnimationFrame(look);
    };
    look();
})"""
_CELL = """() => new Promise((done) => {
    const look = () => {
        if (document.querySelector(".grid .cell")) done(performance.now());
        else requestAnimationFrame(look);
    };
    look();
})"""
_SETTLED = "() => !document.querySelector('[aria-busy=true]')"
_COMPLETE = "() => /[0-9] of this/.test(document.querySelector('#frames-note').textContent)"
# three seconds of a wheel that is turned quickly
_SCROLL = """async () => {
    const grid = document.querySelector(".grid");
    const tasks = [0];
    new PerformanceObserver((list) => tasks.push(...list.getEntries().map((each) => each.duration)))
        .observe({ entryTypes: ["longtask"] });
    const gaps = [];
    let before = performance.now();
    for (let at = 0; at < 180; at += 1) {
        grid.scrollTop += 300;
        await new Promise(requestAnimationFrame);
        gaps.push(performance.now() - before);
        before = performance.now();
    }
    await new Promise((done) => setTimeout(done, 300));
    return { gaps, longest: Math.max(...tasks), top: grid.scrollTop };
}"""


def run(scale: Scale, service: Service, worker: Context, folder: Path) -> list[bool]:
    """Fill a campaign of ``grown`` frames and look at it."""
    say(f"\na campaign of {scale.grown:,} frames in a browser")
    chromium = find_chromium()
    if chromium is None:
        say("  skipped: there is no Chromium on the path; STILB_CHROMIUM names one")
        return []
    campaign = fill_campaign(scale, worker, folder, service)
    address = f"{service.url}/campaigns/{campaign}"
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        session = sign_in(browser, service)
        verdicts = [
            *_open_slowly(browser, address, session, scale.starts),
            *_scroll(browser, address, session),
        ]
        verdicts += _follow(browser, address, session, service, campaign)
        browser.close()
    return verdicts


def fill_campaign(scale: Scale, worker: Context, folder: Path, service: Service) -> str:
    """Spread copies of one frame over scenes, ISO values and apertures; return the campaign's id."""
    frame = read_frame(_PREVIEWED, service, worker, folder)
    campaign: str = frame.raw["campaign_id"]
    copy_frame(worker, frame.id, scale.grown)
    with worker.database.writing("bench") as session:
        ids = session.scalars(
            select(FrameRow.id).where(FrameRow.campaign_id == campaign).order_by(FrameRow.id)
        ).all()
        each = FrameRow.__table__
        where = update(each).where(each.c.id == bindparam("frame"))  # type: ignore[arg-type]
        values = {name: bindparam(name) for name in ("scene", "iso", "f_number")}
        session.execute(where.values(**values), [{"frame": i, **_place(n)} for n, i in enumerate(ids)])
    review_all(worker)
    return campaign


def _place(number: int) -> dict[str, Any]:
    rest, f_number = divmod(number // _REPEATS, len(_APERTURES))
    scene, iso = divmod(rest, len(_ISOS))
    return {"scene": f"level-{scene + 1}", "iso": _ISOS[iso], "f_number": _APERTURES[f_number]}


@contextmanager
def _opened(browser: Browser, session: StorageState) -> Iterator[tuple[Page, list[Request]]]:
    with browser.new_context(storage_state=session, viewport=SIZE) as context:
        context.set_default_timeout(_PATIENCE_MS)
        page = context.new_page()
        asked: list[Request] = []
        page.on("requestfinished", lambda each: each.url.startswith("http") and asked.append(each))
        yield page, asked


def _weigh(asked: list[Request]) -> float:
    """Return what was received [kB]."""
    received = ("responseBodySize", "responseHeadersSize")
    return sum(each.sizes()[name] for each in asked for name in received) / 1e3


def _open_slowly(browser: Browser, address: str, session: StorageState, rounds: int) -> list[bool]:
    cells, pictures = [], []
    for _ in range(rounds):
        with _opened(browser, session) as (page, asked):
            line = page.context.new_cdp_session(page)
            line.send("Network.enable")
            line.send("Network.emulateNetworkConditions", _SLOW)
            page.goto(address, wait_until="commit")
            cells.append(float(page.evaluate(_CELL)) / 1e3)
            pictures.append(float(page.evaluate(_FIRST)) / 1e3)
            page.wait_for_function(_PICTURES)
            shown_s = page.evaluate("performance.now()") / 1e3
            count, size_kb = len(asked), _weigh(asked)
    say(f"  1.6 Mbit/s, 150 ms: all in view after {shown_s:.1f} s, {count} requests, {size_kb:.0f} kB")
    return [
        judge_seconds("1.6 Mbit/s, 150 ms: the first frames", cells, at_most_s=_USABLE_S),
        judge_seconds("1.6 Mbit/s, 150 ms: the first picture", pictures, at_most_s=_USABLE_S),
    ]


def _scroll(browser: Browser, address: str, session: StorageState) -> list[bool]:
    with _opened(browser, session) as (page, asked):
        page.goto(address)
        page.wait_for_function(_COMPLETE)
        page.wait_for_function(_SETTLED)
        page.wait_for_function(_PICTURES)
        line = page.context.new_cdp_session(page)
        line.send("Performance.enable")
        pictures = _count(asked)
        before = _read(line)
        found = page.evaluate(_SCROLL)
        page.wait_for_function(_PICTURES)
        line.send("HeapProfiler.collectGarbage")
        after = _read(line)
        gaps = sorted(found["gaps"])
        late = sum(gap > 25 for gap in gaps)
        say(
            f"  scrolled {found['top']:.0f} px in {sum(gaps) / 1e3:.1f} s: "
            f"median {gaps[len(gaps) // 2]:.1f} ms, 95 % {gaps[int(0.95 * len(gaps))]:.1f} ms, "
            f"longest {gaps[-1]:.0f} ms, {late} of {len(gaps)} late; "
            f"script {1e3 * (after['ScriptDuration'] - before['ScriptDuration']):.0f} ms, "
            f"layout {1e3 * (after['LayoutDuration'] - before['LayoutDuration']):.0f} ms, "
            f"heap {after['JSHeapUsedSize'] / 1e6:.0f} MB, {_count(asked) - pictures} requests for pictures"
        )
        return [
            judge("longest task while scrolling [ms]", _one(found["longest"]), at_most=_LONGEST_MS),
            judge("elements of the page", _one(after["Nodes"]), at_most=_MOST_NODES),
            judge(
                "requests for the pictures at the place",
                _one(_count(asked) - pictures),
                at_most=_MOST_REQUESTS,
            ),
        ]


def _count(asked: list[Request]) -> int:
    return sum("thumbnail" in each.url for each in asked)


def _read(line: Any) -> dict[str, float]:  # noqa: ANN401  a CDP session
    return {each["name"]: each["value"] for each in line.send("Performance.getMetrics")["metrics"]}


def _one(value: float) -> Ratio:
    return Ratio(value, value, value)


def _follow(
    browser: Browser, address: str, session: StorageState, service: Service, campaign: str
) -> list[bool]:
    """Leave a frame out elsewhere, and weigh what the page reads until it shows it."""
    with _opened(browser, session) as (page, asked), open_http(service) as http:
        page.goto(address)
        page.wait_for_function(_SETTLED)
        page.wait_for_function(_COMPLETE)
        before = len(asked)
        frame = http.get(f"/v1/campaigns/{campaign}/frames", params={"limit": 1}).json()["items"][0]["id"]
        http.patch(f"/v1/frames/{frame}", json={"left_out": True, "reason": "bench"}).raise_for_status()
        page.wait_for_selector(f'[data-id="{frame}"].out')
        grids = [each for each in asked[before:] if "/grid" in each.url]
        whole = [each for each in grids if each.sizes()["responseBodySize"] > 0]
        size_kb = _weigh(grids)
        say(f"  a frame left out by another: {len(whole)} answers with frames, {size_kb:.0f} kB of the grid")
        return [judge("the grid read again after one change [kB]", _one(size_kb), at_most=20)]
