"""Plots of the calculators: tolerable rotation and blur against exposure time, and footprints."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from html import escape

from radiometry.drawing.svg import Panel, Scale, document, span
from radiometry.tools.coverage import Coverage, View
from radiometry.tools.motion import Motion, MotionCase, compute_motion, tolerable_rate_deg_s

_PANEL_PX, _LEFT_PX, _TOP_PX, _GAP_PX, _LINE_PX = 420, 72, 34, 90, 18
_LEGEND_PX = _TOP_PX + _PANEL_PX + 62
_MOST_NAMED = 12
_COLOURS = ("#b03a2e", "#1f5fa8", "#2e7d32", "#8e5ea2", "#b9770e", "#37474f")
_STYLE = "".join(
    f".s{n}{{fill:none;stroke:{colour};stroke-width:1.5}}.d{n}{{fill:{colour}}}.k{n}{{fill:{colour}}}"
    for n, colour in enumerate(_COLOURS)
)


def draw_motion(cases: Sequence[tuple[str, MotionCase]]) -> str:
    """Tolerable rotation against exposure time, figure 7 of the source; beside it the blur, if it moves."""
    times = [time for _, case in cases for time in (case.exposure_time_s / 8, case.exposure_time_s * 8)]
    low, high = min(times), max(times)
    along = [low * (high / low) ** (i / 60) for i in range(61)]
    parts = [*_draw_tolerable(cases, along), *_draw_blur(cases, along), *_name(_label(cases))]
    return _document(parts, columns=2, named=len(cases), label="Image motion")


def draw_footprints(views: Sequence[tuple[str, View, Coverage]]) -> str:
    """The ground that each camera sees, from above, at one scale both ways."""
    corners = [corner for _, _, coverage in views for corner in coverage.footprint or ()]
    x = span([corner[0] for corner in corners], include=(0.0,))
    y = span([corner[1] for corner in corners], include=(0.0,))
    panel = _panel(
        _even(*x, *y),
        column=0,
        title="Footprint; the camera stands above the cross",
        labels=("x [m]", "y, azimuth 0 [m]"),
    )
    parts = panel.frame()
    for index, (_, _, coverage) in enumerate(views):
        if coverage.footprint is not None:
            parts.append(panel.line([*coverage.footprint, coverage.footprint[0]], f"s{_colour(index)}"))
    across = (panel.x.high - panel.x.low) / 60
    parts.append(panel.line([(-across, 0.0), (across, 0.0)], "limit"))
    parts.append(panel.line([(0.0, -across), (0.0, across)], "limit"))
    labels = [
        name + (": sees the horizon, no footprint" if coverage.horizon_in_view else "")
        for name, _, coverage in views
    ]
    return _document([*parts, *_name(labels)], columns=1, named=len(views), label="Ground coverage")


def _draw_tolerable(cases: Sequence[tuple[str, MotionCase]], along: Sequence[float]) -> Iterator[str]:
    rates = [tolerable_rate_deg_s(case, time) for _, case in cases for time in along]
    rates += [case.rotation_rate_deg_s for _, case in cases if case.rotation_rate_deg_s]
    panel = _panel(
        (along[0], along[-1], *span(rates, logarithmic=True)),
        column=0,
        title="Tolerable rotation (limit of the theoretical motion)",
        labels=("exposure time [s], logarithmic", "rotation [°/s], logarithmic"),
        logarithmic=True,
    )
    yield from panel.frame()
    for index, (name, case) in enumerate(cases):
        line = [(time, tolerable_rate_deg_s(case, time)) for time in along]
        yield panel.line(line, f"s{_colour(index)}")
        if case.rotation_rate_deg_s:
            told = f"{name}: {case.rotation_rate_deg_s:g} °/s at {case.exposure_time_s:g} s"
            yield panel.dot(case.exposure_time_s, case.rotation_rate_deg_s, f"d{_colour(index)}", told)


def _draw_blur(cases: Sequence[tuple[str, MotionCase]], along: Sequence[float]) -> Iterator[str]:
    moving = [(i, name, case) for i, (name, case) in enumerate(cases) if _blur(case, along[0])]
    if not moving:
        return
    blurs = [_blur(case, time) for _, _, case in moving for time in (along[0], along[-1])]
    limits = sorted({case.limit_px for _, _, case in moving})
    panel = _panel(
        (along[0], along[-1], *span([*blurs, *limits], logarithmic=True)),
        column=1,
        title="Theoretical blur; the practical one is half",
        labels=("exposure time [s], logarithmic", "blur [px], logarithmic"),
        logarithmic=True,
    )
    yield from panel.frame()
    for limit in limits:
        yield panel.line([(along[0], limit), (along[-1], limit)], "limit")
    for index, name, case in moving:
        yield panel.line([(time, _blur(case, time)) for time in along], f"s{_colour(index)}")
        blur = _blur(case, case.exposure_time_s)
        yield panel.dot(case.exposure_time_s, blur, f"d{_colour(index)}", f"{name}: {blur:.3g} px")


def _blur(case: MotionCase, exposure_time_s: float) -> float:
    moved: Motion = compute_motion(replace(case, exposure_time_s=exposure_time_s))
    return moved.theoretical_blur_px or 0.0


def _panel(
    limits: tuple[float, float, float, float],
    *,
    column: int,
    title: str,
    labels: tuple[str, str],
    logarithmic: bool = False,
) -> Panel:
    start = _LEFT_PX + column * (_PANEL_PX + _GAP_PX)
    low_x, high_x, low_y, high_y = limits
    bottom = _TOP_PX + _PANEL_PX
    return Panel(
        x=Scale(low=low_x, high=high_x, start_px=start, end_px=start + _PANEL_PX, logarithmic=logarithmic),
        y=Scale(low=low_y, high=high_y, start_px=bottom, end_px=_TOP_PX, logarithmic=logarithmic),
        title=title,
        x_label=labels[0],
        y_label=labels[1],
    )


def _even(low_x: float, high_x: float, low_y: float, high_y: float) -> tuple[float, float, float, float]:
    """Widen the shorter of two ranges: a square panel then shows a square as one."""
    half = max(high_x - low_x, high_y - low_y) / 2
    x, y = (low_x + high_x) / 2, (low_y + high_y) / 2
    return x - half, x + half, y - half, y + half


def _colour(index: int) -> int:
    return index % len(_COLOURS)


def _label(cases: Sequence[tuple[str, MotionCase]]) -> list[str]:
    return [
        f"{name}: {case.pixel_pitch_um:g} µm, {case.focal_length_mm:g} mm, limit {case.limit_px:g} px"
        for name, case in cases
    ]


def _name(labels: Sequence[str]) -> Iterator[str]:
    shown = [*labels[:_MOST_NAMED], *([f"and {len(labels) - _MOST_NAMED} more"] if _too_many(labels) else [])]
    for index, label in enumerate(shown):
        css = f"k{_colour(index)}" if index < _MOST_NAMED else ""
        at = _LEGEND_PX + index * _LINE_PX
        yield f'<text class="{css}" x="{_LEFT_PX}" y="{at}">{escape(label)}</text>'


def _too_many(labels: Sequence[str]) -> bool:
    return len(labels) > _MOST_NAMED


def _document(parts: Sequence[str], *, columns: int, named: int, label: str) -> str:
    width = _LEFT_PX + columns * _PANEL_PX + (columns - 1) * _GAP_PX + 30
    lines = min(named, _MOST_NAMED + 1)
    return document(
        parts, width_px=width, height_px=math.ceil(_LEGEND_PX + lines * _LINE_PX), label=label, style=_STYLE
    )
