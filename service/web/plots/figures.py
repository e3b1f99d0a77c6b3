"""A figure in the page's colours, and its way to the browser."""

import json
import math
from dataclasses import dataclass
from typing import Any, Final, Literal

from bokeh.core.json_encoder import serialize_json
from bokeh.embed import json_item
from bokeh.models import Model
from bokeh.models.annotations import LegendItem
from bokeh.models.labeling import NoOverlap
from bokeh.plotting import figure
from fastapi import Response

Theme = Literal["light", "dark"]

# Of a legend in 12 px letters: what its line takes, and what a phone has for it.
_PHONE_PX: Final = 320
_GLYPH_PX: Final = 32
_LETTER_PX: Final = 7
_LINE_PX: Final = 22


@dataclass(frozen=True, kw_only=True)
class Colours:
    """As static/stilb.css has them; ``series`` are told apart also by those who see red and green alike."""

    ground: str
    ink: str
    muted: str
    line: str
    accent: str
    bad: str
    series: tuple[str, ...]


COLOURS: Final[dict[Theme, Colours]] = {
    "light": Colours(
        ground="#ffffff",
        ink="#1d1c1a",
        muted="#5f5b54",
        line="#e2ded5",
        accent="#0b5f6b",
        bad="#9c2a20",
        series=("#0b5f6b", "#c1611a", "#6a4c93", "#4f7a28", "#a83f6f", "#3b6fb6"),
    ),
    "dark": Colours(
        ground="#1a1d20",
        ink="#e8e6e1",
        muted="#a3a19b",
        line="#2d3135",
        accent="#73c5d0",
        bad="#f29a90",
        series=("#73c5d0", "#f0a35e", "#b99be0", "#a5cf7a", "#ee93b8", "#8db8f2"),
    ),
}


def new_figure(theme: Theme, *, x_label: str, y_label: str, height_px: int = 320, **more: Any) -> figure:  # noqa: ANN401
    """An empty figure as wide as its place, quiet until it is touched."""
    colours = COLOURS[theme]
    drawn = figure(
        height=height_px,
        sizing_mode="stretch_width",
        background_fill_color=colours.ground,
        border_fill_color=colours.ground,
        outline_line_color=None,
        toolbar_location="above",
        tools="pan,box_zoom,wheel_zoom,reset,save",
        active_drag=None,
        active_scroll=None,
        x_axis_label=x_label,
        y_axis_label=y_label,
        **more,
    )
    drawn.toolbar.logo = None
    drawn.toolbar.autohide = True
    drawn.grid.grid_line_color = colours.line
    for axis in drawn.axis:
        axis.axis_line_color = colours.line
        axis.major_tick_line_color = colours.line
        axis.minor_tick_line_color = None
        axis.major_label_policy = NoOverlap()
        axis.major_label_text_color = colours.muted
        axis.axis_label_text_color = colours.muted
        axis.axis_label_text_font_style = "normal"
        axis.axis_label_text_font = axis.major_label_text_font = "system-ui, sans-serif"
        axis.axis_label_text_font_size = axis.major_label_text_font_size = "12px"
    return drawn


def style_legend(drawn: figure, theme: Theme) -> None:
    """Below the plot, in as many columns as a phone has room for; the plot keeps its own height."""
    legend = drawn.legend[0]
    labels = [
        str(getattr(item.label, "value", item.label)) for item in legend.items if isinstance(item, LegendItem)
    ]
    columns = min(len(labels), max(1, _PHONE_PX // (_GLYPH_PX + _LETTER_PX * max(map(len, labels)))))
    legend.ncols = columns
    drawn.height = (drawn.height or 0) + _LINE_PX * (math.ceil(len(labels) / columns) - 1)
    legend.background_fill_color = legend.border_line_color = None
    legend.label_text_color = COLOURS[theme].muted
    legend.label_text_font = "system-ui, sans-serif"
    legend.label_text_font_size = "12px"
    legend.click_policy = "mute"
    legend.orientation = "horizontal"
    drawn.add_layout(legend, "below")


def send_plot(drawn: Model) -> Response:
    """What static/plots.js embeds. Bokeh writes NaN as null itself, so the text is JSON."""
    body = serialize_json(json_item(drawn))
    json.loads(body, parse_constant=_refuse)
    return Response(body, media_type="application/json", headers={"Cache-Control": "private, no-cache"})


def _refuse(constant: str) -> None:
    raise ValueError(f"{constant} in a plot is no JSON")
