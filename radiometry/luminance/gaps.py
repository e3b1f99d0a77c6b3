"""Gaps of a luminance campaign: which frame to photograph next, with its place in the grid."""

import math
import statistics as python_statistics
from collections import Counter
from collections.abc import Sequence

from radiometry.drawing.text import sort_naturally
from radiometry.luminance.agreement import measure_brightness
from radiometry.luminance.points import IsoSeries, collect_series
from radiometry.luminance.rows import FrameRow, Params, Reading
from radiometry.luminance.suggestions import GOOD_SCENES, place_levels
from radiometry.specification.grid import Gap

GOOD_SIGNAL = 0.5
"""Signal above dark to expose for, as a fraction of the span from dark to white: a stop below white."""

_STOP_THIRDS = 3

_EVERY_CAMERA_S = 1e-3, 1.0
"""Exposure times that a camera with manual exposure has; others are suggested if a frame shows them."""


def find_gaps(rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params) -> tuple[Gap, ...]:
    """List the frames to add, each with its scene, ISO value and f-number as far as they are known.

    Returns
    -------
    tuple of Gap
        A scene's frame at a setting that at least half of the scenes have, with the exposure time that its
        other frames suggest; dark frames of an ISO value that has none; further light levels of an ISO value
        that has too few.
    """
    lit = [row for row in rows if row.role == "light" and row.scene]
    read = {each.scene: each.value for each in readings if each.quantity == "luminance"}
    shown = {(row.scene, row.exposure.iso, row.exposure.f_number) for row in lit}
    scenes = sort_naturally({row.scene for row in lit if row.scene} | read.keys())
    taken_s = [row.exposure.exposure_time_s for row in rows]
    common = Counter((iso, f_number) for _, iso, f_number in shown)
    series = collect_series(rows, readings, params)
    spans = {each.iso: _find_span(each) for each in series}
    light = _measure_light(series)
    ks = [value / read[scene] for scene, value in light.items() if scene in read]
    if ks:
        light = {scene: python_statistics.median(ks) * value for scene, value in read.items()} | light
    gaps = [
        Gap(
            role="light",
            at={"scene": scene, "iso": iso, "f_number": f_number},
            exposure_time_s=_suggest_time(
                light.get(scene), spans.get(iso), iso=iso, f_number=f_number, taken_s=taken_s
            ),
        )
        for scene in scenes
        for (iso, f_number), count in sorted(common.items())
        if 1 < len(scenes) <= 2 * count and (scene, iso, f_number) not in shown
    ]
    darks = {row.exposure.iso for row in rows if row.role == "dark"}
    for iso in sorted({row.exposure.iso for row in lit} - darks):
        here = [row.exposure for row in lit if row.exposure.iso == iso]
        (f_number, _), *_ = Counter(each.f_number for each in here).most_common()
        time_s = python_statistics.median_low(each.exposure_time_s for each in here)
        gaps.append(Gap(role="dark", at={"iso": iso, "f_number": f_number}, exposure_time_s=time_s))
    for one in series:
        levels = sorted({c.luminance_cd_m2 for c in one.used if c.luminance_cd_m2 is not None})
        short = GOOD_SCENES - len({candidate.scene for candidate in one.used})
        if levels and short > 0:
            noun = "level" if short == 1 else "levels"
            text = f"{short} more {noun} {place_levels(levels)}"
            gaps.append(Gap(role="light", at={"iso": one.iso}, text=text))
    return tuple(gaps)


def _measure_light(series: Sequence[IsoSeries]) -> dict[str, float]:
    """Return K L of each scene, which is nearly the same at all ISO values [DN*m2/(cd*s) times cd/m2]."""
    found: dict[str, list[float]] = {}
    for one in series:
        for scene, frames in measure_brightness(one).items():
            found.setdefault(scene, []).extend(frames.values())
    return {scene: python_statistics.median(values) for scene, values in found.items()}


def _find_span(series: IsoSeries) -> float | None:
    return min((candidate.span_dn for candidate in series.candidates), default=None)


def _suggest_time(
    light: float | None, span_dn: float | None, *, iso: float, f_number: float, taken_s: Sequence[float]
) -> float | None:
    """Return the time for `GOOD_SIGNAL`, rounded down to a third of a stop.

    None if no light is known, or if the camera may not have that time: it is beyond `_EVERY_CAMERA_S` and
    those of the campaign's frames.
    """
    if light is None or span_dn is None:
        return None
    time_s = GOOD_SIGNAL * span_dn * f_number**2 / (light * iso) if light * iso > 0 else math.inf
    if not min(_EVERY_CAMERA_S[0], *taken_s) <= time_s <= max(_EVERY_CAMERA_S[1], *taken_s):
        return None
    return float(2.0 ** (math.floor(_STOP_THIRDS * math.log2(time_s)) / _STOP_THIRDS))
