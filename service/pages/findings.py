"""Entries of what codes mean, for pages of the manual: the registry of findings as Markdown."""

import re

from radiometry.methods.findings import FINDINGS

PLACES = {
    "errors": ("file", "request", "job"),
    "on-site": ("verdict",),
    "certificate": ("certificate",),
    "flags": ("frame", "campaign", "calibration", "measurement", "fleet"),
}
"""Where the findings occur that a page explains."""
_HEADING = re.compile(r"^#+ (\w+)\n", re.MULTILINE)
_OUTCOMES = {"warn": "Warn. ", "pending": "Pending. ", "fail": "Fail. ", "error": "Fail. "}
_OF_THE_SCIENCE = 422
"""Status of most refusals; the page of errors states it once."""


def expand_entries(text: str, page: str) -> str:
    """Put what a code means under its heading, and every code of a page where it wants them."""
    every = (f"## {code}\n" for code in sorted(FINDINGS) if _belongs(code, page))
    text = text.replace("<!-- findings -->\n", "\n".join(every))
    return _HEADING.sub(lambda found: f"{found[0]}{_describe(found[1], page)}", text)


def find_page(code: str) -> str | None:
    """Return the first page that explains a code."""
    return next((page for page in PLACES if _belongs(code, page)), None)


def _belongs(code: str, page: str) -> bool:
    return code in FINDINGS and bool({*PLACES.get(page, ())} & {*FINDINGS[code].where})


def _describe(code: str, page: str) -> str:
    if not _belongs(code, page):
        return ""
    finding, errors = FINDINGS[code], page == "errors"
    status = f"HTTP {finding.status}: " if errors and finding.status not in (None, _OF_THE_SCIENCE) else ""
    outcome = _OUTCOMES[finding.severity] if page == "on-site" else status
    retryable = "\nRetryable." if errors and finding.retryable else ""
    return f"{outcome}{finding.sentence}\n{finding.remedy}{retryable}\n\n"
