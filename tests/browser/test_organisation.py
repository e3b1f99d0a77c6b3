"""The organisation: keys, sessions and its details."""

import re

import pytest
from playwright.sync_api import expect

from tests.support.browser import check_access, look, settle, sign_in, visit


def test_a_key_is_made_seen_once_used_and_revoked(page, browser, service):
    page.goto("/organisation")
    settle(page)
    page.keyboard.press("Tab")
    page.get_by_role("button", name="New key…").focus()
    page.keyboard.press("Enter")
    page.get_by_label("Name", exact=True).fill("Field tablet 2")
    page.get_by_label("send", exact=True).check()
    check_access(page)
    look(page, "key-new")
    page.keyboard.press("Enter")
    made = page.locator("#made")
    secret = made.locator("code").inner_text()
    expect(made).to_contain_text("it is not shown again")
    check_access(page)
    look(page, "key-made")
    row = page.locator("#keys").get_by_role("row").filter(has_text="Field tablet 2")
    expect(row).to_contain_text("never used")
    made.get_by_role("button", name="I have saved it").click()
    assert secret not in page.content()
    with visit(browser, service.url, color_scheme="dark", width="phone") as tablet:
        other = sign_in(tablet, secret)
        other.goto("/organisation")
        settle(other)
        expect(other.locator("#keys")).to_contain_text("ask an administrator")
        expect(other.locator("#sessions").get_by_role("row")).to_have_count(2)
        check_access(other)
        look(other, "dark-keys")
        page.reload()
        settle(page)
        page.get_by_role("button", name="End the session of Field tablet 2").click()
        expect(page.locator("#sessions").get_by_role("row")).to_have_count(2)
        other.reload()
        expect(other).to_have_url(re.compile("/sign-in"))
    row.get_by_role("button", name="Revoke Field tablet 2").click()
    check_access(page)
    page.get_by_role("button", name="Revoke key").click()
    expect(row).to_have_count(0)
    page.get_by_role("button", name="Ended").click()
    expect(row).to_be_visible()
    look(page, "keys-ended")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_details_are_edited(browser, service, team, scheme):
    with visit(browser, service.url, color_scheme=scheme) as context:
        page = sign_in(context, team.key)
        page.goto("/organisation/details")
        settle(page)
        page.get_by_role("button", name="Edit…").click()
        page.get_by_label("Address on certificates").fill("Platz 1, 10587 Berlin")
        check_access(page)
        page.get_by_role("button", name="Save").click()
        expect(page.locator("#details")).to_contain_text("Platz 1")
        expect(page.locator("#storage")).to_contain_text("no limit")
        check_access(page)
        look(page, f"organisation-{scheme}")
