"""Agreement of a light frame with its scene: with the readings, and with the other frames."""

import statistics as python_statistics
from collections.abc import Iterable, Sequence
from functools import cache

from radiometry.drawing.text import sort_naturally
from radiometry.findings import Reason, shared
from radiometry.frame.exposure import Settings, compute_rhs
from radiometry.luminance import codes
from radiometry.luminance.exposure import USEFUL_SHARE
from radiometry.luminance.messages import show_settings
from radiometry.luminance.points import Candidate, IsoSeries, is_below_detection, is_saturated
from radiometry.luminance.rows import FrameRow, Params, Reading
from radiometry.luminance.scenes import check_scenes, summarise_scenes

DOUBTFUL_REL = 0.25
"""Distance of a frame's brightness from the median of its scene. Markings of aperture and time err by up to
5.6 % and 6.7 %, a lens that vignettes wide open by some more; a next light level lies further off."""

LIKE_REL = 0.10
"""A scene that a doubtful frame would fit better agrees with it to what markings err."""

_MOST_NAMES = 4


def inspect_scenes(
    rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params
) -> dict[str, list[Reason]]:
    """Check which light frames lack a scene or its reading, and in which scenes the lamp drifted.

    Returns
    -------
    dict of str to list of Reason
        Reasons by name of the frame. Fail: `scene_missing`. Pending:
        `reading_missing`. Warn: `lamp_drift`.
    """
    read = sort_naturally({reading.scene for reading in readings if reading.quantity == "luminance"})
    scenes = summarise_scenes(readings, panel_rho=params.panel_rho)
    drifts = {
        raised.where: raised.detail for raised in check_scenes(scenes) if raised.flag == codes.LAMP_DRIFT
    }

    @cache
    def inspect(scene: str | None) -> list[Reason]:
        if not scene:
            detail = "Nobody said which light level this frame shows: give it its scene."
            return [codes.SCENE_MISSING.reason(detail)]
        reasons = [] if scene in read else [_reading_missing(scene, read)]
        if f"scene {scene}" in drifts:
            detail = (
                f"{drifts[f'scene {scene}']} The lamp drifted in scene {scene}: let it warm up, then "
                "repeat the frames and the readings of this level."
            )
            reasons.append(codes.LAMP_DRIFT.reason(detail))
        return reasons

    return {row.frame: inspect(row.scene) for row in rows if row.role == "light"}


def _reading_missing(scene: str, read: Sequence[str]) -> Reason:
    named = ", ".join(read[:_MOST_NAMES]) + (
        f" and {len(read) - _MOST_NAMES} more" if len(read) > _MOST_NAMES else ""
    )
    there = f"; there are readings of {named}" if read else ""
    detail = (
        f"Scene {scene} has no luminance reading{there}. Read the meter while the lamp still "
        "burns at this level, or correct the name."
    )
    return codes.READING_MISSING.reason(detail)


def find_repeats(rows: Sequence[FrameRow], params: Params) -> dict[str, list[Reason]]:
    """Find the light frames that repeat another of the same scene and settings.

    Returns
    -------
    dict of str to list of Reason
        `redundant` (warn) by name of the frame; the first frame by name is not
        among them.
    """
    groups: dict[tuple[str, Settings], list[str]] = {}
    for row in sorted(rows, key=lambda row: row.frame):
        if row.role == "light" and row.scene:
            groups.setdefault((row.scene, row.settings_on(params.exposure_basis)), []).append(row.frame)
    found: dict[str, list[Reason]] = {}
    for (scene, settings), (earlier, *repeats) in groups.items():
        detail = (
            f"{earlier} shows scene {scene} at {show_settings(settings)} already: a repeat "
            "shares the errors of reading and aperture and adds next to nothing. Change the aperture or "
            "the level."
        )
        reasons = [shared.REDUNDANT.reason(detail, "warn")]
        found |= dict.fromkeys(repeats, reasons)
    return found


def measure_brightness(series: IsoSeries) -> dict[str, dict[str, float]]:
    """Compute the signal above dark per t S / f^2 of each frame, which is K L.

    Parameters
    ----------
    series : IsoSeries
        Frames of one ISO value.

    Returns
    -------
    dict of str to dict of str to float
        By scene and frame, for frames whose signal is neither clipped nor weak
        [DN*m2/(cd*s) times cd/m2]. The exposure settings of a frame cancel, its
        light does not.
    """

    def sum_up() -> dict[str, dict[str, float]]:
        found: dict[str, dict[str, float]] = {}
        for candidate in series.candidates:
            value = candidate.keep("brightness", None, _measure_one, candidate)
            if value is not None:
                found.setdefault(candidate.scene, {})[candidate.frame] = value
        return found

    return series.keep("brightness", None, sum_up)


def _measure_one(candidate: Candidate) -> float | None:
    lost = is_saturated(candidate.signal) or is_below_detection(candidate.signal, candidate.dark)
    if lost or candidate.above_dark_dn < USEFUL_SHARE * candidate.span_dn:
        return None
    return candidate.above_dark_dn / _per_luminance(candidate)


def expect_signals(series: IsoSeries, brightness: dict[str, dict[str, float]]) -> dict[str, float]:
    """Predict the signal above dark of clipped frames from the other frames of their scene.

    Parameters
    ----------
    series : IsoSeries
        Frames of one ISO value.
    brightness : dict of str to dict of str to float
        Result of `measure_brightness`.

    Returns
    -------
    dict of str to float
        Signal above dark by name of the frame [DN].
    """
    medians = {scene: python_statistics.median(frames.values()) for scene, frames in brightness.items()}
    return {
        candidate.frame: medians[candidate.scene] * _per_luminance(candidate)
        for candidate in series.candidates
        if is_saturated(candidate.signal) and candidate.scene in medians
    }


def inspect_agreement(brightness: dict[str, dict[str, float]]) -> dict[str, list[Reason]]:
    """Find the frames of one ISO value that disagree with their scene, and the scene that they would fit.

    Parameters
    ----------
    brightness : dict of str to dict of str to float
        Result of `measure_brightness`.

    Returns
    -------
    dict of str to list of Reason
        `scene_doubtful` (warn) by name of the frame.

    Notes
    -----
    A frame is compared with the median of its scene's frames, itself among them. If
    two disagree, it is not known which is wrong, and both are named.
    """
    medians = {scene: python_statistics.median(frames.values()) for scene, frames in brightness.items()}
    found = {}
    for scene, frames in brightness.items():
        for frame, value in frames.items():
            ratio = value / medians[scene]
            if abs(ratio - 1.0) > DOUBTFUL_REL:
                fitting = _find_fitting(value, medians.items())
                found[frame] = [_doubtful(scene, ratio, fitting)]
    return found


def _find_fitting(value: float, medians: Iterable[tuple[str, float]]) -> str:
    distances = sorted((abs(value / median - 1.0), scene) for scene, median in medians)
    return distances[0][1] if distances and distances[0][0] <= LIKE_REL else ""


def _doubtful(scene: str, ratio: float, fitting: str) -> Reason:
    hint = f"It would fit scene {fitting}. " if fitting else ""
    detail = (
        f"Its settings taken into account, this frame is {ratio:.2f} times as bright as the frames of scene "
        f"{scene} at this ISO. {hint}Check its scene; if that is right, the lamp or the camera "
        "moved: take it again."
    )
    return codes.SCENE_DOUBTFUL.reason(detail)


def _per_luminance(candidate: Candidate) -> float:
    return compute_rhs(candidate.settings, luminance_cd_m2=1.0)
