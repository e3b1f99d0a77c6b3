"""Plot of a geometry calibration: distortion along the radius, coverage by corners, each view's error."""

from collections.abc import Iterator
from typing import Any

from radiometry.drawing.sheet import Axis, dot, finish, line, name_series, place, swath, write

Node = dict[str, Any]


def draw(result: Node) -> str:
    """Return the SVG of a stored geometry result; the swath is twice the standard uncertainty.

    Hollow marks were left out.
    """
    parts = [*_draw_curve(result["curve"]), *_draw_coverage(result), *_draw_views(result)]
    colours = result.get("lateral_colour") or []
    parts += _draw_colours(colours) if colours else ()
    return finish(parts, panels=4 if colours else 3, label="Geometry calibration")


def _draw_curve(curve: list[Node]) -> Iterator[str]:
    panel = place(
        0,
        x=Axis(values=[p["radius_px"] for p in curve], label="distance from the principal point [px]"),
        y=Axis(values=[p["distortion_px"] for p in curve], include=(0.0,), label="distortion [px]"),
        title="Radial distortion; dashed: beyond the corners",
    )
    yield from panel.frame()
    seen = [p for p in curve if not p["extrapolated"]]
    beyond = [*seen[-1:], *(p for p in curve if p["extrapolated"])]
    points = [(p["radius_px"], p["distortion_px"], 2.0 * p["standard_uncertainty_px"]) for p in curve]
    yield swath(panel, [(x, y - u, y + u) for x, y, u in points], 0)
    for mine, css in ((seen, line(0)), (beyond, line(1))):
        yield panel.line([(p["radius_px"], p["distortion_px"]) for p in mine], css)


def _draw_coverage(result: Node) -> Iterator[str]:
    """The frame with the number of corners in each cell: the darker, the more."""
    camera, counts = result["camera"], result["coverage"]["counts"]
    width, height = float(camera["width_px"]), float(camera["height_px"])
    panel = place(
        1,
        x=Axis(values=[0.0, width], label="column [px]"),
        y=Axis(values=[0.0, height], label="row [px], from below"),
        title=f"Corners seen: {100.0 * result['coverage']['share']:.0f} % of the cells",
    )
    yield from panel.frame()
    rows, cols = len(counts), len(counts[0])
    most = max(max(row) for row in counts) or 1
    for row, line_of_cells in enumerate(counts):
        for col, count in enumerate(line_of_cells):
            left, right = (panel.x(width * each / cols) for each in (col, col + 1))
            top, bottom = (panel.y(height * (1.0 - each / rows)) for each in (row, row + 1))
            size = f'width="{right - left:.1f}" height="{bottom - top:.1f}"'
            shade = f'fill-opacity="{0.75 * count / most:.2f}"'
            yield f'<rect class="d0" x="{left:.1f}" y="{top:.1f}" {size} {shade} stroke-opacity="0.3"/>'
            middle = height * (1.0 - (row + 0.5) / rows)
            yield write(panel, width * (col + 0.5) / cols, middle, str(count))


def _draw_views(result: Node) -> Iterator[str]:
    views = [(i, p) for i, p in enumerate(result["points"], start=1) if p.get("rms_px") is not None]
    panel = place(
        2,
        x=Axis(values=[float(i) for i, _ in views], label="view, in turn"),
        y=Axis(values=[p["rms_px"] for _, p in views], include=(0.0,), label="rms of its corners [px]"),
        title="Error of each view; dashed: all together",
    )
    yield from panel.frame()
    yield panel.line([(panel.x.low, result["rms_px"]), (panel.x.high, result["rms_px"])], "limit")
    for i, p in views:
        left_out = f", left out: {p['left_out']}" if p["left_out"] else ""
        yield panel.dot(float(i), p["rms_px"], dot(0, used=p["used"]), f"{p['frame']}{left_out}")


def _draw_colours(colours: list[Node]) -> Iterator[str]:
    points = [point for each in colours for point in each["curve"]]
    panel = place(
        3,
        x=Axis(values=[p["radius_px"] for p in points], label="distance from the principal point [px]"),
        y=Axis(values=[p["displacement_px"] for p in points], include=(0.0,), label="displacement [px]"),
        title="Lateral colour",
    )
    yield from panel.frame()
    for series, each in enumerate(colours):
        shown = [
            (p["radius_px"], p["displacement_px"], 2.0 * p["standard_uncertainty_px"]) for p in each["curve"]
        ]
        yield swath(panel, [(x, y - u, y + u) for x, y, u in shown], series)
        yield panel.line([(x, y) for x, y, _ in shown], line(series))
    yield from name_series(panel, [each["channels"] for each in colours])
