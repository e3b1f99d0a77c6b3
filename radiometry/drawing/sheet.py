"""A sheet of panels side by side, and series that differ in colour and dash: for print and every eye."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from html import escape

from radiometry.drawing.svg import Panel, Scale, document, span

COLUMNS = 3

_LEFT_PX, _PANEL_PX, _GAP_PX, _RIGHT_PX = 64, 290, 82, 42
_ROW_PX, _TOP_PX, _BOTTOM_PX = 300, 44, 52
# Okabe and Ito, Color Universal Design: told apart by eyes that confuse red with green; in grey by dashes
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
_DASHES = ("none", "7 3", "2 3", "9 3 2 3", "4 2", "12 4")
_STYLE = (
    ".bar{stroke-width:1.2}.swath{stroke:none;opacity:.18}.note{font-size:10.5px}.unknown{fill:#bbb}"
    + "".join(
        f".l{i}{{fill:none;stroke:{colour};stroke-width:1.6;stroke-dasharray:{dash}}}"
        f".d{i}{{fill:{colour};stroke:{colour}}}.h{i}{{fill:#fff;stroke:{colour}}}"
        for i, (colour, dash) in enumerate(zip(_COLOURS, _DASHES, strict=True))
    )
)


@dataclass(frozen=True, kw_only=True)
class Axis:
    """An axis, with limits around ``values`` and ``include``."""

    values: Sequence[float]
    label: str
    logarithmic: bool = False
    include: tuple[float, ...] = ()

    def scale(self, start_px: float, end_px: float) -> Scale:
        """Return the scale of the axis between two pixels.

        Parameters
        ----------
        start_px, end_px : float
            Ends of the axis.
        """
        low, high = span(self.values, logarithmic=self.logarithmic, include=self.include)
        return Scale(low=low, high=high, start_px=start_px, end_px=end_px, logarithmic=self.logarithmic)


def place(index: int, *, x: Axis, y: Axis, title: str) -> Panel:
    """Return a panel of the sheet.

    Parameters
    ----------
    index : int
        Position, row by row from the left.
    x, y : Axis
        Its axes.
    title : str
        Text above it.
    """
    row, column = divmod(index, COLUMNS)
    left, top = _LEFT_PX + column * (_PANEL_PX + _GAP_PX), row * _ROW_PX
    return Panel(
        x=x.scale(left, left + _PANEL_PX),
        y=y.scale(top + _ROW_PX - _BOTTOM_PX, top + _TOP_PX),
        title=title,
        x_label=x.label + (", logarithmic" if x.logarithmic else ""),
        y_label=y.label,
    )


def finish(parts: Iterable[str], *, panels: int, label: str) -> str:
    """Return the sheet as an SVG document.

    Parameters
    ----------
    parts : iterable of str
        Elements.
    panels : int
        Number of panels.
    label : str
        Text for screen readers.
    """
    columns, rows = min(max(panels, 1), COLUMNS), max(1, -(-panels // COLUMNS))
    width = _LEFT_PX + columns * _PANEL_PX + (columns - 1) * _GAP_PX + _RIGHT_PX
    return document(parts, width_px=width, height_px=rows * _ROW_PX, label=label, style=_STYLE)


def line(series: int) -> str:
    """Return the class of a series' line.

    Parameters
    ----------
    series : int
        Number of the series, which selects colour and dash.
    """
    return f"l{series % len(_COLOURS)}"


def dot(series: int, *, used: bool = True) -> str:
    """Return the class of a series' points.

    Parameters
    ----------
    series : int
        Number of the series, which selects colour and dash.
    used : bool, optional
        False: hollow, for points that were left out.
    """
    return f"{'d' if used else 'h'}{series % len(_COLOURS)}"


def bar(panel: Panel, at: float, low: float, high: float, series: int) -> str:
    """Return an error bar, cut at the panel's limits.

    Parameters
    ----------
    panel : Panel
        Where it is drawn.
    at : float
        x.
    low, high : float
        Ends in y.
    series : int
        Number of the series, which selects colour and dash.
    """
    low, high = max(low, panel.y.low), min(high, panel.y.high)
    return panel.line([(at, low), (at, high)], f"{dot(series)} bar") if low <= high else ""


def swath(panel: Panel, points: Sequence[tuple[float, float, float]], series: int) -> str:
    """Return the area between two curves, cut at the panel's limits.

    Parameters
    ----------
    panel : Panel
        Where it is drawn.
    points : sequence of (float, float, float)
        x with the lower and upper y.
    series : int
        Number of the series, which selects colour and dash.
    """

    def cut(value: float) -> float:
        return panel.y(min(max(value, panel.y.low), panel.y.high))

    inside = [(x, low, high) for x, low, high in points if panel.x.low <= x <= panel.x.high]
    there = [f"{panel.x(x):.1f},{cut(low):.1f}" for x, low, _ in inside]
    back = [f"{panel.x(x):.1f},{cut(high):.1f}" for x, _, high in reversed(inside)]
    return f'<polygon class="{dot(series)} swath" points="{" ".join([*there, *back])}"/>'


def write(panel: Panel, x: float, y: float, text: str, css: str = "mid note") -> str:
    """Return a text at a point of a panel.

    Parameters
    ----------
    panel : Panel
        Where it is drawn.
    x, y : float
        Position.
    text : str
        Text.
    css : str, optional
        Classes.
    """
    return f'<text class="{css}" x="{panel.x(x):.1f}" y="{panel.y(y):.1f}">{escape(text)}</text>'


def name_series(panel: Panel, names: Sequence[str], *, on_left: bool = False) -> Iterator[str]:
    """Return the legend, inside at the top: a piece of each line with its name.

    Parameters
    ----------
    panel : Panel
        Where it is drawn.
    names : sequence of str
        Names of the series.
    on_left : bool, optional
        True: at the left.
    """
    top = panel.y.end_px + 14
    right = panel.x.start_px + 32 if on_left else panel.x.end_px - 8
    at, css = (right + 4, "note") if on_left else (right - 28, "end note")
    for series, name in enumerate(names):
        y = top + 14 * series
        yield f'<path class="{line(series)}" d="M{right - 24:.1f} {y - 4:.1f}H{right:.1f}"/>'
        yield f'<text class="{css}" x="{at:.1f}" y="{y:.1f}">{escape(name)}</text>'
