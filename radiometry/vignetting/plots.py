"""Plots of a vignetting version: the surface, the corner per aperture, and falloff along the radius."""

from collections.abc import Iterator
from typing import Any, Final

from radiometry.drawing.figure import Axis, Cell, Figure, Mark, Plot, Series
from radiometry.specification.key_figures import choose_channel
from radiometry.vignetting.plot import evaluate

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
                curve = evaluate(c)
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
                told = (f"{y:.2f} ± {u:.2g} %, two standard uncertainties",)
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
        note="Bars: two standard uncertainties",
    ),
    Plot(name="falloff", title="Falloff along the radius", build=_build_falloff),
)
