"""Entries of what codes mean, for pages of the manual: the registry of findings as Markdown."""

import re
import textwrap
from collections.abc import Iterable

from radiometry.findings import Finding
from radiometry.methods.findings import FINDINGS

PLACES = {
    "errors": ("file", "request", "job"),
    "on-site": ("verdict",),
    "certificate": ("certificate",),
    "flags": ("frame", "campaign", "calibration", "measurement", "fleet"),
}
"""Where the findings occur that a page explains; one of several pages has those of the first."""
_PLACE = re.compile(r"^<!-- findings: (\S+) -->\n", re.MULTILINE)
_OUTCOMES = {"warn": "Warn. ", "pending": "Pending. ", "fail": "Fail. ", "error": "Fail. "}
_OF_THE_SCIENCE = 422
"""Status of most refusals; the page of errors states it once."""


def expand_entries(text: str) -> str:
    """Put the entries of a page where it says so: ``<!-- findings: errors -->``."""
    return _PLACE.sub(lambda found: "\n".join(list_entries(found[1])), text)


def list_entries(page: str) -> Iterable[str]:
    """Return each entry of a page, as Markdown under its code."""
    for code in sorted(FINDINGS):
        if page == find_page(code):
            yield f"## {code}\n{describe(FINDINGS[code], page)}\n"


def find_page(code: str) -> str | None:
    """Return the page that explains a code."""
    return next((page for page in PLACES if belongs(code, page)), None)


def belongs(code: str, page: str) -> bool:
    return code in FINDINGS and bool({*PLACES[page]} & {*FINDINGS[code].where})


def describe(finding: Finding, page: str) -> str:
    """Return what a finding means and what to do, in lines as a page has them."""
    errors = page == "errors"
    status = f"HTTP {finding.status}: " if errors and finding.status not in (None, _OF_THE_SCIENCE) else ""
    outcome = _OUTCOMES[finding.severity] if page == "on-site" else status
    lines = [f"{outcome}{finding.sentence}", finding.remedy]
    if errors and finding.retryable:
        lines.append("Retryable.")
    fill = textwrap.TextWrapper(128, break_long_words=False, break_on_hyphens=False).fill
    return "\n".join(map(fill, lines))
