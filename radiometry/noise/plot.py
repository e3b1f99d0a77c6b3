"""Plot of a noise calibration, a row per ISO value: photon transfer, signal-to-noise ratio, linearity."""

from collections.abc import Callable, Iterator
from typing import Any

from radiometry.drawing.sheet import COLUMNS, Axis, dot, finish, line, name_series, place, write
from radiometry.drawing.svg import Panel

Node = dict[str, Any]


def draw(result: Node) -> str:
    """Return the SVG of a stored noise result; levels outside the photon transfer are hollow."""
    isos = sorted({fit["iso"] for fit in result["channel_fits"]})
    parts: list[str] = []
    for row, iso in enumerate(isos):
        fits = [fit for fit in result["channel_fits"] if fit["iso"] == iso]
        parts += _draw_transfer(fits, row * COLUMNS)
        parts += _draw_snr(fits, row * COLUMNS + 1)
        parts += _draw_linearity(fits, row * COLUMNS + 2)
    return finish(parts, panels=COLUMNS * len(isos), label="Noise calibration")


def _draw_transfer(fits: list[Node], index: int) -> Iterator[str]:
    """Variance above dark against signal above dark, and the line whose slope is the system gain."""
    panel = _plot(
        fits,
        index,
        title="photon transfer",
        x=("signal_dn", "signal - dark [DN]"),
        y=("excess_dn2", "variance - dark's [DN²]"),
    )
    yield from panel.frame()
    for series, fit in enumerate(fits):
        if fit.get("transfer"):
            gain = fit["transfer"]["system_gain_dn_per_e"]["value"]
            yield panel.line([(x, gain * x) for x in _along(panel)], line(series))
        yield from _dots(panel, fit, series, "signal_dn", "excess_dn2")
    yield from name_series(panel, [fit["channel"] for fit in fits], on_left=True)


def _draw_snr(fits: list[Node], index: int) -> Iterator[str]:
    """Signal to noise; the line is what photons alone would give, the square root of the electrons."""
    panel = _plot(
        fits, index, title="signal to noise", x=("light_dn", "light [DN]"), y=("snr", "signal / noise")
    )
    yield from panel.frame()
    for series, fit in enumerate(fits):
        if fit.get("transfer"):
            gain = fit["transfer"]["system_gain_dn_per_e"]["value"]
            yield panel.line([(x, (x / gain) ** 0.5) for x in _along(panel)], line(series))
        yield from _dots(panel, fit, series, "light_dn", "snr")


def _draw_linearity(fits: list[Node], index: int) -> Iterator[str]:
    levels = [level for fit in fits for level in fit["levels"] if level.get("deviation_rel") is not None]
    panel = place(
        index,
        x=Axis(values=[level["light_dn"] for level in levels], label="light [DN]"),
        y=Axis(
            values=[100.0 * level["deviation_rel"] for level in levels],
            include=(-0.5, 0.5),
            label="from the straight line [%]",
        ),
        title=f"ISO {fits[0]['iso']:g}: linearity",
    )
    yield from panel.frame()
    if not levels:
        yield write(panel, 0.5 * (panel.x.low + panel.x.high), 0.0, "too few levels")
        return
    yield panel.line([(panel.x.low, 0.0), (panel.x.high, 0.0)], "limit")
    for series, fit in enumerate(fits):
        yield from _dots(panel, fit, series, "light_dn", "deviation_rel", lambda y: 100.0 * y)


def _plot(fits: list[Node], index: int, *, title: str, x: tuple[str, str], y: tuple[str, str]) -> Panel:
    """Both axes logarithmic, around what is positive."""
    shown = [
        level
        for fit in fits
        for level in fit["levels"]
        if (level.get(y[0]) or 0.0) > 0.0 and level[x[0]] > 0.0
    ]
    return place(
        index,
        x=Axis(values=[level[x[0]] for level in shown], label=x[1], logarithmic=True),
        y=Axis(values=[level[y[0]] for level in shown], label=f"{y[1]}, logarithmic", logarithmic=True),
        title=f"ISO {fits[0]['iso']:g}: {title}",
    )


def _dots(
    panel: Panel, fit: Node, series: int, x: str, y: str, scale: Callable[[float], float] = float
) -> Iterator[str]:
    for level in fit["levels"]:
        if level.get(y) is None:
            continue
        left_out = f", left out: {level['left_out']}" if level["left_out"] else ""
        told = f"{fit['channel']}, {level['exposure_time_s']:g} s{left_out}"
        yield panel.dot(level[x], scale(level[y]), dot(series, used=not level["left_out"]), told)


def _along(panel: Panel) -> list[float]:
    low, high = panel.x.low, panel.x.high
    return [low * (high / low) ** (i / 60) for i in range(61)]
