"""Write what reasons and missing items mean into their pages, from the registry of findings: `make findings`.

An entry is the first paragraph under a heading that is its code; what follows is written by hand.
"""

import re
from pathlib import Path

from radiometry.methods.findings import FINDINGS
from service.pages.findings import belongs, describe

DOCS = Path(__file__).parent
PAGES = ("on-site", "certificate")
_ENTRY = re.compile(r"^(#+ (\w+)\n)(?:.+\n)*", re.MULTILINE)


def render() -> dict[Path, str]:
    """Return each page with its text as the registry gives it."""
    pages = {}
    for name in PAGES:

        def fill(found: re.Match[str], name: str = name) -> str:
            code = found[2]
            return f"{found[1]}{describe(FINDINGS[code], name)}\n" if belongs(code, name) else found[0]

        path = DOCS / f"{name}.md"
        pages[path] = _ENTRY.sub(fill, path.read_text(encoding="utf-8"))
    return pages


if __name__ == "__main__":
    for page, text in render().items():
        page.write_text(text, encoding="utf-8")
