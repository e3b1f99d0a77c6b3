"""Write the entries of the registry of findings into the pages of the documentation.

An entry is the text between ``<!-- finding -->`` and ``<!-- end -->`` under a heading that is its code. What
follows the second mark is written by hand.
"""

import re
import textwrap
from pathlib import Path

from radiometry.findings import Finding
from radiometry.methods.findings import FINDINGS

PLACES = {"errors": ("file", "request", "job"), "on-site": ("verdict",), "certificate": ("certificate",)}
PAGES = tuple(Path(__file__).with_name(f"{name}.md") for name in PLACES)
_ENTRY = re.compile(r"^(#+ (\w+)\n)<!-- finding -->\n.*?<!-- end -->$", re.MULTILINE | re.DOTALL)
_OUTCOMES = {"warn": "Warn. ", "pending": "Pending. ", "fail": "Fail. ", "error": "Fail. "}
_OF_THE_SCIENCE = 422
"""Status of most refusals; the page of errors states it once."""


def fill_entries(text: str, *, page: str) -> str:
    """Return a page with its entries as the registry has them."""
    return _ENTRY.sub(lambda found: f"{found[1]}{_format(FINDINGS[found[2]], page)}", text)


def _format(finding: Finding, page: str) -> str:
    errors = page == "errors"
    status = f"{finding.status}. " if errors and finding.status not in (None, _OF_THE_SCIENCE) else ""
    outcome = _OUTCOMES[finding.severity] if page == "on-site" else status
    lines = [f"{outcome}{finding.sentence}", finding.remedy]
    if errors:
        lines.append(f"Retryable: {'yes' if finding.retryable else 'no'}.")
    wrapped = [textwrap.fill(line, 128, break_long_words=False, break_on_hyphens=False) for line in lines]
    return "\n".join(["<!-- finding -->", *wrapped, "<!-- end -->"])


if __name__ == "__main__":
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        page.write_text(fill_entries(text, page=page.stem), encoding="utf-8")
