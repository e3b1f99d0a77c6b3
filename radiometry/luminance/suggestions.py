"""Advice on what a luminance campaign lacks for a good fit, beyond what any fit needs."""

import itertools
import math
import statistics as python_statistics
from collections.abc import Sequence

from radiometry.drawing.text import sort_naturally
from radiometry.findings import shared
from radiometry.luminance import codes
from radiometry.luminance.agreement import DOUBTFUL_REL, measure_brightness
from radiometry.luminance.dark import check_dark
from radiometry.luminance.flicker import compute_flicker
from radiometry.luminance.lamp import check_reading_times
from radiometry.luminance.lamp_kinds import find_modulation
from radiometry.luminance.messages import show_time
from radiometry.luminance.missing import list_unread_scenes
from radiometry.luminance.points import FEW_POINTS, FEWEST_SCENES, IsoSeries, collect_series
from radiometry.luminance.rows import FrameRow, Params, Reading
from radiometry.luminance.scenes import check_scenes, summarise_scenes

GOOD_SCENES = 5
"""Usable light levels per ISO value. The models have one or two parameters: five levels leave three degrees
of freedom, and one wrong reading stands out against four right ones. The procedure shows six."""

GOOD_SPAN = 10.0
"""Ratio of the brightest usable level to the darkest, per ISO value. Five levels over a decade whose readings
err by 1 % fix the exponent of the power model to 0.006, so that the 0.02 which is flagged as nonlinear stands
out three times; over a factor of three it would be 0.012."""

# the repeatability of a good meter: less is not seen beside it
_FLICKER = 0.01


def plan(rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params) -> tuple[str, ...]:
    """List by name what to add while the lamp is still in place.

    Returns
    -------
    tuple of str
        Fragments of sentences, the gravest first.

    Notes
    -----
    Nothing here keeps a fit from starting: that is in `list_missing`. Scenes
    without a reading are in both, since a fit can also be made without them.
    """
    found = list_unread_scenes(rows, readings, params)
    found += [
        f"the readings of {far.where} do not belong to its frames. {far.detail} Correct the time, or read "
        "and photograph it again"
        for far in check_reading_times(rows, readings)
    ]
    light = {row.exposure.iso for row in rows if row.role == "light"}
    series = {one.iso: one for one in collect_series(rows, readings, params)}
    darks = {row.exposure.iso for row in rows if row.role == "dark"}
    found += [f"no dark frames at ISO {iso:g}" for iso in sorted(light - darks)]
    for one in series.values():
        found += _plan_darks(one) + _plan_levels(one) + _plan_settings(one)
        found += _plan_times(one, params) + _doubt_readings(one)
    if params.camera_response is not None and params.lamp is None and params.lamp_kind is None:
        found.append("the lamp is not stated: without it no spectral mismatch can be corrected")
    return (*found, *_plan_readings(rows, readings, params))


def _plan_darks(series: IsoSeries) -> list[str]:
    """Convert the flags of the fit to advice."""
    if not series.dark_times_s or not series.used:
        return []
    raised = check_dark(
        series.dark,
        iso=series.iso,
        light_times_s=[candidate.settings.exposure_time_s for candidate in series.used],
        dark_times_s=series.dark_times_s,
        weakest_signal_dn=min(c.above_dark_dn for c in series.used),
    )
    advice: dict[str, str] = {
        codes.DARK_FROM_FEW_FRAMES: "fewer than three dark frames at {iso}: add some at other apertures",
        codes.DARK_VARIES: "the dark frames at {iso} differ too much for its weakest signal: repeat them",
        shared.DARK_EXPOSURE_DIFFERS: "no dark frames at {iso} with a like exposure time: {detail}",
    }
    return [
        advice[found.flag].format(iso=f"ISO {series.iso:g}", detail=found.detail.rstrip("."))
        for found in raised
    ]


def _plan_levels(series: IsoSeries) -> list[str]:
    """State how many light levels to add, and where: in the widest gap, or beyond the ends."""
    levels = sorted({c.luminance_cd_m2 for c in series.used if c.luminance_cd_m2 is not None})
    scenes = len({candidate.scene for candidate in series.used})
    short = GOOD_SCENES - scenes
    where = f"ISO {series.iso:g}"
    if not levels:
        return [f"{where} has no usable level: add {short}"]
    narrow = levels[-1] / levels[0] < GOOD_SPAN
    if short > 0:
        noun = "level" if scenes == 1 else "levels"
        return [f"{where} has {scenes} usable {noun}: add {short} more {place_levels(levels)}"]
    if narrow:
        span = f"{levels[0]:.3g} to {levels[-1]:.3g} cd/m2"
        return [f"add a darker level at {where}, {levels[-1] / GOOD_SPAN:.3g} cd/m2 or less: it has {span}"]
    return []


def place_levels(levels: Sequence[float]) -> str:
    """State where to add light levels to these [cd/m2]: in the widest gap, or beyond the ends."""
    if levels[-1] / levels[0] < GOOD_SPAN:
        low, high = levels[-1] / GOOD_SPAN, levels[0] * GOOD_SPAN
        return f"down to {low:.3g} cd/m2 or up to {high:.3g} cd/m2"
    low, high = max(itertools.pairwise(levels), key=lambda pair: pair[1] / pair[0])
    return f"between {low:.3g} and {high:.3g} cd/m2"


def _plan_settings(series: IsoSeries) -> list[str]:
    found = []
    where, count = f"ISO {series.iso:g}", len(series.used)
    apertures = sorted({candidate.settings.f_number for candidate in series.used})
    if len(apertures) == 1:
        error = f"one aperture only at {where} (f/{apertures[0]:g}): its f-number error cannot average out"
        found.append(error)
    if 0 < count < FEW_POINTS:
        found.append(f"{where} has {count} usable frames: add {FEW_POINTS - count} more")
    return found


def _plan_times(series: IsoSeries, params: Params) -> list[str]:
    """Name the exposure times that catch a part of a period of the lamp's flicker."""
    mains, (_, depth) = params.mains_frequency_hz, find_modulation(params.lamp_kind, params.lamp_modulation)
    if mains is None:
        return []
    found = []
    for time_s in sorted({candidate.settings.exposure_time_s for candidate in series.used}):
        error = depth * compute_flicker(time_s, mains_frequency_hz=mains)
        if error > _FLICKER:
            found.append(
                f"{show_time(time_s)} at ISO {series.iso:g} is no whole number of half periods of "
                f"{mains:g} Hz mains: flicker errs by up to {error:.1%}, use multiples of "
                f"1/{2 * mains:g} s"
            )
    return found


def _doubt_readings(series: IsoSeries) -> list[str]:
    """Find the scenes whose frames and reading together disagree with the other scenes'."""
    luminances = {c.scene: c.luminance_cd_m2 for c in series.candidates if c.luminance_cd_m2 is not None}
    brightness = measure_brightness(series)
    ks = {
        scene: python_statistics.median(frames.values()) / luminances[scene]
        for scene, frames in brightness.items()
        if scene in luminances
    }
    if len(ks) < FEWEST_SCENES:
        return []
    usual = python_statistics.median(ks.values())
    return [
        f"the reading of scene {scene} is {usual / ks[scene]:.3g} times what its frames at ISO "
        f"{series.iso:g} give: check it, and its unit"
        for scene in sort_naturally(ks)
        if not abs(math.log(ks[scene] / usual)) <= math.log1p(DOUBTFUL_REL)
    ]


def _plan_readings(rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params) -> list[str]:
    shown = {row.scene for row in rows if row.role == "light" and row.scene}
    here = [reading for reading in readings if reading.scene in shown]
    scenes = summarise_scenes(here, panel_rho=params.panel_rho)
    found = []
    if scenes and max(scene.readings for scene in scenes) == 1:
        found.append("only one reading per scene: repeatability cannot be seen")
    illuminances = [reading.scene for reading in here if reading.quantity == "illuminance"]
    if scenes and len(illuminances) == len(set(illuminances)):
        found.append("no scene has two illuminance readings: a drifting lamp cannot be seen")
    advice: dict[str, str] = {
        codes.LAMP_DRIFT: "the lamp drifted in {where}: repeat its frames and readings",
        codes.RHO_CROSS_CHECK: "luminance and illuminance of {where} disagree: check both readings and rho",
    }
    found += [advice[raised.flag].format(where=raised.where) for raised in check_scenes(scenes)]
    meters = sorted(
        {r.meter or "" for r in here if r.quantity == "luminance" and r.expanded_uncertainty_rel is None}
    )
    found += [
        f"the meter {meter} has no certificate: its calibration uncertainty is not in that of K"
        if meter
        else "some luminance readings name no meter: its calibration uncertainty is not in that of K"
        for meter in meters
    ]
    return found
