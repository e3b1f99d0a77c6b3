"""The regions in which the frames were measured, as numbers and drawn."""

from collections import defaultdict
from typing import Final

from service.certificate.figures import plain
from service.certificate.sheet import Node, figure, table

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
