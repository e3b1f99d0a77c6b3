"""A newcomer's evening: the mistakes of a first campaign, each seen where it is made and mended there.

Their browser is in another time zone than the camera, and they press every button twice.
"""

import json
import re
import struct
from pathlib import Path

from playwright.sync_api import expect

from tests.support.browser import DIALOG, check_access, look, settle, sign_in, visit
from tests.support.frames import write_frame

SIGNALS_DN = {"level-1": 2000.0, "level-2": 700.0, "level-3": 250.0}
SHAPE = (240, 360)
UPLOADS = re.compile(r"/v1/campaigns/[^/]+/frames\?")
# EXIF tags
EXPOSURE_TIMES, SERIALS = ((33434, 5, 1), (37377, 10, 1)), ((50735, 2, 7), (42033, 2, 7))
ISO_VALUES = ((34855, 3, 1),)
SLOW = {"offline": False, "latency": 0, "downloadThroughput": -1, "uploadThroughput": 60_000}
QUICK = SLOW | {"uploadThroughput": -1}
# for what a worker computes, on a machine that has other work
PATIENCE_MS = 90_000
# as many files lie in the browser's own store
KEPT = """count => new Promise(done => {
    const asked = indexedDB.open("stilb-uploads");
    asked.onsuccess = () => {
        const all = asked.result.transaction("files").objectStore("files").count();
        all.onsuccess = () => (asked.result.close(), done(all.result === count));
    };
})"""
# rows that are out of sight do not exist
IN_SIGHT = "grid => grid.scrollIntoView()"
# what a browser notes of a lost line, a refusal and an ended session
PROVOKED = re.compile("ERR_INTERNET_DISCONNECTED|status of 40[019]|status of 422")


def test_the_mistakes_of_a_newcomer_are_seen_and_mended(browser, service, team, tmp_path):
    card = write_card(tmp_path)
    with visit(browser, service.url, timezone_id="America/Detroit") as context:
        context.grant_permissions(["clipboard-read", "clipboard-write"])
        page = sign_in(context, team.key, "/")
        name_the_camera(page, tmp_path)
        mend_the_card(page, card)
        page = lose_tab_and_line(context, stop_what_is_sent(page))
        (campaign,) = team.client.campaigns()
        own = [f"{level}/DJI_000{n}.DNG" for level in SIGNALS_DN for n in (1, 2, 3)]
        assert name_frames(team, campaign) == sorted([*own, "level-2/DJI_0009.DNG"])
        draw_the_region(page)
        send_what_is_none(page, tmp_path, card)
        type_the_readings(page, team, campaign)
        sign_in_again(page, team)
        sign_the_checklist(page)
        correct_the_campaign(page, team, campaign)
        noted = [said for said in context.complaints if not PROVOKED.search(said)]
        assert noted == [], noted
        context.complaints.clear()


def write_card(folder):
    """Three levels, one frame in the wrong folder, one overexposed, and no dark frame."""
    card = folder / "card"
    for level, signal_dn in SIGNALS_DN.items():
        for n in (1, 2, 3):
            take(card / level / f"DJI_000{n}.DNG", signal_dn)
    take(card / "level-3" / "DJI_0009.DNG", SIGNALS_DN["level-2"])
    take(card / "level-1" / "DJI_0008.DNG", 5000.0)
    return card


def take(path, signal_dn, *, hidden=(), **settings):
    path.parent.mkdir(parents=True, exist_ok=True)
    seed = int.from_bytes(path.as_posix()[-18:].encode(), "little")
    write_frame(path, signal_dn=signal_dn, seed=seed, shape=SHAPE, **settings)
    content = path.read_bytes()
    for tag, kind, count in hidden:
        entry = struct.pack("<HHI", tag, kind, count)
        assert content.count(entry) == 1
        # the tag becomes one that nobody knows
        content = content.replace(entry, struct.pack("<HHI", tag + 8000, kind, count))
    path.write_bytes(content)
    return path


def choose(page, place):
    with page.expect_file_chooser() as chooser:
        page.get_by_role("button", name="Choose folder").click()
    chooser.value.set_files(place)


def name_the_camera(page, folder):
    take(folder / "unnamed" / "DJI_0001.DNG", 700.0, hidden=SERIALS)
    choose(page, folder / "unnamed")
    alert = page.get_by_role("alert")
    expect(alert).to_contain_text("These files do not name their camera")
    expect(page.get_by_role("button", name="Create campaign and send")).to_be_disabled()
    alert.get_by_role("button", name="Register a camera…").click()
    dialog = page.get_by_role("dialog")
    expect(dialog.get_by_label("Model", exact=True)).to_have_value("FC6520")
    dialog.get_by_label("Serial number", exact=True).fill("0K1XE8")
    check_access(page, DIALOG)
    dialog.get_by_role("button", name="Register").dblclick()
    expect(page.get_by_label("Camera of these frames")).to_have_value(re.compile("cam_"))
    expect(page.get_by_role("button", name="Create campaign and send")).to_be_enabled()
    look(page, "mistakes-1-unnamed-camera")
    page.get_by_role("button", name="Cancel").click()


def mend_the_card(page, card):
    choose(page, card)
    title = page.get_by_role("heading", level=1)
    expect(title).to_have_text("11 frames, 3 scenes, one known camera")
    lines = page.get_by_role("region", name="Check before sending").get_by_role("listitem")
    expect(lines).to_have_count(3)
    look(page, "mistakes-2-card")
    lines.filter(has_text="DJI_0008 is overexposed").get_by_role("button", name="Leave out").click()
    expect(title).to_have_text("10 frames, 3 scenes, one known camera")
    lines.filter(has_text="DJI_0009 may belong to level-2").get_by_role(
        "button", name="Move to level-2"
    ).click()
    expect(lines).to_have_count(1)
    expect(lines).to_contain_text("No dark frames")
    page.get_by_label("Project number").fill("P-1")


def stop_what_is_sent(page):
    """On a slow line: all of it is told from the first second, and what is stopped stays listed."""
    line = page.context.new_cdp_session(page)
    line.send("Network.enable")
    line.send("Network.emulateNetworkConditions", SLOW)
    page.get_by_role("button", name="Create campaign and send").dblclick()
    told = page.locator(".upload-panel")
    expect(told).to_contain_text(re.compile(r"B of 1\.[67]\d MB · [\d.]+ kB/s · \d+ s left"))
    page.get_by_role("button", name="Stop").click()
    expect(told.get_by_role("status")).to_have_text(re.compile("^[0-9]+ to send$"))
    # a quick person presses Stop in the moment in which it is there
    page.get_by_role("button", name=re.compile("^Send [0-9]+ files")).click()
    page.get_by_role("button", name="Stop").click()
    expect(told.get_by_role("status")).to_have_text(re.compile("^[0-9]+ to send$"))
    line.send("Network.emulateNetworkConditions", QUICK)
    return page


def lose_tab_and_line(context, page):
    """The first file is refused, the line is lost, the tab is closed: another one goes on."""
    other = context.new_page()
    other.goto(page.url)
    settle(other)
    # a browser draws a tab that is behind another only once a second
    page.bring_to_front()
    refused = []

    def refuse(route):
        if route.request.method != "POST" or refused:
            return route.continue_()
        refused.append(route.request.url)
        problem = {"title": "Full", "detail": "The disk is full.", "code": "storage_full", "status": 507}
        return route.fulfill(status=400, json=problem, content_type="application/problem+json")

    page.route(UPLOADS, refuse)
    page.get_by_role("button", name=re.compile("^Send [0-9]+ files")).click()
    alert = page.get_by_role("alert").filter(has_text="Sending stopped after")
    expect(alert).to_contain_text("The disk is full.")
    look(page, "mistakes-3-refusal")
    page.unroute_all()
    context.set_offline(True)
    alert.get_by_role("button", name=re.compile("^Send the other")).click()
    expect(page.locator(".upload-panel")).to_contain_text("No connection since")
    page.locator("#upload").get_by_role("button", name="Try again").click()
    told = page.locator(".upload-panel").get_by_role("status")
    expect(told).to_have_text(re.compile("^Sending [0-9]+ of 10$"))
    waiting = 10 - int(told.inner_text().split()[1])
    expect(page.locator(".upload-panel")).to_contain_text(f"{waiting} waiting for the connection")
    page.wait_for_function(KEPT, arg=waiting)
    look(page, "mistakes-4-offline")
    page.close()
    context.set_offline(False)
    told = other.locator(".upload-panel").get_by_role("status")
    expect(told).to_have_text(
        re.compile(r"^(\d+) of \1 received, waiting for a region$"), timeout=PATIENCE_MS
    )
    look(other, "mistakes-5-received")
    with other.expect_download() as download:
        other.get_by_role("button", name="Receipt").click()
    receipt = json.loads(Path(download.value.path()).read_text())["receipt"]
    assert {file["name"] for file in receipt["files"]} >= {"card/level-1/DJI_0001.DNG"}
    return other


def name_frames(team, campaign):
    return sorted(f"{frame.scene}/{frame.filename}" for frame in team.client.frames(campaign.id))


def draw_the_region(page):
    page.locator(".upload-panel").get_by_role("link", name="Draw region").click()
    page.get_by_role("button", name="Rectangle").click()
    page.get_by_role("button", name="Use for all frames").dblclick()
    expect(page.get_by_text("The region is set")).to_be_visible()


def send_what_is_none(page, folder, card):
    """One that is there, its twin, another camera's, one without its exposure, and a file that is none."""
    strange = take(folder / "strange.DNG", 700.0, serial="0K1XF2")
    blank = take(folder / "level-1" / "blank.DNG", 700.0, hidden=EXPOSURE_TIMES)
    (folder / "notes.txt").write_bytes(b"no frame at all")
    (folder / "DJI_0001.JPG").write_bytes(b"\xff\xd8\xff")
    known = card / "level-1" / "DJI_0001.DNG"
    page.get_by_label("Files to send").set_input_files(
        [known, folder / "DJI_0001.JPG", strange, blank, folder / "notes.txt"]
    )
    alert = page.get_by_role("alert").filter(has_text="These frames are from another camera")
    expect(alert).to_contain_text("1 of 4 files say DJI FC6520 0K1XF2. They have not been sent.")
    alert.get_by_role("button", name="Leave them out").click()
    expect(page.locator(".upload-panel")).to_contain_text(re.compile("[0-9] already there, not sent"))
    page.get_by_role("button", name="Send 2 files").dblclick()
    lines = page.locator("#before").get_by_role("listitem").filter(has_text="refused")
    expect(lines).to_have_count(2)
    check_access(page)
    look(page, "mistakes-6-refused")
    lines.filter(has_text="blank.DNG").get_by_role("button", name="Enter exposure…").click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_label("Exposure time [s]").fill("0,01")
    dialog.get_by_role("button", name="Read again").dblclick()
    expect(lines).to_have_count(1)
    for _ in range(2):
        lines.get_by_role("button", name="Withdraw").click()
        expect(lines).to_have_count(0)
        page.locator(".toast").get_by_role("button", name="Undo").last.click()
        expect(lines).to_have_count(1)
    lines.get_by_role("button", name="Withdraw").click()
    expect(lines).to_have_count(0)
    darks = page.locator("#before").get_by_role("listitem").filter(has_text="dark frame")
    expect(darks.get_by_role("link", name="Add frames")).to_have_attribute("href", "#frames")


def type_the_readings(page, team, campaign):
    """As people write them: with commas, with a unit, as a column of a spreadsheet, with a time."""
    first, second = (page.get_by_label(f"Luminance of level-{n}") for n in (1, 2))
    first.fill("12,5 cd/m²")
    first.press("Enter")
    expect(page.get_by_role("button", name="Readings of level-1: 1 reading")).to_be_visible()
    page.evaluate("navigator.clipboard.writeText('4,4\\r\\n1,6\\r\\n')")
    store = page.get_by_role("dialog", name="Paste readings").get_by_role("button", name="Store")
    for undone in (True, False):
        second.focus()
        page.keyboard.press("ControlOrMeta+v")
        store.dblclick()
        expect(page.get_by_role("button", name="Readings of level-3: 1 reading")).to_be_visible()
        if undone:
            pasted = page.locator(".toast").filter(has_text="2 readings recorded")
            pasted.get_by_role("button", name="Undo").click()
            expect(page.get_by_role("button", name="Readings of level-3: No reading yet")).to_be_visible()
    page.get_by_role("button", name="Paste readings…").click()
    lines = page.get_by_label("Lines")
    lines.fill("level-1\t54,4\nlevel-2\t1,234\nlevel-3\tabout 2\n\nlevel-3\t0,260\tfL")
    expect(page.locator(".faults li")).to_have_text(
        [re.compile("Line 2: .*is ambiguous"), re.compile("Line 3: .*not a number")]
    )
    store.click()
    expect(page.get_by_role("alert").filter(has_text="Line 2")).to_have_count(2)
    lines.fill("levle-3\t1 234,5\tcd/m²\t2026-05-01 20:30")
    expect(page.locator(".preview-lines")).to_contain_text("no frames of levle-3")
    lines.fill("level-3\t1,7\tcd/m²\t2026-05-01 20:30")
    store.dblclick()
    expect(lines).to_have_count(0)  # stored: the stages said as much before
    expect(page.get_by_role("list", name="Stages")).to_contain_text("3 readings, 3 scenes")
    with team.http() as http:
        made = http.get(f"/v1/campaigns/{campaign.id}/readings").json()["items"]
    standing = [each for each in made if "withdrawn_at" not in each]
    assert [each["value"] for each in standing] == [12.5, 4.4, 1.7]
    assert standing[-1]["taken_at"] == "2026-05-01T20:30:00Z"


def sign_in_again(page, team):
    """The session has ended while a value was typed: nothing is lost, with a wrong key neither."""
    page.locator(".grid").evaluate(IN_SIGHT)
    typed = page.get_by_label("Luminance of level-1")
    typed.fill("12,7")
    page.context.clear_cookies()
    typed.press("Enter")
    dialog = page.get_by_role("dialog", name="Your session has ended")
    expect(dialog.get_by_label("Key")).to_be_focused()
    dialog.get_by_label("Key").fill("stilb_nobody_has_this")
    dialog.get_by_role("button", name="Sign in").click()
    expect(dialog.get_by_role("alert")).to_contain_text("This key is not known")
    check_access(page, DIALOG)
    look(page, "mistakes-7-session")
    dialog.get_by_label("Key").fill(team.key)
    dialog.get_by_role("button", name="Sign in").dblclick()
    expect(dialog).to_have_count(0)
    expect(page.get_by_role("rowheader").filter(has_text="level-1").first).to_contain_text("Saved")


def sign_the_checklist(page):
    """A step that the record shows undone stays open; a change after a signature is told."""
    checklist = page.locator("section#checklist")
    page.evaluate("location.hash = 'checklist'")
    section = checklist.locator("details:has(li p.muted:not(:has(time)))").first
    section.locator("summary").click()
    undone = section.locator("li:has(p.muted:not(:has(time)))").first
    why = undone.locator("p.muted").inner_text()
    undone.get_by_role("checkbox").click()
    expect(page.locator(".toast").filter(has_text=why)).to_be_visible()
    expect(undone.get_by_role("checkbox")).not_to_be_checked()
    dialog = page.get_by_role("dialog")
    checklist.locator("summary", has_text="Drone Camera Calibration Equipment").click()
    checklist.get_by_role("checkbox", name="A dimmable lamp").check()
    checklist.get_by_role("button", name="Note on: A dimmable lamp").click()
    dialog.get_by_label("What was done").fill("40 W halogen")
    check_access(page, DIALOG)
    dialog.get_by_role("button", name="Save").click()
    expect(checklist).to_contain_text("“40 W halogen”")
    check_access(page, "#checklist")
    checklist.get_by_role("button", name="Sign the checklist").click()
    dialog.get_by_label("Operator").fill("A. Meier")
    check_access(page, DIALOG)
    dialog.get_by_role("button", name="Sign", exact=True).dblclick()
    expect(checklist).to_contain_text("Signed by A. Meier")
    page.locator(".grid").evaluate(IN_SIGHT)
    page.get_by_role("button", name="Readings of level-1").click()
    dialog.get_by_role("button", name="Withdraw 12.7 cd/m² of level-1").click()
    expect(dialog.get_by_role("button", name="Restore 12.7 cd/m² of level-1")).to_be_visible()
    dialog.get_by_role("button", name="Close").click()
    expect(checklist).to_contain_text("have changed since: check them, and sign again")
    expect(page.get_by_role("list", name="Stages")).to_contain_text("changed since it was signed")
    checklist.get_by_role("button", name="Sign again").click()
    dialog.get_by_label("Operator").fill("A. Meier")
    dialog.get_by_role("button", name="Sign", exact=True).click()
    expect(page.get_by_role("list", name="Stages")).to_contain_text("signed")
    expect(checklist.get_by_role("button", name="Sign again")).to_have_count(0)


def correct_the_campaign(page, team, campaign):
    """With another camera every frame is checked again, and none is sent again."""
    other = team.client.create_camera("DJI", "X5S", "mistyped")
    edit(page, {"Camera": other.id, "Customer": "City of Lansing", "End (UTC)": "2026-05-01T22:15"})
    refused = page.locator("#before").get_by_role("listitem").filter(has_text="frames refused")
    expect(refused).to_contain_text("0K1XE8")
    look(page, "mistakes-8-renamed")
    refused.get_by_role("button", name="Change camera…").click()
    page.get_by_role("dialog").get_by_label("Camera").select_option(campaign.camera_id)
    page.get_by_role("dialog").get_by_role("button", name="Save").dblclick()
    settle(page)
    expect(refused).to_have_count(0)
    edit(page, {"Lens make": "DJI"}, saves=False)
    expect(page.get_by_role("dialog").get_by_role("alert")).to_contain_text("lens.model: is missing")
    page.get_by_role("dialog").get_by_label("Lens model").fill("MFT 15 mm")
    page.get_by_role("dialog").get_by_label("Start (UTC)").fill("2026-05-01T19:00")
    page.get_by_role("dialog").get_by_role("button", name="Save").click()
    expect(page.get_by_text("City of Lansing · 2026-05-01 · DJI MFT 15 mm")).to_be_visible()
    stored = team.client.campaign(campaign.id).raw
    assert (stored["ended_at"], stored["lens"]["model"]) == ("2026-05-01T22:15:00Z", "MFT 15 mm")
    page.get_by_role("button", name="Archive", exact=True).click()
    page.locator(".toast").filter(has_text="Archived.").get_by_role("button", name="Undo").click()
    page.get_by_role("button", name="Archive", exact=True).click()
    expect(page.get_by_role("button", name="Take out of the archive")).to_be_visible()
    page.goto("/campaigns")
    expect(page.get_by_text("All campaigns are archived.")).to_be_visible()
    page.get_by_label("Archived (1)").check()
    expect(page.get_by_role("row").filter(has_text="P-1")).to_have_count(1)
    page.goto(f"/cameras/{other.id}")
    page.get_by_role("button", name="Edit camera").click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_label("Serial number", exact=True).fill("0K1XE9")
    dialog.get_by_label("Lens make").fill("DJI")
    dialog.get_by_label("Lens model").fill("MFT 15 mm")
    dialog.get_by_label("Pixel pitch [µm]").fill("3,3")
    check_access(page, DIALOG)
    dialog.get_by_role("button", name="Save").dblclick()
    expect(page.get_by_text("DJI MFT 15 mm")).to_be_visible()
    renamed = team.client.camera(other.id).raw
    assert (renamed["serial"], renamed["pixel_pitch_um"]) == ("0K1XE9", 3.3)


def edit(page, values, *, saves=True):
    page.get_by_role("button", name="Edit details").click()
    dialog = page.get_by_role("dialog")
    for label, value in values.items():
        field = dialog.get_by_label(label, exact=True)
        if label == "Camera":
            field.select_option(value)
        else:
            field.fill(value)
    dialog.get_by_role("button", name="Save").click()
    if saves:
        expect(dialog).to_have_count(0)
        settle(page)
