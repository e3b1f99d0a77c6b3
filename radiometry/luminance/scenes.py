"""Meter readings of the scenes, and the change of the lamp from them to the frames."""

import math
import statistics as python_statistics
from collections import defaultdict
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from functools import cache

from radiometry.findings import Raised
from radiometry.luminance import codes
from radiometry.luminance.results import SceneSummary
from radiometry.luminance.rows import FrameRow, Params, Reading
from radiometry.records import Record

_LAMP_DRIFT_REL = 0.02
_RHO_TOLERANCE_REL = 0.10
_USUAL_COVERAGE_FACTOR = 2.0
_HALF_HOUR_S = 1800.0
_DOUBTFUL_S = 600.0
_FARTHEST_ZONE_S = 14 * 3600.0
_UNTIMED_S = 600.0
_FAR_S = 3600.0
_DAYS_S = 48 * 3600.0
_READING_U_REL = 0.01
_FEW_DIFFERENCES = 3


def summarise_scenes(readings: Sequence[Reading], *, panel_rho: float | None) -> tuple[SceneSummary, ...]:
    """Average the readings per scene; a scene without a luminance reading has none."""
    by_scene: dict[str, list[Reading]] = defaultdict(list)
    for reading in readings:
        by_scene[reading.scene].append(reading)
    scenes = sorted({reading.scene for reading in readings if reading.quantity == "luminance"})
    return tuple(_summarise(scene, by_scene[scene], panel_rho) for scene in scenes)


def _summarise(scene: str, readings: Sequence[Reading], panel_rho: float | None) -> SceneSummary:
    luminances, illuminances = (
        sorted(each.value for each in readings if each.quantity == quantity)
        for quantity in ("luminance", "illuminance")
    )
    mean_lx = math.fsum(illuminances) / len(illuminances) if illuminances else None
    return SceneSummary(
        scene=scene,
        readings=len(luminances),
        luminance_cd_m2=math.fsum(luminances) / len(luminances),
        spread_rel=_spread(luminances),
        illuminance_lx=mean_lx,
        illuminance_spread_rel=_spread(illuminances) if illuminances else None,
        rho_e_pi_cd_m2=panel_rho * mean_lx / math.pi
        if panel_rho is not None and mean_lx is not None
        else None,
    )


def _spread(ordered: Sequence[float]) -> float:
    """Compute (largest - smallest) / mean."""
    return (ordered[-1] - ordered[0]) / (math.fsum(ordered) / len(ordered))


def check_scenes(scenes: Sequence[SceneSummary]) -> list[Raised]:
    """Check the lamp for drift, and compare luminance with illuminance."""
    raised: list[Raised] = []
    for scene in scenes:
        where = f"scene {scene.scene}"
        drift = scene.illuminance_spread_rel
        if drift is not None and drift > _LAMP_DRIFT_REL:
            detail = f"The illuminance readings spread over {drift:.1%} of their mean."
            raised.append(codes.LAMP_DRIFT.at(where, detail))
        expected = scene.rho_e_pi_cd_m2
        if (
            expected is not None
            and not abs(scene.luminance_cd_m2 - expected) <= _RHO_TOLERANCE_REL * expected
        ):
            detail = f"L is {scene.luminance_cd_m2:.4g} cd/m2, rho E / pi is {expected:.4g} cd/m2."
            raised.append(codes.RHO_CROSS_CHECK.at(where, detail))
    return raised


def meter_calibration_u_rel(readings: Sequence[Reading]) -> tuple[float, bool]:
    """Return the meters' relative calibration uncertainty.

    Of several meters the largest is used, as one error common to all points: that is the cautious choice if
    it is not known how their standards are related. A certificate without a coverage factor is read with k =
    2.
    """
    luminance = [reading for reading in readings if reading.quantity == "luminance"]
    known = [
        reading.expanded_uncertainty_rel / (reading.coverage_factor or _USUAL_COVERAGE_FACTOR)
        for reading in luminance
        if reading.expanded_uncertainty_rel is not None
    ]
    return max(known, default=0.0), len(known) == len(luminance)


class Change(Record):
    """The lamp at a frame relative to its scene's mean reading."""

    ratio: float = 1.0  # luminance at the frame over that of the readings
    u_rel: float = 0.0  # of the ratio, with the sign that it has at the other frames of `label`
    # of an error that all frames share: the change before or after them of a lamp that drifts
    level_u_rel: float = 0.0
    # frames of one label share one error: a scene whose readings determine its drift, or "" for all others
    label: str = ""


def follow_lamp(rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params) -> dict[str, Change]:
    """Estimate the change of the lamp from the meter readings to each light frame.

    With r the relative rate of a scene and tau the mean time of its luminance readings, L(t) = L (1 + r (t -
    tau)). Before any reading r is 0 within `lamp_drift_u_rel` / T, T being the duration of the scene.
    Readings of one quantity at two or more times, luminance or illuminance, give a line of ln L, and r is the
    mean of both, weighted by their variances [1]. A reading repeats to `meter_repeatability_rel`, else to 1
    %, and to no more than readings of one scene differ. Where the times of readings are not known, those of
    the frames still show r: a reading lies one interval between frames before the first or after the last,
    and its distance from the middle of those of an ISO value is the root mean square of both, half of T at
    least. T is then at least 10 minutes, since the reading may lie apart from a burst.

    Cameras write local time. Where the file states no offset, it is the number of half hours that brings the
    frames closest to the readings of their scenes. Times that are then still more than 10 minutes apart, or
    further than any time zone, are not known.

    [1] JCGM 100:2008, H.3, doi:10.59161/JCGM100-2008E
    """
    light, stated, times = _find_times(rows, readings)
    isos = {row.frame: row.exposure.iso for row in light}
    spreads = {name: _find_repeatability(name, readings, params) for name in ("luminance", "illuminance")}
    found: dict[str, Change] = {}
    frames: dict[str, dict[str, float | None]] = defaultdict(dict)
    read: dict[str, list[Reading]] = defaultdict(list)
    for row in light:
        frames[row.scene or ""][row.frame] = times.get(row.frame)
    for reading in readings:
        read[reading.scene].append(reading)
    for scene in sorted(frames):
        clocks = [moment for name in frames[scene] if (moment := stated.get(name))]
        if len(clocks) < len(frames[scene]) or len({moment.tzinfo is None for moment in clocks}) > 1:
            clocks = []
        found |= _follow_scene(frames[scene], clocks, isos, read[scene], spreads, params)
    return found


def check_reading_times(rows: Sequence[FrameRow], readings: Sequence[Reading]) -> list[Raised]:
    """Find the readings that were taken more than an hour from the frames of their scene."""
    light, stated, times = _find_times(rows, readings)
    spans: dict[str, list[tuple[float, float]]] = defaultdict(list)
    for row in light:
        if row.frame in stated:
            local = stated[row.frame].replace(tzinfo=UTC).timestamp()
            known = (times[row.frame], 0.0) if row.frame in times else (local, _FARTHEST_ZONE_S)
            spans[row.scene or ""].append(known)
    raised = []
    for scene in sorted(spans):
        read = [_to_seconds(each.taken_at) for each in readings if each.scene == scene and each.taken_at]
        apart = [min(abs(at - time_s) - slack_s for time_s, slack_s in spans[scene]) for at in read]
        if apart and max(apart) > _FAR_S:
            far_s = max(apart)
            span = f"{far_s / 3600.0:.1f} h" if far_s < _DAYS_S else f"{far_s / 86400.0:.0f} days"
            detail = f"A reading was taken {span} from the nearest frame."
            raised.append(codes.READING_FAR_FROM_FRAMES.at(f"scene {scene}", detail))
    return raised


def _follow_scene(
    frames: Mapping[str, float | None],
    clocks: Sequence[datetime],
    isos: Mapping[str, float],
    readings: Sequence[Reading],
    spreads: Mapping[str, float],
    params: Params,
) -> dict[str, Change]:
    shown = {name: time_s for name, time_s in frames.items() if time_s is not None}
    read = sorted(_to_seconds(r.taken_at) for r in readings if r.quantity == "luminance" and r.taken_at)
    if len(shown) < len(frames) or not read or len(read) < sum(r.quantity == "luminance" for r in readings):
        after_s = [(moment - clocks[0]).total_seconds() for moment in clocks] or [0.0] * len(frames)
        drift = params.lamp_drift_u_rel
        groups: dict[float, list[float]] = defaultdict(list)
        for name, time_s in zip(frames, after_s, strict=True):
            groups[isos[name]].append(time_s)
        middles_s = {iso: (min(each) + max(each)) / 2.0 for iso, each in groups.items()}
        span_s = max(after_s) - min(after_s)
        gap_s = span_s / max(len(after_s) - 1, 1)
        rate = drift / max(span_s + gap_s, _UNTIMED_S)
        reach_s, middle_s = span_s / 2.0 + gap_s, (min(after_s) + max(after_s)) / 2.0

        @cache
        def change(time_s: float, own_s: float) -> Change:
            level_u_rel = max(drift / 2.0, rate * math.hypot(reach_s, own_s - middle_s))
            return Change(u_rel=rate * (time_s - own_s), level_u_rel=level_u_rel)

        return {
            name: change(time_s, middles_s[isos[name]]) for name, time_s in zip(frames, after_s, strict=True)
        }
    timed = [(_to_seconds(each.taken_at), each) for each in readings if each.taken_at]
    every = [*shown.values(), *(time_s for time_s, _ in timed)]
    duration_s = max(every) - min(every)
    if not duration_s:
        return dict.fromkeys(frames, Change())
    weight, pull = (duration_s / params.lamp_drift_u_rel) ** 2 if params.lamp_drift_u_rel else math.inf, 0.0
    label = ""
    for quantity, u_rel in spreads.items():
        own = sorted((time_s, math.log(each.value)) for time_s, each in timed if each.quantity == quantity)
        lever_s2, product = _sum_up(own)
        if lever_s2 and math.isfinite(weight):
            label, weight, pull = readings[0].scene, weight + lever_s2 / u_rel**2, pull + product / u_rel**2
    centre_s = math.fsum(read) / len(read)
    return {
        name: Change(
            ratio=math.exp(pull / weight * (time_s - centre_s)),
            u_rel=(time_s - centre_s) / math.sqrt(weight),
            label=label,
        )
        for name, time_s in shown.items()
    }


def _sum_up(points: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Return sum (t - mean)^2 and sum (t - mean) y, whose quotient is the slope of a line."""
    if not points:
        return 0.0, 0.0
    centre = math.fsum(time_s for time_s, _ in points) / len(points)
    lever = math.fsum((time_s - centre) ** 2 for time_s, _ in points)
    return lever, math.fsum((time_s - centre) * value for time_s, value in points)


def _find_repeatability(quantity: str, readings: Sequence[Reading], params: Params) -> float:
    """Return the relative standard uncertainty of one reading, at most what readings of a scene differ by."""
    usual = params.meter_repeatability_rel or _READING_U_REL
    by_scene: dict[str, list[float]] = {}
    for reading in readings:
        if reading.quantity == quantity:
            by_scene.setdefault(reading.scene, []).append(math.log(reading.value))
    squares, dof = 0.0, 0
    for _, logs in sorted(by_scene.items()):
        centre = math.fsum(sorted(logs)) / len(logs)
        squares += math.fsum(sorted((each - centre) ** 2 for each in logs))
        dof += len(logs) - 1
    seen = math.sqrt(squares / dof) if dof >= _FEW_DIFFERENCES else usual
    return max(min(usual, seen), 1e-6)


def _find_times(
    rows: Sequence[FrameRow], readings: Sequence[Reading]
) -> tuple[list[FrameRow], dict[str, datetime], dict[str, float]]:
    """Return the light frames, the times that they state, and those that can be compared with readings."""
    light = [row for row in rows if row.role == "light" and row.scene]
    stated = {row.frame: datetime.fromisoformat(row.taken_at) for row in light if row.taken_at}
    zoned = {frame: moment.timestamp() for frame, moment in stated.items() if moment.tzinfo}
    read: dict[str, list[float]] = {}
    for reading in readings:
        if reading.taken_at:
            read.setdefault(reading.scene, []).append(_to_seconds(reading.taken_at))
    local = {frame: m.replace(tzinfo=UTC).timestamp() for frame, m in stated.items() if not m.tzinfo}
    apart = sorted(
        local[row.frame] - math.fsum(sorted(read[row.scene])) / len(read[row.scene])
        for row in light
        if row.frame in local and row.scene in read
    )
    if not apart:
        return light, stated, zoned
    apart_s = python_statistics.median(apart)
    offset_s = _HALF_HOUR_S * round(apart_s / _HALF_HOUR_S)
    if abs(offset_s) > _FARTHEST_ZONE_S or abs(apart_s - offset_s) > _DOUBTFUL_S:
        return light, stated, zoned
    return light, stated, zoned | {frame: time_s - offset_s for frame, time_s in local.items()}


def _to_seconds(moment: str | None) -> float:
    return datetime.fromisoformat(moment or "").timestamp()
