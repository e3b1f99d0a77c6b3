"""Figures of the calculators: tolerable rotation and blur against exposure time, footprints, exponents."""

import math
import statistics
from collections.abc import Iterator, Sequence
from dataclasses import replace

from radiometry.drawing.chart import draw_sheet
from radiometry.drawing.figure import Axis, Figure, Mark, Series
from radiometry.drawing.text import write_exposure
from radiometry.tools.coverage import Coverage
from radiometry.tools.exponents import SETTINGS, ExponentFit, SeriesRow
from radiometry.tools.motion import MotionCase, compute_motion, tolerable_rate_deg_s

_MOST_NAMED = 12
_AXES = {
    "exposure_time_s": Axis(label="exposure time [s], logarithmic", logarithmic=True),
    "f_number": Axis(label="f-number, logarithmic", logarithmic=True),
    "iso": Axis(label="ISO value, logarithmic", logarithmic=True),
}


def plot_motion(cases: Sequence[tuple[str, MotionCase]]) -> list[Figure]:
    """Return tolerable rotation against exposure time, figure 7 of the source, and the blur of what moves."""
    times = [time for _, case in cases for time in (case.exposure_time_s / 8, case.exposure_time_s * 8)]
    low, high = min(times), max(times)
    along = [low * (high / low) ** (i / 60) for i in range(61)]
    names = _fold(
        [
            f"{name}: {case.pixel_pitch_um:g} µm, {case.focal_length_mm:g} mm, limit {case.limit_px:g} px"
            for name, case in cases
        ]
    )
    rotation = Figure(
        part="Tolerable rotation",
        note="Below its line the theoretical motion from rotation alone stays within the limit.",
        x=_AXES["exposure_time_s"],
        y=Axis(label="rotation [°/s], logarithmic", logarithmic=True),
        series=tuple(
            Series(
                name=names[place],
                line=tuple((time, tolerable_rate_deg_s(case, time)) for time in along),
                marks=_mark(case, case.rotation_rate_deg_s, name, "°/s"),
            )
            for place, (name, case) in enumerate(cases)
        ),
    )
    moving = [(i, name, case) for i, (name, case) in enumerate(cases) if _blur(case, along[0])]
    blur = Figure(
        part="Blur",
        note="Theoretical blur; the practical one is half. Dashed: the limits.",
        x=_AXES["exposure_time_s"],
        y=Axis(
            label="blur [px], logarithmic",
            logarithmic=True,
            include=tuple(sorted({case.limit_px for *_, case in moving})),
        ),
        levels=tuple(sorted({case.limit_px for *_, case in moving})),
        series=tuple(
            Series(
                name=names[place],
                place=place,
                line=tuple((time, _blur(case, time)) for time in along),
                marks=_mark(case, _blur(case, case.exposure_time_s), name, "px"),
            )
            for place, name, case in moving
        ),
    )
    return [rotation, *([blur] if moving else [])]


def plot_footprints(views: Sequence[tuple[str, Coverage]]) -> Figure:
    """Return the ground that each camera sees, from above, at one scale both ways."""
    names = _fold(
        [
            name + (": sees the horizon, no footprint" if coverage.horizon_in_view else "")
            for name, coverage in views
        ]
    )
    return Figure(
        note="The camera stands above the point where the dashed lines cross.",
        x=Axis(label="x [m]", include=(0.0,)),
        y=Axis(label="y, azimuth 0 [m]", include=(0.0,)),
        is_to_scale=True,
        levels=(0.0,),
        uprights=(0.0,),
        series=tuple(
            Series(name=names[place], line=(*coverage.footprint, coverage.footprint[0]))
            if coverage.footprint
            else Series(name=names[place])
            for place, (_, coverage) in enumerate(views)
        ),
    )


def plot_exponents(rows: Sequence[SeriesRow], fit: ExponentFit, *, dark_dn: float) -> Iterator[Figure]:
    """Yield the signal against each setting that varies, the others brought to their medians."""
    out = {each.row: each.reason for each in fit.left_out}
    slopes = {name: quantity.value for name, quantity in fit.exponents.items()}
    usual = {name: statistics.median(getattr(row, name) for row in rows) for name in SETTINGS}
    for name, slope in slopes.items():
        points = []
        for number, row in enumerate(rows):
            above = row.signal_dn - (dark_dn if row.dark_dn is None else row.dark_dn)
            others = (
                (getattr(row, other) / usual[other]) ** slopes[other] for other in slopes if other != name
            )
            if above > 0.0:
                points.append((number, getattr(row, name), above / math.prod(others)))
        used = [(x, y) for number, x, y in points if number not in out]
        centre_x, centre_y = (statistics.geometric_mean(each) for each in zip(*used, strict=True))
        ends = (min(x for x, _ in used), max(x for x, _ in used))
        yield Figure(
            part=_AXES[name].label.replace(" [s]", "").partition(",")[0],
            note=f"Exponent {slope:.3f} ± {fit.exponents[name].standard_uncertainty:.3f}. Hollow: left out.",
            x=_AXES[name],
            y=Axis(label="signal above dark [DN], logarithmic", logarithmic=True),
            series=(
                Series(
                    marks=tuple(
                        Mark(
                            x=x,
                            y=y,
                            name=f"row {number}",
                            told=(f"{y:.4g} DN",),
                            left_out=out.get(number, ""),
                        )
                        for number, x, y in points
                    ),
                    line=tuple((x, centre_y * (x / centre_x) ** slope) for x in ends),
                ),
            ),
        )


def draw_tool(figures: Sequence[Figure], label: str) -> str:
    """Return the figures of a calculator side by side, as they are saved."""
    return draw_sheet([[(each.part, each) for each in figures]], label, panel_px=(420, 420))


def _mark(case: MotionCase, value: float | None, name: str, unit: str) -> tuple[Mark, ...]:
    if not value:
        return ()
    told = (f"{value:.3g} {unit} at {write_exposure(case.exposure_time_s)}",)
    return (Mark(x=case.exposure_time_s, y=value, name=name, told=told),)


def _blur(case: MotionCase, exposure_time_s: float) -> float:
    return compute_motion(replace(case, exposure_time_s=exposure_time_s)).theoretical_blur_px or 0.0


def _fold(names: Sequence[str]) -> list[str]:
    """Name the first of many, and count the rest once."""
    more = len(names) - _MOST_NAMED
    if more <= 0:
        return list(names)
    return [*names[:_MOST_NAMED], f"and {more} more", *([""] * (more - 1))]
