"""A card on the first page: what is proposed for it, and what is seen before anything is sent."""

import re
import zipfile
from datetime import UTC, datetime, timedelta
from urllib.parse import urlsplit

import pytest
from PIL import Image
from playwright.sync_api import expect

from tests.support.browser import DIALOG, check_access, drop, look, settle
from tests.support.data import data_file
from tests.support.frames import write_frame
from worker.decode.metadata import read_metadata
from worker.decode.tiff import read_directories

PROPOSE = """async ([cases, names]) => {
    const own = document.querySelector("script[type=module]").src;
    const { propose } = await import(own.replace("pages/home.js", "card/propose.js"));
    const { METHODS } = await import(own.replace("pages/home.js", "methods.js"));
    return Promise.all(cases.map(async ([rows, context, choice]) => {
        const found = await propose(rows, { methods: METHODS, ...context }, choice);
        return {
            cameras: found.cameras.map(({ serial, frames, known, renamed }) =>
                [serial, frames.length, Boolean(known), Boolean(renamed)]),
            campaign: found.campaign && [found.campaign.kind, found.campaign.method],
            scenes: found.scenes.map(each => [each.role, each.scene ?? null, each.frames.length]),
            skipped: Object.values(found.skipped).map(each => each.length),
            checks: found.checks.map(each => [each.code, each.scene ?? null]),
        };
    }));
}"""
MINUTE = 60_000


def row(name, at=0.0, *, serial="0K1XE8", signal=0.3, clipped=0.0, exposure_time_s=0.01, iso=100, **header):
    """A raw frame as its header is read; ``at`` in minutes."""
    said = {"make": "DJI", "model": "FC6520", "serial": serial, "lens": {}, "taken": 1e12 + at * MINUTE}
    exposure = {"exposure_time_s": exposure_time_s, "f_number": 4, "iso": iso}
    centre = {"signal": signal, "clipped": clipped}
    stated = {"header": said | exposure | header, "centre": centre}
    return {"key": name, "name": name, "size": 1, "kind": "raw"} | stated


def test_card_shows_cameras_scenes_checks_and_what_is_skipped(page, team):
    """What the service proposes of roles and scenes has tests of its own."""
    camera = team.client.create_camera("dji", "FC6520", "0k1xe8")
    known = {"id": camera.id, "make": "dji ", "model": "FC6520", "serial": "0k1xe8"}
    other = {"key": "x", "size": 1, "header": None}
    card = [
        *[row(f"DCIM/100MEDIA/DJI_{n:04}.DNG", n / 10 + 5 * (n // 4)) for n in range(12)],
        *[row(f"DCIM/100MEDIA/DJI_{n:04}.DNG", n / 10 + 20, signal=0.0) for n in range(12, 14)],
        {**other, "name": "DCIM/100MEDIA/DJI_0001.JPG", "kind": "picture"},
        {**other, "name": "DCIM/100MEDIA/DJI_0099.JPG", "kind": "picture"},
        {**other, "name": "DCIM/100MEDIA/DJI_0002.MP4", "kind": "video"},
        {**other, "name": "notes.txt", "kind": "other"},
    ]
    folders = [row(f"night/level-{n % 2}/{n}.DNG", n, exposure_time_s=0.1) for n in range(8)]
    folders.append(row("night/level-1/wrong.DNG", 9, exposure_time_s=0.02))
    folders[4] |= {"centre": {"signal": 0.9, "clipped": 0.2}}
    for each in folders[1:8:2]:
        each["centre"] = {"signal": 0.06, "clipped": 0}
    folders[8]["centre"] = {"signal": 0.06, "clipped": 0}
    twice = [row("a.DNG"), row("b.DNG"), row("c.DNG", serial="0K1XF2")]
    # a header of absurd values is asked about without them
    twice[0]["header"] |= {"f_number": 4e9, "iso": -1}
    # JPEG alone: of a chart, as nothing else may be a picture; one without EXIF is skipped
    charts = [row(f"{n}.JPG") | {"kind": "picture", "centre": None} for n in range(3)]
    charts.append({**other, "name": "4.JPG", "kind": "picture"})
    cases = [
        (card, {"cameras": [known]}, {}),
        (folders, {}, {}),
        (twice, {"cameras": [known | {"model": "X5S"}]}, {"campaign": "night"}),
        (charts, {}, {}),
    ]
    page.goto("/")
    first, second, third, fourth = page.evaluate(PROPOSE, [cases, None])
    assert first == {
        "cameras": [["0K1XE8", 14, True, False]],
        "campaign": ["new", "luminance"],
        "scenes": [*(["light", f"Scene {n}", 4] for n in (1, 2, 3)), ["dark", None, 2]],
        "skipped": [1, 1, 1, 1],
        "checks": [],
    }
    assert second["scenes"] == [["light", "level-0", 4], ["light", "level-1", 5]]
    assert second["checks"] == [["overexposed", None], ["misplaced", "level-0"], ["no_darks", None]]
    assert third["cameras"] == [["0K1XE8", 2, False, True], ["0K1XF2", 1, False, False]]
    assert (third["campaign"], third["scenes"]) == (["night", "luminance"], [["field", None, 2]])
    assert (fourth["campaign"], fourth["scenes"]) == (["new", "sharpness"], [["chart", None, 3]])
    assert (fourth["skipped"], fourth["checks"]) == ([0, 1, 0, 0], [])


def test_what_lies_beside_the_frames_that_are_meant_is_left_out(page):
    """Another day, place or aim, and a file that is cut; dark frames stay with those nearest in time."""
    night = [row(f"DJI_{n}.DNG", n / 10 + 5 * (n // 4), place=[52.5, 13.4], aim=[-90, 10]) for n in range(8)]
    night[5]["header"]["aim"] = [-20, 10]
    night[6]["header"]["cut"] = 4096
    night.append(row("DJI_8.DNG", 30, signal=0.0, place=[52.5, 13.5]))
    before = [row(f"DJI_1{n}.DNG", n - 2000) for n in range(3)]
    elsewhere = [row(f"DJI_2{n}.DNG", n + 100, place=[52.6, 13.4]) for n in range(2)]
    broken = row("DJI_30.DNG") | {"header": None, "fault": "The file ends before its header does."}
    page.goto("/")
    card = [*before, *night, *elsewhere, broken]
    keep = "{ kept: new Set(choice.kept) }"
    found, kept = page.evaluate(
        PROPOSE.replace("}, choice)", f"}}, {keep})"),
        [[(card, {}, {"kept": []}), (card, {}, {"kept": ["run DJI_10.DNG"]})], None],
    )
    assert found["scenes"] == [["light", "Scene 1", 4], ["light", "Scene 2", 2], ["dark", None, 1]]
    assert [code for code, _ in found["checks"]] == ["cut", "other_day", "other_place", "other_aim"]
    assert [scene[2] for scene in kept["scenes"]] == [3, 4, 2, 1]
    assert [code for code, _ in kept["checks"]] == ["cut", "other_place", "other_aim"]


@pytest.mark.parametrize("context", ["phone"], indirect=True)
def test_the_same_old_card_again_finds_its_campaign(page, team, service, tmp_path):
    """With a frame of the day before and a file that was cut, which are marked before anything is sent."""
    card = tmp_path / "DCIM"
    at = datetime(2026, 5, 1, 20, 0, tzinfo=UTC)
    for n in range(6):
        write_frame(card / f"DJI_{n}.DNG", seed=n, taken_at=at + timedelta(minutes=n))
    write_frame(card / "DJI_8.DNG", seed=8, taken_at=at - timedelta(days=1))
    cut = write_frame(card / "DJI_9.DNG", seed=9, taken_at=at + timedelta(minutes=7))
    cut.write_bytes(cut.read_bytes()[:-64])
    page.goto("/")
    drop(page, page.locator("#card-drop"), [card])
    checks = page.get_by_role("region", name="Check before sending")
    expect(checks.get_by_role("listitem").filter(has_text="DJI_9 is cut short")).to_be_visible()
    other = checks.get_by_role("listitem").filter(has_text="1 frame of another day")
    expect(other).to_contain_text("2026-04-30 20:00")
    expect(page.locator("main")).to_contain_text("2026-05-01 20:00\N{EN DASH}20:05")
    for key, scenes in (("ArrowLeft", "2 scenes"), ("ArrowRight", "1 scene")):
        page.get_by_role("button", name="End of Scene 1").press(key)
        expect(page.get_by_role("heading", level=1)).to_contain_text(scenes)
    other.get_by_role("button", name="Include").click()
    expect(page.locator(".foot-bar")).to_contain_text("7 frames")
    assert "2026-04-30" in " ".join(page.locator(".lanes text").all_text_contents())
    look(page, "card-another-day")
    check_access(page)
    page.get_by_role("button", name="Create campaign and send").click()
    expect(page.get_by_text("7 of 7 received")).to_be_visible()
    (campaign,) = team.client.campaigns()
    assert campaign.raw["started_at"] == "2026-04-30T20:00:00Z"
    service.wait_for_jobs([each.id for each in team.client.frames(campaign.id)])
    page.goto("/")
    drop(page, page.locator("#card-drop"), [card])
    expect(page.get_by_role("radio", name="Add to")).to_be_checked()
    expect(page.locator(".under")).to_contain_text("Already here: 6 of 6")
    expect(page.get_by_role("heading", level=1)).to_have_text("6 frames, already here")
    expect(page.locator(".foot-bar")).to_contain_text("All frames are there in Luminance")
    look(page, "card-again")
    page.get_by_role("link", name="Open the campaign").click()
    expect(page).to_have_url(re.compile(campaign.id))


REGROUP = """async ([rows]) => {
    const own = document.querySelector("script[type=module]").src;
    const { bracketsOf, timeline } = await import(own.replace("pages/home.js", "timeline.js"));
    const sceneOf = (each) => each.header.scene ?? (Number.parseInt(each.name) < 4 ? "Scene 1" : "Scene 2");
    const frames = rows.map((each) => ({ ...each, role: "light", scene: sceneOf(each) }));
    const draw = () => {
        const scenes = bracketsOf(frames);
        window.counts = Object.fromEntries(scenes.map(each => [each.scene, each.frames.length]));
        const regroup = (some, scene) => (some.forEach(each => (each.scene = scene ?? "fresh")), draw());
        document.querySelector("#main").replaceChildren(timeline({ scenes, frames }, { regroup }));
        return window.counts;
    };
    return draw();
}"""


READ = """async () => {
    const own = document.querySelector("script[type=module]").src;
    const { readHeader } = await import(own.replace("pages/home.js", "card/headers.js"));
    return Promise.all([...document.querySelector("#probe").files].map(async file => {
        const { serial, taken, zoned, ...header } = await readHeader(file);
        const stamp = taken && new Date(taken).toISOString();
        return { ...header, serial, taken: zoned ? undefined : stamp?.slice(0, 19) };
    }));
}"""
CARDS = [
    *("sequoia/IMG_180413_080658_0000_GRE.TIF", "rededge/0000SET_000_IMG_0000_1.tif", "p4m/DJI_0011.TIF"),
    *("dng/truncated_libraw_reads_zeros.dng", "dng/canon_14bit_packed_activearea_zero_exif.dng"),
]


def test_browser_reads_headers_as_the_worker_does(page, tmp_path):
    paths = [data_file(name) for name in CARDS]
    page.goto("/")
    page.evaluate(
        "document.body.append(Object.assign(document.createElement('input'), "
        "{ type: 'file', multiple: true, id: 'probe' }))"
    )
    page.locator("#probe").set_input_files(paths)
    for path, seen in zip(paths, page.evaluate(READ), strict=True):
        stated = read_metadata(read_directories(path.read_bytes())[0])
        for name in ("make", "model", "serial"):
            assert seen.get(name) == stated[name], (path, name)
        for name in ("exposure_time_s", "f_number", "iso"):
            # a zero in a file means that nothing was written
            assert seen.get(name) == (stated[name] or None), (path, name)
        assert seen.get("taken") == (stated["taken_at"] and stated["taken_at"][:19]), path
    bands = [seen.get("band") for seen in page.evaluate(READ)]
    assert bands == ["Green", "Blue", "Blue", None, None]
    # in a JPEG the same tags, after a segment that is not theirs
    tags = Image.Exif()
    tags.update({271: "DJI", 272: "FC6520"})
    tags.get_ifd(0x8769).update(
        {33434: 0.004, 33437: 5.6, 34855: 200, 36867: "2026:05:01 22:00:00", 42033: "0K1XE8"}
    )
    picture = tmp_path / "DJI_1.JPG"
    Image.new("RGB", (64, 48), "grey").save(picture, exif=tags, comment=b"a chart")
    page.locator("#probe").set_input_files([picture])
    (seen,) = page.evaluate(READ)
    stated = {"make": "DJI", "model": "FC6520", "serial": "0K1XE8", "taken": "2026-05-01T22:00:00"}
    assert (stated | {"exposure_time_s": 0.004, "f_number": 5.6, "iso": 200}).items() <= seen.items()
    assert seen["preview"] == {"at": 0, "size": picture.stat().st_size}


def write_cards(folder):
    """Frames of two cameras, a zip of them with paths that lead out of it, and the same zip cut off."""
    frames = [write_frame(folder / f"DJI_{n:04}.DNG", seed=n) for n in range(2)]
    frames.append(write_frame(folder / "DJI_0009.DNG", serial="0K1XF2"))
    packed = folder / "card.zip"
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as card:
        for path in frames:
            card.write(path, f"../DCIM/100MEDIA/{path.name}")
        card.writestr("DCIM/100MEDIA/DJI_0000.JPG", b"\xff\xd8\xff", zipfile.ZIP_STORED)
        card.writestr("DCIM/100MEDIA/DJI_0003.MP4", b"video")
    cut = folder / "cut.zip"
    cut.write_bytes(packed.read_bytes()[:-40])
    return frames, packed, cut


def test_wrong_camera_is_seen_before_the_first_byte(page, team, tmp_path):
    """A zip of two cameras, one of them registered under another name, with a video and a JPEG twin."""
    camera = team.client.create_camera("DJI", "X5S", "0K1XE8")
    campaign = team.client.create_campaign(camera.id)
    frames, packed, cut = write_cards(tmp_path)
    sent = []
    page.on("request", lambda asked: asked.method != "GET" and sent.append(urlsplit(asked.url).path))

    # on a campaign of another camera
    page.goto(f"/campaigns/{campaign.id}")
    page.get_by_label("Files to send").set_input_files(packed)
    alert = page.get_by_role("alert")
    expect(alert).to_contain_text("These frames are from another camera")
    expect(alert).to_contain_text("is for DJI X5S 0K1XE8. All 3 files say DJI FC6520")
    look(page, "campaign-other-camera")
    page.get_by_role("button", name="New campaign").press("Enter")

    # where its files go on as a card
    expect(page.get_by_role("heading", level=1)).to_have_text("2 frames, 1 scene, 2 cameras")
    expect(page.get_by_text("Two cameras on this card")).to_be_visible()
    expect(page.get_by_text("Registered is DJI X5S 0K1XE8")).to_be_visible()
    page.get_by_role("button", name="Send only 0K1XF2").press("Enter")
    expect(page.get_by_role("heading", level=1)).to_have_text("1 frame, 1 scene, 2 cameras")
    check_access(page)
    look(page, "card-two-cameras")
    page.get_by_role("button", name="1 frame of scene 1: show").press("Enter")
    check_access(page, DIALOG)
    page.keyboard.press("Escape")
    page.get_by_label("Project number").focus()
    page.keyboard.type("P-9")
    page.get_by_label("Name of scene 1").press("ControlOrMeta+a")
    page.keyboard.type("dusk")
    assert set(sent) == {"/v1/proposals"}  # of headers alone
    # as a hand does it: the name is left by the press that sends, and the finger stays a while
    page.get_by_role("button", name="Create campaign and send").click(delay=150)
    expect(page.get_by_role("heading", level=1)).to_have_text("P-9")
    expect(page.get_by_text("1 of 1 received")).to_be_visible()
    page.evaluate("location.hash = 'readings'")
    with team.http() as http:
        (made,) = [each for each in http.get("/v1/campaigns").json()["items"] if each.get("project_number")]
        (frame,) = http.get(f"/v1/campaigns/{made['id']}/frames").json()["items"]
        assert http.get(f"/v1/cameras/{made['camera_id']}").json()["serial"] == "0K1XF2"
    assert (frame["filename"], frame["role"], frame["scene"]) == ("DJI_0009.DNG", "light", "dusk")
    settle(page)
    # a place within the page has loaded nothing again
    expect(page.get_by_text("1 of 1 received")).to_be_visible()
    page.go_back()
    page.go_back()
    settle(page)

    # or the campaign becomes that camera's
    page.goto(f"/campaigns/{campaign.id}")
    page.get_by_label("Files to send").set_input_files([frames[0], cut])
    expect(page.get_by_text("cut.zip: This zip has no list of its files")).to_be_visible()
    page.get_by_role("button", name="Change the campaign to DJI FC6520 0K1XE8").press("Enter")
    page.get_by_role("button", name="Send 1 file").press("Enter")
    expect(page.get_by_text("1 of 1 received")).to_be_visible()


def drag(page, edge, to_x):
    box = edge.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + 20)
    page.mouse.down()
    page.mouse.move(to_x, box["y"] + 20, steps=3)
    page.mouse.up()


def test_brackets_of_the_timeline_are_split_and_joined(page):
    """By the pointer, and with the arrows; the focus stays on the edge."""
    page.goto("/")
    counts = page.evaluate(REGROUP, [[row(f"{n}.DNG", n / 10 + 5 * (n // 4)) for n in range(8)]])
    page.locator(".lanes").scroll_into_view_if_needed()
    assert counts == {"Scene 1": 4, "Scene 2": 4}
    edge = page.get_by_role("button", name="End of Scene 1")
    edge.focus()
    page.keyboard.press("ArrowRight")
    assert page.evaluate("window.counts") == {"Scene 1": 5, "Scene 2": 3}
    page.get_by_role("button", name="End of Scene 2").focus()
    page.keyboard.press("ArrowLeft")
    assert page.evaluate("window.counts") == {"Scene 1": 5, "Scene 2": 2, "fresh": 1}
    lanes = page.locator(".lanes").bounding_box()
    drag(page, edge, lanes["x"] + lanes["width"])
    assert page.evaluate("window.counts") == {"Scene 1": 8}

    # the other end: outwards it takes frames of the scene before, inwards it leaves its first
    page.evaluate(REGROUP, [[row(f"{n}.DNG", n / 10 + 5 * (n // 4)) for n in range(8)]])
    start = page.get_by_role("button", name="Start of Scene 2")
    start.focus()
    page.keyboard.press("ArrowLeft")
    assert page.evaluate("window.counts") == {"Scene 1": 3, "Scene 2": 5}
    page.get_by_role("button", name="Start of Scene 1").focus()
    page.keyboard.press("ArrowRight")
    assert page.evaluate("window.counts") == {"Scene 1": 2, "Scene 2": 5, "fresh": 1}
    drag(page, start, page.locator(".lanes").bounding_box()["x"])
    assert page.evaluate("window.counts") == {"Scene 2": 8}

    # many short brackets beside each other: all are named, no name lies over another
    page.evaluate(REGROUP, [[row(f"{n}.DNG", n / 10, scene=f"Scene {n + 1}") for n in range(24)]])
    boxes = [each.bounding_box() for each in page.locator(".lanes text.strong").all()]
    assert len(boxes) == 24
    apart = [
        a["x"] + a["width"] <= b["x"] or b["x"] + b["width"] <= a["x"] or abs(a["y"] - b["y"]) > 8
        for n, a in enumerate(boxes)
        for b in boxes[n + 1 :]
    ]
    assert all(apart)
    assert page.locator(".lanes .lane title").first.text_content() == "Scene 1, 1 frame"


def test_dropped_card_without_raw_frames_says_what_to_set(page, team, tmp_path):
    (tmp_path / "DJI_1.JPG").write_bytes(b"\xff\xd8")
    page.goto("/")
    drop(page, page.locator("#card-drop"), [tmp_path])
    expect(page.get_by_role("alert")).to_contain_text("set the camera to RAW or JPEG + RAW")
    page.get_by_role("button", name="Choose another folder").click()
    expect(page.get_by_role("heading", name="Start with a card")).to_be_visible()
    # with them it is a night of measurements: the JPEG twin is counted, and stays on the card
    (tmp_path / "field").mkdir()
    (tmp_path / "DJI_1.JPG").rename(tmp_path / "field" / "DJI_1.JPG")
    for n in (1, 2):
        write_frame(tmp_path / "field" / f"DJI_{n}.DNG", seed=n)
    drop(page, page.locator("#card-drop"), [tmp_path])
    expect(page.get_by_role("radio", name="Measuring night")).to_be_checked()
    expect(page.locator("main")).to_contain_text("1 JPEG twin")
    page.get_by_role("button", name="Create campaign and send").click()
    expect(page.get_by_text("2 of 2 received")).to_be_visible()
    (night,) = team.client.campaigns()
    assert night.kind == "measurement"
    sent = sorted((frame.filename, frame.role, frame.scene) for frame in team.client.frames(night.id))
    assert sent == [("DJI_1.DNG", "field", None), ("DJI_2.DNG", "field", None)]
    expect(page.get_by_role("list", name="Stages")).to_contain_text(re.compile("Measured *none yet"))
    look(page, "card-night")
