"""What people read: the reference of this API, and what each error means. No key is needed."""

from pathlib import Path

from fastapi import APIRouter, Request, Response

from service.problems import HttpCode, Problem
from service.web.markdown import render_markdown
from service.web.page import build_page
from service.web.reference import render_reference

router = APIRouter(include_in_schema=False)

_ERRORS = Path(__file__).parents[2] / "docs" / "errors.md"


@router.get("/docs")
def get_reference(request: Request) -> Response:
    return build_page("stilb API", render_reference(request.app.openapi()))


@router.get("/docs/errors")
def get_errors_page() -> Response:
    """The page to which the `type` of every problem points."""
    if not _ERRORS.is_file():
        raise Problem(404, HttpCode.NOT_FOUND, "This installation came without its page of errors.")
    return build_page("stilb errors", render_markdown(_ERRORS.read_text(encoding="utf-8")))
