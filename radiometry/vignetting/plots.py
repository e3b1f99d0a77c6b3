"""Plots of a vignetting version: the surface, the corner per aperture, and falloff along the radius."""

import math
from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from radiometry.drawing.figure import MOST, Axis, Cell, Figure, Mark, Plot, Series
from radiometry.drawing.text import write_quantity
from radiometry.frame.packing import Packed, unpack
from radiometry.specification.certificate import choose_channel

Node = dict[str, Any]

_COLUMNS: Final = 24


def _build_surface(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401  no rows are needed
    """One map per f-number, of the channel that stands for brightness, all in one scale."""
    shown = [c for c in _list(result) if c["channel"] == choose_channel(c["channel"] for c in _list(result))]
    darkest = max((c["corner_falloff"] for c in shown), default=0.0)
    for c in shown:
        height, width = float(c["height_px"]), float(c["width_px"])
        rows = max(1, round(_COLUMNS * height / width))
        cells = []
        for place in range(rows * _COLUMNS):
            row, col = divmod(place, _COLUMNS)
            (top, bottom), (left, right) = (
                [(each + end) * size / count for end in (0, 1)]
                for each, size, count in ((row, height, rows), (col, width, _COLUMNS))
            )
            y, x = 0.5 * (top + bottom), 0.5 * (left + right)
            lost = 1.0 - _share(c, y, x)
            told = f"row {y:.0f}, column {x:.0f}: {100.0 * (1.0 - lost):.1f} % of the light"
            cells.append(
                Cell(x=(left, right), y=(-bottom, -top), share=max(0.0, lost) / max(darkest, 1e-9), told=told)
            )
        yield Figure(
            part=f"f/{c['f_number']:g}",
            x=Axis(label="column [px]"),
            y=Axis(label="row [px]", is_downward=True),
            cells=tuple(cells),
            note=f"Channel {c['channel']}; full shade: {100.0 * darkest:.1f} % of the light lost",
        )


def _share(c: Node, row: float, col: float) -> float:
    """Return the share of the light at a point of the frame."""
    r2 = ((row - c["centre_row_px"]) ** 2 + (col - c["centre_col_px"]) ** 2) / c["radius_px"] ** 2
    return float(1.0 + r2 * (c["k1"] + r2 * (c["k2"] + r2 * c["k3"])))


def _build_falloff(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401
    for channel in _channels(result):
        series = []
        for c in _list(result):
            if c["channel"] == channel:
                curve = list(_evaluate(c))
                swath = tuple((r, 100.0 * (v - 2.0 * u), 100.0 * (v + 2.0 * u)) for r, v, u in curve)
                line = tuple((r, 100.0 * v) for r, v, _ in curve)
                series.append(Series(name=f"f/{c['f_number']:g}", line=line, swath=swath))
        yield Figure(
            part=channel,
            x=Axis(label="distance from the centre, 1 at half of the diagonal"),
            y=Axis(label="share of the light [%]", include=(100.0,)),
            series=tuple(series),
        )


def _build_corner(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401
    series = []
    for channel in _channels(result):
        marks = []
        for c in _list(result):
            if c["channel"] == channel:
                y, u = 100.0 * c["corner_falloff"], 200.0 * c["corner_falloff_standard_uncertainty"]
                told = (f"{write_quantity(y, u, '%')}, two standard uncertainties",)
                name = f"{channel}, f/{c['f_number']:g}"
                marks.append(Mark(x=c["f_number"], y=y, low=y - u, high=y + u, name=name, told=told))
        line = tuple((mark.x, mark.y) for mark in marks)
        series.append(Series(name=channel, marks=tuple(marks), line=line))
    f_numbers = sorted({c["f_number"] for c in _list(result)})
    yield Figure(
        x=Axis(label="f-number", logarithmic=True, ticks=tuple((f, f"f/{f:g}") for f in f_numbers)),
        y=Axis(label="falloff at the corner [%]", include=(0.0,)),
        levels=tuple(100.0 * each["falloff"] for each in result["thresholds"]),
        series=tuple(series),
    )


def _evaluate(c: Node) -> Iterator[tuple[float, float, float]]:
    """Yield (r, V, u(V)) along the radius, with u from the covariance of k1, k2, k3."""
    covariance, terms = np.array(c["covariance"])[:3, :3], np.array([c["k1"], c["k2"], c["k3"]])
    for r in np.linspace(0.0, 1.0, 61):
        powers = r ** np.array([2, 4, 6])
        variance = max(0.0, powers @ covariance @ powers)
        yield float(r), float(1.0 + powers @ terms), math.sqrt(variance)


def _build_residuals(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401
    """Maps of (light - fitted) / fitted per f-number, of the brightness' channel, in one scale."""
    fits = sorted(result["channel_fits"], key=lambda fit: float(fit["coefficient"]["f_number"]))
    shown = [fit for fit in fits if fit["coefficient"]["channel"] == _channels(result)[0]]
    maps = [_shrink(unpack(Packed(**fit["residuals"]))) for fit in shown]
    largest = max((float(np.nanmax(np.abs(each))) for each in maps if np.isfinite(each).any()), default=0.0)
    for fit, residuals in zip(shown, maps, strict=True):
        c = fit["coefficient"]
        height, width = c["height_px"] / len(residuals), c["width_px"] / len(residuals[0])
        cells = tuple(
            Cell(
                x=(col * width, (col + 1) * width),
                y=(-(row + 1) * height, -row * height),
                share=float(value / (largest or 1.0)) if math.isfinite(value) else None,
                told=f"{100.0 * value:+.2g} %" if math.isfinite(value) else "unknown",
            )
            for (row, col), value in np.ndenumerate(residuals)
        )
        yield Figure(
            part=f"f/{c['f_number']:g}",
            x=Axis(label="column [px]"),
            y=Axis(label="row [px]", is_downward=True),
            cells=cells,
            note=f"Channel {c['channel']}; full shade: ±{100.0 * largest:.2g} %, orange: less light",
        )


def _shrink(residuals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return means over neighbours; no side has more cells than columns are shown."""
    step = math.ceil(max(residuals.shape) / _COLUMNS)
    rows, cols = (range(0, size, step) for size in residuals.shape)
    blocks = [[residuals[row : row + step, col : col + step] for col in cols] for row in rows]
    return np.array([[np.nanmean(b) if np.isfinite(b).any() else np.nan for b in line] for line in blocks])


def _list(result: Node) -> list[Node]:
    return sorted((fit["coefficient"] for fit in result["channel_fits"]), key=lambda c: float(c["f_number"]))


def _channels(result: Node) -> list[str]:
    """Return the channels, first the one that stands for brightness."""
    channels = list(dict.fromkeys(fit["coefficient"]["channel"] for fit in result["channel_fits"]))
    return sorted(channels, key=lambda name: name != choose_channel(channels))


PLOTS: Final = (
    Plot(name="surface", title="Surface", build=_build_surface),
    Plot(
        name="corner",
        title="Corner per aperture",
        build=_build_corner,
        most_printed=1,
        note="Bars: two standard uncertainties",
    ),
    Plot(name="falloff", title="Falloff along the radius", build=_build_falloff, most_printed=1),
    Plot(name="residuals", title="Residuals", build=_build_residuals, most_printed=MOST),
)
