"""The door of the pages: what a person does in a browser, as docs/first-evening.md and docs/pages.md tell.

No figure comes from the API, and nothing is sent but by the pages: what is returned is what a person reads.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, expect

from radiometry.methods import get_method
from tests.journeys.door import Certificate, Door
from tests.journeys.plan import Corners, Figure, File, Plan
from tests.support.browser import complete_certificate, look, settle, sign_in, visit

# For what a worker computes, on a machine that has other work.
PATIENCE_MS = 120_000
_METER = {"kind": "Kind", "make": "Make", "model": "Model", "serial": "Serial number"}
_CERTIFICATE = {
    "number": "Certificate number",
    "laboratory": "Laboratory",
    "issued_on": "Issued on",
    "due_on": "Due on",
    "coverage_factor": "Coverage factor",
}
_BOARD = {
    "columns": "Columns",
    "rows": "Rows",
    "square_size_mm": "Side of a square",
}
_CHARTS = {"slanted_edge": "Slanted edges", "siemens_star": "Siemens stars"}
_MOTION = {
    "pixel_pitch_um": "Pixel pitch [µm]",
    "focal_length_mm": "Focal length [mm]",
    "distance_m": "Distance [m]",
    "ground_speed_m_s": "Ground speed [m/s]",
}
_QUANTITY = re.compile(r"(-?\d[\d ]*(?:\.\d+)?) ± (\d[\d ]*(?:\.\d+)?)")


class Pages(Door):
    """The pages at 1440 px; those on the way are looked at, and at 390 px too."""

    def __init__(self, url: str, key: str, folder: Path, *, browser: Browser):
        super().__init__(url, key, folder)
        self._visit = visit(browser, url)
        self._looked: set[str] = set()

    def __enter__(self):
        self.page = sign_in(self._visit.__enter__(), self.key, "/")
        return self

    def __exit__(self, *error):
        return self._visit.__exit__(*error)

    def register(self, plan: Plan) -> None:
        """Put off: a camera is registered with its card, meter and panel where they are asked for."""

    def begin(self, plan: Plan) -> None:
        """Put off: the card begins the campaign."""

    def send(self, plan: Plan) -> None:
        """Choose the card's folder on the first page, correct what is proposed, and send it."""
        page = self.page
        page.get_by_role("link", name="stilb").first.click()
        with page.expect_file_chooser() as chooser:
            page.get_by_role("button", name="Choose folder").click()
        chooser.value.set_files(plan.folder)
        self._choose_method(get_method(plan.method).label)
        self._correct_scenes(plan.files)
        page.get_by_label("Project number").fill(plan.number)
        self._see(plan, "1-card")
        page.get_by_role("button", name="Create campaign and send").click()
        expect(page.get_by_role("heading", level=1)).to_have_text(plan.number)
        received = page.get_by_role("status").filter(has_text=re.compile(r"(\d+) of \1 received"))
        # the first refusal stops the sending, and tells its reason
        others = page.get_by_role("button", name=re.compile("^Send the other"))
        expect(received.or_(others)).to_be_visible(timeout=PATIENCE_MS)
        if others.is_visible():
            others.click()
        expect(received).to_be_visible(timeout=PATIENCE_MS)
        if target := plan.details.get("target"):
            self._describe_target(target)
        if recorder := plan.details.get("recorder"):
            page.get_by_role("button", name="Edit details").click()
            page.get_by_role("dialog").get_by_label("Recorded by").fill(recorder)
            page.get_by_role("dialog").get_by_role("button", name="Save").click()
            settle(page)
        self._type_exposures(plan.files)
        if plan.panel:
            self._register_panel(plan.panel)
        self._see(plan, "2-campaign")

    def set_region(self, plan: Plan) -> None:
        """Click the corners on the preview, and the first one again; parts of a chart have names."""
        page = self.page
        expect(page.locator("#region-tool image")).to_be_visible(timeout=PATIENCE_MS)
        if plan.region:
            self._click(plan.region)
        for number, (name, corners) in enumerate((plan.regions or {}).items(), start=1):
            if number > 1:
                page.get_by_role("button", name="Add a part").click()
            self._click(corners)
            page.get_by_label(f"Name of part {number}").fill(name)
            page.get_by_label(f"Name of part {number}").blur()
        self._see(plan, "3-region")
        page.get_by_role("button", name="Use for all frames").click()
        expect(page.get_by_text("The region is set")).to_be_visible()

    def type_readings(self, plan: Plan) -> None:
        """Register each meter above the grid, and paste its lines; then sign the checklist."""
        dialog = self.page.get_by_role("dialog", name="Paste readings")
        known = self.page.get_by_label("Meter of typed readings")
        for meter in plan.meters:
            known.select_option("Register a meter…")
            self._register_meter(meter)
            lines = [each for each in plan.readings if each["quantity"] == meter["kind"]]
            if not lines:
                continue
            self.page.get_by_label("Unit of typed readings").select_option(lines[0]["unit"])
            expect(known.locator("option:checked")).to_contain_text(meter["serial"])
            text = "\n".join(f"{each['scene']}\t{each['value']}" for each in lines)
            self.page.get_by_role("button", name="Paste readings…").click()
            dialog.get_by_label("Lines").fill(text)
            dialog.get_by_role("button", name="Store").click()
            expect(dialog).to_have_count(0)
        self._sign_checklist(plan)
        self._see(plan, "4-readings")

    def fit(self, plan: Plan) -> str:
        page = self.page
        expect(page.get_by_text("Nothing is missing.")).to_be_visible(timeout=PATIENCE_MS)
        self._state(plan)
        page.get_by_role("button", name=re.compile("^Fit( K)?$")).last.click()
        page.wait_for_url(re.compile("/calibrations/cal_"), timeout=PATIENCE_MS)
        settle(page)
        self._see(plan, "5-version")
        return page.url.rpartition("/")[2]

    def publish(self, version: str, *, valid_from: str, valid_to: str | None = None, reason: str) -> None:
        page = self.page
        self._open_version(version)
        complete_certificate(page)
        page.get_by_role("button", name="Publish…").click()
        dialog = page.get_by_role("dialog", name="Publish version")
        for label, day in (("In force from", valid_from), ("Until", valid_to)):
            if day:
                dialog.get_by_label(re.compile(f"^{label}")).fill(f"{day}T00:00")
        dialog.get_by_label("Reason", exact=True).fill(reason)
        settle(page)
        self._look("6-publish")
        dialog.get_by_role("button", name="Publish", exact=True).click()
        expect(page.locator("#version-status")).to_contain_text("published")
        settle(page)

    def look_up(self, plan: Plan, name: str, *, at: str | None = None, **where: float | str) -> Figure:
        """On the page of the camera's coefficients in time."""
        page = self.page
        self._go("Cameras")
        page.get_by_role("row").filter(has_text=plan.camera["serial"]).get_by_role("link").first.click()
        settle(page)
        self._see(plan, "7-camera")
        page.get_by_role("link", name="Coefficients in time").click()
        settle(page)
        method = get_method(plan.method)
        page.get_by_role("navigation", name="Method").get_by_role("link", name=method.label).click()
        settle(page)
        if at:
            page.get_by_role("textbox", name="In force at").fill(f"{at} 12:00")
            page.keyboard.press("Enter")
            settle(page)
        choice = page.get_by_label("Show", exact=True)
        (label,) = _find_option(choice.locator("option").all_inner_texts(), method, name, where)
        choice.select_option(label=label)
        expect(page.locator("#values-title")).to_contain_text(label)
        settle(page)
        self._see(plan, "8-coefficients")
        answer = page.locator("#answer")
        expect(answer).to_contain_text("is in force")
        return _read_figure(answer.inner_text())

    def measure(self, plan: Plan, file: File, region: Corners) -> Figure:
        page = self.page
        self._go("Measurements")
        page.get_by_role("link", name="Measure a frame").first.click()
        settle(page)
        option = page.get_by_label("Campaign", exact=True).locator("option", has_text=plan.number).first
        page.get_by_label("Campaign", exact=True).select_option(option.get_attribute("value"))
        settle(page)
        page.get_by_label("Frame", exact=True).select_option(label=file.path.name)
        settle(page)
        self._click(region)
        self._see(plan, "9-new-measurement")
        page.get_by_role("button", name="Measure", exact=True).click()
        page.wait_for_url(re.compile("/measurements/msr_"), timeout=PATIENCE_MS)
        settle(page)
        self._see(plan, "10-measurement")
        mean = page.locator("#figures .figures > div").filter(has_text=re.compile("^Mean"))
        return _read_figure(mean.inner_text())

    def judge_fleet(self, method: str, serials: Sequence[str], *, tolerance: float) -> dict[str, str]:
        """On the page that compares cameras: the verdicts by name, as its table has them."""
        page = self.page
        self._go("Cameras")
        page.get_by_role("link", name="Compare cameras").click()
        page.get_by_label("Method", exact=True).select_option(method)
        for serial in serials:
            expect(page.get_by_role("checkbox", name=re.compile(serial))).to_be_checked()
        page.get_by_label(re.compile("^Accepted deviation")).fill(f"{tolerance:g}")
        page.get_by_role("button", name="Compare", exact=True).click()
        answer = page.locator("#fleet-answer")
        expect(answer.get_by_role("row")).not_to_have_count(0, timeout=PATIENCE_MS)
        settle(page)
        self._look("11-fleet")
        known = {
            "one set for all": "shared",
            "one set per camera": "per_camera",
            "inconclusive": "cannot_tell",
        }
        found = {}
        for row in answer.get_by_role("row").filter(has=page.locator("[title]")).all():
            verdict = row.locator(".tag").first.inner_text()
            found[row.locator("[title]").first.get_attribute("title")] = known.get(verdict, verdict)
        return found

    def find_motion_px(self, plan: Plan, file: File, **flight: float) -> float:
        """Read the exposure in the grid, and enter it in the calculator."""
        page = self.page
        self._go("Campaigns")
        page.get_by_role("link", name=plan.number).first.click()
        settle(page)
        page.get_by_label("Find a frame").fill(file.path.name)
        page.get_by_role("button", name=re.compile(f"^{re.escape(file.path.name)}")).click()
        said = page.get_by_role("dialog").locator(".shots").inner_text()
        page.keyboard.press("Escape")
        page.get_by_role("link", name="Calculators").click()
        for name, value in flight.items():
            page.get_by_label(_MOTION[name], exact=True).fill(f"{value:g}")
        (whole,) = re.findall(r"1/(\d+) s", said)
        page.get_by_label("Exposure time [s]", exact=True).fill(f"{1 / int(whole):g}")
        page.get_by_role("button", name="Compute").click()
        row = page.locator("#answer").get_by_role("row").filter(has_text=re.compile("^Forward blur"))
        expect(row).to_be_visible()
        self._look("12-motion")
        (blur_px,) = re.findall(r"\d+\.\d+", row.inner_text())
        return float(blur_px)

    def take_certificate(self, version: str) -> Certificate:
        """Both links of the version's page; `make verify` is told the address of the second."""
        self._open_version(version)
        status = self.page.locator("#version-status")
        pdf, told = (status.get_by_role("link", name=name).get_attribute("href") for name in ("PDF", "JSON"))
        return Certificate(pdf=self.page.request.get(pdf).body(), place=f"{self.url}{told}", data=self.url)

    # on a card

    def _choose_method(self, label: str) -> None:
        page = self.page
        expect(page.get_by_role("radio").first).to_be_visible(timeout=PATIENCE_MS)
        proposed = page.get_by_role("radio", name=f"New {label.lower()} calibration")
        if proposed.count():
            proposed.check()
            return
        page.get_by_role("radio", name="Something else").check()
        page.get_by_label("Method", exact=True).select_option(label=label)

    def _correct_scenes(self, files: Sequence[File]) -> None:
        """Set the role and name of each scene to those that the notebook has for its first frame."""
        page, known = self.page, {file.path.stem: file for file in files}
        leave_out = page.get_by_role("button", name="Leave out")
        while leave_out.count():
            leave_out.first.click()
        # from the last on: a scene that gets another role goes behind all others
        for number in range(page.get_by_label(re.compile(r"^Role of scene \d+$")).count(), 0, -1):
            page.get_by_role("button", name=re.compile(rf"frames? of scene {number}: show")).click()
            dialog = page.get_by_role("dialog")
            name = dialog.get_by_role("rowheader").first.inner_text().removesuffix(".DNG")
            dialog.get_by_role("button", name="Close").click()
            file = known[name]
            role = page.get_by_label(f"Role of scene {number}", exact=True)
            if role.input_value() != file.role:
                role.select_option(file.role)
            field = page.get_by_label(f"Name of scene {number}", exact=True)
            if file.scene and field.input_value() != file.scene:
                field.fill(file.scene)
                field.blur()

    # on a campaign

    def _describe_target(self, target: Mapping[str, Any]) -> None:
        page, section = self.page, self.page.get_by_role("region", name="Target")
        settle(page)
        if (folded := section.get_by_text(re.compile("^Change: "))).count():
            folded.click()
        if target["kind"] == "checkerboard":
            for name, label in _BOARD.items():
                section.get_by_label(re.compile(f"^{label}")).fill(str(target[name]))
        else:
            section.get_by_role("radio", name=_CHARTS[target["kind"]]).check()
            if cycles := target.get("cycles"):
                section.get_by_label("Cycles of the star").fill(str(cycles))
        section.get_by_role("button", name="Find it in the frames").click()
        expect(section.get_by_role("button", name="Find it in the frames")).to_be_hidden()
        settle(page)

    def _type_exposures(self, files: Sequence[File]) -> None:
        """What the notebook alone states: the same for all at once, else for those of an f-number's name."""
        page = self.page
        wanted = {tuple(file.exposure.items()) for file in files if file.exposure}
        if not wanted:
            return
        lines = page.locator("#before").get_by_role("listitem").filter(has_text="refused")
        unread = sum(bool(file.exposure) for file in files)
        expect(lines).to_contain_text(f"{unread} frames refused", timeout=PATIENCE_MS)
        for exposure in wanted:
            if len(wanted) > 1:
                page.get_by_label("Find a frame").fill(f"f{dict(exposure)['f_number']:g}-")
                page.get_by_role("button", name="Select all").click()
                page.get_by_role("button", name="Exposure…", exact=True).click()
            else:
                lines.get_by_role("button", name="Enter exposure…").click()
            dialog = page.get_by_role("dialog")
            for label, name in (("f-number", "f_number"), ("ISO", "iso")):
                dialog.get_by_label(label, exact=True).fill(str(dict(exposure)[name]))
            dialog.get_by_role("button", name="Read again").click()
            expect(dialog).to_have_count(0)
        page.get_by_label("Find a frame").fill("")
        expect(lines).to_have_count(0, timeout=PATIENCE_MS)

    def _register_panel(self, panel: Mapping[str, Any]) -> None:
        """From the line that says that it is missing."""
        page = self.page
        page.locator("#before").get_by_role("button", name="Choose panel…").click(timeout=PATIENCE_MS)
        dialog = page.get_by_role("dialog", name="Register a panel")
        dialog.get_by_label("Serial number").fill(panel["serial"])
        dialog.get_by_label("Measured on").fill(panel["measured_on"])
        lines = [" ".join(str(value) for value in band.values()) for band in panel["bands"]]
        dialog.get_by_label("Reflectance").fill("\n".join(lines))
        self._look("2-panel")
        dialog.get_by_role("button", name="Register").click()
        expect(dialog).to_have_count(0)

    def _register_meter(self, meter: Mapping[str, Any]) -> None:
        dialog = self.page.get_by_role("dialog", name="Register a meter")
        dialog.get_by_label("Kind").select_option(meter["kind"])
        for name, label in list(_METER.items())[1:]:
            dialog.get_by_label(label, exact=True).fill(meter[name])
        if certificate := meter.get("certificate"):
            for name, label in _CERTIFICATE.items():
                dialog.get_by_label(label, exact=True).fill(str(certificate[name]))
            percent = f"{100 * certificate['expanded_uncertainty_rel']:g}"
            dialog.get_by_label("Expanded uncertainty [%]").fill(percent)
        self._look("4-meter")
        dialog.get_by_role("button", name="Register").click()
        expect(dialog).to_have_count(0)

    def _sign_checklist(self, plan: Plan) -> None:
        page, checklist = self.page, self.page.locator("section#checklist")
        ticks = checklist.get_by_role("button", name=re.compile("open items of"))
        expect(ticks).not_to_have_count(0)
        while left := ticks.count():
            ticks.first.click()
            expect(ticks).to_have_count(left - 1)
        checklist.get_by_role("button", name="Sign the checklist").click()
        dialog = page.get_by_role("dialog")
        dialog.get_by_label("Operator").fill(plan.details.get("recorder", "B. Schulz"))
        dialog.get_by_role("button", name="Sign", exact=True).click()
        expect(page.get_by_role("list", name="Stages")).to_contain_text("signed")

    def _state(self, plan: Plan) -> None:
        """Enter what the fit takes and is not at its default."""
        page, parameters = self.page, {each.name: each for each in get_method(plan.method).parameters}
        given = {name: value for name, value in plan.details.items() if name in parameters} | plan.params
        changed = {name: value for name, value in given.items() if value != parameters[name].default}
        for name, value in changed.items():
            fold = "Parameters of the fit" if name in plan.params else "Light, distance and verdict"
            details = page.locator("#calibrate details").filter(has=page.get_by_text(fold, exact=True))
            if details.get_attribute("open") is None:
                details.locator("summary").first.click()
            control = details.get_by_label(re.compile(f"^{re.escape(parameters[name].label)}")).first
            if isinstance(value, str):
                control.select_option(value)
            else:
                percent = "[%]" in control.evaluate("each => each.labels[0].textContent")
                control.fill(f"{value * 100 if percent else value:g}")
        self._see(plan, "4-fit")

    # everywhere

    def _go(self, name: str) -> None:
        self.page.get_by_role("link", name=name, exact=True).first.click()
        settle(self.page)

    def _open_version(self, version: str) -> None:
        """A version's page is where a fit ends, and has its address."""
        if not self.page.url.endswith(version):
            self.page.goto(f"/calibrations/{version}")
            settle(self.page)

    def _click(self, corners: Corners) -> None:
        canvas = self.page.locator(".roi-canvas")
        expect(canvas.locator("image").first).to_be_visible(timeout=PATIENCE_MS)
        canvas.scroll_into_view_if_needed()
        across, down = canvas.evaluate("svg => [svg.viewBox.baseVal.width, svg.viewBox.baseVal.height]")
        box = canvas.bounding_box()
        scale = min(box["width"] / across, box["height"] / down)
        left, top = (box["width"] - across * scale) / 2, (box["height"] - down * scale) / 2
        for x, y in (*corners, corners[0]):
            canvas.click(position={"x": left + x * scale, "y": top + y * scale})

    def _see(self, plan: Plan, name: str) -> None:
        settle(self.page)
        self._look(f"{name}-{plan.method}")

    def _look(self, name: str) -> None:
        """Nothing sticks out; each page of a journey is looked at once."""
        if name not in self._looked:
            self._looked.add(name)
            look(self.page, f"journey-{name}")


def _find_option(
    labels: Sequence[str], method: Any, name: str, where: Mapping[str, float | str]
) -> list[str]:
    """Those that name the coefficient and all that it holds for, and no f-number unless one is wanted."""
    (kind,) = [each for each in method.coefficients if each.name == name]
    said = {"iso": "ISO {}", "f_number": "f/{:g}", "band": "band {}", "channel": "channel {}", "model": "{}"}
    words = [said[key].format(_plain(value)) for key, value in where.items()]
    return [
        label
        for label in labels
        if label.split(", ")[0] == kind.label
        and {*words} <= {*label.split(", ")[1:]}
        and ("f_number" in where or ", f/" not in label)
    ]


def _plain(value: float | str) -> float | str:
    return value.rpartition(":")[2].replace("_", " ") if isinstance(value, str) else value


def _read_figure(text: str) -> Figure:
    """The first value with its uncertainty; thousands are apart by thin spaces."""
    plain = re.sub(r"(?<=\d)[\u2009\u202f\u00a0](?=\d)", "", text).replace("\u2212", "-")
    found = _QUANTITY.search(plain.replace("\u202f", " ").replace("\u2009", " "))
    assert found, text
    value, u = (float(each.replace(" ", "")) for each in found.groups())
    return Figure(value, u)
