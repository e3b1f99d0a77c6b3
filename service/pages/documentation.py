"""Documentation pages: the reference of this API, and the manual. No key is needed."""

import itertools
import json
import re
from functools import partial
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Request, Response
from fastapi import Path as InPath
from fastapi.responses import FileResponse
from markdown_it import MarkdownIt
from markdown_it.token import Token
from markupsafe import Markup

from radiometry.findings import interface
from radiometry.methods.findings import FINDINGS
from service.http import answers, problems
from service.http.auth import find_session
from service.http.context import UsesContext
from service.http.document import ALSO_ACCEPTS, Document, resolve
from service.pages.rendering import render

PLACES = {
    "errors": ("file", "request", "job"),
    "on-site": ("verdict",),
    "certificate": ("certificate",),
    "flags": ("frame", "campaign", "calibration", "measurement", "fleet"),
}
"""Where the findings occur that a page explains."""
_HEADING = re.compile(r"^#+ (\w+)\n", re.MULTILINE)
_OUTCOMES = {"warn": "Warn. ", "pending": "Pending. ", "fail": "Fail. ", "error": "Fail. "}
_OF_THE_SCIENCE = 422  # status of most refusals; the page of errors states it once


def expand_entries(text: str, page: str) -> str:
    """Put what a code means under its heading, and every code of a page where it wants them."""
    every = (f"## {code}\n" for code in sorted(FINDINGS) if _belongs(code, page))
    text = text.replace("<!-- findings -->\n", "\n".join(every))
    return _HEADING.sub(lambda found: f"{found[0]}{_describe(found[1], page)}", text)


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


_PAGE = re.compile(r"^([a-z-]+)\.md(#.*)?$")


def render_markdown(text: str) -> str:
    """Return HTML of pages of docs/, headings as places; after a further title all are one level lower."""
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    tokens = parser.parse(re.sub(r"^<!--.*-->\n", "", text, flags=re.MULTILINE))
    places = set()
    for token, inline in itertools.pairwise(tokens):
        if token.type == "heading_open":
            places.add(place := re.sub(r"[^\w -]", "", inline.content.lower()).replace(" ", "-"))
            token.attrSet("id", place)
    # put all headings after the first title one level lower, where there are further titles
    titles = [place for place, token in enumerate(tokens) if token.tag == "h1"]
    for token in tokens[titles[1] + 1 :] if len(titles) > 2 else ():
        if token.type.startswith("heading"):
            token.tag = f"h{int(token.tag[1]) + 1}"
    for opened, inline, closed in zip(tokens, tokens[1:], tokens[2:], strict=False):
        if opened.type == "th_open" and not inline.content:
            opened.tag = closed.tag = "td"  # heads nothing
    _link(tokens, places)
    html: str = parser.renderer.render(tokens, parser.options, {})
    return html


def _link(tokens: list[Token], places: set[str]) -> None:
    """Lead to other pages, and from codes to what they mean; a name that a table begins is a place."""
    for token, inline in itertools.pairwise(tokens):
        for part in inline.children or ():
            name = part.content if part.type == "code_inline" and part.content.isidentifier() else ""
            if name and token.type == "td_open" and name not in places:
                places.add(name)
                part.attrSet("id", name)
            elif page := next((page for page in PLACES if _belongs(name, page)), None):
                part.type = "html_inline"
                part.content = f'<a href="/docs/{page}#{name}"><code>{name}</code></a>'
            elif part.type == "link_open" and (other := _PAGE.match(str(part.attrGet("href")))):
                part.attrSet("href", f"/docs/{other[1]}{other[2] or ''}")
            elif part.type == "image" and str(part.attrGet("src")).startswith("pictures/"):
                part.attrSet("src", f"/docs/{part.attrGet('src')}")


router = APIRouter(include_in_schema=False)

_INSTALLED = Path(__file__).parent / "manual"
_MANUAL = _INSTALLED if _INSTALLED.is_dir() else Path(__file__).parents[2] / "docs"


@router.get("/openapi.json")
def get_document(request: Request) -> Response:
    """Send the OpenAPI document: it changes with the release alone."""
    document: Document = request.app.state.document
    headers = answers.unless_kept(request, document.tag, {"Cache-Control": "no-cache"})
    return Response(document.text, headers=headers, media_type="application/json")


@router.get("/docs")
def get_reference(request: Request, context: UsesContext) -> Response:
    return render(
        request,
        "reference.html",
        title="API",
        caller=find_session(request, context),
        document=request.app.openapi(),
        also_accepts=ALSO_ACCEPTS,
        resolve=resolve,
        write=partial(json.dumps, indent=2),
    )


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
    text = expand_entries(_file(f"{name}.md").read_text(encoding="utf-8"), name)
    return _page(request, context, _title(text), render_markdown(text))


@router.get("/docs/pictures/{name}")
def get_picture(name: Annotated[str, InPath(pattern="^[a-z0-9-]+[.](svg|webp)$")]) -> Response:
    return FileResponse(_file(f"pictures/{name}"), headers={"Cache-Control": "public, max-age=3600"})


def _title(text: str) -> str:
    return text.partition("# ")[2].partition("\n")[0]


def _file(name: str) -> Path:
    found = _MANUAL / name
    if not found.is_file():
        raise problems.Problem(interface.NOT_FOUND, "The manual has no such page.")
    return found


def _page(request: Request, context: UsesContext, title: str, html: str) -> Response:
    body = Markup(html)  # noqa: S704  both renderers escape what they are given
    return render(request, "document.html", title=title, body=body, caller=find_session(request, context))
