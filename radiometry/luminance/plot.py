"""Plot of a luminance calibration: signal against X and ln X, and residuals, a row per ISO value."""

import math
from collections.abc import Callable, Iterator
from typing import Any

from radiometry.drawing.svg import Panel, Scale, document, span

_WIDTH, _ROW_PX = 1140, 300
_LEFT_PX, _PANEL_PX, _GAP_PX, _TOP_PX, _BOTTOM_PX = 64, 290, 82, 44, 52


def draw(result: dict[str, Any]) -> str:
    """Draw a stored luminance result as SVG.

    Parameters
    ----------
    result : dict of str to Any
        Stored result of the fit.

    Returns
    -------
    str
        SVG document; points left out are hollow, the tolerance is dashed.
    """
    fits = result["iso_fits"]
    parts = [part for row, fit in enumerate(fits) for part in _row(result, fit, row * _ROW_PX)]
    height = _ROW_PX * len(fits)
    return document(parts, width_px=_WIDTH, height_px=height, label="Luminance calibration")


def _row(result: dict[str, Any], fit: dict[str, Any], top: float) -> Iterator[str]:
    coefficient = fit["coefficient"]
    points = [p for p in result["points"] if p["iso"] == coefficient["iso"] and p.get("rhs")]
    name = f"ISO {coefficient['iso']:g}"
    model = _model(coefficient)
    signals = [p["adjusted_signal_dn"] for p in points]
    for column, logarithmic in ((0, False), (1, True)):
        panel = Panel(
            x=_x_scale([p["rhs"] for p in points], column, logarithmic=logarithmic),
            y=_y_scale(*span(signals, include=(0.0,)), top),
            title=f"{name}: signal against {'ln X' if logarithmic else 'X'}",
            x_label="X = t S L / f²  [cd s/m²]" + (", logarithmic" if logarithmic else ""),
            y_label="signal - dark [DN]",
        )
        yield from panel.frame()
        yield panel.line([(x, model(x)) for x in _along(panel.x)], "fit")
        for p in points:
            yield panel.dot(p["rhs"], p["adjusted_signal_dn"], "used" if p["used"] else "out", _title_of(p))
    yield from _residuals(name, points, result["tolerance_rel"], top)


def _residuals(name: str, points: list[dict[str, Any]], tolerance: float, top: float) -> Iterator[str]:
    judged = [p for p in points if p.get("residual_rel") is not None]
    used = [100 * p["residual_rel"] for p in judged if p["used"]]
    limit = 100 * tolerance
    panel = Panel(
        x=_x_scale([p["rhs"] for p in points], 2, logarithmic=True),
        y=_y_scale(*span(used, include=(-limit, limit)), top),
        title=f"{name}: residuals",
        x_label="X, logarithmic",
        y_label="(L fit - L meter) / L meter [%]",
    )
    yield from panel.frame()
    for level, css in ((0.0, "fit"), (limit, "limit"), (-limit, "limit")):
        yield panel.line([(panel.x.low, level), (panel.x.high, level)], css)
    for p in judged:
        yield panel.dot(p["rhs"], 100 * p["residual_rel"], "used" if p["used"] else "out", _title_of(p))


def _x_scale(values: list[float], column: int, *, logarithmic: bool) -> Scale:
    low, high = span(values, logarithmic=logarithmic, include=() if logarithmic else (0.0,))
    start = _LEFT_PX + column * (_PANEL_PX + _GAP_PX)
    return Scale(low=low, high=high, start_px=start, end_px=start + _PANEL_PX, logarithmic=logarithmic)


def _y_scale(low: float, high: float, top: float) -> Scale:
    return Scale(low=low, high=high, start_px=top + _ROW_PX - _BOTTOM_PX, end_px=top + _TOP_PX)


def _along(scale: Scale) -> list[float]:
    low, high = scale.low, scale.high
    if scale.logarithmic:
        return [low * (high / low) ** (i / 60) for i in range(61)]
    return [low + (high - low) * i / 60 for i in range(61)]


def _model(coefficient: dict[str, Any]) -> Callable[[float], float]:
    """Return the fitted signal as a function of X, for the model that was chosen."""
    p = coefficient["parameters"]
    match coefficient["model"]:
        case "proportional":
            return lambda x: p[0] * x
        case "affine":
            return lambda x: p[0] * x + p[1]
        case "power":
            return lambda x: p[0] * x ** p[1] if x > 0 else 0.0
        case _:
            return lambda x: p[0] * math.log(x) + p[1] if x > 0 else -math.inf


def _title_of(point: dict[str, Any]) -> str:
    left_out = f", left out: {point['left_out']}" if point["left_out"] else ""
    return f"{point['frame']}, {point['scene']}{left_out}"
