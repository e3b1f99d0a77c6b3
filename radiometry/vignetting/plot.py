"""Plot of a vignetting calibration: falloff by f-number, at the corner by channel, and residuals."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radiometry.drawing.sheet import Axis, bar, dot, finish, line, name_series, place, swath
from radiometry.drawing.svg import Panel
from radiometry.frame.packing import Packed, unpack

Node = dict[str, Any]

_STEPS = 60
_MOST_CELLS = 24
_FIRST_CHOICE = ("G1", "green", "grey")
# from blue over white to orange, which eyes that confuse red with green tell apart
_BELOW, _ABOVE = (0, 90, 181), (220, 50, 32)


def draw(result: Node) -> str:
    """Return the SVG of a stored vignetting result; swaths and bars are twice the standard uncertainty."""
    fits = result["channel_fits"]
    shown = _choose_channel(fits)
    mine = [fit for fit in fits if fit["coefficient"]["channel"] == shown]
    parts = [*_draw_curves(mine, shown), *_draw_corners(result), *_draw_residuals(mine)]
    return finish(parts, panels=2 + len(mine), label="Vignetting calibration")


def _choose_channel(fits: list[Node]) -> str:
    """The green channel, which stands for brightness; else the first."""
    channels = [fit["coefficient"]["channel"] for fit in fits]
    return str(next((name for name in _FIRST_CHOICE if name in channels), channels[0]))


def _draw_curves(fits: list[Node], channel: str) -> Iterator[str]:
    curves = [evaluate(fit["coefficient"]) for fit in fits]
    panel = place(
        0,
        x=Axis(values=[0.0, 1.0], label="r, 1 at half of the diagonal"),
        y=Axis(
            values=[v for curve in curves for _, v, _ in curve], include=(1.0,), label="share of the light"
        ),
        title=f"Falloff by f-number, channel {channel}",
    )
    yield from panel.frame()
    for series, curve in enumerate(curves):
        yield swath(panel, [(r, v - 2 * u, v + 2 * u) for r, v, u in curve], series)
        yield panel.line([(r, v) for r, v, _ in curve], line(series))
    yield from name_series(panel, [f"f/{fit['coefficient']['f_number']:g}" for fit in fits])


def evaluate(c: Node) -> list[tuple[float, float, float]]:
    """Return (r, V, u(V)) along the radius, with u from the covariance of k1, k2, k3.

    Parameters
    ----------
    c : Node
        Stored coefficient of one f-number and channel.
    """
    covariance = np.array(c["covariance"])[:3, :3]
    curve = []
    for step in range(_STEPS + 1):
        r2 = (step / _STEPS) ** 2
        powers = np.array([r2, r2**2, r2**3])
        variance = float(powers @ covariance @ powers)
        value = 1.0 + float(powers @ np.array([c["k1"], c["k2"], c["k3"]]))
        curve.append((step / _STEPS, value, math.sqrt(max(0.0, variance))))
    return curve


def _draw_corners(result: Node) -> Iterator[str]:
    coefficients = [fit["coefficient"] for fit in result["channel_fits"]]
    limits = [threshold["falloff"] for threshold in result["thresholds"]]
    falloffs = [100.0 * c["corner_falloff"] for c in coefficients]
    panel = place(
        1,
        x=Axis(values=[c["f_number"] for c in coefficients], label="f-number", logarithmic=True),
        y=Axis(
            values=falloffs, include=(0.0, *(100.0 * limit for limit in limits)), label="at the corner [%]"
        ),
        title="Falloff at the farthest corner",
    )
    yield from panel.frame()
    for limit in limits:
        yield panel.line([(panel.x.low, 100.0 * limit), (panel.x.high, 100.0 * limit)], "limit")
    channels = list(dict.fromkeys(c["channel"] for c in coefficients))
    for series, channel in enumerate(channels):
        mine = sorted(
            (c for c in coefficients if c["channel"] == channel), key=lambda c: float(c["f_number"])
        )
        yield panel.line([(c["f_number"], 100.0 * c["corner_falloff"]) for c in mine], line(series))
        for c in mine:
            y, u = 100.0 * c["corner_falloff"], 200.0 * c["corner_falloff_standard_uncertainty"]
            yield bar(panel, c["f_number"], y - u, y + u, series)
            yield panel.dot(c["f_number"], y, dot(series), f"{channel}, f/{c['f_number']:g}: {y:.2f} %")
    yield from name_series(panel, channels)


def _draw_residuals(fits: list[Node]) -> Iterator[str]:
    """Maps of (light - fitted) / fitted, all in one scale."""
    maps = [_shrink(unpack(Packed(**fit["residuals"]))) for fit in fits]
    largest = max((float(np.nanmax(np.abs(each))) for each in maps if np.isfinite(each).any()), default=0.0)
    for index, (fit, residuals) in enumerate(zip(fits, maps, strict=True), start=2):
        c = fit["coefficient"]
        panel = place(
            index,
            x=Axis(values=[0.0, float(c["width_px"])], label="column [px]"),
            y=Axis(values=[0.0, float(c["height_px"])], label="row [px], from below"),
            title=f"f/{c['f_number']:g}: left over, ±{100.0 * largest:.2g} %",
        )
        yield from panel.frame()
        yield from _paint(panel, residuals, largest, width=c["width_px"], height=c["height_px"])


def _shrink(residuals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean over neighbours, until no side has more cells than a thumbnail shows."""
    step = max(1, math.ceil(max(residuals.shape) / _MOST_CELLS))
    rows, cols = (math.ceil(size / step) for size in residuals.shape)
    cells = np.full((rows, cols), np.nan)
    for row in range(rows):
        for col in range(cols):
            cell = residuals[row * step : (row + 1) * step, col * step : (col + 1) * step]
            if np.isfinite(cell).any():
                cells[row, col] = np.nanmean(cell)
    return cells


def _paint(
    panel: Panel, cells: NDArray[np.float64], largest: float, *, width: int, height: int
) -> Iterator[str]:
    rows, cols = cells.shape
    wide = (panel.x(width) - panel.x(0.0)) / cols
    high = (panel.y(0.0) - panel.y(height)) / rows
    for (row, col), value in np.ndenumerate(cells):
        x, y = panel.x(0.0) + col * wide, panel.y(height) + row * high
        fill = f'fill="{_colour(float(value), largest)}"' if math.isfinite(value) else 'class="unknown"'
        yield f'<rect x="{x:.1f}" y="{y:.1f}" width="{wide + 0.3:.1f}" height="{high + 0.3:.1f}" {fill}/>'


def _colour(value: float, largest: float) -> str:
    share = min(1.0, abs(value) / largest) if largest > 0.0 else 0.0
    end = _BELOW if value < 0.0 else _ABOVE
    red, green, blue = (round(255 + share * (each - 255)) for each in end)
    return f"#{red:02x}{green:02x}{blue:02x}"
