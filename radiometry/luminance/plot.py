"""Plot of a luminance calibration: signal against X and ln X, and residuals, a row per ISO value."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from radiometry.drawing.sheet import COLUMNS, Axis, finish, place
from radiometry.drawing.svg import Scale
from radiometry.fitting.models import predict

_X = "X = t S L / f²  [cd s/m²]"


def draw(result: dict[str, Any]) -> str:
    """Draw a stored luminance result as SVG.

    Returns
    -------
    str
        SVG document; points left out are hollow, the tolerance is dashed.
    """
    fits = result["iso_fits"]
    parts = [part for row, fit in enumerate(fits) for part in _draw_row(result, fit["coefficient"], row)]
    return finish(parts, panels=COLUMNS * len(fits), label="Luminance calibration")


def _draw_row(result: dict[str, Any], coefficient: dict[str, Any], row: int) -> Iterator[str]:
    points = [p for p in result["points"] if p["iso"] == coefficient["iso"] and p.get("rhs")]
    name, rhs = f"ISO {coefficient['iso']:g}", [p["rhs"] for p in points]
    signals = Axis(
        values=[p["adjusted_signal_dn"] for p in points], include=(0.0,), label="signal - dark [DN]"
    )
    for logarithmic in (False, True):
        x = Axis(values=rhs, label=_X, logarithmic=logarithmic, include=() if logarithmic else (0.0,))
        title = f"{name}: signal against {'ln X' if logarithmic else 'X'}"
        panel = place(row * COLUMNS + logarithmic, x=x, y=signals, title=title)
        yield from panel.frame()
        along = _sample(panel.x)
        fitted = predict(coefficient["model"], np.asarray(coefficient["parameters"]), along)
        yield panel.line(zip(along.tolist(), fitted.tolist(), strict=True), "fit")
        for p in points:
            yield panel.dot(p["rhs"], p["adjusted_signal_dn"], "used" if p["used"] else "out", _title_of(p))
    judged = [p for p in points if p.get("residual_rel") is not None]
    limit = 100 * result["tolerance_rel"]
    panel = place(
        row * COLUMNS + 2,
        x=Axis(values=rhs, label="X", logarithmic=True),
        y=Axis(
            values=[100 * p["residual_rel"] for p in judged if p["used"]],
            include=(-limit, limit),
            label="(L fit - L meter) / L meter [%]",
        ),
        title=f"{name}: residuals",
    )
    yield from panel.frame()
    for level, css in ((0.0, "fit"), (limit, "limit"), (-limit, "limit")):
        yield panel.line([(panel.x.low, level), (panel.x.high, level)], css)
    for p in judged:
        yield panel.dot(p["rhs"], 100 * p["residual_rel"], "used" if p["used"] else "out", _title_of(p))


def _sample(scale: Scale) -> np.ndarray:
    if scale.logarithmic:
        return np.geomspace(scale.low, scale.high, 61)
    along = np.linspace(scale.low, scale.high, 61)
    # a power or a logarithm has no value at 0
    return along[along > 0.0]


def _title_of(point: dict[str, Any]) -> str:
    left_out = f", left out: {point['left_out']}" if point["left_out"] else ""
    return f"{point['frame']}, {point['scene']}{left_out}"
