"""A campaign on its page: made, filled, calibrated; by one person and by two."""

import hashlib
import re

import pytest
from playwright.sync_api import expect
from sqlalchemy import select

from store.tables import Blob, FrameRow, new_id
from tests.browser.test_mistakes import ISO_VALUES, take
from tests.support.browser import DIALOG, Held, check_access, look, settle, sign_in, visit
from tests.support.data import data_file
from tests.support.fieldwork import write_campaign
from tests.support.frames import write_frame


@pytest.fixture(scope="module")
def shots(tmp_path_factory):
    """The frames of the small campaign at its first ISO value."""
    found = write_campaign(tmp_path_factory.mktemp("shots"))
    return [shot for shot in found if "-3200-" in shot.path.name]


PLACE = "each => each.getBoundingClientRect().top + scrollY"


def test_a_campaign_is_made_and_filled(page, shots):
    page.goto("/campaigns")
    expect(page.get_by_text("No campaigns yet")).to_be_visible()
    page.get_by_role("link", name="New campaign").first.click()
    # a night states its light alone
    page.get_by_role("radio", name=re.compile("^Measuring night")).check()
    page.get_by_role("radio", name="Luminance").check()
    expect(page.get_by_label("Kind of lamp")).to_be_visible()
    expect(page.get_by_label("Decision rule")).to_have_count(0)
    page.get_by_role("radio", name=re.compile("^Calibration")).check()
    page.get_by_role("radio", name="Luminance").check()
    page.locator("#camera select").select_option(label="Register another…")
    dialog = page.get_by_role("dialog")
    for label, text in {"Make": "DJI", "Model": "FC6520", "Serial number": "0K1XE8"}.items():
        dialog.get_by_label(label, exact=True).fill(text)
    dialog.get_by_role("button", name="Register").click()
    expect(dialog).to_have_count(0)
    for label, text in {"Project number": "P-17", "Focus distance [m]": "1.5"}.items():
        page.get_by_role("textbox", name=label, exact=True).fill(text)
    page.get_by_role("combobox", name="Lamp", exact=True).fill("A")
    page.get_by_label("Kind of lamp").select_option("incandescent")
    page.get_by_label("Mains frequency [Hz]").fill("0")
    page.get_by_label("Decision rule").select_option("guarded")
    check_access(page)
    look(page, "campaign-new")
    page.get_by_role("button", name="Create campaign").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("P-17")
    settle(page)
    look(page, "campaign-empty")
    page.get_by_text("Light, distance and verdict").click()
    for label, text in {
        "Lamp": "A",
        "Kind of lamp": "incandescent",
        "Mains frequency [Hz]": "0",
        "Focus distance [m]": "1.5",
        "Decision rule": "guarded",
    }.items():
        expect(page.get_by_label(label, exact=True).first).to_have_value(text)

    held = Held(page, "**/frames/known")
    page.get_by_label("Files to send").set_input_files([shot.path for shot in shots])
    cancel, asked = page.get_by_role("button", name="Remove all"), held.release()
    expect(page.get_by_text(f"{len(shots)} being compared")).to_be_visible()
    before = cancel.evaluate(PLACE)
    asked.continue_()
    expect(page.get_by_text("all compared")).to_be_visible()
    assert cancel.evaluate(PLACE) == before
    page.unroute("**/frames/known")
    expect(page.get_by_text("Dark frames: 3 · Light frames, Scene 1: 12")).to_be_visible()
    look(page, "campaign-files")
    page.get_by_role("button", name=f"Send {len(shots)} files").click()
    expect(page.get_by_text(f"{len(shots)} of {len(shots)} received", exact=False)).to_be_visible()
    settle(page)
    # the one list of files is in view
    assert page.locator(".grid").evaluate("each => each.getBoundingClientRect().top + scrollY") < 900
    look(page, "campaign")

    page.goto("/campaigns")
    expect(page.get_by_role("link", name="P-17")).to_be_visible()
    look(page, "campaigns")


def move_to_dusk_and_undo(page, frame_id):
    """What the service answered before the undo arrives after it, and is not shown."""
    page.keyboard.press("?")
    expect(page.get_by_role("dialog", name="Keys")).to_be_visible()
    check_access(page, DIALOG)
    page.keyboard.press("Escape")
    expect(page.locator(f'[data-id="{frame_id}"]')).to_be_focused()
    page.keyboard.press("m")
    check_access(page, DIALOG)
    page.get_by_role("dialog").get_by_label("Scene").fill("dusk")
    late = []
    page.route("**/grid?*", lambda route: late.append((route, route.fetch())), times=1)
    page.keyboard.press("Enter")
    expect(page.get_by_text("moved to dusk")).to_be_visible()
    expect(page.get_by_role("rowheader").filter(has_text="dusk")).to_have_count(1)
    page.keyboard.press("z")
    expect(page.get_by_text("Undone.")).to_be_visible()
    page.locator(f'[data-id="{frame_id}"]').focus()
    page.evaluate("""() => {
        const grid = document.querySelector(".grid");
        const watch = new MutationObserver(() => (window.shown = grid.innerText));
        watch.observe(grid, {childList: true, subtree: true});
    }""")
    while not late:
        page.wait_for_timeout(20)
    ((asked, answer),) = late
    with page.expect_event("requestfinished", lambda request: request == asked.request):
        asked.fulfill(response=answer)
    page.wait_for_timeout(500)
    assert "dusk" not in (page.evaluate("window.shown") or "")
    expect(page.get_by_role("rowheader").filter(has_text="dusk")).to_have_count(0)


def see_pixels_and_compare(page, dialog):
    """The very pixels of two frames at the same place, in the same grey scale, side by side and by turns."""
    dialog.get_by_role("button", name="100 %").click()
    expect(dialog.locator(".large .crop[href]")).to_have_count(1)
    expect(dialog.locator(".pair")).to_contain_text("none is clipped")
    dialog.get_by_role("button", name="Compare").click()
    crops = dialog.locator(".large .crop[href]")
    expect(crops).to_have_count(2)
    places = [[crop.get_attribute(name) for name in ("x", "y", "width", "height")] for crop in crops.all()]
    assert places[0] == places[1]
    assert crops.nth(0).get_attribute("href") != crops.nth(1).get_attribute("href")
    first, second = dialog.locator(".large").all()
    first.focus()
    for key in ("+", "+", "ArrowLeft"):
        page.keyboard.press(key)
    assert first.get_attribute("viewBox") == second.get_attribute("viewBox")
    for hidden in (first, second):
        dialog.get_by_role("button", name="Blink").click()
        expect(hidden).to_be_hidden()


def go_back_and_forward(page, dialog, frame_id):
    """The address names the open frame, the history closes and opens it, a reload shows it again."""
    expect(page).to_have_url(re.compile(f"frame={frame_id}$"))
    page.go_back()
    expect(dialog).to_have_count(0)
    page.get_by_label("Find a frame").fill("level-1")
    expect(page).to_have_url(re.compile(r"find=level-1$"))
    page.go_forward()
    expect(dialog).to_contain_text(shown := page.locator("#frame-name").inner_text())
    page.keyboard.press("Escape")
    expect(page).to_have_url(re.compile(r"/campaigns/[^?]*\?find=level-1$"))
    page.goto(f"{page.url}&frame={frame_id}")
    expect(dialog).to_contain_text(shown)
    page.keyboard.press("Escape")
    expect(dialog).to_have_count(0)
    expect(page).to_have_url(re.compile(r"/campaigns/[^?]*\?find=level-1$"))
    expect(page.locator(f'[data-id="{frame_id}"]')).to_be_focused()
    page.get_by_label("Find a frame").fill("")


def test_frames_are_walked_moved_left_out_and_restored_by_keys_alone(page, team, service, shots):
    campaign = team.campaign()
    lit = [shot for shot in shots if shot.role == "light"][:6]
    service.wait_for_jobs([frame.id for frame in team.push(campaign, lit)])
    page.goto(f"/campaigns/{campaign.id}")
    settle(page)
    cells = page.locator(".grid .cell")
    expect(cells).to_have_count(6)
    first = cells.first.get_attribute("data-id")
    cells.first.focus()
    for key in ("ArrowDown", "ArrowUp", "End", "Home", "x"):
        page.keyboard.press(key)
    expect(page.locator(f'[data-id="{first}"].out')).to_be_visible()
    check_access(page)
    look(page, "campaign-grid")
    page.locator(f'[data-id="{first}"]').focus()
    move_to_dusk_and_undo(page, first)
    expect(page.locator(f'[data-id="{first}"]')).to_be_focused()
    page.keyboard.press("Enter")
    dialog = page.get_by_role("dialog")
    expect(dialog).to_contain_text("Left out by")
    expect(dialog.locator(".histogram")).to_be_visible()
    see_pixels_and_compare(page, dialog)
    look(page, "campaign-frame")
    dialog.get_by_role("button", name="Compare").click()
    dialog.get_by_role("button", name="Fit").click()
    # pressed while the next frame loads, released when it has been drawn
    second = page.locator(".grid .cell").nth(1).get_attribute("data-id")
    held = Held(page, f"**/v1/frames/{second}")
    page.keyboard.press("ArrowRight")
    expect(dialog).to_contain_text("2 of 6")
    dialog.get_by_role("button", name="Withdraw").hover()
    page.mouse.down()
    held.release().continue_()
    page.unroute_all()
    settle(page)
    page.mouse.up()
    expect(dialog.get_by_role("button", name="Restore")).to_be_visible()
    go_back_and_forward(page, dialog, second)
    withdrawn = page.get_by_role("row").filter(has_text="Withdrawn")
    expect(withdrawn.locator(".cell")).to_have_attribute("data-id", second)
    page.get_by_role("button", name="Select all").click()
    page.get_by_role("button", name="Move…").click()
    page.get_by_role("dialog").get_by_label("Scene").fill("dawn")
    page.keyboard.press("Enter")
    expect(page.get_by_text("6 frames moved to dawn")).to_be_visible()
    assert {frame.scene for frame in team.client.frames(campaign.id)} == {"dawn"}


def see_in_time(page, team, campaign):
    """Brackets of the scenes on the time axis, and the reading that has a time among them."""
    said = {"scene": "level-1", "quantity": "luminance", "value": 40.2, "unit": "cd/m2"}
    team.client.add_readings(campaign.id, [said | {"taken_at": "2026-05-01T20:05:00Z"}])
    page.get_by_text("In time").click()
    shown = page.locator(".in-time")
    expect(shown.locator(".lane")).to_have_count(3)
    page.reload()
    settle(page)
    page.get_by_text("In time").click()
    expect(shown.get_by_role("img")).to_have_accessible_name(re.compile("3 frames and 1 reading"))
    expect(shown).to_contain_text("Readings without a time")
    # frames of one moment lie on all of their brackets
    assert shown.locator(".lanes > :is(.lane, .f1)").last.get_attribute("class") == "f1"
    look(page, "campaign-in-time")


def test_a_frame_is_dragged_and_readings_are_typed_in_the_grid(page, team, service, shots):
    campaign = team.client.create_campaign(team.client.create_camera("DJI", "FC6520", "0K1XE8").id)
    team.client.set_roi(campaign.id, polygon=[[8, 8], [88, 8], [88, 56], [8, 56]])
    lit = [shot for shot in shots if shot.role == "light" and shot.path.stem.endswith("-0")][:3]
    service.wait_for_jobs([frame.id for frame in team.push(campaign, lit)])
    page.goto(f"/campaigns/{campaign.id}")
    settle(page)
    page.get_by_label("Luminance of level-1").fill("40")
    page.keyboard.press("Enter")
    expect(page.get_by_label("Luminance of level-2")).to_be_focused()
    page.keyboard.type("20")
    page.keyboard.press("Enter")
    expect(page.get_by_label("Luminance of level-3")).to_be_focused()
    expect(page.locator(".cell.good")).to_have_count(2)
    first = page.get_by_role("rowheader").filter(has_text="level-1")
    first.get_by_role("button", name="+ repeat").click()
    page.get_by_label("Luminance of level-1 in cd/m², reading 2").fill("44")
    page.get_by_label("Luminance of level-1 in cd/m², reading 2").press("Enter")
    said = page.get_by_role("button", name=re.compile("Readings of level-1: mean 42, spread 9.5 %"))
    said.click()
    dialog = page.get_by_role("dialog")
    check_access(page)
    dialog.get_by_role("button", name="Withdraw 44 cd/m² of level-1").click()
    dialog.get_by_role("button", name="Restore 44 cd/m² of level-1").click()
    expect(dialog.get_by_role("button", name="Withdraw 44 cd/m² of level-1")).to_be_visible()
    dialog.get_by_role("button", name="Close").click()
    expect(page.locator(".grid")).to_have_css("position", "relative")  # nothing in it widens the page
    # the one line that blocks the fit says so, and units are written for people
    expect(page.locator("#before .tag.warn")).to_have_count(1)
    expect(page.locator("#before")).not_to_contain_text("cd/m2")
    see_in_time(page, team, campaign)
    moved = page.locator(".cell", has=page.locator("img")).nth(1)
    name = moved.text_content().split(":")[0]
    target = page.get_by_role("rowheader").filter(has_text="level-1")
    target.scroll_into_view_if_needed()  # a page that scrolls under the pointer drags nothing
    moved.drag_to(target)
    expect(page.get_by_text("moved to level-1")).to_be_visible()
    (frame,) = [each for each in team.client.frames(campaign.id) if each.filename == name]
    assert frame.scene == "level-1"
    read_with_meter_and_time(page, team, campaign)


def read_with_meter_and_time(page, team, campaign):
    """What is chosen above the grid goes with what is typed; a reading of another night is told."""
    page.get_by_label("Unit of typed readings").select_option("fL")
    page.get_by_label("Meter of typed readings").select_option("Register a meter…")
    dialog = page.get_by_role("dialog")
    for label, text in {"Make": "Konica Minolta", "Model": "LS-150", "Serial number": "1"}.items():
        dialog.get_by_label(label, exact=True).fill(text)
    dialog.get_by_role("button", name="Register").click()
    expect(dialog).to_have_count(0)
    page.get_by_label("Time of typed readings").select_option("read now")
    page.clock.set_fixed_time("2026-05-01T20:02:00Z")
    typed = page.get_by_label("Luminance of level-3 in fL")
    typed.fill("2")
    typed.press("Enter")
    expect(page.get_by_role("button", name="Readings of level-3: 1 reading")).to_be_visible()
    (meter,) = team.client.meters()
    *_, made = team.client.readings(campaign.id)
    assert (made["entered_value"], made["entered_unit"], made["meter_id"]) == (2.0, "fL", meter.id)
    assert (made["scene"], made["taken_at"]) == ("level-3", "2026-05-01T20:02:00Z")
    far = page.locator("#before").get_by_role("listitem").filter(has_text="do not belong to its frames")
    expect(far).to_have_count(0)
    page.clock.set_fixed_time("2026-05-04T20:02:00Z")
    head = page.get_by_role("rowheader").filter(has_text="level-3")
    head.get_by_role("button", name="+ repeat").click()
    repeat = page.get_by_label("Luminance of level-3 in fL, reading 2")
    repeat.fill("2.01")
    repeat.press("Enter")
    expect(far).to_contain_text("taken 3 days from the nearest frame")
    page.get_by_role("button", name=re.compile("Readings of level-3: mean ")).click()
    dialog.get_by_role("button", name="Withdraw 2.01 fL of level-3").click()
    expect(far).to_have_count(0)
    look(page, "campaign-readings")


def test_a_table_instead_of_raw_frames_is_dropped(page, team, tmp_path):
    campaign = team.client.create_campaign(team.client.create_camera("Nikon", "D70", "7").id)
    table = tmp_path / "Results.csv"
    head = " ,Label,Area,Mean,Min,Max,scene,exposure_time,aperture,iso,note"
    table.write_text(f"{head}\n1,a.NEF,400,1200,1100,5000,lamp,1/60,4,200,dim\n")
    page.goto(f"/campaigns/{campaign.id}")
    settle(page)
    page.get_by_label("Files to send").set_input_files(table)
    dialog = page.get_by_role("dialog", name="Add the rows of Results.csv")
    white = dialog.get_by_label("White level [DN]")
    white.fill("4095")
    check_access(page, DIALOG)
    dialog.get_by_role("button", name="Add").click()
    expect(dialog.get_by_role("alert")).to_contain_text("line 2")
    page.context.complaints.clear()  # the browser tells every answer of 422
    white.fill("16 383")
    dialog.get_by_role("button", name="Add").click()
    expect(page.locator(".toast")).to_contain_text("1 row added. Not read: note.")
    (frame,) = team.client.frames(campaign.id)
    assert (frame.filename, frame.scene) == ("a.NEF", "lamp")
    look(page, "campaign-table")


def test_a_board_may_be_described_after_its_pictures_have_come(page, team):
    campaign = team.client.create_campaign(
        team.client.create_camera("Canon", "EOS 5D", "1").id, method="geometry"
    )
    team.client.push(campaign.id, data_file("checkerboard/left01.jpg"), role="chart")
    page.goto(f"/campaigns/{campaign.id}")
    settle(page)
    said = page.get_by_role("region", name="Target")
    how_far = page.get_by_role("region", name="Status of this campaign")
    expect(how_far.get_by_text("Nobody has said what is photographed")).to_be_visible()
    look(page, "campaign-board-untold")
    for label, text in {
        "Columns": "9",
        "Rows": "6",
        "Side of a square [mm]": "25",
    }.items():
        said.get_by_label(label).fill(text)
    said.get_by_role("button", name="Find it in the frames").click()
    expect(said.get_by_text("Change: checkerboard")).to_be_visible()
    expect(how_far.get_by_text("3 views of the board are needed at least, 1 can be used")).to_be_visible()


def test_two_people_see_what_each_other_does(page, team, browser, service, shots):
    campaign = team.client.create_campaign(team.client.create_camera("DJI", "FC6520", "0K1XE8").id)
    page.goto(f"/campaigns/{campaign.id}")
    expect(page.get_by_text("No frames yet")).to_be_visible()
    with visit(browser, service.url) as other_context:
        other = sign_in(other_context, team.key)
        other.goto(f"/campaigns/{campaign.id}")
        other.get_by_label("Files to send").set_input_files(shots[1].path)
        other.get_by_role("button", name="Send 1 file").click()
        expect(page.get_by_role("button", name=re.compile(f"^{shots[1].path.name}"))).to_be_visible()
        both_move(page, other)
        other.get_by_role("button", name="Paste readings…").click()
        other.get_by_label("Lines").fill("level-1 54.4")
        other.get_by_role("button", name="Store").click()
        expect(page.get_by_role("button", name="Readings of level-1: 1 reading")).to_be_visible()
        both_draw(page, other)
        page.get_by_role("button", name="Use for all frames").click()
        expect(page.get_by_text("The region is set")).to_be_visible()
        # what the other is drawing is not taken away
        expect(other.get_by_text("Another user has set a region meanwhile")).to_be_visible()
        other.get_by_role("button", name="Use for all frames").click()
        expect(other.get_by_text("The region is set")).to_be_visible()
        expect(page.get_by_role("button", name=re.compile("^Corner 1 of 4: x 39, y 26"))).to_be_attached()


def both_move(page, other):
    """What another user has changed meanwhile is neither changed again nor undone, and is told."""
    first, second = (each.locator(".grid .cell") for each in (page, other))
    move(page, first, "dusk")
    expect(second).to_contain_text("dusk")
    page.route("**/grid?*", lambda _: None)  # what the other does is not shown yet
    move(other, second, "dawn")
    page.locator(".toast").get_by_role("button", name="Undo").click()
    expect(page.locator(".toast", has_text="Not undone.")).to_contain_text(
        re.compile("was changed by .+ meanwhile: its scene is dawn. Look at it again.")
    )
    move(page, first, "night", told="changed_meanwhile")
    page.unroute_all()
    expect(first).to_contain_text("dawn")


def move(page, cell, scene, told=None):
    cell.focus()
    page.keyboard.press("m")
    dialog = page.get_by_role("dialog")
    dialog.get_by_label("Scene").fill(scene)
    page.keyboard.press("Enter")
    if told is None:
        expect(page.locator(".toast", has_text=f"moved to {scene}")).to_be_visible()
        return
    expect(dialog.get_by_role("alert")).to_contain_text("its scene is dawn")
    page.context.complaints.clear()  # the browser tells every answer of 409
    page.keyboard.press("Escape")


def both_draw(page, other):
    for each in (page, other):
        each.get_by_role("button", name="Rectangle").click()
        expect(each.get_by_role("button", name="Corner 1 of 4: x 38, y 26")).to_be_focused()
    other.keyboard.press("ArrowRight")


def test_the_first_rows_do_not_wait_for_a_thousand(page, team, service, tmp_path):
    campaign = team.campaign()
    path = write_frame(tmp_path / "frame-0.DNG")
    with team.http() as http:
        sent = http.post(
            f"/v1/campaigns/{campaign.id}/frames",
            params={"role": "light", "scene": "level-1", "filename": path.name},
            content=path.read_bytes(),
        ).json()
    service.wait_for_jobs([sent["id"]])
    multiply(service.database, sent["id"], 1000)
    pictures = []
    page.on("request", lambda request: "thumbnail" in request.url and pictures.append(request))
    rest = re.compile(r"/grid\?.*limit=2000")
    held = Held(page, rest)
    page.goto(f"/campaigns/{campaign.id}")
    # all but the first page is held back
    expect(page.get_by_role("button", name=re.compile(r"^frame-2\.DNG"))).to_be_visible()
    first = held.release()
    page.route(rest, lambda route: route.continue_())
    for each in (first, *held):
        each.continue_()
    expect(page.locator("#frames-note")).to_have_text("1000 of this campaign", timeout=30_000)
    # repeats of one cell are a count until they are asked for
    expect(page.locator(".grid .cell")).to_have_count(3)
    page.get_by_role("button", name=re.compile(r"^997 more .*\(level-1")).press("Enter")
    assert page.locator(".grid tbody tr").count() < 60
    page.locator(".grid").evaluate("element => element.scrollTo(0, element.scrollHeight)")
    expect(page.get_by_role("button", name=re.compile(r"^frame-999\.DNG"))).to_be_visible()
    assert page.locator(".grid tbody tr").count() < 60
    page.wait_for_function(SEEN_HAVE_PICTURES)
    # whatever the number of cells: the frames around a place come together
    assert len(pictures) <= 6
    walk_pages(page)


def walk_pages(page):
    """Keys lead to cells that are not drawn yet, and say which row of how many they are in."""
    focused = page.locator(".grid td > :focus")
    page.locator(".grid .cell").last.focus()
    page.keyboard.press("Control+Home")
    expect(focused).to_have_accessible_name(re.compile(r"^frame-0\.DNG"))
    page.keyboard.press("PageDown")
    expect(focused).not_to_have_accessible_name(re.compile(r"^frame-0\.DNG"))
    row = int(focused.locator("xpath=ancestor::tr").get_attribute("aria-rowindex"))
    assert 4 < row < 40
    page.keyboard.press("Control+End")
    last = page.get_by_role("grid").get_attribute("aria-rowcount")
    expect(page.locator(f'.grid tr[aria-rowindex="{last}"] td > :focus')).to_be_visible()


SEEN_HAVE_PICTURES = """() => [...document.querySelectorAll(".grid img.picture")]
    .every((img) => img.complete && img.naturalWidth)"""


def multiply(database, frame_id, count):
    """As many frames as that: the same row, under other names and hashes."""
    with database.writing("test") as session:
        row = session.scalar(select(FrameRow).where(FrameRow.id == frame_id))
        columns = {column.key: getattr(row, column.key) for column in FrameRow.__table__.columns}
        hashes = [hashlib.sha256(f"{frame_id} {index}".encode()).hexdigest() for index in range(1, count)]
        session.add_all([Blob(sha256=each, size_bytes=1) for each in hashes])
        session.flush()
        session.add_all(
            [
                FrameRow(**columns | {"id": new_id("frm"), "sha256": each, "filename": f"frame-{index}.DNG"})
                for index, each in enumerate(hashes, start=1)
            ]
        )


def create(page, method):
    """Open the form of a method; what it is filled with is sent by the second press."""
    page.goto("/campaigns/new")
    settle(page)
    page.get_by_role("radio", name=method).check()
    return page.get_by_role("button", name="Create campaign")


def test_a_board_and_a_panel_are_described_where_the_method_wants_them(page, team):
    team.client.create_camera("DJI", "FC6520", "0K1XE8")
    made = "**/campaigns/cmp_*"
    button = create(page, "Geometry")
    for label, text in (("Columns", "9"), ("Rows", "6,5"), ("Side of a square [mm]", "24,8")):
        page.get_by_label(label).fill(text)
    button.click()
    expect(page.get_by_role("alert")).to_contain_text("“6,5” is not a whole number")
    page.get_by_label("Rows", exact=True).fill("6")
    look(page, "campaign-new-geometry")
    button.click()
    page.wait_for_url(made)
    button = create(page, "Reflectance")
    page.locator("#panel").locator("select").select_option(label="Register another…")
    panel = page.get_by_role("dialog")
    panel.get_by_label("Serial number").fill("RP02")
    panel.get_by_label("Measured on").fill("2026-03-14")
    panel.get_by_label("Reflectance").fill("green 0,69 0,005\nred 0,68")
    panel.get_by_role("button", name="Register").click()
    expect(panel).to_have_count(0)
    button.click()
    page.wait_for_url(made)
    button = create(page, "Sharpness")
    page.get_by_role("radio", name=re.compile("^Siemens stars")).check()
    expect(page.get_by_label("Cycles of the star")).to_be_visible()
    page.get_by_role("radio", name=re.compile("^Slanted edges")).check()
    expect(page.get_by_label("Cycles of the star")).to_be_hidden()
    button.click()
    page.wait_for_url(made)
    board, reflecting, edges = team.client.campaigns()
    (registered,) = team.client.panels()
    said = {"kind": "checkerboard", "columns": 9, "rows": 6, "square_size_mm": 24.8}
    assert said.items() <= board.raw["target"].items()
    assert reflecting.raw["panel_id"] == registered.id
    assert (edges.raw["target"]["kind"], edges.raw["target"]["tone_curve"]) == ("slanted_edge", "linear")
    assert [each["reflectance"] for each in registered.raw["bands"]] == [0.69, 0.68]


def test_exposures_that_files_do_not_state_are_entered_for_many_at_once(page, team, service, tmp_path):
    camera = team.client.create_camera("DJI", "FC6520", "0K1XE8")
    campaign = team.client.create_campaign(camera.id, method="vignetting")
    paths = [
        take(tmp_path / f"iso{n}-{m}.DNG", 1500.0, hidden=ISO_VALUES) for n in (100, 200) for m in (1, 2)
    ]
    service.wait_for_jobs([each.id for each in team.client.push(campaign.id, paths, role="flat")])
    page.goto(f"/campaigns/{campaign.id}")
    settle(page)
    refused = page.locator("#before").get_by_role("listitem").filter(has_text="refused")
    expect(refused).to_contain_text("4 frames refused")
    dialog = page.get_by_role("dialog")
    for iso in ("100", "200"):
        page.get_by_label("Find a frame").fill(f"iso{iso}-")
        page.get_by_role("button", name="Select all").click()
        page.get_by_role("button", name="Exposure…", exact=True).click()
        dialog.get_by_label("ISO", exact=True).fill(iso)
        dialog.get_by_role("button", name="Read again").click()
        expect(page.locator(".bulk")).to_be_hidden()  # nothing is selected any more
    page.get_by_label("Find a frame").fill("")
    expect(refused).to_have_count(0)
    read = {frame.filename: frame.raw["iso"] for frame in team.client.frames(campaign.id)}
    assert read == {"iso100-1.DNG": 100, "iso100-2.DNG": 100, "iso200-1.DNG": 200, "iso200-2.DNG": 200}
