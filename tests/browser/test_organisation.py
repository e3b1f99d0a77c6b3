"""The organisation: keys, sessions and its details."""

import re

from playwright.sync_api import expect

from tests.support.browser import check_access, look, settle, sign_in, visit
from tests.support.furnishing import furnish


def test_a_key_is_made_seen_once_used_and_revoked(page, context, browser, service):
    page.goto("/organisation")
    settle(page)
    page.keyboard.press("Tab")
    page.get_by_role("button", name="New key…").focus()
    page.keyboard.press("Enter")
    page.get_by_label("Name", exact=True).fill("Field tablet 2")
    page.get_by_label("Person", exact=True).fill("A. Meier")
    page.get_by_label("send", exact=True).check()
    check_access(page)
    look(page, "key-new")
    page.keyboard.press("Enter")
    # half a signature is none
    expect(page.get_by_role("dialog")).to_contain_text("a certificate names a person with name and role")
    context.complaints.clear()
    page.get_by_label("Role", exact=True).fill("physicist")
    page.keyboard.press("Enter")
    made = page.locator("#made")
    secret = made.locator("code").inner_text()
    expect(made).to_contain_text("it is not shown again")
    check_access(page)
    look(page, "key-made")
    row = page.locator("#keys").get_by_role("row").filter(has_text="Field tablet 2")
    expect(row).to_contain_text("never used")
    expect(row).to_contain_text("A. Meier")
    made.get_by_role("button", name="I have saved it").click()
    assert secret not in page.content()
    with visit(browser, service.url, color_scheme="dark", width="phone") as tablet:
        other = sign_in(tablet, secret)
        other.goto("/organisation")
        settle(other)
        expect(other.locator("#keys")).to_contain_text("ask an administrator")
        expect(other.locator("#sessions").get_by_role("row")).to_have_count(2)
        expect(other.locator(".who-name")).to_have_text("A. Meier")
        look(other, "dark-keys")
        page.reload()
        settle(page)
        page.get_by_role("button", name="End the session of Field tablet 2").click()
        expect(page.locator("#sessions").get_by_role("row")).to_have_count(2)
        other.reload()
        expect(other).to_have_url(re.compile("/sign-in"))
    row.get_by_role("button", name="Person of Field tablet 2").click()
    page.get_by_label("Role", exact=True).fill("head of the laboratory")
    page.get_by_role("button", name="Save").click()
    expect(row).to_contain_text("head of the laboratory")
    row.get_by_role("button", name="Revoke Field tablet 2").click()
    page.get_by_role("button", name="Revoke key").click()
    expect(row).to_have_count(0)
    page.get_by_role("button", name="Ended").click()
    expect(row).to_be_visible()
    look(page, "keys-ended")


def test_details_are_edited(page):
    page.goto("/organisation/details")
    settle(page)
    page.get_by_role("button", name="Edit…").click()
    page.get_by_label("Name on certificates").fill("Laboratory of Light")
    page.get_by_label("Address on certificates").fill("Platz 1, 10587 Berlin")
    check_access(page)
    page.get_by_role("button", name="Save").click()
    for text in ("Platz 1", "Laboratory of Light"):
        expect(page.locator("#details")).to_contain_text(text)
    expect(page.locator("#storage")).to_contain_text("no limit")
    look(page, "organisation")


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
        page.get_by_role("button", name="only this (DJI FC6520 0K1XE8)").click()
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
        context.unroute_all()
        page.goto("/organisation/audit?action=revocation.create")
        settle(page)
        expect(page.get_by_text("No entries")).to_be_visible()
        check_access(page)
        page.get_by_label("What").select_option("published")
        expect(page.locator("#counted")).to_have_text("8 entries, all there are")
        look(page, "audit")
