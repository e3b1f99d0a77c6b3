"""Charts as SVG, for pages and for print, and sheets of them side by side."""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from html import escape
from typing import Final

from radiometry.drawing.figure import Axis, Figure, Mark, Series
from radiometry.drawing.text import shorten, write_tick
from radiometry.records import Record

_STEPS = (1.0, 2.0, 5.0, 10.0)
_LEAST_TICKS, _MOST_TICKS = 3, 8
_ROUNDING_PX: Final = 1e-6
_STYLE = (
    "text{font:12px system-ui,sans-serif;fill:#222}.title{font-weight:600}.mid{text-anchor:middle}"
    ".end{text-anchor:end}.box{fill:none;stroke:#555}.tick{stroke:#ddd}"
    ".limit{fill:none;stroke:#888;stroke-dasharray:4 3}"
    "svg{background:#fff}"
)


def document(parts: Iterable[str], *, width_px: int, height_px: int, label: str, style: str = "") -> str:
    """Return an SVG document."""
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width_px} {height_px}" width="{width_px}" '
        f'height="{height_px}" role="img" aria-label="{escape(label)}"><style>{_STYLE}{style}</style>'
        f"{''.join(parts)}</svg>"
    )


class Scale(Record):
    """Mapping of a value to a pixel along one axis."""

    low: float  # Ends of the axis
    high: float
    start_px: float  # Their pixels
    end_px: float
    logarithmic: bool = False  # True for a logarithmic scale
    is_downward: bool = False  # True if values are negated; ticks have no sign
    # Where ticks stand, with their texts; None for round numbers
    named: tuple[tuple[float, str], ...] | None = None

    def __call__(self, value: float) -> float:
        """Return the pixel of a value, which on a logarithmic scale is positive."""
        low, high, at = self.low, self.high, value
        if self.logarithmic:
            low, high, at = math.log(low), math.log(high), math.log(value)
        return self.start_px + (self.end_px - self.start_px) * (at - low) / (high - low)

    def label(self, tick: float) -> str:
        if self.named is not None:
            return dict(self.named)[tick]
        step = 0.0 if self.logarithmic else self._even_step()
        return write_tick(abs(tick) if self.is_downward else tick, step=step)

    def ticks(self) -> list[float]:
        """Return the named ticks, else round values: 1, 2 and 5 in a power of ten, or even steps.

        Many powers of ten have 1 alone, or some of them; a part of one power has even steps.
        """
        if self.named is not None:
            return [at for at, _ in self.named if self.low <= at <= self.high]
        if self.logarithmic:
            powers = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
            figures: list[float] = []
            for steps in (_STEPS[:3], _STEPS[:1]):
                found = [step * 10.0**power for power in powers for step in steps]
                figures = [figure for figure in found if self.low <= figure <= self.high]
                if len(figures) <= _MOST_TICKS:
                    break
            if len(figures) >= _LEAST_TICKS:
                return figures[:: math.ceil(len(figures) / _MOST_TICKS)]
        step = self._even_step()
        first = math.ceil(self.low / step - 1e-9)
        return [step * i for i in range(first, math.floor(self.high / step + 1e-9) + 1)]

    def _even_step(self) -> float:
        rough = (self.high - self.low) / 6
        power = 10.0 ** math.floor(math.log10(rough))
        return next(s * power for s in _STEPS if s * power >= rough * 0.999)

    def shows(self, value: float) -> bool:
        """Return True if a value has a place on the axis, within the limits or beyond."""
        return math.isfinite(value) and (value > 0.0 or not self.logarithmic)


def span(values: Iterable[float], *, logarithmic: bool = False) -> tuple[float, float]:
    """Return limits with a margin around the values."""
    known = [value for value in values if math.isfinite(value)]
    if logarithmic:
        known = [value for value in known if value > 0] or [1.0]
        return min(known) / 1.5, max(known) * 1.5
    low, high = min(known, default=0.0), max(known, default=1.0)
    air = 0.06 * (high - low) or 0.5 * abs(high) or 1.0
    return low - air, high + air


class Panel(Record):
    """A frame with axes; what is drawn in it is clipped to it by staying within the limits."""

    x: Scale
    y: Scale
    title: str
    x_label: str
    y_label: str

    def frame(self) -> list[str]:
        left, right = self.x.start_px, self.x.end_px
        bottom, top = self.y.start_px, self.y.end_px
        middle = (left + right) / 2
        size = f'width="{right - left:.1f}" height="{bottom - top:.1f}"'
        turned = f"translate({left - 46:.1f} {(top + bottom) / 2:.1f}) rotate(-90)"
        parts = [
            f'<rect class="box" x="{left:.1f}" y="{top:.1f}" {size}/>',
            f'<text class="title" x="{left:.1f}" y="{top - 8:.1f}">{escape(self.title)}</text>',
            f'<text class="mid" x="{middle:.1f}" y="{bottom + 34:.1f}">{escape(self.x_label)}</text>',
            f'<text class="mid" transform="{turned}">{escape(self.y_label)}</text>',
        ]
        taken = -math.inf
        for tick in sorted(self.x.ticks()):
            at, text = self.x(tick), self.x.label(tick)
            parts.append(f'<path class="tick" d="M{at:.1f} {bottom:.1f}V{top:.1f}"/>')
            # a text that would lie over the one before is left out
            if at - 4.0 * len(text) > taken:
                parts.append(f'<text class="mid" x="{at:.1f}" y="{bottom + 16:.1f}">{escape(text)}</text>')
                taken = at + 4.0 * len(text)
        for tick in self.y.ticks():
            at = self.y(tick)
            parts.append(f'<path class="tick" d="M{left:.1f} {at:.1f}H{right:.1f}"/>')
            parts.append(
                f'<text class="end" x="{left - 5:.1f}" y="{at + 4:.1f}">{escape(self.y.label(tick))}</text>'
            )
        return parts

    def line(self, points: Iterable[tuple[float, float]], css: str, *, dash: str = "none") -> str:
        """Return a line through points, cut at the limits; a point without a place on the axes breaks it."""
        dashes = "" if dash == "none" else f' stroke-dasharray="{dash}"'
        return "".join(
            f'<polyline class="{css}"{dashes} points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in run)}"/>'
            for run in self._cut(points)
        )

    def _cut(self, points: Iterable[tuple[float, float]]) -> Iterator[list[tuple[float, float]]]:
        """Yield the parts of a line that lie within the limits [px]."""
        places = [(self.x(x), self.y(y)) if self.x.shows(x) and self.y.shows(y) else None for x, y in points]
        run: list[tuple[float, float]] = []
        for start, end in itertools.pairwise(places):
            part = self._cut_segment(start, end) if start and end else None
            if run and (part is None or run[-1] != part[0]):
                yield run
                run = []
            if part is not None:
                run += part[1:] if run else part
        if run:
            yield run

    def _cut_segment(
        self, start: tuple[float, float], end: tuple[float, float]
    ) -> tuple[tuple[float, float], tuple[float, float]] | None:
        """Return the part of a segment that lies within the limits (Liang and Barsky), None if none does."""
        low, high = 0.0, 1.0
        for scale, a, b in zip((self.x, self.y), start, end, strict=True):
            least, most = sorted((scale.start_px, scale.end_px))
            least, most = least - _ROUNDING_PX, most + _ROUNDING_PX
            if a == b:
                if not least <= a <= most:
                    return None
                continue
            first, last = sorted(((least - a) / (b - a), (most - a) / (b - a)))
            low, high = max(low, first), min(high, last)
        if low > high:
            return None
        (x0, y0), (x1, y1) = start, end
        return (
            start if low == 0.0 else (x0 + low * (x1 - x0), y0 + low * (y1 - y0)),
            end if high == 1.0 else (x0 + high * (x1 - x0), y0 + high * (y1 - y0)),
        )

    def write(self, x: float, y: float, text: str, css: str = "mid note") -> str:
        return f'<text class="{css}" x="{self.x(x):.1f}" y="{self.y(y):.1f}">{escape(text)}</text>'

    def holds(self, x: float, y: float) -> bool:
        """Return True if a point lies within the limits."""
        return self.x.low <= x <= self.x.high and self.y.low <= y <= self.y.high


WIDEST_PX: Final = 1600  # Of the picture

BAR_PX: Final = 200  # Of its width: the bar and its labels


def find_step(width_px: int) -> int:
    """Return how many pixels of the map, along each side, are one of its picture."""
    return max(1, math.ceil(width_px / (WIDEST_PX - BAR_PX)))


_BOTTOM_PX, _LINE_PX = 48, 22
_WIDE_PX, _HIGH_PX = 290, 204  # what the axes of a printed figure enclose
_MONTHS: Final = (1, 2, 3, 6, 12, 24, 60, 120, 240)
_DAY_S, _HALF_HOUR_S = 86_400.0, 1800.0
_LETTER_PX, _LEAST_LETTERS = 7, 8
# of more points, those that would lie over one of their series are not drawn
_MOST_MARKS: Final = 2000
# steps of time below a month, with the form of a tick
_TIMES: Final = tuple(
    (60.0 * minutes, "%H:%M") for minutes in (1, 2, 5, 10, 15, 30, 60, 120, 180, 360, 720)
) + tuple((_DAY_S * days, "%m-%d") for days in (1, 2, 4, 7, 14))
# around a point: circle, square, triangle, diamond, triangle upside down, cross
_SYMBOLS: Final = (
    *("M-4.5 0a4.5 4.5 0 1 0 9 0a4.5 4.5 0 1 0-9 0Z", "M-4-4H4V4H-4Z", "M0-5L5 4H-5Z"),
    *("M0-5.5L5 0L0 5.5L-5 0Z", "M0 5L5-4H-5Z", "M-5-2H-2V-5H2V-2H5V2H2V5H-2V2H-5Z"),
)
# Okabe and Ito, Color Universal Design: told apart by eyes that confuse red with green; in grey by dashes.
# After six the colours come again with other dashes and symbols.
_COLOURS: Final = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
_DASHES: Final = ("none", "7 3", "2 3", "9 3 2 3", "4 2", "12 4")
# of a picture that is printed or saved; in a page stilb.css has the colours
STYLE: Final = (
    ".band{fill:#0b5f6b;opacity:.07}.unknown{fill:#bbb}.note{font-size:10.5px}"
    + "".join(
        f".line.s{n}{{fill:none;stroke:{colour};stroke-width:1.6}}"
        f".point.s{n}{{fill:{colour};stroke:{colour};stroke-width:1.2}}"
        f".cell.s{n}{{fill:{colour}}}.swath.s{n}{{fill:{colour};opacity:.18}}"
        for n, colour in enumerate(_COLOURS)
    )
    + ".line.bar{stroke-width:1.2}.point.out{fill:#fff}"
)


class _Dates(Scale):
    """Time in seconds since 1970, in UTC; ticks at the beginnings of months, or of shorter spans."""

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
        if step and step < _DAY_S and tick % _DAY_S == 0.0:
            form = "%m-%d"
        return datetime.fromtimestamp(tick, UTC).strftime(form)

    def _step(self) -> float | None:
        """Return the step below a month, None for months."""
        return next((step for step, _ in _TIMES if self.high - self.low <= 6.0 * step), None)


def place_figure(
    figure: Figure, box: tuple[float, float, float, float], *, title: str = "", in_print: bool = False
) -> Panel:
    (left, top, right, bottom), (xs, ys) = box, figure.find_limits(in_print=in_print)
    # names share the width, and none is wider than the axes
    most_x = max(_LEAST_LETTERS, int((right - left) / _LETTER_PX / max(1, len(figure.x.ticks or ()))))
    most_y = max(_LEAST_LETTERS, int(left / _LETTER_PX) - 1)
    x = _scale(_name_shortly(figure.x, most_x), xs, left, right)
    y = _scale(_name_shortly(figure.y, most_y), ys, bottom, top)
    return Panel(x=x, y=y, title=title, x_label=figure.x.label, y_label=figure.y.label)


def _name_shortly(axis: Axis, most: int) -> Axis:
    if axis.ticks is None:
        return axis
    return replace(axis, ticks=tuple((at, shorten(text, most)) for at, text in axis.ticks))


def _scale(axis: Axis, values: Sequence[float], start_px: float, end_px: float) -> Scale:
    low, high = span(values, logarithmic=axis.logarithmic)
    if axis.is_time and values:
        # frames of one minute need a scale, too
        middle, half = (
            (min(values) + max(values)) / 2.0,
            max(0.53 * (max(values) - min(values)), _HALF_HOUR_S),
        )
        low, high = middle - half, middle + half
    elif axis.ticks and not axis.logarithmic and values:
        low, high = min(values), max(values)
    return (_Dates if axis.is_time else Scale)(
        low=low,
        high=high,
        start_px=start_px,
        end_px=end_px,
        logarithmic=axis.logarithmic,
        is_downward=axis.is_downward,
        named=axis.ticks,
    )


def draw_figure(figure: Figure, panel: Panel, *, in_print: bool) -> tuple[list[str], float]:
    parts = [*panel.frame(), *_draw_ground(panel, figure, in_print=in_print)]
    for n, each in enumerate(figure.series):
        place = _place(each, n)
        drawn = "".join(_draw_series(panel, figure, each, place, in_print=in_print))
        parts.append(f'<g class="series" data-series="{place}">{drawn}</g>' if drawn else "")
    legend, bottom = _draw_legend(panel, figure, in_print=in_print)
    return [*parts, *legend], bottom


def _place(series: Series, number: int) -> int:
    return number if series.place is None else series.place


def _draw_ground(panel: Panel, figure: Figure, *, in_print: bool) -> Iterator[str]:
    """Map, band, dashed lines and moments: what lies behind the series."""
    x, y = panel.x, panel.y
    for cell in figure.cells:
        (left, right), (bottom, top) = _cut(x, cell.x), _cut(y, cell.y)
        size = f'width="{max(0.0, right - left) + 0.3:.1f}" height="{max(0.0, bottom - top) + 0.3:.1f}"'
        css = "unknown" if cell.share is None else _colour(cell.share < 0)
        # a text must be read on its cell
        full = 0.6 if in_print and cell.text else 1.0
        shade = "" if cell.share is None else f' fill-opacity="{full * abs(cell.share):.3f}"'
        told = "" if in_print else f' data-told="{escape(cell.told)}"'
        yield f'<rect class="cell {css}" x="{left:.1f}" y="{top:.1f}" {size}{shade}{told}/>'
        if in_print and cell.text:
            yield panel.write(sum(cell.x) / 2.0, sum(cell.y) / 2.0, cell.text)
    if figure.band:
        bottom, top = _cut(y, figure.band)
        size = f'width="{x.end_px - x.start_px:.1f}" height="{bottom - top:.1f}"'
        yield f'<rect class="band" x="{x.start_px:.1f}" y="{top:.1f}" {size}/>'
    for level in figure.levels:
        yield panel.line([(x.low, level), (x.high, level)], "limit")
    for upright in figure.uprights:
        yield panel.line([(upright, y.low), (upright, y.high)], "limit")
    foot, top, middle = (y.low + share * (y.high - y.low) for share in (0.02, 0.06, 0.08))
    # at most one a pixel
    moments = [each for each in figure.moments if x.low <= each <= x.high]
    for moment in {round(x(each)): each for each in moments}.values():
        yield panel.line([(moment, foot), (moment, top)], "box")
    if moments:
        yield panel.write(min(moments), middle, figure.moments_are, "note")


def _cut(scale: Scale, ends: tuple[float, float]) -> tuple[float, float]:
    low, high = (scale(min(max(end, scale.low), scale.high)) for end in ends)
    return low, high


def _cut_swath(swath: Sequence[tuple[float, float, float]], panel: Panel) -> list[tuple[float, float, float]]:
    """Return the part of a band between the limits of x, with its edges at them."""
    x = panel.x
    known = [each for each in swath if x.shows(each[0]) and all(map(math.isfinite, each))]
    ends = [
        (end, a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2]))
        for end in (x.low, x.high)
        for a, b in itertools.pairwise(known)
        if a[0] < end < b[0]
        for share in ((end - a[0]) / (b[0] - a[0]),)
    ]
    return sorted([*(each for each in known if x.low <= each[0] <= x.high), *ends])


def _draw_series(panel: Panel, figure: Figure, each: Series, place: int, *, in_print: bool) -> Iterator[str]:
    across = bool(figure.y.ticks)
    ends = panel.x if across else panel.y
    inside = _cut_swath(each.swath, panel)
    if len(inside) > 1:
        edges = [(panel.x(x), *_cut(panel.y, (low, high))) for x, low, high in inside]
        there = [f"{x:.1f},{low:.1f}" for x, low, _ in edges]
        back = [f"{x:.1f},{high:.1f}" for x, _, high in reversed(edges)]
        yield f'<polygon class="swath {_colour(place)}" points="{" ".join([*there, *back])}"/>'
    for points in (each.model, each.line):
        if points:
            yield panel.line(points, f"line {_colour(place)}", dash=_dash(place))
    taken: set[tuple[int, int, bool]] = set()
    for mark in each.marks:
        if len(each.marks) > _MOST_MARKS and panel.holds(mark.x, mark.y):
            at_px = (round(panel.x(mark.x)), round(panel.y(mark.y)), bool(mark.left_out))
            if at_px in taken:
                continue
            taken.add(at_px)
        if mark.low is not None and mark.high is not None:
            low, high = max(mark.low, ends.low), min(mark.high, ends.high)
            if low <= high:
                bar = [(low, mark.y), (high, mark.y)] if across else [(mark.x, low), (mark.x, high)]
                yield panel.line(bar, f"line bar {_colour(place)}")
        if panel.holds(mark.x, mark.y):
            at = f"translate({panel.x(mark.x):.1f} {panel.y(mark.y):.1f}){' scale(.7)' if in_print else ''}"
            css = f"point {'out ' if mark.left_out else ''}{_colour(place)}"
            attributes, inner = _tell(mark, in_print=in_print)
            yield f'<path class="{css}"{attributes} transform="{at}" d="{_symbol(place)}">{inner}</path>'


def _tell(mark: Mark, *, in_print: bool) -> tuple[str, str]:
    """Return what the card of a page shows of a point, or its tooltip in a picture of its own."""
    told = [*mark.told, f"left out: {mark.left_out}"] if mark.left_out else [*mark.told]
    if in_print:
        return "", f"<title>{escape(', '.join([mark.name, *told]))}</title>"
    data = {"frame": mark.name, "frame-id": mark.frame_id} if mark.frame_id else {}
    # a line feed as it is would be read as a space
    lines = told if mark.frame_id else [mark.name, *told]
    said = {name: escape(text) for name, text in data.items()} | {"told": "&#10;".join(map(escape, lines))}
    return "".join(f' data-{name}="{text}"' for name, text in said.items()), ""


def _draw_legend(panel: Panel, figure: Figure, *, in_print: bool) -> tuple[list[str], float]:
    """Return the legend below the axes, in as many columns as there is room for, and where it ends."""
    named = [(_place(each, n), each) for n, each in enumerate(figure.series)]
    named = [(place, each) for place, each in named if each.name and (in_print or len(named) > 1)]
    inner = panel.x.end_px - panel.x.start_px
    columns = max(1, int(inner // (40 + 7 * max((len(each.name) for _, each in named), default=1))))
    top = panel.y.start_px + _BOTTOM_PX
    legend: list[str] = []
    for n, (place, each) in enumerate(named):
        x = panel.x.start_px + n % columns * inner / columns + 12
        y = top + _LINE_PX * (n // columns) + 8
        at = f'transform="translate({x:.1f} {y:.1f})"'
        symbol = f'<path class="point {_colour(place)}" {at} d="{_symbol(place)}"/>'
        line = f'<path class="line {_colour(place)}" stroke-dasharray="{_dash(place)}" {at} d="M-12 0H12"/>'
        lined = bool(each.line or each.model)
        shown = (line if lined else "") + (symbol if each.marks or not lined else "")
        name = shorten(each.name, max(_LEAST_LETTERS, int((inner - 40) / _LETTER_PX)))
        text = f'<text x="{x + 16:.1f}" y="{y + 4:.1f}">{escape(name)}</text>'
        legend.append(f'<g class="legend" data-series="{place}">{shown}{text}</g>')
    bottom = top + _LINE_PX * -(-len(named) // columns)
    if in_print and figure.note:
        legend.append(
            f'<text class="note" x="{panel.x.start_px:.1f}" y="{bottom + 8:.1f}">{escape(figure.note)}</text>'
        )
        bottom += _LINE_PX
    return legend, bottom


def _colour(place: int) -> str:
    return f"s{place % len(_COLOURS)}"


def _symbol(place: int) -> str:
    return _SYMBOLS[(place + place // len(_COLOURS)) % len(_SYMBOLS)]


def _dash(place: int) -> str:
    return _DASHES[(place + place // len(_COLOURS)) % len(_DASHES)]


_COLUMNS: Final = 3
_LEFT_PX, _GAP_PX, _RIGHT_PX, _TOP_PX, _BELOW_PX = 64, 82, 42, 44, 4


def draw_sheet(figures: Sequence[tuple[str, Figure]], label: str) -> str:
    """Draw figures with their titles as an SVG document, with a text for screen readers."""
    parts: list[str] = []
    columns, bottom = min(max(len(figures), 1), _COLUMNS), 0.0
    for first in range(0, len(figures), _COLUMNS):
        top = bottom + _TOP_PX
        for column, (title, figure) in enumerate(figures[first : first + _COLUMNS]):
            left = _LEFT_PX + column * (_WIDE_PX + _GAP_PX)
            box = (left, top, left + _WIDE_PX, top + _HIGH_PX)
            panel = place_figure(figure, box, title=title, in_print=True)
            drawn, end = draw_figure(figure, panel, in_print=True)
            parts += drawn
            bottom = max(bottom, end + _BELOW_PX)
    width = _LEFT_PX + columns * _WIDE_PX + (columns - 1) * _GAP_PX + _RIGHT_PX
    return document(parts, width_px=width, height_px=math.ceil(bottom), label=label, style=STYLE)
