"""One version as people see it: plots to look into, a point left out, what publishing changes."""

import re

import pytest
from playwright.sync_api import expect

from radiometry.methods import METHODS, get_method
from service.calibrations.methods import NewCalibration, read_request
from store.codec import decode, drop_absent
from tests.support.browser import (
    ALL_DRAWN,
    DIALOG,
    WIDTHS,
    Held,
    check_access,
    complete_certificate,
    look,
    open_folds,
    settle,
    sign_in,
)
from tests.support.campaigns import ISOS, LEVELS, SETTINGS

USED = len(ISOS) * len(LEVELS) * len(SETTINGS)
# the point of a plot that lies furthest from all others: where it is on the page, and which frame it is
LONELIEST = """(plot) => {
    const points = [...document.querySelectorAll(`#${plot} .point[data-frame-id]`)].map((each) => {
        const { x, y, width, height } = each.getBoundingClientRect();
        const { frame, frameId: frame_id } = each.dataset;
        return { x: x + width / 2, y: y + height / 2, frame, frame_id };
    });
    const nearest = (one) => Math.min(
        ...points.filter((each) => each !== one).map((each) => Math.hypot(each.x - one.x, each.y - one.y)),
    );
    const found = points.reduce((best, each) => nearest(each) > nearest(best) ? each : best);
    return {...found, points: points.length};
}"""

BOTTOMS = "cards => cards.map((each) => Math.round(each.getBoundingClientRect().bottom))"
# the dialog for a refit of any version, whatever the page shows
REFIT = """(calibration) => {
    const page = document.querySelector("script[type=module]").src;
    import(page.replace("page.js", "decide.js")).then(({ fitAnew }) => fitAnew(calibration));
}"""
# as if the time had passed that an answer may take
IMPATIENT = (
    "const { timeout } = AbortSignal; AbortSignal.timeout = (ms) => timeout.call(AbortSignal, ms / 10);"
)
# the parameters of a version in words
FACTS = """async ([method, values]) => {
    const page = document.querySelector("script[type=module]").src;
    const { parameterFacts } = await import(page.replace("calibration/page.js", "campaign/parameters.js"));
    const { methodOf } = await import(page.replace("calibration/page.js", "methods.js"));
    return parameterFacts(values, methodOf(method).parameters).textContent;
}"""
LENS = {"id": "cal_lens", "version": 3, "state": "published", "content_sha256": "f" * 64}


@pytest.fixture
def shown(night_page, night):
    night_page.goto(f"/calibrations/{night.version.id}")
    settle(night_page)
    open_folds(night_page)
    expect(night_page.locator("#signal-plot .chart")).to_be_visible()
    expect(night_page.locator(".plot:not(:has(.chart))")).to_have_count(0)
    # where a plot has nothing to show, its neighbours are drawn again in its room
    night_page.wait_for_function(ALL_DRAWN, arg=night_page.locator("main").element_handle())
    return night_page


def find_point(page, plot):
    page.locator(f"#{plot}").scroll_into_view_if_needed()
    return page.evaluate(LONELIEST, plot)


def list_labels(parameter):
    return [parameter.label, *(label for each in parameter.members for label in list_labels(each))]


def draft(night, **params):
    """A version of this test's own."""
    return night.team.client.calibrate(night.campaign_id, **params)


def test_what_was_found_stands_there_with_its_uncertainty(shown, night):
    expect(shown.get_by_role("heading", level=1)).to_have_text("Luminance version 1")
    expect(shown.locator("#version-status")).to_contain_text("published")
    figures = shown.locator(".key-figures")
    expect(figures).to_contain_text(
        re.compile(r"ISO 3200 K.*2\.0\d+ ± 0\.0\d+ DN·m²/\(cd·s\)u = 2\.2 % · relative onlyISO 6400")
    )
    expect(figures.get_by_role("img", name="Passes")).to_have_count(len(ISOS))
    rows = shown.locator("#coefficients").get_by_role("row")
    expect(rows.filter(has_text="f/")).to_have_count(2 * len(ISOS))
    rows = rows.filter(has_text="all")
    expect(rows.filter(has_text="3200")).to_contain_text(re.compile(r"2\.0\d+ ± 0\.0\d+ DN·m²/\(cd·s\)"))
    expect(shown.locator("#flags")).to_contain_text("lacks the error of the meter's scale")
    models = shown.locator("#models").get_by_role("row")
    expect(models).to_have_count(1 + 4 * len(ISOS))
    expect(models.filter(has_text="reported")).to_have_count(len(ISOS))
    expect(shown.locator("#budget")).to_contain_text(re.compile(r"u = 2\.2 %.*f-number 2\.1 %"))
    lower = shown.get_by_role("list", name="What would lower it, at best").get_by_role("listitem")
    expect(lower.filter(has_text="Measure the true f-numbers")).to_contain_text("2.2 % → 0.70 %")
    frames = lower.filter(has_text="Measure the true f-numbers").get_by_role("link", name="Add frames")
    expect(frames).to_have_attribute("href", f"/campaigns/{night.campaign_id}")
    shown.get_by_role("button", name="ISO 6400", exact=True).click()
    expect(shown.locator("#budget caption")).to_have_text("Budget of ISO 6400")
    expect(shown.locator("#made")).to_contain_text(re.compile("[0-9a-f]{64}"))
    expect(shown.locator("#history")).to_contain_text("spring, reviewed by A. Meier")
    plots = get_method(night.version.method).plots
    # all frames are of one time: against it there is nothing to see
    expect(shown.locator(".plot-card .chart")).to_have_count(len(plots) - 2)
    assert len(set(shown.locator(".plot-card:not(.wide-plot)").evaluate_all(BOTTOMS))) <= 3


def test_the_answer_comes_first_and_what_lies_behind_it_is_folded(night_page, night):
    night_page.goto(f"/calibrations/{draft(night, tolerance=0.05).id}")
    settle(night_page)
    expect(night_page.locator("details[open]")).to_have_count(0)
    expect(night_page.get_by_role("heading", name="Before you publish")).to_be_visible()
    for size, most in ((WIDTHS["desktop"], 2_000), (WIDTHS["phone"], 4_500)):
        night_page.set_viewport_size(dict(zip(("width", "height"), size, strict=True)))
        settle(night_page)
        assert night_page.evaluate("document.documentElement.scrollHeight") < most


def test_plots_are_looked_into(shown):
    """Points are touched, a part is magnified, a series hidden; axes are linear or logarithmic."""
    touch_points(shown)
    hide_a_series(shown)
    change_the_axes(shown)


def touch_points(shown):
    for plot in ("signal-plot", "residuals-signal-plot"):
        found = find_point(shown, plot)
        assert found["points"] == USED
        shown.mouse.move(found["x"], found["y"])
        tip = shown.locator(".tip", has_text=found["frame"])
        expect(tip).to_contain_text("ISO")
        # the same frame is lit in every plot that shows it
        expect(shown.locator(f".point.lit[data-frame-id={found['frame_id']}]")).to_have_count(4)
        expect(tip.locator("img").first).not_to_have_js_property("naturalWidth", 0)
        expect(tip).to_contain_text("residual")


def change_the_axes(shown):
    axes = shown.locator("#signal-plot text.mid", has_text="[")
    expect(axes).to_have_text(["X = t S L / f²  [cd·s/m²]", "signal above dark [DN]"])
    with shown.expect_response("**/signal?*part=1*"):
        shown.get_by_role("button", name="Logarithmic", exact=True).click()
    expect(axes).to_have_text(
        ["X = t S L / f²  [cd·s/m²], logarithmic", "signal above dark [DN], logarithmic"]
    )
    # a telephone that is turned gets another drawing of the same
    shown.set_viewport_size({"width": 390, "height": 844})
    expect(shown.locator("#signal-plot .chart")).to_have_attribute("width", re.compile(r"^3\d\d$"))
    expect(shown.get_by_role("button", name="Logarithmic", exact=True)).to_have_attribute(
        "aria-pressed", "true"
    )


def hide_a_series(shown):
    plot = shown.locator("#residuals-signal-plot")
    plot.scroll_into_view_if_needed()
    points = plot.locator(".point[data-frame-id]")
    expect(points).to_have_count(USED)
    name = plot.locator(".legend").first
    name.click()
    expect(plot.locator(".off:not(.legend)").first).to_be_hidden()
    name.click()
    expect(plot.locator(".off")).to_have_count(0)


def test_a_point_is_left_out_with_a_reason_and_the_version_before_stays(shown, night):
    found = find_point(shown, "residuals-signal-plot")
    shown.mouse.click(found["x"], found["y"])
    chosen = shown.get_by_role("region", name="Chosen points")
    expect(chosen).to_contain_text(found["frame"])
    shown.get_by_role("button", name="Show all").click()
    expect(shown.get_by_role("checkbox", name=f"Choose {found['frame']}")).to_be_checked()
    # on a slow line a reason is written before the parameters are there
    parameters = Held(shown, "**/calibrations?method=*", times=1)
    chosen.get_by_role("button", name="Exclude and refit").click()
    dialog = shown.get_by_role("dialog")
    check_access(shown)
    dialog.get_by_label("Reason for exclusion").fill("somebody walked through the light")
    dialog.get_by_role("button", name="Refit").click()
    parameters.release().continue_()
    shown.wait_for_url(re.compile(f"/calibrations/(?!{night.version.id})"))
    settle(shown)
    open_folds(shown)
    shown.get_by_role("button", name="Show all").click()
    row = shown.locator("#points").get_by_role("row").filter(has_text=found["frame"])
    expect(row).to_contain_text("somebody walked through the light")
    expect(shown.locator("#version-status")).to_contain_text("draft")
    expect(shown.locator("#siblings").get_by_role("row").filter(has_text="1 excluded").first).to_be_visible()
    # once more, with what was left out kept and another model
    second = shown.url
    shown.get_by_role("button", name="Refit…", exact=True).click()
    dialog.get_by_label("Model").select_option("affine")
    expect(dialog.get_by_role("checkbox", name=found["frame"])).to_be_checked()
    dialog.get_by_role("button", name="Refit").click()
    shown.wait_for_url(lambda url: "/calibrations/" in url and url != second and night.version.id not in url)
    settle(shown)
    with night.team.http() as http:
        parameters = http.get(f"/v1{shown.url.removeprefix(night.team.url)}").json()["parameters"]
    assert parameters["model"] == "affine"
    (excluded,) = parameters["exclude"]
    assert (excluded["frame"], excluded["reason"]) == (found["frame"], "somebody walked through the light")


def other_than_default(parameter):
    """A value that the parameter may have, as a version stores it."""
    low, high, default = parameter.minimum or 0.0, parameter.maximum, parameter.default
    match parameter.kind:
        case "choice":
            return next(each.value for each in reversed(parameter.choices) if each.value != default)
        case "boolean":
            return not default
        case "interval":
            return [low + (high - low) * part for part in (0.3, 0.7)]
        case "group":
            return {each.field: other_than_default(each) for each in parameter.members}
        case "version" | "text":
            return LENS["content_sha256"] if parameter.kind == "version" else parameter.example
    return ((low if default is None else default) + high) / 2


def test_a_refit_asks_for_every_parameter_of_its_version(night_page, night):
    """By the names that requests have for them; what is switched off stays off.

    The form is sent before the versions are there that it offers, and one question after the job has no
    answer.
    """
    bodies = []

    def start(route):
        bodies.append(route.request.post_data_json)
        route.fulfill(json={"id": "job_1"}, status=202)

    job = {"id": "job_1", "state": "succeeded", "result": {"calibration_id": "cal_1"}}
    night_page.route("**/v1/campaigns/cmp_1/calibrations", start)
    night_page.route("**/v1/jobs/job_1", lambda route: route.fulfill(json=job))
    lost = Held(night_page, "**/v1/jobs/job_1", times=1)
    lenses = Held(night_page, "**/v1/cameras/cam_1/calibrations?**")
    night_page.add_init_script(IMPATIENT)
    night_page.goto(f"/calibrations/{night.version.id}")
    settle(night_page)
    dialog = night_page.get_by_role("dialog")
    for spec in METHODS:
        parameters = [each for each in spec.parameters if each.given_by == "request"]
        for stored in (
            {each.field: other_than_default(each) for each in parameters},
            {each.field: None if each.none_allowed else each.default for each in parameters},
        ):
            version = {"id": "cal_1", "camera_id": "cam_1", "campaign_id": "cmp_1", "method": spec.name}
            said = night_page.evaluate(FACTS, [spec.name, drop_absent(stored)])
            shown = [each for each in parameters if stored[each.field] is not None]
            assert all(label in said for each in shown for label in list_labels(each)), said
            assert not re.search(r"[{}]|\[object|\b[a-z]+_[a-z]+\b", said), said
            night_page.evaluate(REFIT, version | {"parameters": drop_absent(stored), "points": []})
            dialog.get_by_role("button", name="Refit").click()
            for _ in {each.version_of for each in parameters} - {""}:
                lenses.release().fulfill(json={"items": [LENS]})
            expect(dialog).to_have_count(0)
            asked = read_request(NewCalibration(bodies.pop()), spec).read_parameters(spec)
            named = {
                each.field: LENS["id"] for each in parameters if each.kind == "version" and stored[each.field]
            }
            assert decode(spec.params, asked) == decode(spec.params, stored | named), spec.name
    assert len(lost) == 1


def test_what_publishing_changes_is_seen_before_it_is_decided(night_page, night):
    version = draft(night, tolerance=0.031)
    night_page.goto(f"/calibrations/{version.id}")
    settle(night_page)
    dialog = night_page.get_by_role("dialog")
    expect(night_page.get_by_role("button", name="Publish…")).to_be_disabled()
    complete_certificate(night_page)
    night_page.get_by_role("button", name="Publish…").click()
    expect(dialog).to_contain_text("Version 1 is in force then")
    made = len(list(night.team.client.measurements(calibration_id=night.version.id)))
    expect(dialog).to_contain_text(f"{made} measurements were made with the version in force")
    settle(night_page)
    check_access(night_page)
    look(night_page, "calibration-publish")
    # what was asked for another date, and comes later, is not shown over it
    earlier = Held(night_page, "**/impact?at=2026-05-01*")
    dialog.get_by_label("In force from (UTC)").fill("2026-05-01T00:00")
    dialog.get_by_label("Reason").click()
    dialog.get_by_label("In force from (UTC)").fill("2025-01-01T00:00")
    dialog.get_by_label("Reason").click()
    expect(dialog).to_contain_text("Nothing is in force then")
    with night_page.expect_response("**/impact?at=2026-05-01*"):
        earlier.release().continue_()
    night_page.evaluate("() => new Promise((done) => setTimeout(done, 200))")
    expect(dialog).to_contain_text("Nothing is in force then")
    dialog.get_by_label("Until (UTC)").fill("2025-02-01T00:00")
    dialog.get_by_label("Reason").fill("a rehearsal")
    dialog.get_by_role("button", name="Publish", exact=True).click()
    in_force = re.compile("2025-01-01 . 2025-02-01")
    expect(night_page.locator("#version-status")).to_contain_text(in_force, timeout=60_000)
    expect(night_page.locator("#history")).to_contain_text("a rehearsal")
    night_page.get_by_role("button", name="Revoke…").click()
    expect(dialog).to_contain_text("No measurements were made with it")
    check_access(night_page, DIALOG)
    dialog.get_by_label("Reason").fill("it was a rehearsal")
    dialog.get_by_role("button", name="Revoke permanently").click()
    expect(night_page.locator("#version-status")).to_contain_text("it was a rehearsal")
    expect(night_page.get_by_role("button", name="Publish")).to_have_count(0)


def test_the_certificate_and_the_points_can_be_downloaded(shown):
    for name, kind in (("PDF", "application/pdf"), ("JSON", "application/json")):
        address = shown.locator("#version-status").get_by_role("link", name=name).get_attribute("href")
        answer = shown.request.get(address)
        assert (answer.status, answer.headers["content-type"]) == (200, kind)
    with shown.expect_download() as download:
        shown.get_by_role("link", name="Download as CSV").click()
    lines = download.value.path().read_text(encoding="utf-8").splitlines()
    assert len(lines) == 1 + USED
    # a chart as a picture: with styles of its own
    with shown.expect_download() as download:
        shown.locator("#signal-plot").get_by_role("link", name="Save as SVG").click()
    assert "<style>" in download.value.path().read_text(encoding="utf-8")


def test_a_key_that_may_only_read_is_offered_nothing_else(context, night):
    with night.team.http() as http:
        made = http.post("/v1/keys", json={"name": "the office", "scopes": ["read"]})
    page = sign_in(context, made.json()["secret"])
    page.goto(f"/calibrations/{night.version.id}")
    settle(page)
    expect(page.locator(".key-figures")).to_be_visible()
    expect(
        page.locator("main").get_by_role("button").filter(has_text=re.compile("Publish|Revoke|Fit"))
    ).to_have_count(0)
    expect(page.locator("#points").get_by_role("checkbox")).to_have_count(0)
    page.goto(f"/campaigns/{night.measured_id}")
    expect(page.locator("#frames")).to_contain_text("opens a frame, ? shows all keys")
