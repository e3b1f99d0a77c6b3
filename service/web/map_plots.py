"""Figures of line profiles and histograms of a map."""

import itertools
from collections.abc import Sequence

from radiometry.drawing.figure import Axis, Cell, Figure, Series
from radiometry.drawing.text import write_unit
from service.schemas.map_tools import HistogramAnswer, ProfileAnswer, ProfilePoint

_QUANTITIES = {"cd/m2": "luminance"}


def _label(unit: str) -> str:
    """Return the name of an axis of values."""
    return "value" if unit == "1" else f"{_QUANTITIES.get(unit, 'value')} [{write_unit(unit)}]"


def plot_profile(profile: ProfileAnswer, *, logarithmic: bool) -> Figure:
    """Return values along a line with the band of their uncertainty; points of a gap break the line."""
    in_metres = profile.scale is not None
    runs = [list(run) for is_gap, run in itertools.groupby(profile.points, _is_gap) if not is_gap]
    series = [
        part for n, run in enumerate(runs) for part in _draw_run(run, in_metres=in_metres, named=n == 0)
    ]
    moments = tuple(_place(point, in_metres=in_metres) for point in profile.points if _is_gap(point))
    kinds = [kind.replace("_", " ") for kind, count in profile.gaps.items() if count]
    of_lanes = " on the road" if profile.scale == "road_m" else " on the ground" if in_metres else ""
    return Figure(
        note="Wide band: standard uncertainty. Narrow band: noise of each point alone, at most.",
        x=Axis(label=f"distance{of_lanes} [{'m' if in_metres else 'px'}]"),
        y=Axis(
            label=_label(profile.unit) + (", logarithmic" if logarithmic else ""), logarithmic=logarithmic
        ),
        series=tuple(series),
        moments=moments,
        moments_are=" or ".join(kinds),
    )


def _is_gap(point: ProfilePoint) -> bool:
    return point.gap is not None


def _place(point: ProfilePoint, *, in_metres: bool) -> float:
    return point.distance_m if in_metres and point.distance_m is not None else point.distance_px


def _draw_run(run: Sequence[ProfilePoint], *, in_metres: bool, named: bool) -> list[Series]:
    line, wide, narrow = [], [], []
    for point in run:
        x, value = _place(point, in_metres=in_metres), point.value or 0.0
        total, own = point.standard_uncertainty or 0.0, point.own_uncertainty or 0.0
        line.append((x, value))
        wide.append((x, value - total, value + total))
        narrow.append((x, value - own, value + own))
    return [
        Series(name="value ± u" if named else "", line=tuple(line), swath=tuple(wide), place=0),
        Series(name="± noise of the point" if named else "", swath=tuple(narrow), place=1),
    ]


def plot_histogram(histogram: HistogramAnswer) -> Figure:
    """Return the shares of area in bins, with the median dashed."""
    logarithmic = histogram.axis == "logarithmic"
    median = next((each.value for each in histogram.percentiles if each.percent == 50), None)
    apart = [
        f"{100.0 * count / histogram.pixels:.3g} % {name}"
        for name, count in (
            ("saturated", histogram.unknown),
            ("too dark", histogram.too_dark),
            ("below the axis", histogram.below),
            ("above the axis", histogram.above),
        )
        if count
    ]
    unit = "" if histogram.unit == "1" else f" {write_unit(histogram.unit)}"
    return Figure(
        note=". ".join(
            [f"{histogram.pixels} pixels"]
            + ([f"Dashed: median {median:.3g}{unit}"] if median is not None else [])
            + ([f"Not drawn: {', '.join(apart)}"] if apart else [])
        )
        + ".",
        x=Axis(
            label=_label(histogram.unit) + (", logarithmic" if logarithmic else ""), logarithmic=logarithmic
        ),
        y=Axis(label="share of area [%]", include=(0.0,)),
        uprights=() if median is None or not _is_on(histogram, median) else (median,),
        cells=tuple(
            Cell(
                x=(each.low, each.high),
                y=(0.0, 100.0 * each.share),
                share=1.0,
                told=f"{each.low:.3g} to {each.high:.3g}{unit}: {100.0 * each.share:.3g} %, "
                f"{each.pixels} pixels",
            )
            for each in histogram.bins
            if each.pixels
        ),
        series=(Series(line=((histogram.bins[0].low, 0.0), (histogram.bins[-1].high, 0.0))),),
    )


def _is_on(histogram: HistogramAnswer, value: float) -> bool:
    return histogram.bins[0].low <= value <= histogram.bins[-1].high
