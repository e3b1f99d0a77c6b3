"""A person without a mouse: goes to what they want with Tab, and must see at each step where they are."""

from playwright.sync_api import Locator, Page, expect

MOST_STEPS = 80
# what each focus is found wanting: kept over navigations
WATCH = """
    const tell = (what) =>
        localStorage.faults = `${localStorage.faults ?? ""}${location.pathname}: ${what}\\n`;
    const named = (element) => `${element.tagName}#${element.id}.${element.getAttribute("class")} `
        + (element.getAttribute("aria-label") ?? element.textContent.trim().slice(0, 40));
    const ringed = (element) => [element, ...element.children].some((each) => {
        const { outlineStyle, outlineWidth, stroke, strokeWidth } = getComputedStyle(each);
        return (outlineStyle !== "none" && parseFloat(outlineWidth) >= 1)
            || (stroke !== "none" && parseFloat(strokeWidth) >= 2);
    });
    const uncovered = (element) => {
        const { left, right, top, bottom } = element.getBoundingClientRect();
        const within = (low, high, most) => [0.5, 0.1, 0.9].map((share) =>
            Math.max(low, 0) + share * (Math.min(high, most) - Math.max(low, 0)));
        return within(left, right, innerWidth).some((x) => within(top, bottom, innerHeight).some((y) => {
            const hit = document.elementFromPoint(x, y);
            return hit && (element.contains(hit) || hit.contains(element) || hit.closest("#toasts"));
        }));
    };
    // what is drawn above a place moves it: it is looked at again, for as long as nobody could tell
    const look = (element, frames = 6) => {
        if (document.activeElement !== element || element.matches("main, h1")) return;
        if (!uncovered(element)) {
            const isDrawn = document.querySelector("[aria-busy=true]") === null;
            if (!isDrawn || frames > 0) return requestAnimationFrame(() => look(element, frames - isDrawn));
            tell(`covered or out of sight: ${named(element)}`);
        }
        if (!ringed(element)) tell(`focus is not seen on ${named(element)}`);
    };
    // a new page begins at its top, and a place within it where that is; else it has been lost
    let held = null;
    addEventListener("hashchange", () => held = null);
    // a link within the page takes the focus a moment before it is told
    const drawn = () => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
    window.lost = () => drawn().then(() =>
        document.activeElement === document.body && held && tell(`focus is lost after ${held}`));
    addEventListener("focusin", ({ target }) => {
        held = named(target);
        requestAnimationFrame(() => requestAnimationFrame(() => look(target)));
    }, { capture: true });
    const clicked = ({ target }) => tell(`a mouse was used on ${named(target)}`);
    addEventListener("mousedown", clicked, { capture: true });
"""
IS_FOCUSED = "element => element === document.activeElement"


class Keyboard:
    """The keys of a page; ``faults`` are what a sighted person without a mouse stumbled over."""

    def __init__(self, page: Page):
        self.page = page
        page.context.add_init_script(WATCH)

    @property
    def faults(self) -> list[str]:
        return (self.page.evaluate("localStorage.faults") or "").splitlines()

    def reach(self, target: Locator, step: str = "Tab") -> None:
        """Press Tab until the focus is there."""
        expect(target).to_be_visible()
        self.page.evaluate("lost()")
        for _ in range(MOST_STEPS):
            if target.evaluate(IS_FOCUSED):
                return
            self.page.keyboard.press(step)
        raise AssertionError(f"{target} is not reached with {step}: {self.faults}")

    def press(self, target: Locator, key: str = "Enter", step: str = "Tab") -> None:
        self.reach(target, step)
        self.page.keyboard.press(key)

    def write(self, target: Locator, text: str) -> None:
        """In place of what stands there."""
        self.reach(target)
        if target.get_attribute("type") == "date":
            # month, day and year are fields of their own
            year, month, day = text.split("-")
            return self.page.keyboard.type(f"{month}{day}{year}")
        self.page.keyboard.press("ControlOrMeta+a")
        return self.page.keyboard.insert_text(text)
