"""The regions in which the frames were measured, as numbers and drawn."""

from collections import defaultdict

from service.certificate.figures import plain
from service.certificate.sheet import Node, figure, table


def region_blocks(certificate: Node, preview: str) -> list[Node]:
    """A line a region or part of one; below, a frame on which they are drawn. ``preview`` : "" for none."""
    used: dict[str, int] = defaultdict(int)
    panels: dict[str, str] = {}
    for frame in certificate["frames"]:
        used[frame["roi_sha256"]] += 1
        if frame.get("roi_origin") == "found":
            panels[frame["roi_sha256"]] = frame["panel_serial"]
    rows = [
        [
            _corners(part) + _origin(panels.get(region["sha256"])),
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


def _origin(panel: str | None) -> str:
    return f"\nfound by the code of panel {panel}" if panel else ""


def _corners(part: Node) -> str:
    corners = " ".join(f"({plain(x, 7)}, {plain(y, 7)})" for x, y in part["points"])
    return f"{part['name']}: {corners}" if part.get("name") else corners
