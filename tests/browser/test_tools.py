"""The calculators, with the manual behind each of their fields."""

import re

from playwright.sync_api import expect

from tests.support.browser import check_access, look, settle

MOTION = {
    "Pixel pitch [µm]": "4.65",
    "Focal length [mm]": "9",
    "Exposure time [s]": "1/400 s",
    "Distance [m]": "100",
    "Ground speed [m/s]": "15",
}


def test_calculators_answer_with_units_and_lead_into_the_manual(night_page):
    page = night_page
    page.goto("/")
    page.get_by_role("link", name="Calculators").click()
    for label, value in MOTION.items():
        page.get_by_label(label, exact=True).fill(value)
    page.get_by_label("Ground speed [km/h]", exact=True).fill("54")
    page.get_by_role("button", name="Compute").press("Enter")
    expect(page.get_by_role("alert")).to_contain_text("ground speed in m/s or ground speed in km/h, not both")
    page.context.complaints.clear()
    page.get_by_label("Ground speed [km/h]", exact=True).fill("")
    page.get_by_role("button", name="Compute").press("Enter")
    rows = page.locator("#answer").get_by_role("row")
    expect(rows.filter(has_text=re.compile("^Theoretical blur"))).to_contain_text("0.7258")
    expect(rows.filter(has_text="Longest exposure")).to_contain_text("1/581 s")
    page.get_by_label("Focal length [mm]", exact=True).fill("6")
    page.get_by_role("button", name="Compare with this, too").click()
    expect(rows.filter(has_text=re.compile("^Theoretical blur"))).to_contain_text("0.72580.4839")
    settle(page)
    # no name of the API in its sentences
    expect(page.locator("main")).not_to_contain_text(re.compile("[a-z]_[a-z]"))
    check_access(page)
    look(page, "tools-motion")
    page.reload()
    expect(rows.filter(has_text=re.compile("^Theoretical blur"))).to_contain_text("0.4839")
    with page.expect_popup() as opened:
        page.get_by_role("link", name="Focal length [mm] in the manual").press("Enter")
    expect(opened.value.locator("code:target")).to_have_text("focal_length_mm")
    look(opened.value, "manual-tools")
    opened.value.close()

    page.get_by_role("navigation", name="Calculators").get_by_role("link", name="Coverage").click()
    for label, value in (("Height [m]", "100"), ("Tilt [°]", "30"), ("Focal length [mm]", "9")):
        page.get_by_label(label, exact=True).fill(value)
    for label, value in (("width", "6.4"), ("height", "4.8")):
        page.get_by_label(f"Sensor {label} [mm]", exact=True).fill(value)
    page.get_by_label("Pixel pitch [µm]", exact=True).fill("4.65")
    page.get_by_role("button", name="Compute").click()
    expect(rows.filter(has_text="Field of view")).to_contain_text("39.")
    settle(page)
    look(page, "tools-coverage")

    page.get_by_role("navigation", name="Calculators").get_by_role("link", name="Exposure").click()
    page.get_by_label("White level [DN]", exact=True).fill("16384")
    table = page.locator("textarea")
    given = table.input_value()
    table.fill(given.replace("812", "bright"))
    page.get_by_role("button", name="Compute").click()
    expect(page.get_by_role("alert")).to_contain_text("Line 3 ")
    page.context.complaints.clear()
    table.fill(given)
    page.get_by_role("button", name="Compute").click()
    expect(rows.filter(has_text="Exponents")).to_contain_text("0.99")
    settle(page)
    look(page, "tools-exposure")
