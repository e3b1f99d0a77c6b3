"""A luminance calibration to look into: signal against X, and residuals, each point with its frame."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import Any, Final, Literal

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool, Scatter, TapTool
from bokeh.models.annotations import BoxAnnotation, Span
from bokeh.models.axes import LogAxis
from bokeh.models.renderers import DataRenderer
from bokeh.models.tickers import FixedTicker
from bokeh.plotting import figure

from radiometry.fitting import models
from service.web.plots.figures import COLOURS, Colours, Theme, new_figure, style_legend

Axes = Literal["linear", "log"]
Row = dict[str, Any]

_SYMBOLS: Final = ("circle", "square", "triangle", "diamond", "inverted_triangle", "hex")
_ALONG: Final = 80
_DECADES: Final = [float(f"{digit}e{power}") for power in range(-6, 7) for digit in (1, 2, 5)]
_HOLLOW: Final = "rgba(0, 0, 0, 0)"
_X: Final = "X = t S L / f²  [cd·s/m²]"
# what stands for @name is escaped by Bokeh, also the name of a file
_TOLD: Final = """
<div><img src="@preview" alt="" width="180" height="120"></div>
<div><b>@frame</b></div>
<div>@scene, @settings</div>
<div>signal @signal_said DN, L @luminance_said cd/m²</div>
<div>@verdict</div>
"""


def draw_signal(result: Row, *, axes: Axes, theme: Theme) -> figure:
    """Signal above dark against X with the fitted models, a colour and a symbol for each ISO value."""
    drawn = new_figure(
        theme,
        x_label=_X,
        y_label="signal above dark [DN]",
        height_px=400,
        x_axis_type=axes,
        y_axis_type=axes,
    )
    for place, (coefficient, points) in enumerate(_by_iso(result)):
        shown = [p for p in points if axes == "linear" or p["adjusted_signal_dn"] > 0.0]
        xs, ys = _curve(coefficient, [p["rhs"] for p in shown], axes)
        colour, label = _colour(place, theme), f"ISO {coefficient['iso']:g}"
        drawn.line(xs, ys, color=colour, alpha=0.7, line_width=1.5, legend_label=label)
        _scatter(drawn, shown, [p["adjusted_signal_dn"] for p in shown], place, label, theme)
    _finish(drawn, theme)
    return drawn


def draw_residuals(result: Row, *, theme: Theme) -> figure:
    """(L_fit - L_meter) / L_meter in % against X, with the band that the tolerance leaves."""
    colours = COLOURS[theme]
    limit = 100.0 * result["tolerance_rel"]
    series = [(c, [p for p in points if p["residual_rel"] is not None]) for c, points in _by_iso(result)]
    # a point that was left out may lie anywhere: those that were used fill the plot
    used = [abs(100.0 * p["residual_rel"]) for _, points in series for p in points if p["used"]]
    widest = 1.2 * max([limit, *used])
    drawn = new_figure(
        theme,
        x_label=_X,
        y_label="residual [% of L]",
        height_px=300,
        x_axis_type="log",
        y_range=(-widest, widest),
    )
    _draw_tolerance(drawn, limit, colours)
    for place, (coefficient, points) in enumerate(series):
        values = [100.0 * p["residual_rel"] for p in points]
        _scatter(drawn, points, values, place, f"ISO {coefficient['iso']:g}", theme)
    _finish(drawn, theme)
    return drawn


def _draw_tolerance(drawn: figure, limit: float, colours: Colours) -> None:
    band = BoxAnnotation(
        bottom=-limit,
        top=limit,
        fill_color=colours.accent,
        fill_alpha=0.07,
        line_color=None,
        level="underlay",
    )
    drawn.add_layout(band)
    for level, dash in ((limit, "dashed"), (0.0, "solid"), (-limit, "dashed")):
        drawn.add_layout(
            Span(location=level, dimension="width", line_color=colours.muted, line_dash=dash, line_alpha=0.7)
        )


def _by_iso(result: Row) -> Iterator[tuple[Row, list[Row]]]:
    for fit in result["iso_fits"]:
        coefficient = fit["coefficient"]
        yield coefficient, [p for p in result["points"] if p["iso"] == coefficient["iso"] and p["rhs"]]


def _scatter(
    drawn: figure, points: Sequence[Row], values: Sequence[float], place: int, label: str, theme: Theme
) -> None:
    colour, marker = _colour(place, theme), _SYMBOLS[place % len(_SYMBOLS)]
    scattered = drawn.scatter(
        "x",
        "y",
        source=ColumnDataSource(_columns(points, values, colour)),
        marker=marker,
        size=9,
        fill_color="fill",
        line_color=colour,
        line_width=1.5,
        nonselection_alpha=0.6,
        legend_label=label,
        name="points",
    )
    scattered.selection_glyph = Scatter(
        marker=marker, size=14, fill_color="fill", line_color=COLOURS[theme].ink, line_width=2.5
    )


def _columns(points: Sequence[Row], values: Sequence[float], colour: str) -> dict[str, list[Any]]:
    columns: dict[str, list[Any]] = defaultdict(list)
    columns |= {name: [] for name in ("x", "y", "fill", "frame", "frame_id")}
    for point, value in zip(points, values, strict=True):
        columns["x"].append(point["rhs"])
        columns["y"].append(value)
        columns["fill"].append(colour if point["used"] else _HOLLOW)
        columns["frame"].append(point["frame"])
        columns["frame_id"].append(point["frame_id"])
        columns["preview"].append(f"/v1/frames/{point['frame_id']}/preview.png")
        columns["scene"].append(point["scene"])
        columns["settings"].append(
            f"{_time(point['exposure_time_s'])} s, f/{point['f_number']:g}, ISO {point['iso']:g}"
        )
        columns["signal_said"].append(f"{point['adjusted_signal_dn']:.5g}")
        columns["luminance_said"].append(f"{point['luminance_cd_m2']:.4g}")
        columns["verdict"].append(_verdict(point))
    return columns


def _verdict(point: Row) -> str:
    if not point["used"]:
        return f"left out: {point['left_out']}"
    return f"residual {100.0 * point['residual_rel']:+.2f} % of L"


def _time(exposure_time_s: float) -> str:
    return f"1/{1.0 / exposure_time_s:.4g}" if exposure_time_s < 0.3 else f"{exposure_time_s:g}"


def _curve(coefficient: Row, rhs: Sequence[float], axes: Axes) -> tuple[list[float], list[float]]:
    if not rhs:
        return [], []
    low, high = min(rhs), max(rhs)
    # a power or a logarithm has no value at 0
    along = np.geomspace(low, high, _ALONG) if axes == "log" else np.linspace(low / 50.0, high, _ALONG)
    signal = models.predict(coefficient["model"], np.asarray(coefficient["parameters"]), along)
    kept = signal > 0.0 if axes == "log" else np.isfinite(signal)
    return along[kept].tolist(), signal[kept].tolist()


def _colour(place: int, theme: Theme) -> str:
    series = COLOURS[theme].series
    return series[place % len(series)]


def _finish(drawn: figure, theme: Theme) -> None:
    points = [r for r in drawn.renderers if isinstance(r, DataRenderer) and r.name == "points"]
    drawn.add_tools(HoverTool(tooltips=_TOLD, renderers=points), TapTool(renderers=points))
    style_legend(drawn, theme)
    drawn.legend.click_policy = "hide"
    for axis in drawn.axis:
        if isinstance(axis, LogAxis):
            # by itself it ticks two decades like one, 20, 40, 60 and nothing below, and rounds the exponents
            # of its labels: 20 would read 10 to the first, and 50 to the second power
            labels = {tick: f"{tick:g}" for tick in _DECADES}
            axis.update(ticker=FixedTicker(ticks=_DECADES), major_label_overrides=labels)
