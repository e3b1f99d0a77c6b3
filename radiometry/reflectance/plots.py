"""Plots of a reflectance version: K of each band, and the visits to the panel in time."""

from collections.abc import Iterator
from typing import Any, Final

from radiometry.drawing.figure import Axis, Figure, Mark, Plot, Series
from radiometry.drawing.text import write_unit

Node = dict[str, Any]


def _build_visits(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401  no rows are needed
    """K of each visit, relative to the K of its band; by number where frames state no time."""
    points = [p for p in result["points"] if p.get("reflectance_k") is not None]
    timed = all(p.get("at_s") is not None for p in points)
    series = []
    for fit in result["band_fits"]:
        c = fit["coefficient"]
        marks = tuple(
            Mark(
                x=p["at_s"] if timed else float(p.get("visit") or 1),
                y=100.0 * (p["reflectance_k"] / c["reflectance_k"] - 1.0),
                name=p["frame"],
                told=(
                    f"band {c['band']}, visit {p.get('visit') or 1}",
                    f"K {p['reflectance_k']:.5g} {write_unit(c['reflectance_k_unit'])}",
                ),
                frame_id=p.get("frame_id", ""),
                left_out="" if p["used"] else p.get("left_out") or "not used",
            )
            for p in points
            if p["band"] == c["band"]
        )
        series.append(Series(name=c["band"], marks=marks, line=_join(c, timed=timed)))
    if any(each.marks for each in series):
        yield Figure(
            x=Axis(label="time taken" if timed else "visit to the panel", is_time=timed),
            y=Axis(label="K / K of the band [% difference]", include=(-1.0, 1.0)),
            levels=(0.0,),
            series=tuple(series),
        )


def _join(c: Node, *, timed: bool) -> tuple[tuple[float, float], ...]:
    """Return the line between the visits, where the version follows it in time."""
    knots = [knot for knot in c["knots"] if knot.get("at_s") is not None]
    if not timed or c.get("interpolation", "linear") != "linear":
        return ()
    return tuple((knot["at_s"], 100.0 * (knot["reflectance_k"] / c["reflectance_k"] - 1.0)) for knot in knots)


def _build_bands(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401
    coefficients = [fit["coefficient"] for fit in result["band_fits"]]
    known = all(c.get("wavelength_nm") for c in coefficients)
    series = []
    for n, c in enumerate(coefficients, start=1):
        k, u, unit = c["reflectance_k"], c["expanded_uncertainty"], write_unit(c["reflectance_k_unit"])
        x = float(c["wavelength_nm"]) if known else float(n)
        told = (f"{k:.5g} ± {u:.2g} {unit} (95 %)",)
        mark = Mark(x=x, y=k, low=k - u, high=k + u, name=f"band {c['band']}", told=told)
        series.append(Series(name=c["band"], marks=(mark,)))
    yield Figure(
        x=Axis(label="wavelength [nm]" if known else "band, in turn"),
        y=Axis(label=f"K [{write_unit(coefficients[0]['reflectance_k_unit'])}]", include=(0.0,)),
        series=tuple(series),
    )


PLOTS: Final = (
    Plot(name="visits", title="Panel visits in time", build=_build_visits, is_wide=True),
    Plot(name="bands", title="K per band", build=_build_bands, note="95 % intervals"),
)
