"""Plot of a reflectance calibration: K per band, and K of each panel capture relative to the band's K."""

from collections.abc import Iterator
from typing import Any

from radiometry.drawing.sheet import Axis, bar, dot, finish, line, name_series, place, write

Node = dict[str, Any]

_BESIDE_NM = 30.0
_ONE_MOMENT_S = 1.0


def draw(result: Node) -> str:
    """Draw a stored reflectance result as SVG.

    Returns
    -------
    str
        SVG document; bars are expanded uncertainties, frames left out are not
        drawn.
    """
    coefficients = [fit["coefficient"] for fit in result["band_fits"]]
    parts = [*_draw_bands(coefficients), *_draw_visits(result, coefficients)]
    return finish(parts, panels=2, label="Reflectance calibration")


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


def _draw_visits(result: Node, coefficients: list[Node]) -> Iterator[str]:
    """Draw K relative to each band's K, since bands differ in size; the means of the captures are joined."""
    points = [p for p in result["points"] if p["used"] and p.get("reflectance_k") is not None]
    times = [p["at_s"] for p in points if p.get("at_s") is not None]
    # the bands of one capture differ by less than a moment
    timed = len(times) == len(points) and max(times) - min(times) > _ONE_MOMENT_S
    start = min(times) if timed else 0.0
    panel = place(
        1,
        x=Axis(
            values=[_when(p, start, timed=timed) for p in points],
            label="since the first panel frame [s]" if timed else "visit to the panel",
        ),
        y=Axis(
            values=[
                *(_percent(p["reflectance_k"], c) for c in coefficients for p in points if _is_of(p, c)),
                *(_percent(k["reflectance_k"], c) + u for c in coefficients for k, u in _list_bars(c)),
            ],
            include=(-1.0, 1.0),
            label="K of the frame / K of the band - 1 [%]",
        ),
        title="K by visit",
    )
    yield from panel.frame()
    yield panel.line([(panel.x.low, 0.0), (panel.x.high, 0.0)], "limit")
    for series, c in enumerate(coefficients):
        knots = [(k["at_s"] - start if timed else float(i), k) for i, k in enumerate(c["knots"], start=1)]
        yield panel.line([(x, _percent(knot["reflectance_k"], c)) for x, knot in knots], line(series))
        for x, knot in knots:
            y, u = _percent(knot["reflectance_k"], c), 200.0 * knot["u_rel"]
            yield bar(panel, x, y - u, y + u, series)
        for p in points:
            if _is_of(p, c):
                at = _when(p, start, timed=timed)
                yield panel.dot(at, _percent(p["reflectance_k"], c), dot(series), p["frame"])
    yield from name_series(panel, [c["band"] for c in coefficients])


def _list_bars(coefficient: Node) -> list[tuple[Node, float]]:
    """List each panel capture with both ends of its bar, in %."""
    return [(k, sign * 200.0 * k["u_rel"]) for k in coefficient["knots"] for sign in (-1.0, 1.0)]


def _when(point: Node, start: float, *, timed: bool) -> float:
    return float(point["at_s"]) - start if timed else float(point["visit"])


def _is_of(point: Node, coefficient: Node) -> bool:
    return bool(point["band"] == coefficient["band"])


def _percent(k: float, coefficient: Node) -> float:
    return float(100.0 * (k / coefficient["reflectance_k"] - 1.0))
