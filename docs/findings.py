"""Write what flags, reasons and errors mean, from the registry of findings, into the pages: `make findings`.

In a page of PLACES an entry is the first paragraph under a heading that is its code; what follows is written
by hand. The page of flags is written whole.
"""

import re
import textwrap
from pathlib import Path

from radiometry.findings import Finding
from radiometry.methods.findings import FINDINGS

DOCS = Path(__file__).parent
PLACES = {"errors": ("file", "request", "job"), "on-site": ("verdict",), "certificate": ("certificate",)}
_FLAGS = ("frame", "campaign", "calibration", "measurement", "fleet")
_ENTRY = re.compile(r"^(#+ (\w+)\n)(?:.+\n)*", re.MULTILINE)
_OUTCOMES = {"warn": "Warn. ", "pending": "Pending. ", "fail": "Fail. ", "error": "Fail. "}
_OF_THE_SCIENCE = 422
"""Status of most refusals; the page of errors states it once."""
_HEAD = """# Flags

A flagged result is usable, with a reservation. The pages and the commands show each flag with its meaning and
its remedy, and `GET /v1/findings` lists all. `make findings` writes this page from the same source.
"""


def render() -> dict[Path, str]:
    """Return each page with its text as the registry gives it."""
    pages = {}
    for name, places in PLACES.items():

        def fill(found: re.Match[str], name: str = name, places: tuple[str, ...] = places) -> str:
            code = found[2]
            return f"{found[1]}{_format(FINDINGS[code], name)}\n" if _belongs(code, places) else found[0]

        path = DOCS / f"{name}.md"
        pages[path] = _ENTRY.sub(fill, path.read_text(encoding="utf-8"))
    flags = sorted(code for code in FINDINGS if _belongs(code, _FLAGS))
    return {**pages, DOCS / "flags.md": "\n".join([_HEAD, *map(_format_flag, flags)])}


def _belongs(code: str, places: tuple[str, ...]) -> bool:
    return code in FINDINGS and bool({*places} & {*FINDINGS[code].where})


def _format_flag(code: str) -> str:
    elsewhere = next((name for name, places in PLACES.items() if _belongs(code, places)), None)
    linked = f"See [{elsewhere}]({elsewhere}.md#{code})."
    return f"## {code}\n{linked if elsewhere else _format(FINDINGS[code], 'flags')}\n"


def _format(finding: Finding, page: str) -> str:
    errors = page == "errors"
    status = f"{finding.status}. " if errors and finding.status not in (None, _OF_THE_SCIENCE) else ""
    outcome = _OUTCOMES[finding.severity] if page == "on-site" else status
    lines = [f"{outcome}{finding.sentence}", finding.remedy]
    if errors and finding.retryable:
        lines.append("Retryable.")
    fill = textwrap.TextWrapper(128, break_long_words=False, break_on_hyphens=False).fill
    return "\n".join(map(fill, lines))


if __name__ == "__main__":
    for page, text in render().items():
        page.write_text(text, encoding="utf-8")
