"""The queue as people see it, and the first page."""

import re

from playwright.sync_api import expect

from tests.support.browser import check_access, look, settle
from tests.support.furnishing import furnish, postpone, set_aside


def test_an_empty_house_says_what_to_do(page):
    page.goto("/")
    settle(page)
    expect(page.get_by_text("Camera, scenes and darks are found for you")).to_be_visible()
    check_access(page)
    look(page, "home-empty")
    page.goto("/jobs")
    settle(page)
    expect(page.get_by_text("No failed jobs")).to_be_visible()
    check_access(page)
    look(page, "jobs-empty")


def test_what_failed_stands_there_with_its_reason_and_is_tried_again(page, service, team):
    furnish(service.database, team.key)
    job_id = set_aside(service.database, team.key)
    page.goto("/jobs")
    settle(page)
    row = page.locator("#failures").get_by_role("row").filter(has_text="Fit of P-")
    expect(row).to_contain_text("Its worker was lost 3 times")
    check_access(page)
    look(page, "jobs")
    with page.expect_response(f"**/v1/jobs/{job_id}/retry") as retried:
        row.get_by_role("button", name="Retry").click()
    assert retried.value.status == 202
    # it has no frames to fit: the worker says so, and the page without being loaded again
    expect(row.get_by_text("failed", exact=True)).to_be_visible()


def test_a_job_that_waits_for_a_passing_fault_says_when_it_is_tried_again(page, service, team):
    furnish(service.database, team.key)
    postpone(service.database, team.key)
    page.goto("/jobs")
    settle(page)
    row = page.locator("#recent").get_by_role("row").filter(has_text="next attempt")
    expect(row).to_contain_text(re.compile(r"next attempt \d{4}-\d\d-\d\d \d\d:\d\d UTC"))
    check_access(page)


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
    row = page.locator("#failures").get_by_role("row").filter(has_text="DJI_0007.DNG")
    expect(row).to_contain_text("JPEG")
    row.get_by_role("link", name="DJI_0007.DNG")


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
