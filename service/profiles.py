"""Answers of line profiles and histograms."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from radiometry.maps.ground import place_on_earth, place_on_road, travel
from radiometry.maps.histogram import AreaHistogram, make_histogram
from radiometry.maps.profile import Profile, average_trace, trace_line
from radiometry.maps.uncertainty import PixelUncertainty

from service.map_tools import OpenMap, count_area, read_points, read_trace, weigh_lens
from service.schemas.base import Quantity
from service.schemas.map_tools import (
    BinsOfMap,
    Gap,
    HistogramAnswer,
    LineOfMap,
    ProfileAnswer,
    ProfilePoint,
    RankedValue,
    Scale,
    list_bins,
)

Array = NDArray[np.float64]

_TOO_FAR = (
    "The line lies too far outside the marked rectangle of the lanes: its distances are in pixels only."
)
_PLANE = "Distances in metres hold on the plane of the road, and are as well known as its four corners."
_MEANS = "Pixels along the line are averaged to {} at a time: a finer line has fewer."
_UNKNOWN = "Saturated points have no value: mean and largest value are those of the others, and too low."
_NOISE = (
    "Values of single pixels: their noise widens the histogram. Noise beyond the brightness of the measured "
    "region is an upper bound."
)
_PLACES = {"road_m": ("x_m", "y_m"), "wgs84": ("longitude_deg", "latitude_deg")}


def answer_profile(found: OpenMap, asked: LineOfMap) -> ProfileAnswer:
    layout = found.layout
    trace = trace_line(
        read_points(asked.line),
        height_px=layout.height_px,
        width_px=layout.width_px,
        across_px=asked.across_px,
    )
    profile = average_trace(trace, read_trace(found, trace), most=asked.most)
    uncertainty = weigh_lens(found, profile.xy_px)
    dark = np.zeros(len(profile.values), np.bool_)
    if uncertainty is not None and found.is_light:
        dark = profile.find_dark(uncertainty)
    scale, placed, notes = _find_scale(found, profile.xy_px)
    metres = None if placed is None else travel(placed, is_in_degrees=scale == "wgs84")
    known = np.isfinite(profile.values)
    gap: Gap = "saturated" if found.is_light else "no_value"
    if not known.all():
        notes.append(_UNKNOWN)
    if profile.step > 1:
        notes.append(_MEANS.format(profile.step))
    common = own = total = None
    if uncertainty is not None:
        values = np.nan_to_num(profile.values)
        common, own = uncertainty.common(values), uncertainty.own(values, profile.pixels)
        total = np.hypot(common, own)

    def make_point(n: int) -> ProfilePoint:
        x, y = profile.xy_px[n].tolist()
        more: dict[str, float] = {}
        if placed is not None and metres is not None and scale is not None:
            more = dict(zip(_PLACES[scale], placed[n].tolist(), strict=True))
            more["distance_m"] = float(metres[n])
        if known[n]:
            more["value"] = float(profile.values[n])
            if common is not None and own is not None and total is not None:
                more["common_uncertainty"], more["own_uncertainty"] = float(common[n]), float(own[n])
                more["standard_uncertainty"] = float(total[n])
        kind: Gap | None = gap if not known[n] else "too_dark" if dark[n] else None
        return ProfilePoint(distance_px=float(profile.distance_px[n]), x_px=x, y_px=y, gap=kind, **more)

    points = [make_point(n) for n in range(len(profile.values))]
    return ProfileAnswer(
        unit=found.unit,
        across_px=asked.across_px,
        step_px=profile.step,
        length_px=float(trace.distance_px[-1]),
        length_m=None if metres is None else float(metres[-1]),
        scale=scale,
        gaps={gap: int((~known).sum()), "too_dark": int((dark & known).sum())},
        notes=[*found.list_notes(is_along_a_line=True), *notes],
        points=points,
        **_summarise(found, profile, uncertainty),
    )


def _summarise(found: OpenMap, profile: Profile, uncertainty: PixelUncertainty | None) -> dict[str, Any]:
    """Return mean, smallest and largest value of the line with their uncertainties."""
    known = np.isfinite(profile.values)
    if not known.any() or uncertainty is None:
        return {}
    values, pixels = profile.values[known], profile.pixels[known]
    relative = np.broadcast_to(uncertainty.relative, profile.values.shape)[known]
    # what all share is added, noise averages
    mean_common = float(np.hypot(np.mean(relative * values), uncertainty.constant))
    mean_own = float(uncertainty.own(np.array(values.mean()), float(pixels.sum())))
    total = np.hypot(np.hypot(relative * values, uncertainty.constant), uncertainty.own(values, pixels))
    low, high = int(values.argmin()), int(values.argmax())

    def quantity(value: float, u: float) -> Quantity:
        return Quantity(value=float(value), standard_uncertainty=float(u), unit=found.unit)

    return {
        "mean": quantity(values.mean(), np.hypot(mean_common, mean_own)),
        "min": quantity(values[low], total[low]),
        "max": quantity(values[high], total[high]),
        "min_to_max": float(values[low] / values[high]) if values[low] > 0.0 and found.is_light else None,
    }


def _find_scale(found: OpenMap, xy_px: Array) -> tuple[Scale | None, Array | None, list[str]]:
    lanes = found.row.parameters.get("lanes")
    if lanes:
        placed = place_on_road(lanes, xy_px)
        return ("road_m", placed, [_PLANE]) if placed is not None else (None, None, [_TOO_FAR])
    transform = found.row.result.get("place", {}).get("transform")
    if transform:
        return "wgs84", place_on_earth(transform, xy_px), []
    return None, None, []


def count_histogram(found: OpenMap, asked: BinsOfMap) -> tuple[AreaHistogram, bool]:
    """Return the histogram of an area, and whether its axis is logarithmic."""
    logarithmic = asked.axis == "logarithmic" or (asked.axis is None and found.is_light)
    limit = found.uncertainty.limit if found.uncertainty is not None and found.is_light else None
    counted = count_area(found, found.find_polygon(asked.area))
    ends = (asked.low, asked.high)
    return make_histogram(
        counted, limit=limit, logarithmic=logarithmic, bins=asked.bins, ends=ends
    ), logarithmic


def answer_histogram(found: OpenMap, asked: BinsOfMap) -> HistogramAnswer:
    histogram, logarithmic = count_histogram(found, asked)
    uncertainty, mean = found.uncertainty, None
    if uncertainty is not None and histogram.mean is not None:
        at = np.array(histogram.mean)
        u = np.hypot(uncertainty.common(at), uncertainty.own(at, float(histogram.pixels)))
        mean = Quantity(value=histogram.mean, standard_uncertainty=float(u), unit=found.unit)

    def rank(each: object) -> RankedValue:
        answer = RankedValue.model_validate(each)
        if uncertainty is not None and answer.value is not None:
            at = np.array(answer.value)
            answer.standard_uncertainty = float(np.hypot(uncertainty.common(at), uncertainty.own(at)))
        return answer

    return HistogramAnswer(
        unit=found.unit,
        area=asked.area,
        axis="logarithmic" if logarithmic else "linear",
        pixels=histogram.pixels,
        unknown=histogram.unknown,
        too_dark=histogram.too_dark,
        limit=histogram.limit,
        below=histogram.below,
        above=histogram.above,
        mean=mean,
        smallest=histogram.smallest,
        largest=histogram.largest,
        percentiles=[rank(each) for each in histogram.percentiles],
        bins=list_bins(histogram),
        notes=[*found.list_notes()[1:], _NOISE],
    )
