"""Our own Markdown as HTML, each heading and each name in a table an address."""

import itertools
import re

from markdown_it import MarkdownIt
from markdown_it.token import Token

_PAGE = re.compile(r"^([a-z-]+)\.md(#.*)?$")


def render_markdown(text: str) -> str:
    """HTML of a page of docs/; ``## some_code`` becomes the place #some_code.

    So does a name where it first stands in a table, and a link to another page is one to where the service
    shows it. What follows a further ``# title`` is one level lower: a page has one title. Comments are left
    out; other HTML in the text stays text.
    """
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    tokens = parser.parse(re.sub(r"^<!--.*-->\n", "", text, flags=re.MULTILINE))
    places = set()
    for token, inline in itertools.pairwise(tokens):
        if token.type == "heading_open":
            places.add(place := re.sub(r"[^\w -]", "", inline.content.lower()).replace(" ", "-"))
            token.attrSet("id", place)
    _keep_one_title(tokens)
    for opened, inline, closed in zip(tokens, tokens[1:], tokens[2:], strict=False):
        if opened.type == "th_open" and not inline.content:
            opened.tag = closed.tag = "td"  # heads nothing
    for token, inline in itertools.pairwise(tokens):
        for part in inline.children or ():
            is_name = part.type == "code_inline" and part.content.isidentifier()
            if token.type == "td_open" and is_name and part.content not in places:
                places.add(part.content)
                part.attrSet("id", part.content)
            elif part.type == "link_open" and (page := _PAGE.match(str(part.attrGet("href")))):
                part.attrSet("href", f"/docs/{page[1]}{page[2] or ''}")
            elif part.type == "image" and str(part.attrGet("src")).startswith("pictures/"):
                part.attrSet("src", f"/docs/{part.attrGet('src')}")
    html: str = parser.renderer.render(tokens, parser.options, {})
    return html


def _keep_one_title(tokens: list[Token]) -> None:
    """Put all headings after the first title one level lower, where there are further titles."""
    titles = [place for place, token in enumerate(tokens) if token.tag == "h1"]
    for token in tokens[titles[1] + 1 :] if len(titles) > 2 else ():
        if token.type.startswith("heading"):
            token.tag = f"h{int(token.tag[1]) + 1}"
