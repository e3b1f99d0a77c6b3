"""The few kinds of block that the template can set."""

import json
from collections.abc import Sequence
from typing import Any, Final

Node = dict[str, Any]

MOST_ROWS: Final = 200
"""Of a printed table: about five pages."""


def write_json(certificate: Node) -> str:
    """Return a certificate as it is sent, and attached to its own pages."""
    return json.dumps(certificate, ensure_ascii=False, allow_nan=False)


def section(title: str, blocks: list[Node]) -> Node:
    return {"title": title, "blocks": blocks}


def flow(text: str) -> Node:
    return {"kind": "text", "text": text}


def facts(rows: list[list[str]]) -> Node:
    """Labels and what they name."""
    return {"kind": "facts", "rows": rows}


def table(
    head: list[str], rows: list[list[str]], *, align: str, widths: Sequence[float], caption: str = ""
) -> Node:
    """``align``: l or r a column. A row of one cell that begins with § is a heading across all columns."""
    if len(rows) > MOST_ROWS:
        cut = f"The first {MOST_ROWS} of {len(rows):,} rows; all are in the JSON certificate."
        rows, caption = rows[:MOST_ROWS], f"{caption} {cut}".strip()
    return {
        "kind": "table",
        "head": head,
        "rows": rows,
        "align": align,
        "widths": list(widths),
        "caption": caption,
    }


def figure(svg: str, caption: str, *, width: float) -> Node:
    """``width``: as a share of the page's."""
    return {"kind": "figure", "svg": svg, "caption": caption, "width": width}
