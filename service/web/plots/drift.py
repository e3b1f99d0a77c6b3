"""One coefficient of a camera from version to version, with error bars."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

from bokeh.models.annotations import TeeHead, Whisker
from bokeh.models.renderers import DataRenderer
from bokeh.models.sources import ColumnDataSource
from bokeh.models.tools import HoverTool
from bokeh.plotting import figure

from radiometry.drawing.svg import span
from radiometry.fleet.determinations import Determination, Key
from service.certificate.figures import in_print, in_step
from service.web.plots.figures import COLOURS, Theme, new_figure, style_legend

_SYMBOLS = ("circle", "square", "triangle", "diamond", "inverted_triangle", "hex")
_LEAST_MS = 90 * 86_400_000.0
_ROOM = 1.15


def draw_drift(
    found: Sequence[Determination], versions: Mapping[str, int], *, quantity: str, theme: Theme
) -> figure:
    """Each ISO, f-number, band and channel in a colour and a symbol; bars are one standard uncertainty.

    ``found`` : of one coefficient, named ``quantity``; ``versions`` : the number of each version
    """
    key = found[0].key
    drawn = new_figure(
        theme,
        x_label="determined",
        y_label=f"{quantity} [{in_print(key.unit)}]",
        x_axis_type="datetime",
        x_range=_time_range(found),
        y_range=span([row.value + sign * row.standard_uncertainty for row in found for sign in (-1, 1)]),
    )
    rows: dict[str, list[Determination]] = defaultdict(list)
    shared = _shared([row.key for row in found])
    for row in found:
        rows[_where(row.key, without=shared).replace("channel ", "")].append(row)
    step_ms = _step_ms(found, len(rows))
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


def _where(key: Key, *, without: frozenset[str] = frozenset()) -> str:
    """What a series holds for, but for what goes without saying."""
    return ", ".join(part for part in _parts(key) if part not in without)


def _parts(key: Key) -> list[str]:
    said = str(key).removeprefix(key.name).removeprefix(" at ").split(", ")
    # of sharpness the model ends with the place in the frame
    return [part for part in (*said, key.model.partition(":")[2]) if part]


def _shared(keys: Sequence[Key]) -> frozenset[str]:
    """What all series hold for: of an only one nothing, as it must have a name."""
    if len(set(keys)) == 1:
        return frozenset()
    return frozenset.intersection(*(frozenset(_parts(key)) for key in keys))


def _time_range(found: Sequence[Determination]) -> tuple[float, float]:
    """From the first version to the last with some room: at least months, as nothing drifts in hours."""
    times = [row.source.at.timestamp() * 1000.0 for row in found]
    middle, half = (max(times) + min(times)) / 2.0, max((max(times) - min(times)) / 2.0, _LEAST_MS / 2.0)
    return middle - _ROOM * half, middle + _ROOM * half


def _step_ms(found: Sequence[Determination], series: int) -> float:
    """Between the series of one version: together a small share of what is shown."""
    low, high = _time_range(found)
    return min(0.012, 0.15 / series) * (high - low)
