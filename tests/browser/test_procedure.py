"""The whole procedure as one person goes it: from the sign-in to a measured street and its certificate.

Up to the published K they have no mouse, and what they press and type is counted.
"""

import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from playwright.sync_api import Page, expect

from tests.support.browser import DIALOG, check_access, drop, illustrate, look, settle
from tests.support.keyboard import Keyboard
from tests.support.taped import ISOS, LEVELS, ROAD, SPOILT, paste_readings, write_night, write_street

METER = {
    "Make": "Konica Minolta",
    "Model": "LS-150",
    "Serial number": "30011942",
    "Certificate number": "L-2026-0117",
    "Laboratory": "Photometry Laboratory",
    "Issued on": "2026-01-17",
    "Due on": "2027-01-17",
    "Expanded uncertainty [%]": "1.5",
}
FRAMES = 30
DROP_HERE = re.compile("Drop the camera.s files or a folder here")
# for what a worker computes, on a machine that has other work
PATIENCE_MS = 60_000


# what a hand or a key does: a press of a button or a link, and a field that has been filled in
COUNT = """
    const add = (name) => (localStorage[name] = Number(localStorage[name] ?? 0) + 1);
    addEventListener("click", ({ isTrusted }) => isTrusted && add("pressed"), { capture: true });
    const fields = "input:not([type]), input[type=text], input[type=date], textarea";
    const filled = new WeakSet();
    addEventListener("change", ({ target }) => {
        if (target.matches(fields) && !filled.has(target)) add("typed");
        filled.add(target);
    }, { capture: true });
"""
COUNTED = ("pressed", "typed")
# all of it: six of the presses register the meter, look at a frame and leave it out
MOST_PRESSED = 25
# from the card to the published K: project number, customer and place
MOST_TYPED = 3


def test_the_whole_procedure(context, team, tmp_path):
    with team.http() as http:
        own = http.get("/v1/keys/own").json()["id"]
        http.patch(f"/v1/keys/{own}", json={"person": "A. Meier", "role": "physicist"}).raise_for_status()
    page = context.new_page()
    keys = Keyboard(page)
    sign_in(keys, team.key)
    context.add_init_script(COUNT)
    page.reload()
    choose_the_card(keys, write_night(tmp_path / "night"))
    draw_the_region(keys)
    once = count_in(register_the_meter, keys)
    readings = count_in(paste_the_readings, keys)
    look_at_the_spoilt_frame(keys)
    sign_the_checklist(keys)
    calibrate(keys)
    mishap = count_in(leave_the_spoilt_frame_out, keys)
    publish(keys)
    # once for all campaigns, all the values of it at once, and the reason of what is no part of the way
    assert [each["typed"] for each in (once, readings, mishap)] == [len(METER), 1, 1]
    assert count(page)["typed"] - (once + readings + mishap)["typed"] <= MOST_TYPED
    assert count(page)["pressed"] <= MOST_PRESSED
    find_k_on_the_cameras_page(keys)
    assert keys.faults == []
    measure_the_street(page, tmp_path)
    download_the_certificate(page)


def count(page: Page) -> Counter:
    """What has been pressed and typed so far."""
    return Counter({name: int(page.evaluate("name => localStorage[name] ?? 0", name)) for name in COUNTED})


def count_in(part: Callable[[Keyboard], None], keys: Keyboard) -> Counter:
    before = count(keys.page)
    part(keys)
    return count(keys.page) - before


def sign_in(keys: Keyboard, key: str) -> None:
    page = keys.page
    page.goto("/")
    expect(page.get_by_label("Key")).to_be_focused()
    page.keyboard.insert_text(key)
    page.keyboard.press("Enter")
    page.wait_for_url("**/")


def choose_the_card(keys: Keyboard, folder: Path) -> None:
    """With one look and one button; what is no raw frame stays here."""
    page = keys.page
    expect(page.get_by_role("heading", level=1)).to_have_text("Start with a card")
    passed(page, "procedure-1-nothing-yet")
    for frame in [*folder.glob("level-1/*")]:
        frame.with_suffix(".JPG").write_bytes(b"\xff\xd8\xff")
    (folder / "flight.MP4").write_bytes(b"video")
    with page.expect_file_chooser() as chooser:
        keys.press(page.get_by_role("button", name="Choose folder"))
    chooser.value.set_files(folder)
    expect(page.get_by_role("heading", level=1)).to_have_text(
        f"{FRAMES} frames, 5 scenes, one new camera", timeout=PATIENCE_MS
    )
    skipped = page.locator(".figures > div").filter(has_text="Skipped")
    expect(skipped).to_contain_text("4 JPEG twins, 1 video")
    expect(page.get_by_role("radio", name="New luminance calibration")).to_be_checked()
    expect(page.get_by_label("Role of scene 6")).to_have_value("dark")
    passed(page, "procedure-2-card")
    keys.write(page.get_by_label("Project number"), "P-2026-014")
    illustrate(page, "card")
    keys.press(page.get_by_role("button", name="Create campaign and send"))
    expect(page.get_by_role("heading", level=1)).to_have_text("P-2026-014")
    told = page.get_by_role("status")
    received = f"{FRAMES} of {FRAMES} received, waiting for a region"
    expect(told.filter(has_text=received)).to_be_visible(timeout=PATIENCE_MS)
    # each has been read: what it still lacks is the region
    expect(page.locator("#region-tool image")).to_be_visible()
    expect(page.locator("#frame-list").get_by_role("row")).not_to_have_count(0)
    passed(page, "procedure-4-files")


def draw_the_region(keys: Keyboard) -> None:
    """The link leads to it; its rectangle lies within the tape."""
    page = keys.page
    lacking = page.locator("#before").get_by_role("listitem")
    keys.press(lacking.filter(has_text="no region").get_by_role("link", name="Draw region"))
    keys.press(page.get_by_role("button", name="Rectangle"))
    expect(page.get_by_role("button", name="Corner 1 of 4")).to_be_focused()
    expect(page.get_by_text("from raw values")).to_be_visible(timeout=PATIENCE_MS)
    expect(page.get_by_role("img", name="Histogram")).to_be_visible()
    illustrate(page, "region", page.locator("section#region"))
    keys.press(page.get_by_role("button", name="Use for all frames"))
    # every frame has its numbers now; of the light ones it is said that their readings are missing
    expect(page.get_by_role("button", name="Waiting 20", exact=True)).to_be_visible(timeout=PATIENCE_MS)


def register_the_meter(keys: Keyboard) -> None:
    """Once for all campaigns; what its certificate states."""
    page = keys.page
    meter = page.get_by_label("Meter of typed readings")
    keys.reach(meter)
    meter.select_option("Register a meter…")
    dialog = page.get_by_role("dialog")
    check_access(page, DIALOG)
    for label, value in METER.items():
        keys.write(dialog.get_by_label(label, exact=True), value)
    illustrate(page, "meter", dialog)
    keys.press(dialog.get_by_role("button", name="Register"))
    expect(meter).to_contain_text("30011942")


def paste_the_readings(keys: Keyboard) -> None:
    page = keys.page
    keys.press(page.get_by_role("button", name="Paste readings…"))
    dialog = page.get_by_role("dialog", name="Paste readings")
    keys.write(dialog.get_by_label("Lines"), paste_readings())
    expect(dialog.get_by_role("row")).to_have_count(2 * len(LEVELS) + 1)
    keys.press(dialog.get_by_role("button", name="Store"))
    expect(page.get_by_role("list", name="Stages")).to_contain_text(
        f"{2 * len(LEVELS)} readings, {len(LEVELS)} scenes"
    )
    expect(page.get_by_role("button", name=f"Passes {FRAMES}", exact=True)).to_be_visible(timeout=PATIENCE_MS)
    passed(page, "procedure-5-readings")
    # higher than the grid, or the header would lie across it
    page.set_viewport_size({"width": 1440, "height": 1400})
    illustrate(page, "grid", page.locator("#frame-list"))
    page.set_viewport_size({"width": 1440, "height": 900})


def look_at_the_spoilt_frame(keys: Keyboard) -> None:
    page = keys.page
    search = page.get_by_role("searchbox", name="Find a frame")
    keys.reach(search, "Shift+Tab")
    keys.write(search, SPOILT)
    keys.press(page.get_by_role("button", name=re.compile(f"^{re.escape(SPOILT)}")))
    dialog = page.get_by_role("dialog")
    expect(dialog.get_by_role("application", name="Frame")).to_be_visible()
    expect(dialog).to_contain_text("none is clipped")
    expect(dialog.get_by_role("table").get_by_role("row")).to_have_count(6)
    check_access(page, DIALOG)
    passed(page, "procedure-5-frame")
    page.keyboard.press("Escape")
    expect(dialog).to_have_count(0)


def sign_the_checklist(keys: Keyboard) -> None:
    """Section by section; what the record shows undone stays open."""
    page = keys.page
    checklist = page.locator("section#checklist")
    keys.press(
        page.get_by_role("list", name="Stages").get_by_role("link", name="Checklist"), step="Shift+Tab"
    )
    expect(page.locator("#checklist-note")).to_contain_text("done")
    ticks = checklist.get_by_role("button", name=re.compile("open items of"))
    expect(ticks).not_to_have_count(0)
    illustrate(page, "checklist", checklist)
    while left := ticks.count():
        keys.press(ticks.first)
        expect(ticks).to_have_count(left - 1)
    keys.press(checklist.get_by_role("button", name="Sign the checklist"))
    dialog = page.get_by_role("dialog")
    expect(dialog.get_by_label("Operator")).to_have_value("A. Meier")
    keys.press(dialog.get_by_role("button", name="Sign", exact=True))
    expect(page.get_by_role("list", name="Stages")).to_contain_text("signed")


def calibrate(keys: Keyboard) -> None:
    page = keys.page
    expect(page.get_by_text("Nothing is missing.")).to_be_visible()
    keys.press(page.get_by_role("button", name="Fit K"))
    page.wait_for_url(re.compile("/calibrations/"), timeout=PATIENCE_MS)
    settle(page)


def leave_the_spoilt_frame_out(keys: Keyboard) -> None:
    page = keys.page
    verdict = page.locator("#verdict")
    expect(verdict).to_contain_text("Fails at")
    passed(page, "procedure-6-beyond-tolerance")
    keys.press(page.get_by_role("checkbox", name=f"Choose {SPOILT}"), "Space")
    keys.press(page.get_by_role("button", name="Exclude and refit"))
    dialog = page.get_by_role("dialog")
    keys.write(dialog.get_by_label("Reason for exclusion"), "somebody walked through the light")
    before = page.url
    keys.press(dialog.get_by_role("button", name="Refit"))
    # a fit that was refused says so in the dialog
    expect(dialog).to_have_count(0, timeout=PATIENCE_MS)
    page.wait_for_url(lambda url: "/calibrations/" in url and url != before, timeout=PATIENCE_MS)
    settle(page)
    expect(verdict).to_contain_text("Passes at both ISO values")
    spoilt = page.locator("#points tr").filter(has_text=SPOILT)
    expect(spoilt).to_contain_text("somebody walked through the light")
    page.evaluate("scrollTo(0, 0)")
    passed(page, "procedure-7-passed")
    page.set_viewport_size({"width": 1440, "height": 1240})
    illustrate(page, "version")
    page.set_viewport_size({"width": 1440, "height": 900})


def publish(keys: Keyboard) -> None:
    page = keys.page
    page.reload()
    settle(page)
    keys.press(page.get_by_role("button", name="Fill in"))
    lacking = page.get_by_role("dialog", name="Add what the certificate lacks")
    keys.write(lacking.get_by_label("Customer"), "City of Mill")
    keys.write(lacking.get_by_label("Place"), "Photometry lab")
    keys.press(lacking.get_by_role("button", name="Save"))
    expect(lacking).to_have_count(0)
    keys.press(page.get_by_role("button", name="Publish…"), step="Shift+Tab")
    dialog = page.get_by_role("dialog", name="Publish version")
    expect(dialog).to_contain_text("Nothing is in force then")
    expect(dialog.get_by_label("Reason")).to_have_value("Checklist signed by A. Meier")
    passed(page, "procedure-8-publish")
    illustrate(page, "publish")
    keys.press(dialog.get_by_role("button", name="Publish", exact=True))
    expect(page.locator("#version-status")).to_contain_text("published", timeout=PATIENCE_MS)
    expect(page.locator("#version-status")).to_contain_text("signed by A. Meier, physicist")
    settle(page)


def find_k_on_the_cameras_page(keys: Keyboard) -> None:
    page = keys.page
    keys.press(
        page.get_by_role("navigation", name="Breadcrumbs").get_by_role("link", name="FC6520"),
        step="Shift+Tab",
    )
    settle(page)
    expect(page.get_by_role("heading", level=1)).to_contain_text("0K1XE8")
    rows = page.locator("#in-force").get_by_role("row").filter(has_text="Luminance K")
    expect(rows.filter(has_text="f/")).to_have_count(2 * len(ISOS))
    rows = rows.filter(has_not_text="f/")
    expect(rows).to_have_count(len(ISOS))
    for iso in ISOS:
        # K_TRUE, as closely as the apertures scatter
        near_the_truth = re.compile(r"(29\.\d|30\.\d)\d* ± 0\.\d+ DN·m²/")
        expect(rows.filter(has_text=f"ISO {iso}")).to_contain_text(near_the_truth)
    expect(page.locator("#history")).to_contain_text("Checklist signed by A. Meier")
    expect(page.locator("#drift-plot .chart")).to_be_visible()
    passed(page, "procedure-9-camera")
    page.set_viewport_size({"width": 390, "height": 844})
    illustrate(page, "camera")
    page.set_viewport_size({"width": 1440, "height": 900})


def measure_the_street(page: Page, folder: Path) -> None:
    write_street(folder / "field" / "street.DNG")
    page.get_by_role("link", name="Campaigns", exact=True).click()
    page.get_by_role("link", name="P-2026-014").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("P-2026-014")
    settle(page)
    drop(page, page.get_by_text(DROP_HERE), [folder / "field"])
    page.get_by_role("button", name="Send 1 file").click()
    told = page.get_by_role("status")
    expect(told.filter(has_text="1 of 1 received, 1 pass")).to_be_visible(timeout=PATIENCE_MS)
    page.get_by_role("link", name="Measurements", exact=True).click()
    page.get_by_role("link", name="Measure a frame").first.click()
    settle(page)
    page.get_by_role("radio", name="Surface with cells").check()
    page.get_by_role("textbox", name="Corners").fill(" ".join(f"{x:g},{y:g}" for x, y in ROAD))
    page.get_by_role("textbox", name="Corners").press("Tab")
    passed(page, "procedure-10-new-measurement")
    page.get_by_role("button", name="Measure", exact=True).click()
    page.wait_for_url(re.compile("/measurements/msr_"), timeout=PATIENCE_MS)
    settle(page)
    expect(page.locator("#figures")).to_contain_text("cd/m²")
    expect(page.locator(".map-over").first).to_be_visible()
    passed(page, "procedure-11-measurement")
    read_the_map(page)


def read_the_map(page: Page) -> None:
    seen = page.locator(".map-over").first
    seen.scroll_into_view_if_needed()
    box = seen.bounding_box()
    page.mouse.move(box["x"] + 0.37 * box["width"], box["y"] + 0.53 * box["height"])
    expect(page.locator(".map-said").first).to_contain_text("cd/m²")
    illustrate(page, "map", page.locator("section").filter(has=seen).first)


def download_the_certificate(page: Page) -> None:
    page.locator("#with").get_by_role("link").first.click()
    settle(page)
    certificate = page.locator("#version-status").get_by_role("link", name="PDF").get_attribute("href")
    assert page.request.get(certificate).body().startswith(b"%PDF-")


def passed(page: Page, name: str) -> None:
    """Nothing sticks out of a page on the way, at 1440 and at 390 px; test_every_page.py asks axe."""
    settle(page)
    look(page, name)
