"""The calculators, which store nothing."""

from typing import Annotated, Final

from fastapi import Depends, Request, Response

from radiometry.findings import interface
from service.auth import Reader
from service.operations import Router
from service.problems import Problem
from service.routes.tools import read_tool_figures
from service.schemas.tools.exposure import ExposureTable
from service.web.charts import View, draw_figure, send_svg
from service.web.rendering import SignedInPage

_TOOLS: Final = {"motion": "Motion", "coverage": "Coverage", "exposure": "Exposure"}

router = Router(include_in_schema=False)


@router.get("/tools/{tool}")
def show_calculator(tool: str, page: SignedInPage) -> Response:
    if tool not in _TOOLS:
        raise Problem(interface.NOT_FOUND, f"There is no calculator {tool}.")
    pages = [(f"/tools/{name}", title) for name, title in _TOOLS.items()]
    return page.render("tools.html", title=_TOOLS[tool], tool=tool, pages=pages)


@router.post("/plots/tools/{tool}")
async def show_plot(
    tool: str, request: Request, view: Annotated[View, Depends()], _caller: Reader
) -> Response:
    """Answer what the page draws for the question in the body; of a table, the query says the rest."""
    names = ExposureTable.model_fields.keys() & request.query_params.keys()
    table = ExposureTable.model_validate({name: request.query_params[name] for name in names})
    figures = await read_tool_figures(tool, request, table)
    parts = [each.part for each in figures if each.part]
    drawn = figures[min(view.part, len(figures) - 1)]
    return send_svg(draw_figure(drawn, _TOOLS[tool], view=view, parts=parts, is_wide=True))
