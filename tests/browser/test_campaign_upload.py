"""Files on their way: known ones are not sent, a lost connection and a reload lose nothing."""

import hashlib
import re
from datetime import UTC, datetime

import pytest
from playwright.sync_api import expect

from tests.support.browser import Held, settle, sign_in, visit
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


def choose_large(page, team, folder, *, count, shape=(1000, 1500)):
    page.goto(f"/campaigns/{team.campaign().id}")
    choose(page, [write_frame(folder / f"level-1-{n}.DNG", shape=shape, seed=n) for n in range(count)])
    expect(page.get_by_text("all compared")).to_be_visible()


def names_of(team, campaign):
    with team.http() as http:
        items = http.get(f"/v1/campaigns/{campaign.id}/frames").json()["items"]
    return sorted(item["filename"] for item in items)


@pytest.mark.usefixtures("campaign")
def test_a_button_that_is_pressed_while_the_list_changes_is_clicked(page, files):
    # what is drawn above moves the button from under the mouse
    expect(page.get_by_role("link", name="Add frames")).to_be_visible()
    choose(page, files[:1])
    settle(page)
    page.get_by_role("button", name="Send 1 file").hover()
    page.mouse.down()
    choose(page, files[1:2])
    page.wait_for_timeout(300)  # longer than the second file is compared
    page.mouse.up()
    expect(page.get_by_text(re.compile(r"^\d of \d received"))).to_be_visible()


def test_frames_of_another_day_wait_to_be_included(team, campaign, page, files, tmp_path):
    other = write_frame(tmp_path / "DJI_0009.DNG", seed=9, taken_at=datetime(2025, 1, 1, 9, tzinfo=UTC))
    choose(page, [*files, other])
    aside = page.get_by_role("listitem").filter(has_text="1 frame of another day. 2025-01-01 09:00")
    expect(page.get_by_role("button", name="Send 3 files")).to_be_visible()
    aside.get_by_role("button", name="Include").click()
    page.get_by_role("button", name="Send 4 files").click()
    expect(page.get_by_text(re.compile("^4 of 4 received"))).to_be_visible()
    expect(aside).to_have_count(0)
    assert len(names_of(team, campaign)) == 4


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


def test_without_a_connection_one_file_looks_for_it_for_all(page, team, files):
    campaign = team.campaign()
    page.goto(f"/campaigns/{campaign.id}")
    choose(page, files)
    expect(page.get_by_text("all compared")).to_be_visible()
    failed = []
    page.on("requestfailed", lambda asked: asked.method == "POST" and failed.append(asked.url))
    page.context.set_offline(True)
    page.get_by_role("button", name=re.compile("^Send [0-9]+ files")).click()
    expect(page.get_by_text(f"{len(files)} waiting for the connection")).to_be_visible()
    page.wait_for_timeout(5000)
    # the first two, and another every two seconds
    assert 3 <= len(failed) <= 5
    page.context.set_offline(False)
    expect(page.get_by_text(f"{len(files)} of {len(files)} received")).to_be_visible()
    page.context.complaints.clear()


def test_files_that_the_service_fails_at_hold_up_no_other(page, team, tmp_path):
    card = [write_frame(tmp_path / f"level-1-{seed}.DNG", seed=seed) for seed in range(6)]
    page.goto(f"/campaigns/{team.campaign().id}")
    choose(page, card)
    problem = {"title": "Internal error", "status": 500, "code": "internal_error", "retryable": True}
    # as many as are under way at once
    page.route(
        re.compile(UPLOADS.pattern + ".*level-1-[0-3]"), lambda route: route.fulfill(status=500, json=problem)
    )
    page.get_by_role("button", name="Send 6 files").click()
    expect(page.get_by_role("link", name="2 received")).to_be_visible()
    page.unroute_all()
    expect(page.get_by_text("6 of 6 received")).to_be_visible()
    page.context.complaints.clear()


def test_a_connection_that_is_back_is_seen_before_a_large_file_is_whole(page, team, tmp_path):
    choose_large(page, team, tmp_path, count=3)
    page.route("**/v1/uploads", lambda route: route.abort("connectionfailed"))
    page.get_by_role("button", name="Send 3 files").click()
    lost = page.get_by_text("No connection since")
    expect(lost).to_be_visible()
    held = Held(page, "**/v1/uploads/*", times=2)
    page.unroute("**/v1/uploads")
    held.release().continue_()
    expect(lost).to_have_count(0)
    held.release().continue_()
    expect(page.get_by_text("3 of 3 received")).to_be_visible()
    page.context.complaints.clear()


def test_a_large_file_that_the_service_fails_at_is_tried_after_the_others(page, team, tmp_path):
    choose_large(page, team, tmp_path, count=5)
    tried = []

    def answer(route):
        tried.append(route.request.url)
        if tried[-1] == tried[0]:
            route.fulfill(status=500, json={"detail": "Broken", "code": "internal_error", "retryable": True})
        else:
            route.fallback()

    page.route(
        "**/v1/uploads/*", lambda each: answer(each) if each.request.method == "PATCH" else each.fallback()
    )
    page.get_by_role("button", name="Send 5 files").click()
    expect(page.get_by_role("link", name="4 received")).to_be_visible()
    again = [at for at, url in enumerate(tried) if url == tried[0]][1:] or [len(tried)]
    assert len({*tried[1 : again[0]]}) >= 3  # of four, of which one may be at its first question yet
    page.unroute_all()
    expect(page.get_by_text("5 of 5 received")).to_be_visible()
    page.context.complaints.clear()


def test_files_that_are_chosen_without_a_connection_are_taken_when_it_is_back(page, team, files):
    page.goto(f"/campaigns/{team.campaign().id}")
    settle(page)
    page.context.set_offline(True)
    choose(page, files)
    again = page.locator("#upload").get_by_role("button", name="Try again")
    expect(again).to_be_visible()
    page.context.set_offline(False)
    again.click()
    page.get_by_role("button", name=f"Send {len(files)} files").click()
    expect(page.get_by_text(f"{len(files)} of {len(files)} received")).to_be_visible()
    page.context.complaints.clear()


def test_a_connection_that_has_died_without_a_word_is_given_up(page, team, files):
    made = team.campaign()
    page.clock.install()
    page.goto(f"/campaigns/{made.id}")
    wake = "document.dispatchEvent(new Event('visibilitychange'))"
    # a phone that has slept, and one whose page stays in view while its network is gone
    for number, (file, silent_s, then) in enumerate([(files[0], 40, wake), (files[1], 150, "0")], 1):
        unanswered = Held(page, UPLOADS, times=1)
        choose(page, [file])
        with page.expect_request(UPLOADS):
            page.get_by_role("button", name="Send 1 file").click()
        page.clock.fast_forward(1000 * silent_s)
        page.evaluate(then)
        expect(page.get_by_text(f"{number} of {number} received")).to_be_visible()
        assert len(unanswered) == 1
    assert names_of(team, made) == sorted(each.name for each in files[:2])


def test_hashes_are_right_where_the_browser_has_none(page):
    page.goto("/campaigns")
    # at and around the ends of a block
    sizes = [0, 55, 56, 64, 1000, 70_000]
    found = page.evaluate(
        """async sizes => {
            const own = document.querySelector("script[type=module]").src;
            const { Sha256 } = await import(own.replace("list.js", "hash-worker.js"));
            return sizes.map(size => {
                const bytes = Uint8Array.from({ length: size }, (_, i) => (7 * i) % 256);
                return new Sha256().update(bytes.subarray(0, 13)).update(bytes.subarray(13)).hex();
            });
        }""",
        sizes,
    )
    assert found == [hashlib.sha256(bytes((7 * i) % 256 for i in range(size))).hexdigest() for size in sizes]


@pytest.mark.usefixtures("campaign")
def test_what_is_on_its_way_is_not_called_missing(page, files):
    before = page.get_by_role("region", name="Before the fit")
    stages = page.get_by_role("list", name="Stages")
    expect(before).to_contain_text("The campaign has no light frame")
    held = []
    page.route(UPLOADS, lambda route: held.append(route))  # noqa: PLW0108  it counts what a handler takes
    choose(page, files[:1])
    page.get_by_role("button", name="Send 1 file").click()
    expect(stages).to_contain_text("waiting for frames")
    expect(before).to_have_count(0)
    while not held:
        page.wait_for_timeout(20)
    held[0].continue_()
    needed = before.get_by_role("listitem").filter(has_text="needed")
    expect(needed.last).to_contain_text("Scene 1 has no luminance reading")
