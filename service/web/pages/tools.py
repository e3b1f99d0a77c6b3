"""The calculators, which store nothing."""

from typing import Final

from fastapi import Response

from radiometry.findings import interface
from service.operations import Router
from service.problems import Problem
from service.web.rendering import SignedInPage

_TOOLS: Final = {"motion": "Motion", "coverage": "Coverage", "exposure": "Exposure"}

router = Router(include_in_schema=False)


@router.get("/tools/{tool}")
def show_calculator(tool: str, page: SignedInPage) -> Response:
    if tool not in _TOOLS:
        raise Problem(interface.NOT_FOUND, f"There is no calculator {tool}.")
    pages = [(f"/tools/{name}", title) for name, title in _TOOLS.items()]
    return page.render("tools.html", title=_TOOLS[tool], tool=tool, pages=pages)
