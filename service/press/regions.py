"""The regions in which the frames were measured, as numbers and drawn."""

import base64
from collections import defaultdict
from collections.abc import Sequence
from typing import Final

from service.press.figures import plain
from service.press.sheet import Node, figure, table

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
    drawn = [figure(preview, "The region on a frame's preview.", width=0.62)] if preview else []
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
    """SVG of a frame's preview with the parts of its region on it, in the frame's own pixels."""
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
