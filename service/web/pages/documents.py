"""Documentation pages: the reference of this API, and the meaning of each error. No key is needed."""

from pathlib import Path

from fastapi import APIRouter, Request, Response
from markupsafe import Markup

from service.auth import find_session
from service.context import UsesContext
from service.web.markdown import render_markdown
from service.web.reference import render_reference
from service.web.rendering import render

router = APIRouter(include_in_schema=False)

_INSTALLED = Path(__file__).parents[1] / "errors.md"
_ERRORS = _INSTALLED if _INSTALLED.is_file() else Path(__file__).parents[3] / "docs" / "errors.md"


@router.get("/docs")
def get_reference(request: Request, context: UsesContext) -> Response:
    return _page(request, context, "API", render_reference(request.app.openapi()))


@router.get("/docs/errors")
def get_errors_page(request: Request, context: UsesContext) -> Response:
    """The page to which the `type` of every problem points."""
    return _page(request, context, "Errors", render_markdown(_ERRORS.read_text(encoding="utf-8")))


def _page(request: Request, context: UsesContext, title: str, html: str) -> Response:
    """Around HTML that is safe by now."""
    body = Markup(html)  # noqa: S704  both renderers escape what they are given
    return render(request, "document.html", title=title, body=body, caller=find_session(request, context))
