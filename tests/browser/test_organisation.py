"""The organisation: keys, sessions and its details."""

import re

import pytest
from playwright.sync_api import expect

from tests.support.browser import check_access, look, settle, sign_in, visit
from tests.support.furnishing import furnish


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
        look(other, "dark-keys")
        page.reload()
        settle(page)
        page.get_by_role("button", name="End the session of Field tablet 2").click()
        expect(page.locator("#sessions").get_by_role("row")).to_have_count(2)
        other.reload()
        expect(other).to_have_url(re.compile("/sign-in"))
    row.get_by_role("button", name="Revoke Field tablet 2").click()
    page.get_by_role("button", name="Revoke key").click()
    expect(row).to_have_count(0)
    page.get_by_role("button", name="Ended").click()
    expect(row).to_be_visible()
    look(page, "keys-ended")


def test_a_webhook_is_added_tested_sent_again_and_removed(page):
    page.goto("/organisation/webhooks")
    settle(page)
    expect(page.get_by_text("No webhooks")).to_be_visible()
    page.get_by_role("button", name="New webhook…").click()
    dialog = page.get_by_role("dialog")
    asked = dialog.get_by_role("button", name="About Address")
    asked.focus()
    page.keyboard.press("Enter")
    expect(dialog.get_by_text("https, without a login")).to_be_visible()
    expect(asked).to_have_attribute("aria-expanded", "true")
    address = dialog.get_by_label("Address", exact=True)
    expect(address).to_have_accessible_description(re.compile("without a login"))
    address.fill("https://board.invalid/hook")
    dialog.get_by_label("job: failed").check()
    check_access(page)
    look(page, "webhook-new")
    dialog.get_by_role("button", name="Add webhook").click()
    made = page.locator("#made")
    secret = made.locator("code").inner_text()
    assert secret.startswith("whsec_")
    look(page, "webhook-made")
    made.get_by_role("button", name="I have saved it").click()
    page.get_by_role("button", name="Test: https://board.invalid/hook").click()
    sent = page.locator("#log").get_by_role("row").filter(has_text="webhook: test")
    # the name is nowhere: each attempt fails, and the next waits
    expect(sent).to_contain_text(re.compile(r"\d attempt"))
    page.get_by_role("button", name=re.compile("Send again: webhook: test")).click()
    expect(page.get_by_text("It is queued")).to_be_visible()
    expect(sent).to_have_count(1)
    settle(page)
    look(page, "webhooks")
    assert secret not in page.content()
    page.get_by_role("button", name="Disable: https://board.invalid/hook").click()
    expect(page.locator("#webhooks")).to_contain_text("It was disabled by a key.")
    page.get_by_role("button", name="Remove: https://board.invalid/hook").click()
    page.get_by_role("button", name="Remove webhook").click()
    expect(page.get_by_text("No webhooks")).to_be_visible()
    expect(page.locator("#log-section")).to_be_hidden()


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
        look(page, f"organisation-{scheme}")


def test_the_audit_trail_is_chosen_exported_and_its_chain_told(browser, service, team):
    furnish(service.database, team.key)
    with visit(browser, service.url, color_scheme="dark") as context:
        page = sign_in(context, team.key)
        page.goto("/organisation/audit")
        settle(page)
        expect(page.locator("#chain")).to_contain_text("The chain is intact")
        rows = page.locator("#entries").get_by_role("row")
        expect(rows.filter(has_text="published").first).to_contain_text("yearly calibration")
        expect(rows.nth(2)).to_contain_text("first")
        look(page, "dark-audit")
        page.get_by_label("What").select_option("registered a camera")
        expect(page.locator("#counted")).to_have_text("3 entries, all there are")
        page.get_by_role("button", name="Only the entries of DJI FC6520 0K1XE8").click()
        expect(page.locator("#counted")).to_have_text("1 entry, all there are")
        page.locator("#entries summary").click()
        expect(page.locator("#entries")).to_contain_text("pixel pitch um")
        look(page, "dark-audit-one")
        with page.expect_download() as saved:
            page.get_by_role("link", name="Export CSV").click()
        assert len(saved.value.path().read_text().splitlines()) == 2
        page.get_by_role("button", name="Clear").click()
        expect(page.locator("#older")).to_be_hidden()
        expect(rows.filter(has_text="published").first).to_be_visible()
        broken = {"state": "broken", "entries": 4182, "broken_at": 4183, "detail": "entry 4183 was edited"}
        context.route("**/v1/audit/chain*", lambda route: route.fulfill(json=broken))
        page.get_by_role("button", name="Check again").click()
        expect(page.locator("#chain")).to_contain_text("The chain is broken at entry 4183")
    with visit(browser, service.url, width="phone") as context:
        page = sign_in(context, team.key)
        page.goto("/organisation/audit?action=revocation.create")
        settle(page)
        expect(page.get_by_text("No entries")).to_be_visible()
        check_access(page)
        page.get_by_label("What").select_option("published")
        expect(page.locator("#counted")).to_have_text("8 entries, all there are")
        look(page, "audit")
