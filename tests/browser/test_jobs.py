"""The queue as people see it, and the first page."""

import re

from playwright.sync_api import expect

from tests.browser.test_every_page import check_both
from tests.support.browser import check_access, look, settle, sign_in
from tests.support.furnishing import furnish, postpone, set_aside


def test_an_empty_house_says_what_to_do(page):
    for path, said in (
        ("/", "Camera, scenes and darks are found for you"),
        ("/jobs", "No failed jobs"),
        ("/measurements", "No measurements yet"),
        ("/measurements/new", "No campaigns yet"),
    ):
        page.goto(path)
        settle(page)
        expect(page.get_by_text(said)).to_be_visible()
        look(page, f"empty{path.replace('/', '-')}")


def test_a_cause_is_dismissed_listed_again_by_a_key_and_tried_again(page, service, team):
    furnish(service.database, team.key)
    set_aside(service.database, team.key)
    page.goto("/jobs")
    settle(page)
    line = page.locator("#failures li").filter(has_text="A fit failed")
    expect(line).to_contain_text("Its worker was lost 3 times")
    check_access(page)
    look(page, "jobs")
    line.get_by_role("button", name="Dismiss").click()
    expect(page.get_by_text("No failed jobs")).to_be_visible()
    expect(page.locator("#recent")).to_contain_text("dismissed")
    page.keyboard.press("z")
    expect(line).to_be_visible()
    with page.expect_response("**/v1/jobs/retry") as retried:
        line.get_by_role("button", name="Retry").click()
    assert retried.value.status == 202
    # it has no frames to fit: the worker says so, and the page without being loaded again
    expect(line).to_contain_text("P-")
    expect(line).not_to_contain_text("worker was lost")


def test_finished_jobs_are_a_line_for_each_campaign(night_page):
    night_page.goto("/jobs")
    settle(night_page)
    line = night_page.locator("#recent details").filter(has_text="Luminance")
    expect(line).to_contain_text(re.compile(r"\d+ fits?, \d+ frames read · median \d+ s"))
    expect(line.get_by_role("table")).to_be_hidden()
    line.locator("summary").click()
    expect(line.get_by_role("table", name="Finished jobs")).to_contain_text("succeeded")


def test_the_operator_sees_workers_disk_and_stored_files(context, service):
    page = sign_in(context, service.key, "/jobs")
    settle(page)
    health = page.locator("#health")
    expect(health).to_contain_text(re.compile(r"Workers\s*\d of \d"))
    for text in ("ready", " free", "Stored files"):
        expect(health).to_contain_text(text)
    check_both(page)
    look(page, "jobs-operator")


def test_a_job_that_waits_for_a_passing_fault_says_when_it_is_tried_again(page, service, team):
    furnish(service.database, team.key)
    postpone(service.database, team.key)
    page.goto("/jobs")
    settle(page)
    row = page.locator("#recent").get_by_role("row").filter(has_text="next attempt")
    expect(row).to_contain_text(re.compile(r"next attempt \d{4}-\d\d-\d\d \d\d:\d\d UTC"))


def test_a_job_that_ends_is_seen_without_reloading(page, team):
    page.goto("/jobs")
    settle(page)
    campaign = team.campaign()
    with team.http() as http:
        answer = http.post(
            f"/v1/campaigns/{campaign.id}/frames",
            content=b"no raw file",
            params={"role": "light", "filename": "DJI_0007.DNG"},
        )
    assert answer.status_code == 201
    line = page.locator("#failures li").filter(has_text="DJI_0007.DNG")
    expect(line).to_contain_text("1 frame refused")
    line.get_by_role("link", name="Show frames").click()
    expect(page).to_have_url(re.compile(f"/campaigns/{campaign.id}"))
    settle(page)


def test_the_first_page_says_what_needs_attention(page, service, team):
    furnish(service.database, team.key)
    set_aside(service.database, team.key)
    page.goto("/")
    settle(page)
    needs = page.locator("#needs")
    for text in ("failed", "Meter certificate expired", "A camera is not calibrated", "noise high"):
        expect(needs).to_contain_text(text)
    expect(page.locator("#in-force")).to_contain_text("version 3")
    check_access(page)
    look(page, "home")
    needs.get_by_role("link", name="Show camera").first.click()
    expect(page).to_have_url(re.compile("/cameras/cam_"))
    settle(page)


def test_a_lost_connection_is_told_and_the_page_goes_on_when_it_is_back(page, context):
    page.goto("/jobs")
    settle(page)
    context.set_offline(True)
    expect(page.locator("#lost")).to_contain_text("The service does not answer")
    page.goto("about:blank")
    context.set_offline(False)
    context.route("**/v1/cameras*", lambda route: route.abort())
    page.goto("/cameras")
    settle(page)
    expect(page.get_by_role("alert")).to_contain_text("The service does not answer")
    context.unroute("**/v1/cameras*")
    page.get_by_role("button", name="Try again").click()
    expect(page.get_by_text("No cameras yet")).to_be_visible()
    context.complaints.clear()
