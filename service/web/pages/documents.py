"""Documentation pages: the reference of this API, and the manual. No key is needed."""

from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Request, Response
from fastapi import Path as InPath
from fastapi.responses import FileResponse
from markupsafe import Markup

from radiometry.findings import interface
from service.auth import find_session
from service.context import UsesContext
from service.document import Document
from service.immutable import not_modified
from service.problems import Problem
from service.web.markdown import render_markdown
from service.web.reference import render_reference
from service.web.rendering import render

router = APIRouter(include_in_schema=False)

_INSTALLED = Path(__file__).parents[1] / "manual"
_MANUAL = _INSTALLED if _INSTALLED.is_dir() else Path(__file__).parents[3] / "docs"


@router.get("/openapi.json")
def get_document(request: Request) -> Response:
    """Send the OpenAPI document, packed once: it changes with the release alone."""
    document: Document = request.app.state.document
    headers = {"ETag": f'"{document.tag}"', "Cache-Control": "no-cache", "Vary": "Accept-Encoding"}
    packed = "gzip" in request.headers.get("accept-encoding", "")
    return not_modified(request, document.tag, headers) or Response(
        document.packed if packed else document.text,
        headers=headers | ({"Content-Encoding": "gzip"} if packed else {}),
        media_type="application/json",
    )


@router.get("/docs")
def get_reference(request: Request, context: UsesContext) -> Response:
    return _page(request, context, "API", render_reference(request.app.openapi()))


@router.get("/docs/manual")
def get_manual(request: Request, context: UsesContext) -> Response:
    pages = [page for page in sorted(_MANUAL.glob("*.md")) if page.stem != "index"]
    lines = "".join(f"- [{_title(page.read_text(encoding='utf-8'))}]({page.name})\n" for page in pages)
    return _page(request, context, "Manual", render_markdown(f"# Manual\n\n{lines}"))


@router.get("/docs/{name}")
def get_manual_page(
    name: Annotated[str, InPath(pattern="^[a-z-]+$")], request: Request, context: UsesContext
) -> Response:
    """A page of the manual; to that of errors the `type` of every problem points."""
    text = _file(f"{name}.md").read_text(encoding="utf-8")
    return _page(request, context, _title(text), render_markdown(text))


@router.get("/docs/pictures/{name}")
def get_picture(name: Annotated[str, InPath(pattern="^[a-z0-9-]+[.](svg|webp)$")]) -> Response:
    return FileResponse(_file(f"pictures/{name}"), headers={"Cache-Control": "public, max-age=3600"})


def _title(text: str) -> str:
    return text.partition("# ")[2].partition("\n")[0]


def _file(name: str) -> Path:
    found = _MANUAL / name
    if not found.is_file():
        raise Problem(interface.NOT_FOUND, "The manual has no such page.")
    return found


def _page(request: Request, context: UsesContext, title: str, html: str) -> Response:
    """Around HTML that is safe by now."""
    body = Markup(html)  # noqa: S704  both renderers escape what they are given
    return render(request, "document.html", title=title, body=body, caller=find_session(request, context))
