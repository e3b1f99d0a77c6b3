"""Plots of the calculators: tolerable rotation and blur against exposure time, and footprints."""

from collections.abc import Sequence
from dataclasses import replace

from radiometry.drawing.figure import Axis, Figure, Mark, Series
from radiometry.drawing.sheet import draw_sheet
from radiometry.tools.coverage import Coverage, View
from radiometry.tools.motion import MotionCase, compute_motion, tolerable_rate_deg_s

_PANEL_PX = (420, 420)
_MOST_NAMED = 12
_TIME = Axis(label="exposure time [s], logarithmic", logarithmic=True)


def draw_motion(cases: Sequence[tuple[str, MotionCase]]) -> str:
    """Tolerable rotation against exposure time, figure 7 of the source; beside it the blur, if it moves."""
    times = [time for _, case in cases for time in (case.exposure_time_s / 8, case.exposure_time_s * 8)]
    low, high = min(times), max(times)
    along = [low * (high / low) ** (i / 60) for i in range(61)]
    labels = [
        f"{name}: {case.pixel_pitch_um:g} µm, {case.focal_length_mm:g} mm, limit {case.limit_px:g} px"
        for name, case in cases
    ]
    tolerable = Figure(
        x=_TIME,
        y=Axis(label="rotation [°/s], logarithmic", logarithmic=True),
        series=tuple(
            Series(
                name=label if n < _MOST_NAMED else "",
                line=tuple((time, tolerable_rate_deg_s(case, time)) for time in along),
                marks=_mark(name, case, case.rotation_rate_deg_s, "°/s"),
            )
            for n, ((name, case), label) in enumerate(zip(cases, labels, strict=True))
        ),
        note=_count_others(cases),
    )
    figures = [("Tolerable rotation (limit of the theoretical motion)", tolerable)]
    moving = [(n, name, case) for n, (name, case) in enumerate(cases) if _blur(case, low)]
    if moving:
        limits = tuple(sorted({case.limit_px for *_, case in moving}))
        blur = Figure(
            x=_TIME,
            y=Axis(label="blur [px], logarithmic", logarithmic=True, include=limits),
            series=tuple(
                Series(
                    line=tuple((time, _blur(case, time)) for time in along),
                    marks=_mark(name, case, _blur(case, case.exposure_time_s), "px"),
                    place=n,
                )
                for n, name, case in moving
            ),
            levels=limits,
        )
        figures.append(("Theoretical blur; the practical one is half", blur))
    return draw_sheet([figures], "Image motion", panel_px=_PANEL_PX)


def _mark(name: str, case: MotionCase, value: float | None, unit: str) -> tuple[Mark, ...]:
    if not value:
        return ()
    told = f"{value:.3g} {unit} at {case.exposure_time_s:g} s"
    return (Mark(x=case.exposure_time_s, y=value, name=name, told=(told,)),)


def _blur(case: MotionCase, exposure_time_s: float) -> float:
    return compute_motion(replace(case, exposure_time_s=exposure_time_s)).theoretical_blur_px or 0.0


def draw_footprints(views: Sequence[tuple[str, View, Coverage]]) -> str:
    """The ground that each camera sees, from above, at one scale both ways."""
    outlines = [
        (*coverage.footprint, coverage.footprint[0]) if coverage.footprint else () for *_, coverage in views
    ]
    corners = [corner for outline in outlines for corner in outline]
    # the shorter of two ranges is widened: a square panel then shows a square as one
    ranges = [sorted((0.0, *(corner[axis] for corner in corners))) for axis in (0, 1)]
    half = max(each[-1] - each[0] for each in ranges) / 2
    x, y = ((middle - half, middle + half) for middle in ((each[0] + each[-1]) / 2 for each in ranges))
    labels = [
        name + (": sees the horizon, no footprint" if coverage.horizon_in_view else "")
        for name, _, coverage in views
    ]
    figure = Figure(
        x=Axis(label="x [m]", include=x),
        y=Axis(label="y, azimuth 0 [m]", include=y),
        series=tuple(
            Series(name=label if n < _MOST_NAMED else "", line=outline)
            for n, (label, outline) in enumerate(zip(labels, outlines, strict=True))
        ),
        levels=(0.0,),
        uprights=(0.0,),
        note=_count_others(views),
    )
    title = "Footprint; the camera stands above the cross"
    return draw_sheet([[(title, figure)]], "Ground coverage", panel_px=_PANEL_PX)


def _count_others(named: Sequence[object]) -> str:
    return f"and {len(named) - _MOST_NAMED} more" if len(named) > _MOST_NAMED else ""
