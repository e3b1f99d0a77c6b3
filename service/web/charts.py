"""Figures as SVG for the pages, each point with what static/plots.js shows of it in a card."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from html import escape
from typing import Annotated, Final

from fastapi import Query, Response

from radiometry.drawing import chart
from radiometry.drawing.chart import document
from radiometry.drawing.figure import Figure

Share = Annotated[float, Query(ge=-1, le=2)]

_LEFT_PX, _RIGHT_PX, _TOP_PX, _NAME_PX = 66, 20, 14, 24
_NAMES_SHARE: Final = 0.4
_HEIGHT_PX: Final = {False: 188, True: 338}


@dataclass(frozen=True, kw_only=True)
class View:
    """How wide a chart's place is, and what is shown: shares of either axis of the whole."""

    width: Annotated[int, Query(ge=240, le=2000)] = 900
    x0: Share = 0.0
    x1: Share = 1.0
    y0: Share = 0.0
    y1: Share = 1.0
    part: Annotated[int, Query(ge=0, le=99, description="Which figure of a plot that has several.")] = 0


def draw_figure(
    figure: Figure, label: str, *, view: View = View(), parts: Sequence[str] = (), is_wide: bool = False
) -> str:
    """Draw a figure as SVG.

    ``label`` : text for screen readers; ``parts`` : labels of all figures of the plot
    """
    names = figure.y.ticks or ()
    height = _NAME_PX * len(names) if names else _HEIGHT_PX[is_wide]
    # figures of one time above each other have one margin
    shares_margin = figure.x.is_time or not names
    # names have the room that they need, up to a share of the width
    longest = min(14 + 7 * max((len(text) for _, text in names), default=0), int(_NAMES_SHARE * view.width))
    left = max(_LEFT_PX if shares_margin else 0, longest)
    panel = chart.place_figure(figure, (left, _TOP_PX, view.width - _RIGHT_PX, _TOP_PX + height))
    panel = replace(panel, x=panel.x.part(view.x0, view.x1), y=panel.y.part(view.y0, view.y1))
    drawn, bottom = chart.draw_figure(figure, panel, in_print=False)
    picture = document(
        drawn, width_px=view.width, height_px=math.ceil(bottom), label=label, style=chart.STYLE
    )
    ends = f'data-low="{panel.x.low:.12g}" data-high="{panel.x.high:.12g}"'
    told = f'{ends} data-parts="{escape(json.dumps(list(parts)))}" data-note="{escape(figure.note)}"'
    return picture.replace("<svg ", f"<svg {told} ", 1)


def send_svg(drawn: str) -> Response:
    return Response(drawn, media_type="image/svg+xml", headers={"Cache-Control": "private, no-cache"})
