"""Plots of a noise version, per ISO value: photon transfer, signal-to-noise ratio, linearity."""

from collections.abc import Callable, Iterator
from typing import Any, Final

import numpy as np

from radiometry.drawing.figure import Axis, Figure, Mark, Plot, Series
from radiometry.drawing.text import write_exposure

Node = dict[str, Any]
Build = Callable[[Node, Any], Iterator[Figure]]


def split(result: Node) -> Iterator[Node]:
    """Yield a result per ISO value."""
    return ({**result, "channel_fits": fits} for _, fits in _by_iso(result))


def _draw(x: str, y: str, labels: tuple[str, str], predict: Callable[[float, float], float]) -> Build:
    """Return what draws a field of the levels against another, with what the gain predicts."""

    def build(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401  no rows are needed
        for iso, fits in _by_iso(result):
            series = []
            for fit in fits:
                levels = [each for each in fit["levels"] if (each.get(y) or 0.0) > 0.0 and each[x] > 0.0]
                model: list[tuple[float, float]] = []
                if levels and fit.get("transfer"):
                    gain = fit["transfer"]["system_gain_dn_per_e"]["value"]
                    ends = [each[x] for each in levels]
                    along = np.geomspace(min(ends) / 1.5, 1.5 * max(ends), 61).tolist()
                    model = [(at, predict(at, gain)) for at in along]
                marks = tuple(_mark(fit, each, each[x], each[y], labels[1]) for each in levels)
                series.append(Series(name=fit["channel"], marks=marks, model=tuple(model)))
            x_axis, y_axis = (Axis(label=f"{label}, logarithmic", logarithmic=True) for label in labels)
            yield Figure(part=iso, x=x_axis, y=y_axis, series=tuple(series))

    return build


def _build_linearity(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401
    for iso, fits in _by_iso(result):
        series = []
        for fit in fits:
            levels = [each for each in fit["levels"] if each.get("deviation_rel") is not None]
            marks = (
                _mark(fit, p, p["light_dn"], 100.0 * p["deviation_rel"], "deviation [%]") for p in levels
            )
            series.append(Series(name=fit["channel"], marks=tuple(marks)))
        if any(each.marks for each in series):
            y = Axis(label="from the straight line [%]", include=(-0.5, 0.5))
            yield Figure(part=iso, x=Axis(label="light [DN]"), y=y, series=tuple(series), levels=(0.0,))


def _mark(fit: Node, level: Node, x: float, y: float, label: str) -> Mark:
    told = (write_exposure(level["exposure_time_s"]), f"{label.partition(' [')[0]} {y:.4g}")
    return Mark(x=x, y=y, name=f"channel {fit['channel']}", told=told, left_out=level["left_out"])


def _by_iso(result: Node) -> Iterator[tuple[str, list[Node]]]:
    for iso in sorted({fit["iso"] for fit in result["channel_fits"]}):
        yield f"ISO {iso:g}", [fit for fit in result["channel_fits"] if fit["iso"] == iso]


PLOTS: Final = (
    Plot(
        name="transfer",
        title="Photon transfer",
        note="Line: the system gain",
        build=_draw(
            "signal_dn",
            "excess_dn2",
            ("signal above dark [DN]", "variance [DN²]"),
            lambda signal, gain: gain * signal,
        ),
        most_printed=1,
    ),
    Plot(
        name="snr",
        title="Signal-to-noise ratio",
        note="Line: photons alone",
        build=_draw(
            "light_dn",
            "snr",
            ("light [DN]", "signal / noise"),
            lambda light, gain: float((light / gain) ** 0.5),
        ),
        most_printed=1,
    ),
    Plot(name="linearity", title="Linearity", build=_build_linearity, most_printed=1),
)
