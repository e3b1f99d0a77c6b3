"""Figures as SVG for the pages, each point with what static/plots.js shows of it in a card."""

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from html import escape
from typing import Annotated, Final

from fastapi import Query, Response

from radiometry.drawing.figure import Axis, Figure, Mark
from radiometry.drawing.svg import Panel, Scale, document, span

Share = Annotated[float, Query(ge=-1, le=2)]

_LEFT_PX, _RIGHT_PX, _TOP_PX, _BOTTOM_PX, _LINE_PX, _NAME_PX = 66, 20, 14, 48, 22, 24
_MONTHS: Final = (1, 2, 3, 6, 12, 24, 60, 120, 240)
_DAY_S, _HALF_HOUR_S = 86_400.0, 1800.0
# steps of time below a month, with the form of a tick
_TIMES: Final = tuple(
    (60.0 * minutes, "%H:%M") for minutes in (1, 2, 5, 10, 15, 30, 60, 120, 180, 360, 720)
) + tuple((_DAY_S * days, "%m-%d") for days in (1, 2, 4, 7, 14))
_ROOM: Final = 1.15
_HEIGHT_PX: Final = {False: 250, True: 400}
# around a point: circle, square, triangle, diamond, triangle upside down, cross
_SYMBOLS: Final = (
    *("M-4.5 0a4.5 4.5 0 1 0 9 0a4.5 4.5 0 1 0-9 0Z", "M-4-4H4V4H-4Z", "M0-5L5 4H-5Z"),
    *("M0-5.5L5 0L0 5.5L-5 0Z", "M0 5L5-4H-5Z", "M-5-2H-2V-5H2V-2H5V2H2V5H-2V2H-5Z"),
)
_COLOURS: Final = ("#0b5f6b", "#c1611a", "#6a4c93", "#4f7a28", "#a83f6f", "#3b6fb6")
# of a picture that is saved; in a page stilb.css has the colours
_STYLE: Final = (
    ".line{fill:none}.band{fill:#0b5f6b;opacity:.07}.swath{stroke:none!important;opacity:.15}.out{fill:#fff}"
    + "".join(
        f".s{n}{{stroke:{colour};stroke-width:1.5}}.point.s{n}:not(.out),.swath.s{n},.cell.s{n}{{fill:{colour}}}"
        for n, colour in enumerate(_COLOURS)
    )
)


@dataclass(frozen=True, kw_only=True)
class View:
    """How wide a chart's place is, and what is shown: shares of either axis of the whole."""

    width: Annotated[int, Query(ge=240, le=2000)] = 900
    x0: Share = 0.0
    x1: Share = 1.0
    y0: Share = 0.0
    y1: Share = 1.0
    part: Annotated[int, Query(ge=0, le=99, description="Which figure of a plot that has several.")] = 0


class Dates(Scale):
    """Time in seconds since 1970, in UTC; a tick at the beginnings of months, or of shorter spans."""

    def ticks(self) -> list[float]:
        step = self._step()
        if step:
            return [step * n for n in range(math.ceil(self.low / step), math.floor(self.high / step) + 1)]
        first, last = (datetime.fromtimestamp(at, UTC) for at in (self.low, self.high))
        months = range(12 * first.year + first.month - 1, 12 * last.year + last.month)
        every = next((step for step in _MONTHS if len(months) <= 7 * step), _MONTHS[-1])
        starts = (datetime(n // 12, n % 12 + 1, 1, tzinfo=UTC).timestamp() for n in months if n % every == 0)
        found = [start for start in starts if self.low <= start <= self.high]
        return found or [self.low]

    def label(self, tick: float) -> str:
        step = self._step()
        form = next((form for size, form in _TIMES if size == step), "%Y-%m")
        return datetime.fromtimestamp(tick, UTC).strftime(form)

    def _step(self) -> float | None:
        """Return the step below a month, None for months."""
        return next((step for step, _ in _TIMES if self.high - self.low <= 6.0 * step), None)


@dataclass(frozen=True, kw_only=True)
class Named(Scale):
    """Ticks where an axis states them, with its texts."""

    named: tuple[tuple[float, str], ...] = ()

    def ticks(self) -> list[float]:
        return [at for at, _ in self.named if self.low <= at <= self.high]

    def label(self, tick: float) -> str:
        return dict(self.named)[tick]


class Downward(Scale):
    """Values that are negated."""

    def label(self, tick: float) -> str:
        return f"{abs(tick):g}"


def draw_figure(
    figure: Figure, label: str, *, view: View = View(), parts: Sequence[str] = (), is_wide: bool = False
) -> str:
    """Draw a figure as SVG.

    ``label`` : text for screen readers; ``parts`` : labels of all figures of the plot
    """
    xs, ys = figure.find_limits()
    names = figure.y.ticks or ()
    height = _TOP_PX + _BOTTOM_PX + _NAME_PX * len(names) if names else _HEIGHT_PX[is_wide]
    # figures of one time above each other have one margin
    shares_margin = figure.x.is_time or not names
    left = max(_LEFT_PX if shares_margin else 0, 14 + 7 * max((len(text) for _, text in names), default=0))
    panel = Panel(
        x=_scale(figure.x, xs, left, view.width - _RIGHT_PX).part(view.x0, view.x1),
        y=_scale(figure.y, ys, height - _BOTTOM_PX, _TOP_PX).part(view.y0, view.y1),
        title="",
        x_label=figure.x.label,
        y_label=figure.y.label,
    )
    return _finish(
        panel, [*_draw_ground(panel, figure), *_draw_series(panel, figure)], figure, label, view, parts
    )


def _scale(axis: Axis, values: Sequence[float], start_px: float, end_px: float) -> Scale:
    low, high = span(values, logarithmic=axis.logarithmic)
    if axis.is_time:
        # frames of one minute need a scale, too
        middle, half = (
            (min(values) + max(values)) / 2.0,
            max(0.53 * (max(values) - min(values)), _HALF_HOUR_S),
        )
        low, high = middle - half, middle + half
    elif axis.ticks and not axis.logarithmic:
        low, high = min(values), max(values)
    scale = (Dates if axis.is_time else Downward if axis.is_downward else Scale)(
        low=low, high=high, start_px=start_px, end_px=end_px, logarithmic=axis.logarithmic
    )
    return scale if axis.ticks is None else Named(**vars(scale), named=axis.ticks)


def _draw_ground(panel: Panel, figure: Figure) -> Iterator[str]:
    """Map, band and dashed lines: what lies behind the series."""
    x, y = panel.x, panel.y
    for cell in figure.cells:
        (left, right), (bottom, top) = _cut(x, cell.x), _cut(y, cell.y)
        size = f'width="{max(0.0, right - left) + 0.3:.1f}" height="{max(0.0, bottom - top) + 0.3:.1f}"'
        shade = f'fill-opacity="{abs(cell.share):.3f}" data-told="{escape(cell.told)}"'
        yield f'<rect class="cell {_colour(cell.share < 0)}" x="{left:.1f}" y="{top:.1f}" {size} {shade}/>'
    if figure.band:
        bottom, top = _cut(y, figure.band)
        size = f'width="{x.end_px - x.start_px:.1f}" height="{bottom - top:.1f}"'
        yield f'<rect class="band" x="{x.start_px:.1f}" y="{top:.1f}" {size}/>'
    for level in figure.levels:
        yield panel.line([(x.low, level), (x.high, level)], "limit")
    for upright in figure.uprights:
        yield panel.line([(upright, y.low), (upright, y.high)], "limit")


def _cut(scale: Scale, ends: tuple[float, float]) -> tuple[float, float]:
    low, high = (scale(min(max(end, scale.low), scale.high)) for end in ends)
    return low, high


def _draw_series(panel: Panel, figure: Figure) -> Iterator[str]:
    across = bool(figure.y.ticks)
    ends = panel.x if across else panel.y
    for n, each in enumerate(figure.series):
        place = n if each.place is None else each.place
        inside = [point for point in each.swath if panel.x.low <= point[0] <= panel.x.high]
        if inside:
            there = [f"{panel.x(x):.1f},{_cut(panel.y, (low, high))[0]:.1f}" for x, low, high in inside]
            back = [
                f"{panel.x(x):.1f},{_cut(panel.y, (low, high))[1]:.1f}" for x, low, high in reversed(inside)
            ]
            yield f'<polygon class="swath {_colour(place)}" points="{" ".join([*there, *back])}"/>'
        for points in (each.model, each.line):
            if points:
                yield panel.line(points, f"line {_colour(place)}")
        for mark in each.marks:
            if mark.low is not None and mark.high is not None:
                low, high = max(mark.low, ends.low), min(mark.high, ends.high)
                if low <= high:
                    bar = [(low, mark.y), (high, mark.y)] if across else [(mark.x, low), (mark.x, high)]
                    yield panel.line(bar, f"line {_colour(place)}")
            yield _draw_mark(panel, mark, place)


def send_svg(drawn: str) -> Response:
    return Response(drawn, media_type="image/svg+xml", headers={"Cache-Control": "private, no-cache"})


def _draw_mark(panel: Panel, mark: Mark, place: int) -> str:
    """A point with what its card says, or nothing outside the panel."""
    if not (panel.x.low <= mark.x <= panel.x.high and panel.y.low <= mark.y <= panel.y.high):
        return ""
    told = [*mark.told, f"left out: {mark.left_out}"] if mark.left_out else [*mark.told]
    data = {"frame": mark.name, "frame-id": mark.frame_id} if mark.frame_id else {}
    # a line feed as it is would be read as a space
    lines = told if mark.frame_id else [mark.name, *told]
    said = {name: escape(text) for name, text in data.items()} | {"told": "&#10;".join(map(escape, lines))}
    more = "".join(f' data-{name}="{text}"' for name, text in said.items())
    return (
        f'<path class="point {"out " if mark.left_out else ""}{_colour(place)}"{more} '
        f'transform="translate({panel.x(mark.x):.1f} {panel.y(mark.y):.1f})" d="{_symbol(place)}"/>'
    )


def _finish(
    panel: Panel, parts: Sequence[str], figure: Figure, label: str, view: View, choices: Sequence[str]
) -> str:
    """With the axes behind and the legend below, in as many columns as there is room for."""
    names = [(n if each.place is None else each.place, each.name) for n, each in enumerate(figure.series)]
    names = [(place, name) for place, name in names if name and len(names) > 1]
    inner = panel.x.end_px - panel.x.start_px
    columns = max(1, int(inner // (32 + 7 * max((len(name) for _, name in names), default=1))))
    top = panel.y.start_px + _BOTTOM_PX
    legend: list[str] = []
    for n, (place, name) in enumerate(names):
        x = panel.x.start_px + n % columns * inner / columns + 8
        y = top + _LINE_PX * (n // columns) + 8
        at = f'transform="translate({x:.1f} {y:.1f})"'
        symbol = f'<path class="point {_colour(place)}" {at} d="{_symbol(place)}"/>'
        text = f'<text x="{x + 12:.1f}" y="{y + 4:.1f}">{escape(name)}</text>'
        legend.append(f'<g class="legend" data-series="{place}">{symbol}{text}</g>')
    height = math.ceil(top + _LINE_PX * -(-len(names) // columns))
    drawn = document(
        [*panel.frame(), *parts, *legend], width_px=view.width, height_px=height, label=label, style=_STYLE
    )
    ends = f'data-low="{panel.x.low:.12g}" data-high="{panel.x.high:.12g}"'
    told = f'{ends} data-parts="{escape(json.dumps(list(choices)))}" data-note="{escape(figure.note)}"'
    return drawn.replace("<svg ", f"<svg {told} ", 1)


def _colour(place: int) -> str:
    return f"s{place % len(_COLOURS)}"


def _symbol(place: int) -> str:
    return _SYMBOLS[place % len(_SYMBOLS)]
