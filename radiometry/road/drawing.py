"""A road drawn from above as SVG: its map with lanes, grid and points."""

import base64
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any, Final

import numpy as np

from radiometry import maps
from radiometry.drawing.text import in_step

Node = dict[str, Any]
Place = tuple[float, float]

_LONG_PX: Final = 900.0
_LABEL_PX: Final = 12
_LINES: Final = (0, 1, -1, 2, -2)  # below its place, where room for a text is looked for
_STYLE: Final = (
    f'font-size="{_LABEL_PX}" font-family="sans-serif" font-weight="600" text-anchor="middle" '
    'paint-order="stroke" stroke-linejoin="round" fill="#ffffff" stroke="#10141a" stroke-width="3"'
)
_DOT: Final = 'fill="#ffffff" stroke="#10141a" stroke-width="1.5"'
_CROSS: Final = ('stroke="#10141a" stroke-width="2.5"', 'stroke="#ffffff" stroke-width="1"')


class Canvas:
    """Places on the road as pixels: x to the right, or upwards as one walks it on a telephone."""

    def __init__(self, x_m: Sequence[float], y_m: Sequence[float], *, is_upright: bool = False) -> None:
        self._x0, self._x1, self._y0 = x_m[0], x_m[1], y_m[0]
        self.is_upright = is_upright
        self.scale = _LONG_PX / (x_m[1] - x_m[0])
        size = _LONG_PX, self.scale * (y_m[1] - y_m[0])
        self.width, self.height = size[::-1] if is_upright else size
        self.parts: list[str] = []
        self._written: list[tuple[float, float, float]] = []  # middle and half width of each text

    def place(self, x_m: float, y_m: float) -> Place:
        along, across = self.scale * (x_m - self._x0), self.scale * (y_m - self._y0)
        return (across, _LONG_PX - along) if self.is_upright else (along, across)

    def line(self, places: Sequence[Place], style: str) -> None:
        points = " ".join("{:.1f},{:.1f}".format(*self.place(*each)) for each in places)
        self.parts.append(f'<polyline points="{points}" fill="none" {style}/>')

    def circle(self, place: Place, radius: float, style: str) -> None:
        x, y = self.place(*place)
        self.parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" {style}/>')

    def sign(self, place: Place, path: str, style: str) -> None:
        x, y = self.place(*place)
        self.parts.append(f'<path d="M{x:.1f} {y:.1f}{path}" {style}/>')

    def text(self, place: Place, words: str) -> None:
        """Write words at a place, within the edges; lines above or below it where others stand."""
        x, y = self.place(*place)
        half, line = 0.3 * _LABEL_PX * len(words), _LABEL_PX + 2.0
        x = min(max(x, half + 2.0), self.width - half - 2.0)
        found = next((each for each in (y + line * n for n in _LINES) if self._is_free(x, each, half)), y)
        self._written.append((x, found, half))
        self.parts.append(f'<text x="{x:.1f}" y="{found + 4.0:.1f}" {_STYLE}>{escape(words)}</text>')

    def _is_free(self, x: float, y: float, half: float) -> bool:
        apart = (
            abs(x - at) >= half + other or abs(y - level) > _LABEL_PX for at, level, other in self._written
        )
        return _LABEL_PX <= y <= self.height - _LABEL_PX and all(apart)

    def length(self, x_m: Place, y_m: float, words: str) -> None:
        self.line([(x_m[0], y_m), (x_m[1], y_m)], 'stroke="#ffffff" stroke-width="2"')
        self.text((sum(x_m) / 2.0, y_m), words)

    def picture(self, png: bytes) -> None:
        data = base64.b64encode(png).decode()
        long, wide = _LONG_PX, self.width if self.is_upright else self.height
        turn = f' transform="matrix(0 -1 1 0 0 {long:.1f})"' if self.is_upright else ""
        self.parts.append(
            f'<image href="data:image/png;base64,{data}" width="{long:.1f}" height="{wide:.1f}" '
            f'preserveAspectRatio="none"{turn}/>'
        )

    def finish(self) -> str:
        box = f"0 0 {self.width:.1f} {self.height:.1f}"
        return f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{box}">{"".join(self.parts)}</svg>'


def draw_map(result: Node, png: bytes, *, is_upright: bool = False, layers: Sequence[str] = ()) -> str:
    """Draw an evaluation on its map, as SVG.

    Parameters
    ----------
    result : mapping
        As it is answered.
    png : bytes
        Picture of the map.
    is_upright : bool, optional
        True for the way that one walks it, upwards.
    layers : sequence of {"e", "grid", "isolux", "points"}, optional
        What is drawn; all by default.
    """
    shown = layers or ("e", "grid", "isolux", "points")
    site, extent = result["stated"]["site"], result["map"]
    canvas = Canvas(extent["x_m"], extent["y_m"], is_upright=is_upright)
    if "e" in shown:
        canvas.picture(png)
    _draw_site(canvas, site, extent)
    points = {each["name"]: each for each in result["points"]}
    if "isolux" in shown:
        judged = [each for each in result["criteria"] if each["figure"] in ("e_av", "e_min")]
        _draw_isolux(canvas, result, [each["at_least"] for each in judged if "at_least" in each])
    if "grid" in shown:
        for each in result["points"]:
            for style in () if each["is_hidden"] else _CROSS:
                canvas.sign((each["x_m"], each["y_m"]), "m-3 0h6m-3 -3v6", style)
    lowest = points[result["minimum"]]
    canvas.circle((lowest["x_m"], lowest["y_m"]), 11, 'fill="none" stroke="#3fd0ff" stroke-width="2.5"')
    if "points" in shown:
        _draw_control(canvas, site, extent, result["control"])
    return canvas.finish()


def _find_edges(site: Node, *kinds: str) -> list[float]:
    strips = [each for each in site.get("strips", ()) if each["kind"] in kinds]
    return sorted({at for each in strips for at in (each["y_m"], each["y_m"] + each["width_m"])})


def _draw_site(canvas: Canvas, site: Node, extent: Node) -> None:
    """Draw edges, areas, field and luminaires; name the strips before the field, and show S and 10 m."""
    style, edges = 'stroke="#ffffff" stroke-width="1.5"', _find_edges(site, "lane")
    start, spacing = site["rows"][0].get("first_x_m", 0.0), site["rows"][0]["spacing_m"]
    end = start + spacing
    for at in edges + _find_edges(site, "walkway", "edge"):
        dashed = at in edges[1:-1] or at not in edges
        canvas.line([(x, at) for x in extent["x_m"]], style + (' stroke-dasharray="10 7"' if dashed else ""))
    for area in site.get("areas", ()):
        canvas.line([*area["corners_m"], area["corners_m"][0]], style)
    if edges:
        low, high = edges[0], edges[-1]
        corners = [(start, low), (end, low), (end, high), (start, high), (start, low)]
        canvas.line(corners, 'stroke="#3fd0ff" stroke-width="2"')
    for row in site["rows"]:
        for at in np.arange(row.get("first_x_m", 0.0), end + 0.1, row["spacing_m"]).tolist():
            canvas.circle((at, row["y_m"]), 5, _DOT)
    for strip in site.get("strips", ()):
        named = f"Lane {strip['name']}" if strip["kind"] == "lane" else strip["name"]
        canvas.text((start - 2.5, strip["y_m"] + strip["width_m"] / 2.0), named)
    (y0, y1), far = extent["y_m"], extent["x_m"][1] - 1.0
    canvas.length((start, end), y0 + 1.0, f"S = {spacing:g} m")
    canvas.length((far - 10.0, far), y1 - 1.0, "10 m")


def _draw_isolux(canvas: Canvas, result: Node, limits: Sequence[float]) -> None:
    """Draw round levels over the lanes, and those of the class heavier."""
    lanes = {each["name"] for each in result["stated"]["site"].get("strips", ()) if each["kind"] == "lane"}
    on_lanes = [each for each in result["points"] if each["part"] in lanes]
    xs, ys = (sorted({each[name] for each in on_lanes}) for name in ("x_m", "y_m"))
    if len(xs) < 2 or len(ys) < 2 or len(on_lanes) != len(xs) * len(ys):
        return
    plane = np.full((len(ys), len(xs)), np.nan)
    for each in on_lanes:
        plane[ys.index(each["y_m"]), xs.index(each["x_m"])] = each["illuminance_lx"]
    levels = maps.choose_levels(float(plane.min()), float(plane.max()), logarithmic=True)
    for drawn in maps.trace_isolines(plane, sorted({*levels, *limits}), step=1, left_px=-0.5, top_px=-0.5):
        width = 2.2 if drawn.level in limits else 0.9
        for line in drawn.lines:
            places = [np.interp(line[:, i], range(len(at)), at) for i, at in enumerate((xs, ys))]
            style = f'stroke="#ffffff" stroke-opacity="0.85" stroke-width="{width}"'
            canvas.line(np.transpose(places).tolist(), style)


def _draw_control(canvas: Canvas, site: Node, extent: Node, control: Sequence[Mapping[str, Any]]) -> None:
    """Draw each control point with its reading beside the road; a wrong one as a square, with both values."""
    across = _find_edges(site, "lane", "walkway", "edge")
    low, high = (min(across), max(across)) if across else extent["y_m"]
    for each in control:
        place = each["x_m"], each["y_m"]
        is_near = each["y_m"] < (low + high) / 2.0
        beside = (low + extent["y_m"][0]) / 2.0 if is_near else (high + extent["y_m"][1]) / 2.0
        canvas.line([place, (each["x_m"], beside)], 'stroke="#ffffff" stroke-width="1"')
        for words in list_labels(each):
            canvas.text((each["x_m"], beside), words)
        if each["state"] == "agrees":
            canvas.circle(place, 5, _DOT)
        else:
            red = 'stroke="#a3261f" stroke-width="2"'
            canvas.sign(place, "m-7 -7h14v14h-14z", f'fill="#ffffff" {red}')
            canvas.sign(place, "m-3.5 -3.5l7 7m0 -7l-7 7", red)


def list_labels(point: Mapping[str, Any]) -> Iterator[str]:
    """Yield what stands beside a control point."""
    unit = "lx" if point["quantity"] == "illuminance" else "cd/m²"
    yield f"{point['name']} {point['value']:.3g} {unit}"
    if point["state"] == "differs" and "without_it" in point:
        value, _ = in_step(point["without_it"], point["without_it"] * point["without_it_u_rel"])
        yield f"map: {value} {unit}"
