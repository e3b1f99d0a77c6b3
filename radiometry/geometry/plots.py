"""Plots of a geometry version: distortion along the radius, corners seen, and the error of each view."""

from collections.abc import Iterator
from typing import Any, Final

from radiometry.drawing.figure import Axis, Cell, Figure, Mark, Plot, Series

Node = dict[str, Any]


def _build_distortion(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401  no rows are needed
    curve = result["curve"]
    seen = [p for p in curve if not p["extrapolated"]]
    beyond = [*seen[-1:], *(p for p in curve if p["extrapolated"])]
    series = [_draw("within the corners seen", seen, "distortion_px")]
    if len(beyond) > 1:
        series.append(_draw("beyond them", beyond, "distortion_px"))
    yield Figure(
        x=Axis(label="distance from the principal point [px]"),
        y=Axis(label="distortion [px]", include=(0.0,)),
        levels=(0.0,),
        series=tuple(series),
    )


def _draw(name: str, points: list[Node], field: str) -> Series:
    us = [2.0 * p["standard_uncertainty_px"] for p in points]
    line = tuple((p["radius_px"], p[field]) for p in points)
    return Series(
        name=name, line=line, swath=tuple((x, y - u, y + u) for (x, y), u in zip(line, us, strict=True))
    )


def _build_colours(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401
    if colours := result.get("lateral_colour"):
        yield Figure(
            x=Axis(label="distance from the principal point [px]"),
            y=Axis(label="displacement [px]", include=(0.0,)),
            series=tuple(_draw(each["channels"], each["curve"], "displacement_px") for each in colours),
        )


def _build_coverage(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401
    camera, counts = result["camera"], result["coverage"]["counts"]
    height, width = camera["height_px"] / len(counts), camera["width_px"] / len(counts[0])
    most = max(map(max, counts)) or 1
    cells = tuple(
        Cell(
            x=(col * width, (col + 1) * width),
            y=(-(row + 1) * height, -row * height),
            share=count / most,
            told=f"{count} corners",
            text=str(count),
        )
        for row, line in enumerate(counts)
        for col, count in enumerate(line)
    )
    yield Figure(
        x=Axis(label="column [px]"),
        y=Axis(label="row [px]", is_downward=True),
        cells=cells,
        note=f"Corners were seen in {100.0 * result['coverage']['share']:.0f} % of the cells",
    )


def _build_views(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401
    marks = tuple(
        Mark(
            x=float(n),
            y=p["rms_px"],
            name=p["frame"],
            told=(f"rms of its corners {p['rms_px']:.3g} px",),
            frame_id=p.get("frame_id", ""),
            left_out="" if p["used"] else p["left_out"],
        )
        for n, p in enumerate(result["points"], start=1)
        if p.get("rms_px") is not None
    )
    yield Figure(
        x=Axis(label="view, in turn"),
        y=Axis(label="rms of its corners [px]", include=(0.0,)),
        levels=(result["rms_px"],),
        series=(Series(marks=marks),),
        note="Dashed: all views together",
    )


PLOTS: Final = (
    Plot(
        name="distortion",
        title="Radial distortion",
        note="Bands: two standard uncertainties",
        build=_build_distortion,
        most_printed=1,
    ),
    Plot(name="coverage", title="Corners seen", build=_build_coverage, most_printed=1),
    Plot(name="views", title="Error of each view", build=_build_views, most_printed=1),
    Plot(name="colours", title="Lateral colour", build=_build_colours, most_printed=1),
)
