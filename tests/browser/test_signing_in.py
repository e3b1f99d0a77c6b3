"""Into the pages with a key, around in them, and out again."""

import re

from playwright.sync_api import expect

from tests.support.browser import check_access, look, settle, sign_in


def test_who_is_not_signed_in_signs_in_and_goes_on_where_they_wanted(stranger_context, team):
    page = stranger_context.new_page()
    page.goto("/jobs?state=failed")
    expect(page).to_have_url(re.compile(r"/sign-in\?next="))
    page.get_by_label("Key").fill(team.key)
    page.keyboard.press("Enter")
    expect(page).to_have_url(re.compile(r"/jobs\?state=failed$"))


def test_a_wrong_key_is_told_on_the_page(stranger_context):
    page = stranger_context.new_page()
    page.goto("/sign-in")
    page.get_by_label("Key").fill("stilb_nobody_has_this")
    page.get_by_role("button", name="Sign in").click()
    expect(page.get_by_role("alert")).to_contain_text("This key is not known")
    check_access(page)
    # the browser itself notes the 401 of the page
    assert [said for said in stranger_context.complaints if "401" not in said] == []
    stranger_context.complaints.clear()


def test_signing_out_ends_it(context, team):
    page = sign_in(context, team.key, "/")
    page.locator("summary", has_text="first").click()
    page.get_by_role("button", name="Sign out").click()
    expect(page).to_have_url(re.compile("/sign-in$"))
    page.goto("/")
    expect(page).to_have_url(re.compile("/sign-in"))


def test_a_page_that_is_not_there_says_so(page):
    page.goto("/nowhere")
    expect(page.get_by_role("heading", level=1)).to_have_text("Not found")
    check_access(page)
    look(page, "problem")
    page.context.complaints.clear()
    page.get_by_role("link", name="Home").click()
    settle(page)


def test_the_first_tab_leads_past_the_navigation(page):
    page.goto("/")
    page.keyboard.press("Tab")
    expect(page.get_by_role("link", name="Skip to the content")).to_be_focused()
    page.keyboard.press("Enter")
    expect(page.locator("main")).to_be_focused()


def test_who_is_signed_in_follows_a_link_from_elsewhere(page, service):
    html = f'<a href="{service.url}/jobs?from=mail">the queue</a>'
    page.context.route(
        "http://elsewhere.example/", lambda route: route.fulfill(body=html, content_type="text/html")
    )
    page.goto("http://elsewhere.example/")
    page.get_by_role("link", name="the queue").click()
    expect(page).to_have_url(f"{service.url}/jobs?from=mail")
    settle(page)
