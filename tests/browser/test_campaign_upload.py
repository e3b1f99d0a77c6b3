"""Files on their way: known ones are not sent, a lost connection and a reload lose nothing."""

import hashlib
import json
import re
from pathlib import Path

import pytest
from playwright.sync_api import expect

from tests.support.browser import sign_in, visit
from tests.support.frames import write_frame
from tests.support.line import line_to

UPLOADS = re.compile(r"/v1/campaigns/[^/]+/frames\?")


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("card")
    return [write_frame(folder / f"level-1-{seed}.DNG", seed=seed) for seed in range(3)]


@pytest.fixture
def campaign(team, page):
    """One with its readings and its region, whose page is open."""
    made = team.campaign()
    page.goto(f"/campaigns/{made.id}")
    return made


def choose(page, files):
    page.get_by_label("Files to send").set_input_files(files)


def names_of(team, campaign):
    with team.http() as http:
        items = http.get(f"/v1/campaigns/{campaign.id}/frames").json()["items"]
    return sorted(item["filename"] for item in items)


def test_what_the_service_has_is_not_sent_again(page, team, campaign, files):
    choose(page, files[:1])
    page.get_by_role("button", name="Send 1 file").click()
    expect(page.get_by_text("1 of 1 received")).to_be_visible()
    page.reload()
    sent = []
    page.on(
        "request",
        lambda asked: asked.method == "POST" and UPLOADS.search(asked.url) and sent.append(asked.url),
    )
    choose(page, files[:2])
    expect(page.get_by_text("1 already there, not sent")).to_be_visible()
    page.get_by_role("button", name="Send 1 file").click()
    expect(page.get_by_text("1 of 1 received")).to_be_visible()
    assert len(sent) == 1
    assert names_of(team, campaign) == ["level-1-0.DNG", "level-1-1.DNG"]
    with page.expect_download() as download:
        page.get_by_role("button", name="Receipt").click()
    receipt = json.loads(Path(download.value.path()).read_text())["receipt"]
    assert sorted(file["name"] for file in receipt["files"]) == ["level-1-0.DNG", "level-1-1.DNG"]


@pytest.mark.usefixtures("campaign")
def test_a_button_that_is_pressed_while_the_list_changes_is_clicked(page, files):
    choose(page, files[:1])
    page.get_by_role("button", name="Send 1 file").hover()
    page.mouse.down()
    choose(page, files[1:2])
    page.wait_for_timeout(300)  # longer than the second file is compared
    page.mouse.up()
    expect(page.get_by_text(re.compile(r"^\d of \d received"))).to_be_visible()


def test_first_refusal_stops_the_rest_and_rows_can_be_removed(page, team, campaign, files):
    refused = []

    def refuse(route):
        if route.request.method != "POST" or refused:
            return route.continue_()
        refused.append(route.request.url)
        problem = {"title": "Full", "detail": "The disk is full.", "code": "storage_full", "status": 507}
        return route.fulfill(status=400, json=problem, content_type="application/problem+json")

    page.route(UPLOADS, refuse)
    choose(page, files)
    page.get_by_role("button", name=f"Remove {files[2].stem}").click()
    page.get_by_role("button", name="Send 2 files").click()
    alert = page.get_by_role("alert")
    expect(alert).to_contain_text("Sending stopped after the first file")
    expect(alert).to_contain_text("The disk is full. The other file was not sent.")
    alert.get_by_role("button", name="Send the other 1").click()
    expect(page.get_by_text("1 not accepted")).to_be_visible()
    page.get_by_role("button", name="Try again").click()
    expect(page.get_by_text("2 of 2 received")).to_be_visible()
    assert names_of(team, campaign) == [path.name for path in files[:2]]
    page.context.complaints.clear()  # the browser notes the refusal


def test_a_lost_connection_is_waited_for(page, team, campaign, files):
    lost = []

    def lose(route):
        lost.append(route.request.url)
        if len(lost) <= 2:
            route.abort("connectionreset")
        else:
            route.continue_()

    page.route(UPLOADS, lambda route: lose(route) if route.request.method == "POST" else route.continue_())
    choose(page, files)
    page.get_by_role("button", name="Send 3 files").click()
    expect(page.get_by_text("waiting for the connection").first).to_be_visible()
    expect(page.get_by_text("3 of 3 received")).to_be_visible()
    assert len(lost) == 5
    assert names_of(team, campaign) == [path.name for path in files]
    # the browser itself notes what was lost
    complaints = page.context.complaints
    assert [said for said in complaints if "ERR_CONNECTION_RESET" not in said] == []
    complaints.clear()


def test_a_line_that_breaks_in_the_middle_of_a_file(browser, service, team, tmp_path):
    large = write_frame(tmp_path / "level-1-large.DNG", shape=(1000, 1500))
    campaign = team.campaign()
    with line_to(service.url) as line, visit(browser, line.url) as context:
        page = sign_in(context, team.key)
        page.goto(f"/campaigns/{campaign.id}")
        choose(page, [large])
        pieces = []
        page.on("request", lambda asked: asked.method == "PATCH" and pieces.append(asked.headers))
        # a browser sends again by itself what broke once
        line.cut_after, line.stays_cut = large.stat().st_size // 2, True
        page.get_by_role("button", name="Send 1 file").click()
        expect(page.get_by_text("1 waiting for the connection")).to_be_visible()
        assert line.cuts > 0
        assert names_of(team, campaign) == []
        line.cut_after = None
        expect(page.get_by_text("1 of 1 received")).to_be_visible()
        # what had arrived is not sent again
        offsets = [int(each["upload-offset"]) for each in pieces]
        assert offsets[0] == 0
        assert offsets[-1] > large.stat().st_size // 4
        lost = ("ERR_CONNECTION_RESET", "ERR_EMPTY_RESPONSE")
        assert [said for said in context.complaints if not any(name in said for name in lost)] == []
        context.complaints.clear()
    with team.http() as http:
        (frame,) = http.get(f"/v1/campaigns/{campaign.id}/frames").json()["items"]
        assert http.get(f"/v1/frames/{frame['id']}/content").content == large.read_bytes()


def test_a_reload_goes_on_where_it_was(page, team, campaign, files):
    held = []
    page.route(
        UPLOADS, lambda route: held.append(route) if route.request.method == "POST" else route.continue_()
    )
    choose(page, files)
    page.get_by_label(f"Scene of {files[2].name}").fill("dusk")
    page.get_by_label(f"Scene of {files[2].name}").blur()
    page.get_by_role("button", name="Send 3 files").click()
    page.wait_for_function(KEPT, arg=len(files))
    page.reload()
    expect(page.get_by_text("Resuming 3 files of an earlier session")).to_be_visible()
    # what is held goes on its way
    page.unroute_all()
    expect(page.get_by_text("3 of 3 received")).to_be_visible()
    with team.http() as http:
        items = http.get(f"/v1/campaigns/{campaign.id}/frames").json()["items"]
    assert {item["filename"]: item.get("scene") for item in items}["level-1-2.DNG"] == "dusk"
    page.reload()
    expect(page.get_by_role("button", name=files[0].name)).to_be_visible()
    expect(page.locator(".upload-panel")).to_be_hidden()


# as many files lie in the browser's own store
KEPT = """count => new Promise(done => {
    const asked = indexedDB.open("stilb-uploads");
    asked.onsuccess = () => {
        const all = asked.result.transaction("files").objectStore("files").count();
        all.onsuccess = () => (asked.result.close(), done(all.result === count));
    };
})"""


def test_a_file_that_is_none_says_why(page, campaign):  # noqa: ARG001  its page is looked at
    choose(page, {"name": "notes.txt", "mimeType": "text/plain", "buffer": b"no frame at all"})
    page.get_by_role("button", name="Send 1 file").click()
    expect(page.get_by_text("1 of 1 received, 1 fail")).to_be_visible()
    page.get_by_role("button", name="notes.txt").click()
    expect(page.get_by_role("dialog")).to_contain_text("The file is no raw image")


def test_hashes_are_right_where_the_browser_has_none(page):
    page.goto("/campaigns")
    # at and around the ends of a block
    sizes = [0, 55, 56, 64, 1000, 70_000]
    found = page.evaluate(
        """async sizes => {
            const own = document.querySelector("script[type=module]").src;
            const { Sha256 } = await import(own.replace("list.js", "sha256.js"));
            return sizes.map(size => {
                const bytes = Uint8Array.from({ length: size }, (_, i) => (7 * i) % 256);
                return new Sha256().update(bytes.subarray(0, 13)).update(bytes.subarray(13)).hex();
            });
        }""",
        sizes,
    )
    assert found == [hashlib.sha256(bytes((7 * i) % 256 for i in range(size))).hexdigest() for size in sizes]
