"""One coefficient of a camera from version to version, with error bars."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

from bokeh.models.annotations import TeeHead, Whisker
from bokeh.models.renderers import DataRenderer
from bokeh.models.sources import ColumnDataSource
from bokeh.models.tools import HoverTool
from bokeh.plotting import figure

from radiometry.fleet.determinations import Determination, Key
from service.certificate.figures import in_print, in_step
from service.svg import span
from service.web.plots.figures import COLOURS, Theme, new_figure, style_legend

_SYMBOLS = ("circle", "square", "triangle", "diamond", "inverted_triangle", "hex")
_DAY_MS = 86_400_000.0


def draw_drift(found: Sequence[Determination], versions: Mapping[str, int], *, theme: Theme) -> figure:
    """Each ISO, f-number, band and channel in a colour and a symbol; bars are one standard uncertainty.

    ``found`` : of one coefficient's name; ``versions`` : the number of each version
    """
    key = found[0].key
    drawn = new_figure(
        theme,
        x_label="determined",
        y_label=f"{key.name} [{in_print(key.unit)}]",
        x_axis_type="datetime",
        y_range=span([row.value + sign * row.standard_uncertainty for row in found for sign in (-1, 1)]),
    )
    rows: dict[str, list[Determination]] = defaultdict(list)
    for row in found:
        rows[_where(row.key)].append(row)
    step_ms = _step_ms(found)
    points: list[DataRenderer] = []
    for place, (label, series) in enumerate(rows.items()):
        # error bars of one day would hide one another
        shift_ms = (place - (len(rows) - 1) / 2) * step_ms
        source = ColumnDataSource(_columns(series, versions, shift_ms))
        points.append(_draw_series(drawn, source, label, place, theme))
    drawn.add_tools(
        HoverTool(renderers=points, tooltips=[("", "@said"), ("", "@value_said"), ("", "@at_said")])
    )
    if len(rows) > 1:
        style_legend(drawn, theme)
    else:
        drawn.legend.visible = False
    return drawn


def _draw_series(
    drawn: figure, source: ColumnDataSource, label: str, place: int, theme: Theme
) -> DataRenderer:
    colours = COLOURS[theme]
    colour = colours.series[place % len(colours.series)]
    drawn.line("at", "value", source=source, color=colour, alpha=0.35, legend_label=label)
    end = TeeHead(size=7, line_color=colour)
    drawn.add_layout(
        Whisker(
            base="at",
            lower="lower",
            upper="upper",
            source=source,
            line_color=colour,
            upper_head=end,
            lower_head=end,
        )
    )
    symbol = _SYMBOLS[place % len(_SYMBOLS)]
    return drawn.scatter(
        "at", "value", source=source, marker=symbol, size=8, color=colour, legend_label=label, name="points"
    )


def _columns(
    series: Sequence[Determination], versions: Mapping[str, int], shift_ms: float
) -> dict[str, list[Any]]:
    columns: dict[str, list[Any]] = defaultdict(list)
    for row in series:
        value, uncertainty = in_step(row.value, row.standard_uncertainty)
        where = _where(row.key)
        columns["at"].append(row.source.at.timestamp() * 1000.0 + shift_ms)
        columns["value"].append(row.value)
        columns["lower"].append(row.value - row.standard_uncertainty)
        columns["upper"].append(row.value + row.standard_uncertainty)
        columns["said"].append(f"version {versions[row.source.version]}" + (f", {where}" if where else ""))
        columns["value_said"].append(f"{value} ± {uncertainty} {in_print(row.key.unit)}")
        columns["at_said"].append(row.source.at.strftime("%Y-%m-%d"))
    return columns


def _where(key: Key) -> str:
    """What a series holds for."""
    return str(key).removeprefix(key.name).removeprefix(" at ")


def _step_ms(found: Sequence[Determination]) -> float:
    """Between the series of one version: a share of what lies between versions, or of a day."""
    times = sorted({row.source.at.timestamp() * 1000.0 for row in found})
    return 0.004 * (times[-1] - times[0]) or 0.04 * _DAY_MS
