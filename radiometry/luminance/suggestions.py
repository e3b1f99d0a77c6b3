"""Advice on a luminance campaign: what keeps it from its fit, what would improve it, and the next frames."""

import itertools
import math
import statistics as python_statistics
from collections import Counter
from collections.abc import Collection, Sequence

from radiometry.drawing.text import name_few, name_range, sort_naturally, write_exposure
from radiometry.findings import shared
from radiometry.findings.grouping import Cause, name_frames
from radiometry.fitting.evidence import list_unknown_exclusions
from radiometry.luminance import brightness, codes, corrections, points
from radiometry.luminance.rows import FrameRow, Params, Reading
from radiometry.luminance.scenes import check_reading_times, check_scenes, summarise_scenes
from radiometry.specification.roles import Gap
from radiometry.spectral.lamps import find_modulation
from radiometry.spectral.mismatch import SPECTRAL_MISMATCH_UNKNOWN

GOOD_SCENES = 5
"""Usable light levels per ISO value. The models have one or two parameters: five levels leave three degrees
of freedom, and one wrong reading stands out against four right ones. The procedure shows six."""

GOOD_SPAN = 10.0
"""Ratio of the brightest usable level to the darkest, per ISO value. Five levels over a decade whose readings
err by 1 % fix the exponent of the power model to 0.006, so that the 0.02 which is flagged as nonlinear stands
out three times; over a factor of three it would be 0.012."""

# the repeatability of a good meter: less is not seen beside it
_FLICKER = 0.01
GOOD_SIGNAL = 0.5
"""Signal above dark to expose for, as a fraction of the span from dark to white: a stop below white."""

_STOP_THIRDS = 3
_EVERY_CAMERA_S = 1e-3, 1.0
"""Exposure times that a camera with manual exposure has; others are suggested if a frame shows them."""


def list_missing(
    rows: Sequence[FrameRow],
    readings: Sequence[Reading],
    params: Params,
    *,
    unread: Sequence[str] = (),
    awaited: Collection[str] = (),
) -> list[str]:
    """List what the fit lacks; scenes whose reading is ``awaited`` are counted as if they had it."""
    excluded = {exclusion.frame for exclusion in params.exclude}
    found = list_unknown_exclusions(params.exclude, [*(row.frame for row in rows), *unread])
    wanted = [row for row in rows if row.frame not in excluded]
    waiting = {*unread} - excluded
    if waiting:
        found.append(name_frames("not read yet", waiting, shared.NOT_READ))
    found += _list_unmeasured(wanted)
    light = [row for row in wanted if row.role == "light"]
    if sceneless := [row.frame for row in light if not row.scene]:
        found.append(name_frames("no scene", sceneless, codes.SCENE_MISSING))
    if not light and not waiting:
        return [*found, "the campaign has no light frame that can be used"]
    if waiting:  # they may be of any ISO value
        return found
    unmeasured = {row.exposure.iso for row in light if not row.statistics}
    for series in points.collect_series(rows, readings, params):
        usable = len(_count_on(series, awaited))
        if usable < points.FEWEST_SCENES and series.iso not in unmeasured:
            found.append(
                f"ISO {series.iso:g} has {usable} usable scene{'' if usable == 1 else 's'}, "
                f"a fit needs {points.FEWEST_SCENES}: {_reasons(series)}"
            )
    return found


def require_shares(rows: Sequence[FrameRow], params: Params) -> None:
    """Refuse a fit in which some signals would be divided by V and others not."""
    excluded = {exclusion.frame for exclusion in params.exclude}
    light = [row for row in rows if row.role == "light" and row.statistics and row.frame not in excluded]
    lacking = [row.frame for row in light if row.lens_share is None]
    if params.vignetting is not None and lacking:
        raise shared.VIGNETTING_NOT_CALIBRATED.reject(
            f"The fit corrects vignetting. No V of the region: {name_few('frame', lacking)}. Give them the "
            "vignetting version."
        )


def _count_on(series: points.IsoSeries, awaited: Collection[str]) -> set[str]:
    """Return the scenes that count, and those that lack their reading alone."""
    waiting = {c.scene for c in series.candidates if c.scene in awaited and not points.is_saturated(c.signal)}
    return {candidate.scene for candidate in series.used} | waiting


def list_unread_scenes(
    rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params
) -> tuple[str, ...]:
    """List the scenes that have light frames but no luminance reading."""
    excluded = {exclusion.frame for exclusion in params.exclude}
    read = {reading.scene for reading in readings if reading.quantity == "luminance"}
    shown = {row.scene for row in rows if row.role == "light" and row.scene and row.frame not in excluded}
    return tuple(sort_naturally(shown - read))


def name_unread(scenes: Sequence[str]) -> list[Cause]:
    if not scenes:
        return []
    lacks = f"{name_range('scene', scenes)} {'has' if len(scenes) == 1 else 'have'} no luminance reading"
    return [Cause(lacks, codes.READING_MISSING, tuple(f"scene {scene}" for scene in scenes))]


def list_doubted(
    rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params, *, gravely: bool
) -> list[Cause]:
    """List the readings that their frames speak against: ``gravely``, or by less.

    A tone curve changes the ratio of two levels: what may have one is never named gravely.
    """
    curved = {row.frame for row in rows if row.rendered or row.from_table}
    return [
        Cause(
            f"{each.describe()}: check {'its row' if each.fits else 'it, and its unit'}",
            codes.READING_OFF,
            (f"scene {each.scene}",),
            {"reading_cd_m2": each.reading_cd_m2, "frames_cd_m2": each.frames_cd_m2},
        )
        for each in brightness.find_doubted(points.collect_series(rows, readings, params), readings)
        if not each.reason and gravely == (each.is_grave and curved.isdisjoint(each.frames))
    ]


def _list_unmeasured(rows: Sequence[FrameRow]) -> list[str]:
    """List the frames without statistics, with whether they lack a region or wait for a worker."""
    regionless = [row.frame for row in rows if not row.statistics and not row.has_region]
    waiting = [row.frame for row in rows if not row.statistics and row.has_region]
    found: list[str] = []
    if regionless and len(regionless) == len(rows):
        found.append(Cause("the campaign has no region (ROI)", shared.NO_REGION))
    elif regionless:
        found.append(name_frames("no region (ROI)", regionless, shared.NO_REGION))
    if waiting:
        found.append(name_frames("no statistics yet", waiting, shared.NOT_EXTRACTED))
    return found


def _reasons(series: points.IsoSeries) -> str:
    """State why the frames of the scenes that do not count were left out."""
    usable = {candidate.scene for candidate in series.used}
    lost = {c.scene: c.left_out for c in series.candidates if c.scene not in usable}
    if not lost:
        return "photograph more light levels"
    scenes: dict[str, list[str]] = {}
    for scene, why in lost.items():
        scenes.setdefault(why, []).append(scene)
    return ", ".join(f"{name_few('scene', names)} left out ({why})" for why, names in scenes.items())


def plan(rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params) -> tuple[str, ...]:
    """List by name what to add while the lamp is still in place.

    Nothing here keeps a fit from starting: that is in `list_missing`.
    """
    # without its scale K is relative only, which matters more than all else
    found: list[str] = [
        *_plan_meters(rows, readings),
        *(
            Cause(
                f"the readings of {far.where} do not belong to its frames. {far.detail} Correct the time, or "
                "read and photograph it again",
                codes.READING_FAR_FROM_FRAMES,
                (far.where,),
            )
            for far in check_reading_times(rows, readings)
        ),
    ]
    awaited = list_unread_scenes(rows, readings, params)
    light = {row.exposure.iso for row in rows if row.role == "light"}
    series = {one.iso: one for one in points.collect_series(rows, readings, params)}
    darks = {row.exposure.iso for row in rows if row.role == "dark"}
    found += [
        Cause(f"no dark frames at ISO {iso:g}", shared.DARK_FROM_BLACK_LEVEL, (f"iso {iso:g}",))
        for iso in sorted(light - darks)
    ]
    advice: dict[str, list[float]] = {}
    for one in series.values():
        for said in (
            *_plan_darks(one),
            *_plan_levels(one, awaited),
            *_plan_settings(one),
            *_plan_times(one, params),
        ):
            advice.setdefault(said, []).append(one.iso)
    found += [
        said.replace("{iso}", "ISO " + ", ".join(f"{iso:g}" for iso in isos)) for said, isos in advice.items()
    ]
    found += list_doubted(rows, readings, params, gravely=False)
    if params.camera_response is not None and params.lamp is None and params.lamp_kind is None:
        lacking = "the lamp is not stated: without it no spectral mismatch can be corrected"
        found.append(Cause(lacking, SPECTRAL_MISMATCH_UNKNOWN))
    return (*found, *_plan_readings(rows, readings, params))


def _plan_darks(series: points.IsoSeries) -> list[str]:
    """Convert the flags of the fit to advice; of this and what follows, "{iso}" is left to be named."""
    if not series.dark_times_s or not series.used:
        return []
    advice: dict[str, str] = {
        codes.DARK_FROM_FEW_FRAMES: "fewer than three dark frames at {iso}: add some at other apertures",
        codes.DARK_VARIES: "the dark frames at {iso} differ too much for its weakest signal: repeat them",
    }
    return [
        advice.get(found.flag)
        or f"no dark frames at {{iso}} with a like exposure time: {found.detail.rstrip('.')}"
        for found in points.check_dark(series)
    ]


def _plan_levels(series: points.IsoSeries, awaited: Collection[str]) -> list[str]:
    """State how many light levels to add, and where: in the widest gap, or beyond the ends."""
    levels = sorted({c.luminance_cd_m2 for c in series.used if c.luminance_cd_m2 is not None})
    scenes = len(_count_on(series, awaited))
    short = GOOD_SCENES - scenes
    if scenes > len({candidate.scene for candidate in series.used}) and (short <= 0 or not levels):
        return []  # where they lie is known once they are read
    if not levels:
        return [f"{{iso}}: no usable level, add {short}"]
    narrow = levels[-1] / levels[0] < GOOD_SPAN
    if short > 0:
        noun = "level" if scenes == 1 else "levels"
        return [f"{{iso}}: {scenes} usable {noun}, add {short} more {place_levels(levels)}"]
    if narrow:
        span = f"{levels[0]:.3g} to {levels[-1]:.3g} cd/m2"
        return [f"add a darker level at {{iso}}, {levels[-1] / GOOD_SPAN:.3g} cd/m2 or less: it has {span}"]
    return []


def place_levels(levels: Sequence[float]) -> str:
    """State where to add light levels to these [cd/m2]: in the widest gap, or beyond the ends."""
    if levels[-1] / levels[0] < GOOD_SPAN:
        low, high = levels[-1] / GOOD_SPAN, levels[0] * GOOD_SPAN
        return f"down to {low:.3g} cd/m2 or up to {high:.3g} cd/m2"
    low, high = max(itertools.pairwise(levels), key=lambda pair: pair[1] / pair[0])
    return f"between {low:.3g} and {high:.3g} cd/m2"


def _plan_settings(series: points.IsoSeries) -> list[str]:
    found = []
    count = len(series.used)
    apertures = sorted({candidate.settings.f_number for candidate in series.used})
    if len(apertures) == 1:
        error = f"one aperture only at {{iso}} (f/{apertures[0]:g}): its f-number error cannot average out"
        found.append(error)
    if 0 < count < points.FEW_POINTS:
        found.append(f"{{iso}}: {count} usable frames, add {points.FEW_POINTS - count} more")
    return found


def _plan_times(series: points.IsoSeries, params: Params) -> list[str]:
    """Name the exposure times that catch a part of a period of the lamp's flicker."""
    mains, (_, depth) = params.mains_frequency_hz, find_modulation(params.lamp_kind, params.lamp_modulation)
    if mains is None:
        return []
    found = []
    for time_s in sorted({candidate.settings.exposure_time_s for candidate in series.used}):
        error = depth * corrections.compute_flicker(time_s, mains_frequency_hz=mains)
        if error > _FLICKER:
            found.append(
                f"{write_exposure(time_s)} at {{iso}} is no whole number of half periods of "
                f"{mains:g} Hz mains: flicker errs by up to {error:.1%}, use multiples of "
                f"1/{2 * mains:g} s"
            )
    return found


def _plan_readings(rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params) -> list[str]:
    shown = {row.scene for row in rows if row.role == "light" and row.scene}
    here = [reading for reading in readings if reading.scene in shown]
    scenes = summarise_scenes(here, panel_rho=params.panel_rho)
    found: list[str] = []
    if scenes and max(scene.readings for scene in scenes) == 1:
        single = "only one reading per scene: repeatability cannot be seen"
        found.append(Cause(single, codes.METER_REPEATABILITY_ESTIMATED))
    repeated = {scene for (scene, _), n in Counter((r.scene, r.quantity) for r in here).items() if n > 1}
    if once := sort_naturally({each.scene for each in scenes} - repeated):
        drift = f"one reading of {name_few('scene', once)}: a lamp that drifts is not seen, read again after "
        found.append(Cause(f"{drift}the frames", codes.LAMP_DRIFT, tuple(f"scene {each}" for each in once)))
    advice = {
        codes.LAMP_DRIFT: "the lamp drifted in {where}: repeat its frames and readings",
        codes.RHO_CROSS_CHECK: "luminance and illuminance of {where} disagree: check both readings and rho",
    }
    found += [
        Cause(advice[code].format(where=raised.where), code, (raised.where,))
        for raised in check_scenes(scenes)
        for code in advice
        if code == raised.flag
    ]
    return found


def _plan_meters(rows: Sequence[FrameRow], readings: Sequence[Reading]) -> list[Cause]:
    shown = {row.scene for row in rows if row.role == "light"}
    bare = [r for r in readings if r.scene in shown and r.expanded_uncertainty_rel is None]
    return [
        Cause(f"{who}: its calibration uncertainty is not in that of K", codes.METER_CERTIFICATE_MISSING)
        for meter in sorted({r.meter or "" for r in bare if r.quantity == "luminance"})
        for who in (
            f"the meter {meter} has no certificate" if meter else "some luminance readings name no meter",
        )
    ]


def find_gaps(rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params) -> tuple[Gap, ...]:
    lit = [row for row in rows if row.role == "light" and row.scene]
    read = {each.scene: each.value for each in readings if each.quantity == "luminance"}
    awaited = list_unread_scenes(rows, readings, params)
    shown = {(row.scene, row.exposure.iso, row.exposure.f_number) for row in lit}
    scenes = sort_naturally({row.scene for row in lit if row.scene} | read.keys())
    taken_s = [row.exposure.exposure_time_s for row in rows]
    common = Counter((iso, f_number) for _, iso, f_number in shown)
    series = points.collect_series(rows, readings, params)
    spans = {each.iso: min(c.span_dn for c in each.candidates) for each in series if each.candidates}
    light = brightness.measure_light(series)
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
        short = GOOD_SCENES - len(_count_on(one, awaited))
        if levels and short > 0:
            noun = "level" if short == 1 else "levels"
            text = f"{short} more {noun} {place_levels(levels)}"
            gaps.append(Gap(role="light", at={"iso": one.iso}, text=text))
    return tuple(gaps)


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
