"""A sheet of figures side by side, as certificates print them."""

import math
from collections.abc import Iterable
from typing import Final

from radiometry.drawing.chart import STYLE, draw_figure, place_figure
from radiometry.drawing.figure import Figure
from radiometry.drawing.svg import document

_COLUMNS: Final = 3
_LEFT_PX, _GAP_PX, _RIGHT_PX, _TOP_PX, _BELOW_PX = 64, 82, 42, 44, 4


def draw_sheet(
    rows: Iterable[Iterable[tuple[str, Figure]]], label: str, *, panel_px: tuple[int, int] = (290, 204)
) -> str:
    """Draw figures with their titles as an SVG document.

    Parameters
    ----------
    rows : iterable of iterable of (str, Figure)
        What begins a row each; what does not fit beside it goes below.
    label : str
        Text for screen readers.
    panel_px : (int, int), optional
        Width and height of what the axes of a figure enclose.
    """
    wide, high = panel_px
    parts: list[str] = []
    columns, bottom = 1, 0.0
    for row in rows:
        figures = list(row)
        for first in range(0, len(figures), _COLUMNS):
            top, shown = bottom + _TOP_PX, figures[first : first + _COLUMNS]
            for column, (title, figure) in enumerate(shown):
                left = _LEFT_PX + column * (wide + _GAP_PX)
                box = (left, top, left + wide, top + high)
                panel = place_figure(figure, box, title=title, in_print=True)
                drawn, end = draw_figure(figure, panel, in_print=True)
                parts += drawn
                bottom = max(bottom, end + _BELOW_PX)
            columns = max(columns, len(shown))
    width = _LEFT_PX + columns * wide + (columns - 1) * _GAP_PX + _RIGHT_PX
    return document(parts, width_px=width, height_px=math.ceil(bottom), label=label, style=STYLE)
