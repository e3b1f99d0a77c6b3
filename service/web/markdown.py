"""Our own Markdown as HTML, each heading an address."""

import itertools
import re

from markdown_it import MarkdownIt


def render_markdown(text: str) -> str:
    """HTML of a page of docs/; ``## some_code`` becomes the place #some_code.

    Comments are left out; other HTML in the text stays text.
    """
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    tokens = parser.parse(re.sub(r"^<!--.*-->\n", "", text, flags=re.MULTILINE))
    for token, inline in itertools.pairwise(tokens):
        if token.type == "heading_open":
            token.attrSet("id", inline.content.strip("`").lower().replace(" ", "-"))
    html: str = parser.renderer.render(tokens, parser.options, {})
    return html
