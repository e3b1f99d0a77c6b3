"""The few kinds of block that the template can set: tables, numbers, times and regions."""

import base64
import json
from collections import defaultdict
from collections.abc import Sequence
from datetime import datetime
from typing import Any, Final

from radiometry.drawing.text import raise_ten

Node = dict[str, Any]

MOST_ROWS: Final = 200  # of a printed table: about five pages


def write_json(certificate: Node) -> str:
    """Return a certificate as it is sent, and attached to its own pages."""
    return json.dumps(certificate, ensure_ascii=False, allow_nan=False)


def section(title: str, blocks: list[Node], *, wide: bool = False) -> Node:
    """``wide``: across the page; else in the shorter of its two columns."""
    return {"title": title, "blocks": blocks, "wide": wide}


def flow(text: str) -> Node:
    return {"kind": "text", "text": text}


def facts(rows: list[list[str]]) -> Node:
    return {"kind": "facts", "rows": rows}


def table(
    head: list[str], rows: list[list[str]], *, align: str, widths: Sequence[float], caption: str = ""
) -> Node:
    """``align``: l or r a column. A row of one cell that begins with § is a heading across all columns."""
    if len(rows) > MOST_ROWS:
        cut = f"The first {MOST_ROWS} of {len(rows):,} rows; all are in the JSON certificate."
        rows, caption = rows[:MOST_ROWS], f"{caption} {cut}".strip()
    told = [at for at in range(len(head)) if at == 0 or any(row[at] != "-" for row in rows if len(row) > 1)]
    return {
        "kind": "table",
        "head": [head[at] for at in told],
        "rows": [[row[at] for at in told] if len(row) > 1 else row for row in rows],
        "align": "".join(align[at] for at in told),
        "widths": [widths[at] for at in told],
        "caption": caption,
    }


def figure(svg: str, caption: str, *, width: float) -> Node:
    """``width``: as a share of the page's."""
    return {"kind": "figure", "svg": svg, "caption": caption, "width": width}


def plain(value: float, digits: int = 5) -> str:
    """A number to so many significant digits, without zeros that say nothing."""
    return raise_ten(f"{value:.{digits}g}")


def name_device(device: Node) -> str:
    """Make, model and serial number; a model that begins with its make names it once."""
    make = "" if device["model"].startswith(device["make"]) else f"{device['make']} "
    serial = f", serial {device['serial']}" if "serial" in device else ""
    return f"{make}{device['model']}{serial}"


def percent(share: float) -> str:
    return f"{100 * share:.2f} %"


def stamp(moment: str) -> str:
    return datetime.fromisoformat(moment).strftime("%Y-%m-%d %H:%M:%S UTC")


def optional(row: dict[str, Any], name: str, form: Any = str) -> str:  # noqa: ANN401  a callable
    return form(row[name]) if name in row else "-"


_FOUND: Final = {
    "code": "found by the code of",
    "reflect_area": "as the camera stated it for",
    "other_band": "from another band of the capture, of",
}


def region_blocks(certificate: Node, preview: str) -> list[Node]:
    """A line a region or part of one; below, a frame on which they are drawn. ``preview`` : "" for none."""
    used: dict[str, int] = defaultdict(int)
    origins: dict[str, str] = {}
    for frame in certificate["frames"]:
        used[frame["roi_sha256"]] += 1
        if frame.get("roi_origin") == "found":
            panel = f" panel {frame['panel_serial']}" if frame.get("panel_serial") else " the panel"
            origins[frame["roi_sha256"]] = _FOUND[frame.get("roi_found_by", "code")] + panel
    rows = [
        [
            _corners(part) + (f"\n{origin}" if (origin := origins.get(region["sha256"])) else ""),
            str(used[region["sha256"]]),
            region["sha256"],
        ]
        for region in certificate["regions"]
        for part in region.get("parts", [region])
    ]
    drawn = [figure(preview, "The region on a frame's preview.", width=0.7)] if preview else []
    return [
        table(["corners (x, y) [px]", "frames", "SHA-256"], rows, align="lrh", widths=[4, 0.7, 3]),
        *drawn,
    ]


def _corners(part: Node) -> str:
    corners = " ".join(f"({plain(x, 7)}, {plain(y, 7)})" for x, y in part["points"])
    return f"{part['name']}: {corners}" if part.get("name") else corners


def draw_region(
    png: bytes,
    width_px: int,
    height_px: int,
    polygons: Sequence[Sequence[Sequence[float]]],
    *,
    thin: Sequence[Sequence[Sequence[float]]] = (),
    style: str = 'fill="#ffd400" fill-opacity="0.12" stroke="#ffd400"',
) -> str:
    picture = base64.b64encode(png).decode()
    stroke = max(width_px, height_px) / 300
    outlines = "".join(
        f'<polygon points="{" ".join(f"{x:g},{y:g}" for x, y in corners)}" {style} '
        f'stroke-width="{share * stroke:.2f}"/>'
        for share, drawn in ((1.0, polygons), (0.35, thin))
        for corners in drawn
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width_px} {height_px}">'
        f'<image href="data:image/png;base64,{picture}" width="{width_px}" height="{height_px}" '
        f'preserveAspectRatio="none"/>{outlines}</svg>'
    )
