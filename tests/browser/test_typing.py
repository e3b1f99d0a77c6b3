"""Readings typed and pasted in the grid: what is stored is what was meant."""

import time

import pytest
from playwright.sync_api import expect

from tests.service.test_points import HEAD
from tests.support.browser import DIALOG, check_access, look, settle
from tests.support.frames import write_frame
from tests.support.meters import METER
from tests.support.processes import wait_until

MEANT = {"Scene 1": 54.4, "Scene 2": 23.1, "Scene 3": 7.35, "Scene 4": 2.94, "Scene 5": 1.28, "Scene 6": 0.56}
SETTINGS = [(f, iso) for iso in (3200, 12800) for f in (2.8, 4.0, 5.6)]


def begin(service, team, levels=MEANT):
    """A campaign of six scenes at six settings each, from a table: nothing has to be read."""
    campaign = team.client.create_campaign(team.client.create_camera("DJI", "FC6520", "0K1XE8").id)
    rows = []
    for scene, level in levels.items():
        for f, iso in SETTINGS:
            time_s = 1200.0 * f**2 / (2.0 * iso * level)
            rows.append(f"{scene}-{iso}-{f},4000,1456,1426,1486,8.1,{scene},,{time_s:.6g},{f},{iso}")
    rows += [
        f"dark-{n}-{iso},4000,256,230,286,8.1,,yes,0.02,4,{iso}" for iso in (3200, 12800) for n in (1, 2, 3)
    ]
    lines = [f"{n},{row}" for n, row in enumerate(rows, start=1)]
    with team.http() as http:
        answer = http.post(
            f"/v1/campaigns/{campaign.id}/points",
            content="\n".join([HEAD, *lines]) + "\n",
            params={"white_level_dn": 4095},
            headers={"Content-Type": "text/csv"},
        )
        assert answer.status_code == 201, answer.text
    service.wait_for_jobs([each["frame_id"] for each in answer.json()["items"]])
    return campaign


def stored(team, campaign):
    """The readings that count, by scene."""
    found = {}
    for each in team.client.readings(campaign.id):
        if not each.get("withdrawn_at"):
            found.setdefault(each["scene"], []).append(each["value"])
    return found


def come(page, campaign):
    page.goto(f"/campaigns/{campaign.id}")
    settle(page)


@pytest.mark.parametrize("context", ["phone"], indirect=True)
def test_a_list_typed_from_the_top_lands_in_the_order_of_the_scenes(page, team, service):
    campaign = begin(service, team)
    come(page, campaign)
    for n, value in enumerate(MEANT.values(), start=1):
        if n in {1, 4}:  # the second time the address has the place already
            page.get_by_role("link", name="Enter readings").first.click()
        expect(page.get_by_label(f"Luminance of Scene {n} ")).to_be_focused()
        page.keyboard.type(f"{value}")
        page.keyboard.press("Enter")
    expect(page.locator("#before .tag.warn")).to_have_count(0)
    meant = {scene: [value] for scene, value in MEANT.items()}
    wait_until(lambda: stored(team, campaign) == meant)
    name_the_meter_afterwards(page, team, campaign)
    assert stored(team, campaign) == meant


def told_of(team, campaign):
    """Meter and time of the readings that count."""
    readings = team.client.readings(campaign.id)
    return {(each.get("meter_id"), each.get("taken_at")) for each in readings if not each.get("withdrawn_at")}


def name_the_meter_afterwards(page, team, campaign):
    """Who typed without a meter need not type again; a certificate that lacks is asked for."""
    mend = page.get_by_role("button", name="State the meter…")
    mend.click()
    expect(page.get_by_label("Meter of typed readings")).to_be_focused()
    with team.http() as http:
        meter = http.post("/v1/meters", json=METER | {"serial": "1006"}).json()
    page.reload()
    page.get_by_label("Meter of typed readings").select_option("Gossen Starlite 2 1006")
    page.get_by_label("Time of typed readings").select_option("read now")
    naming = page.get_by_role("button", name="Name it in 6 readings without a meter")
    for back in (True, False):
        naming.click()
        wait_until(lambda: told_of(team, campaign) == {(meter["id"], None)})
        if back:
            page.locator("#toasts").get_by_role("button", name="Undo").last.click()
            wait_until(lambda: told_of(team, campaign) == {(None, None)})
    expect(page.get_by_text("1006 has no certificate")).to_be_visible()
    mend.click()
    dialog = page.get_by_role("dialog", name="Add a certificate")
    expect(dialog.get_by_label("Serial number")).to_have_value("1006")
    stated = {
        "Certificate number": "17",
        "Laboratory": "PTB",
        "Issued on": "2026-01-05",
        "Due on": "2027-01-05",
        "Expanded uncertainty [%]": "2",
    }
    for label, value in stated.items():
        dialog.get_by_label(label).fill(value)
    dialog.get_by_role("button", name="Add").click()
    expect(mend).to_have_count(0)


def put(page, label, value):
    """Type into a field of the grid, and leave it."""
    field = page.get_by_label(label)
    field.fill(value)
    field.press("Enter")


def head(page, scene):
    return page.get_by_role("rowheader").filter(has_text=scene)


def test_a_field_edits_one_reading_and_a_repeat_is_asked_for(page, team, service):
    campaign = begin(service, team)
    come(page, campaign)
    one = head(page, "Scene 1")
    put(page, "Luminance of Scene 1 ", "5,44")
    expect(one).to_contain_text("1 reading")
    put(page, "Luminance of Scene 1 ", "54.4")
    expect(page.get_by_label("Luminance of Scene 1 ")).to_have_attribute("value", "54.4")
    one.get_by_role("button", name="Undo").click()
    expect(page.get_by_label("Luminance of Scene 1 ")).to_have_value("5.44")
    one.get_by_role("button", name="Put back").click()
    expect(page.get_by_label("Luminance of Scene 1 ")).to_have_value("54.4")
    put(page, "Luminance of Scene 1 ", "54,40 cd/m²")
    expect(one).to_contain_text("The same as now")
    assert stored(team, campaign) == {"Scene 1": [54.4]}
    one.get_by_role("button", name="+ repeat with").click()
    expect(one).to_contain_text("mean 54.4, spread 0 %")
    put(page, "Luminance of Scene 1 in cd/m², reading 2", "54.60")
    expect(one).to_contain_text("mean 54.5")
    one.get_by_role("button", name="+ repeat").click()
    put(page, "Luminance of Scene 1 in cd/m², reading 3", "54 500 mcd/m2")
    expect(page.get_by_label("Luminance of Scene 1 in cd/m², reading 3")).to_have_value("54.5")
    assert stored(team, campaign) == {"Scene 1": [54.4, 54.6, 54.5]}
    for wrong, told in {"1,280": "is ambiguous", "0": "must be above 0", "12 Mcd/m2": "not a unit"}.items():
        put(page, "Luminance of Scene 2 ", wrong)
        expect(page.get_by_role("alert").filter(has_text=told)).to_be_visible()
        expect(page.get_by_label("Luminance of Scene 2 ")).to_have_value(wrong)
        # below the field, as wide as the head of the row
        expect(head(page, "Scene 2").locator("> .act-failed")).to_be_visible()
    assert list(stored(team, campaign)) == ["Scene 1"]


@pytest.mark.parametrize("context", ["phone"], indirect=True)
def test_a_meter_that_is_refused_says_why_where_it_is_seen(page, team, service):
    come(page, begin(service, team))
    page.get_by_label("Meter of typed readings").select_option("Register a meter…")
    dialog = page.get_by_role("dialog")
    meter = {"Make": "Konica Minolta", "Model": "LS-150", "Serial number": "30011942", "Laboratory": "PTB"}
    for label, text in meter.items():
        dialog.get_by_label(label, exact=True).fill(text)
    register = dialog.get_by_role("button", name="Register")
    register.click()
    expect(dialog.get_by_role("alert")).to_be_in_viewport(ratio=1)
    dialog.get_by_label("Laboratory", exact=True).fill("")
    register.click()
    expect(dialog).to_have_count(0)
    expect(head(page, "Scene 1").locator(".reading-row")).to_have_text("cd/m²LS-150")


def test_what_is_typed_without_a_connection_or_by_two_people_is_stored_as_meant(page, team, service):
    campaign = begin(service, team)
    come(page, campaign)
    page.context.set_offline(True)
    put(page, "Luminance of Scene 2 ", "23.1")
    expect(head(page, "Scene 2")).to_contain_text("23.1 waits for a connection")
    expect(page.get_by_label("Luminance of Scene 2 ")).to_have_value("23.1")
    put(page, "Luminance of Scene 3 ", "7.35")
    page.context.set_offline(False)
    alone = {"Scene 2": [23.1], "Scene 3": [7.35]}
    wait_until(lambda: stored(team, campaign) == alone)
    expect(head(page, "Scene 2")).not_to_contain_text("waits")
    field = page.get_by_label("Luminance of Scene 1 ")
    field.fill("3.5")  # what is typed is not taken away by what the other does
    team.client.add_readings(campaign.id, [reading("Scene 1", 3.3)])
    field.press("Enter")
    told = page.get_by_role("alert").filter(has_text="Keep yours or theirs?")
    expect(told).to_contain_text("The reading of Scene 1 was changed by")
    assert stored(team, campaign) == alone | {"Scene 1": [3.3]}
    look(page, "typing-two-people")
    told.get_by_role("button", name="Yours: 3.5").click()
    expect(head(page, "Scene 1")).to_contain_text("Saved")
    assert stored(team, campaign) == alone | {"Scene 1": [3.5]}
    (mine,) = [
        each
        for each in team.client.readings(campaign.id)
        if each["scene"] == "Scene 1" and "withdrawn_at" not in each
    ]
    field.fill("3.6")
    team.client.add_readings(campaign.id, [reading("Scene 1", 3.4) | {"replaces": mine["id"]}])
    field.press("Enter")
    told.get_by_role("button", name="Both").click()
    expect(head(page, "Scene 1")).to_contain_text("mean 3.5")
    assert stored(team, campaign) == alone | {"Scene 1": [3.4, 3.6]}
    page.context.complaints.clear()


def reading(scene, value):
    return {"scene": scene, "quantity": "luminance", "value": value, "unit": "cd/m2"}


def test_readings_and_a_lens_that_other_frames_speak_against_are_told_before_the_fit(
    page, team, service, tmp_path
):
    campaign = push(service, team, tmp_path)
    wrong = {**MEANT, "Scene 4": 29.4, "Scene 5": 12.8}
    team.client.add_readings(campaign.id, [reading(*each) for each in wrong.items()])
    come(page, campaign)
    line = page.locator("#before").get_by_role("listitem").filter(has_text="needed")
    expect(line).to_have_count(1)
    expect(line).to_contain_text("Scene 4: 29.4 cd/m², its frames say 2.9")
    expect(line).to_contain_text("Scene 5: 12.8 cd/m², its frames say 1.3")
    expect(page.get_by_role("list", name="Stages")).to_contain_text("1 missing")
    expect(page.locator(".cell.warn")).to_have_count(4)
    look(page, "typing-off")
    check_access(page)
    line.get_by_role("link", name="Enter readings").click()
    expect(page.get_by_label("Luminance of Scene 4 ")).to_be_focused()
    page.get_by_role("button", name="Fit K").click()
    expect(page.locator(".act-failed")).to_contain_text("its frames say 1.3")
    said = head(page, "Scene 5").get_by_role("alert")
    expect(said).to_contain_text("10 times less")
    said.get_by_role("button", name="Move point: 1.28").click()
    head(page, "Scene 4").get_by_role("button", name="Keep 29.4…").click()
    page.get_by_label("Why is the reading right?").fill("ND 1.0 filter on the lens")
    page.get_by_role("button", name="Keep it").click()
    expect(line).to_have_count(0)
    expect(page.locator(".cell.warn")).to_have_count(2)
    meant = {scene: [value] for scene, value in ({**MEANT, "Scene 4": 29.4}).items()}
    wait_until(lambda: stored(team, campaign) == meant)
    # the fit waits for what was typed just before it
    page.route("**/readings", lambda route: (time.sleep(0.5), route.continue_()))
    page.get_by_label("Luminance of Scene 1 ").fill("54.6")
    page.get_by_role("button", name="Fit K").click()
    page.wait_for_url("**/calibrations/*")
    made = team.client.calibration(page.url.rpartition("/")[2]).raw
    assert {each["value"] for each in made["inputs"]["readings"]} == {54.6, 23.1, 7.35, 29.4, 1.28, 0.56}
    assert [each["detail"] for each in made["findings"] if each["code"] == "reading_off"] == [
        "Scene 4: 29.4 cd/m2, its frames say 2.9. It was kept: ND 1.0 filter on the lens."
    ]
    page.context.complaints.clear()
    other = write_frame(
        tmp_path / "other.DNG", signal_dn=1200.0, seed=77, exposure_time_s=0.011, iso=3200, lens_serial="L2"
    )
    service.wait_for_jobs([team.client.push(campaign.id, other, role="light", scene="Scene 1").id])
    come(page, campaign)
    line = page.locator("#before").get_by_role("listitem").filter(has_text="The file names the lens")
    expect(line).to_have_count(1)
    expect(line).to_contain_text("other.DNG")
    expect(line).to_contain_text("L2, most others name")
    expect(line.get_by_role("link", name="Show frames")).to_be_visible()


def push(service, team, folder):
    """The same levels as raw frames, two of each."""
    campaign = team.client.create_campaign(team.client.create_camera("DJI", "FC6520", "0K1XE8").id)
    team.client.set_roi(campaign.id, polygon=[[8, 8], [88, 8], [88, 56], [8, 56]])
    sent = []
    for n, (scene, level) in enumerate(MEANT.items()):
        for f in (4.0, 5.6):
            time_s = 1200.0 * f**2 / (2.0 * 3200 * level)
            path = folder / f"{n}-{f}.DNG"
            write_frame(path, signal_dn=1200.0, seed=n, exposure_time_s=time_s, f_number=f, iso=3200)
            sent.append(team.client.push(campaign.id, path, role="light", scene=scene))
    path = folder / "dark.DNG"
    write_frame(path, signal_dn=0.0, seed=99, exposure_time_s=0.02, f_number=4.0, iso=3200)
    sent.append(team.client.push(campaign.id, path, role="dark"))
    service.wait_for_jobs([each.id for each in sent])
    return campaign


def test_a_pasted_column_is_held_against_the_frames_before_it_is_stored(page, team, service):
    campaign = begin(service, team)
    come(page, campaign)
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    column = "\\r\\n".join(str(value).replace(".", ",") for value in MEANT.values())
    page.evaluate(f"navigator.clipboard.writeText('{column}')")
    page.get_by_label("Luminance of Scene 2 ").focus()
    page.keyboard.press("ControlOrMeta+v")
    dialog = page.get_by_role("dialog", name="Paste readings")
    expect(dialog).to_contain_text("They fit the frames from Scene 1.")
    expect(dialog.get_by_role("radio", name="One row up, from Scene 1")).to_be_checked()
    expect(dialog.get_by_text("agrees", exact=True)).to_have_count(6)
    look(page, "typing-paste")
    check_access(page, DIALOG)
    dialog.get_by_role("radio", name="As pasted, from Scene 2").check()
    dialog.get_by_role("button", name="Store").click()
    expect(dialog.get_by_role("alert").last).to_contain_text("Line 6: there is no scene for this value.")
    dialog.get_by_role("radio", name="One row up").check()
    dialog.get_by_role("button", name="Store").click()
    expect(page.locator(".toast")).to_contain_text("6 readings recorded")
    meant = {scene: [value] for scene, value in MEANT.items()}
    wait_until(lambda: stored(team, campaign) == meant)
    page.get_by_role("button", name="Paste readings…").click()
    dialog.get_by_label("Lines").fill("54.4\n23.1\n\n7.35\n2.94\n1.28")
    expect(dialog.get_by_role("radio", name="Blank rows left out, from Scene 1")).to_be_checked()
    expect(dialog.get_by_text("agrees", exact=True)).to_have_count(5)
    dialog.get_by_label("Lines").fill("Scene 1\t54,2\nScene 7\t1,0\nScene 2\t23,1")
    expect(dialog).to_contain_text("no frames of Scene 7")
    dialog.get_by_label("Lines").fill("L [mcd/m²]\n54400\n23100\n7350")
    expect(dialog.get_by_role("table")).to_contain_text("23.1 cd/m²")
    # as people name columns and scenes
    dialog.get_by_label("Lines").fill("Scene\tLuminance (mcd/m2)\nscene 1\t54 200\n2\t23,1 nit")
    dialog.get_by_role("button", name="Store").click()
    expect(page.locator(".toast").filter(has_text="1 reading recorded")).to_be_visible()
    assert stored(team, campaign) == {**{scene: [value] for scene, value in MEANT.items()}, "Scene 1": [54.2]}
