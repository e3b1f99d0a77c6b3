"""Plot of a reflectance calibration: K per band, and each band's K in time with the flight's frames."""

import math
from collections.abc import Iterator, Sequence
from datetime import datetime
from typing import Any

from radiometry.drawing.sheet import Axis, bar, dot, finish, line, place, swath, write
from radiometry.drawing.svg import Panel
from radiometry.reflectance.evaluation import HALF_HOUR_S, USUAL_DRIFT_REL, KAtTime, interpolate
from radiometry.reflectance.results import Knot

Node = dict[str, Any]

_BESIDE_NM = 30.0
_MARGIN_S = 300.0
_STEPS = 80


def draw(result: Node) -> str:
    """Draw a stored reflectance result as SVG.

    Parameters
    ----------
    result : Node
        Stored result of the fit; "flight" in it holds the times of measured frames.

    Returns
    -------
    str
        SVG document; bars are expanded uncertainties, frames left out are not
        drawn.
    """
    coefficients = [fit["coefficient"] for fit in result["band_fits"]]
    flight_s = [datetime.fromisoformat(each).timestamp() for each in result.get("flight", ())]
    parts = [*_draw_bands(coefficients)]
    for series, coefficient in enumerate(coefficients):
        points = [p for p in result["points"] if p["used"] and p["band"] == coefficient["band"]]
        parts += _draw_time(coefficient, points, flight_s, series)
    return finish(parts, panels=1 + len(coefficients), label="Reflectance calibration")


def _draw_bands(coefficients: list[Node]) -> Iterator[str]:
    lengths = [c.get("wavelength_nm") for c in coefficients]
    known = all(lengths)
    at = [float(length) if known and length else float(i) for i, length in enumerate(lengths, start=1)]
    ends = [
        c["reflectance_k"] + sign * c["expanded_uncertainty"] for c in coefficients for sign in (-1.0, 1.0)
    ]
    panel = place(
        0,
        x=Axis(
            values=at,
            include=(min(at) - _BESIDE_NM, max(at) + _BESIDE_NM) if known else (0.5, len(at) + 0.5),
            label="wavelength [nm]" if known else "band, in turn",
        ),
        y=Axis(values=ends, include=(0.0,), label=f"K [{coefficients[0]['reflectance_k_unit']}]"),
        title="K per band, with its expanded uncertainty",
    )
    yield from panel.frame()
    for series, (x, c) in enumerate(zip(at, coefficients, strict=True)):
        k, u = c["reflectance_k"], c["expanded_uncertainty"]
        yield bar(panel, x, k - u, k + u, series)
        yield panel.dot(x, k, dot(series), f"{c['band']}: {k:g}")
        yield write(panel, x, panel.y.low + 0.03 * (panel.y.high - panel.y.low), c["band"])


def _draw_time(c: Node, points: list[Node], flight_s: Sequence[float], series: int) -> Iterator[str]:
    """Draw K(t) relative to the band's K: the panel visits, the line between them, and the flight's frames.

    Bars and swath are expanded uncertainties without what all visits share, which does not bend the line.
    """
    knots = [
        Knot(**{name: knot.get(name) for name in ("at_s", "reflectance_k", "u_rel")}) for knot in c["knots"]
    ]
    times = [knot.at_s for knot in knots if knot.at_s is not None]
    start_s = times[0] if len(times) == len(knots) else None
    factor = 100.0 * c.get("coverage_factor", 2.0)

    def find(at_s: float | None) -> KAtTime:
        drift_rel = c.get("drift_half_hour_rel")
        return interpolate(
            knots,
            at_s=at_s,
            follow=c.get("interpolation", "linear") == "linear",
            drift_rel=USUAL_DRIFT_REL if drift_rel is None else drift_rel,
        )

    def place_point(at_s: float | None, visit: int) -> float:
        return (at_s - start_s) / 60.0 if start_s is not None and at_s is not None else float(visit)

    curve: list[tuple[float, float, float]] = []
    near_s: list[float] = []
    if start_s is not None:
        first_s, last_s = start_s - _MARGIN_S, times[-1] + (_MARGIN_S if len(times) > 1 else HALF_HOUR_S)
        near_s = [at for at in flight_s if first_s - HALF_HOUR_S <= at <= last_s + HALF_HOUR_S]
        first_s, last_s = min([first_s, *near_s]), max([last_s, *near_s])
        steps = sorted({*times, *(first_s + n * (last_s - first_s) / _STEPS for n in range(_STEPS + 1))})
        for at_s in steps:
            found = find(at_s)
            u = factor * math.hypot(found.u_rel, found.drift_u_rel)
            curve.append((place_point(at_s, 0), _percent(found.value, c), u))
    seen = [
        (place_point(p.get("at_s"), p.get("visit") or 1), _percent(p["reflectance_k"], c), p["frame"])
        for p in points
        if p.get("reflectance_k") is not None
    ]
    bars = [
        (place_point(knot.at_s, n), _percent(knot.reflectance_k, c), factor * knot.u_rel)
        for n, knot in enumerate(knots, start=1)
    ]
    ends = [y + sign * u for _, y, u in (*curve, *bars) for sign in (-1.0, 1.0)]
    panel = place(
        1 + series,
        x=Axis(
            values=[*(x for x, *_ in (*curve, *bars)), *(x for x, *_ in seen)],
            label="visit to the panel" if start_s is None else "since the first visit to the panel [min]",
        ),
        y=Axis(
            values=ends,
            include=(-1.0, 1.0, min(ends) - 0.15 * (max(ends) - min(ends))),
            label="K / K of the band - 1 [%]",
        ),
        title=f"K in time, {c['band']}",
    )
    yield from panel.frame()
    yield panel.line([(panel.x.low, 0.0), (panel.x.high, 0.0)], "limit")
    if curve:
        yield swath(panel, [(x, y - u, y + u) for x, y, u in curve], series)
        yield panel.line([(x, y) for x, y, _ in curve], line(series))
    for x, y, u in bars:
        yield bar(panel, x, y - u, y + u, series)
    for x, y, frame in seen:
        yield panel.dot(x, y, dot(series), frame)
    yield from _mark_flight(panel, [place_point(at_s, 0) for at_s in near_s])


def _mark_flight(panel: Panel, minutes: list[float]) -> Iterator[str]:
    """Mark when frames were taken, at most one a pixel."""
    height = panel.y.high - panel.y.low
    foot, top = panel.y.low + 0.02 * height, panel.y.low + 0.06 * height
    for x in {round(panel.x(minute)): minute for minute in minutes}.values():
        yield panel.line([(x, foot), (x, top)], "box")
    if minutes:
        yield write(panel, min(minutes), panel.y.low + 0.08 * height, "frames of the flight", "note")


def _percent(k: float, coefficient: Node) -> float:
    return float(100.0 * (k / coefficient["reflectance_k"] - 1.0))
