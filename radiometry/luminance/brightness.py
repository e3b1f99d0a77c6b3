"""Light of a scene as its frames show it, and the frames and readings that disagree."""

import math
import statistics as python_statistics
from collections.abc import Iterable, Sequence

from radiometry.drawing.text import name_few, sort_naturally
from radiometry.findings import Reason
from radiometry.frame.exposure import compute_rhs
from radiometry.luminance import codes, points
from radiometry.luminance.points import Candidate, IsoSeries
from radiometry.luminance.rows import Reading
from radiometry.records import Record

USEFUL_SHARE = 0.01
"""Of the span. Black levels wander between frames by about a ten-thousandth of it (0.4 DN of 12 bits), which
is 1 % of such a signal and more of a weaker one."""

DOUBTFUL_REL = 0.25
"""Distance of a frame's brightness from the median of its scene. Markings of aperture and time err by up to
5.6 % and 6.7 %, a lens that vignettes wide open by some more; a next light level lies further off."""

_GRAVE = 2.0
"""A reading that differs from its frames by this factor is a slip: of its point, its unit or its row."""

LIKE_REL = 0.10  # a scene that a doubtful frame would fit better agrees with it to what markings err


def measure_brightness(series: IsoSeries) -> dict[str, dict[str, float]]:
    """Compute the signal above dark per t S / f^2 of each frame, which is K L."""

    def sum_up() -> dict[str, dict[str, float]]:
        found: dict[str, dict[str, float]] = {}
        for candidate in series.candidates:
            value = candidate.keep("brightness", None, _measure_one, candidate)
            if value is not None:
                found.setdefault(candidate.scene, {})[candidate.frame] = value
        return found

    return series.keep("brightness", None, sum_up)


def _measure_one(candidate: Candidate) -> float | None:
    lost = points.is_saturated(candidate.signal) or points.is_below_detection(
        candidate.signal, candidate.dark
    )
    if lost or candidate.above_dark_dn < USEFUL_SHARE * candidate.span_dn:
        return None
    return candidate.above_dark_dn / _per_luminance(candidate)


def measure_light(series: Sequence[IsoSeries]) -> dict[str, float]:
    """Return K L of each scene, which is nearly the same at all ISO values [DN*m2/(cd*s) times cd/m2]."""
    found: dict[str, list[float]] = {}
    for one in series:
        for scene, frames in measure_brightness(one).items():
            found.setdefault(scene, []).extend(frames.values())
    return {scene: python_statistics.median(values) for scene, values in found.items()}


class Doubted(Record):
    """A luminance reading that the frames of its scene speak against."""

    scene: str
    reading_cd_m2: float
    frames_cd_m2: float  # what they say, by the K of the other scenes
    frames: tuple[str, ...]
    fits: str  # scene beside it whose frames agree, where a list was typed a row off
    reason: str  # of who kept it

    @property
    def is_grave(self) -> bool:
        return not 1 / _GRAVE < self.reading_cd_m2 / self.frames_cd_m2 < _GRAVE

    def describe(self) -> str:
        said = f"{self.reading_cd_m2:.3g} cd/m2, its frames say {self.frames_cd_m2:.2g}"
        fits = f", and it fits {name_few('scene', [self.fits])}" if self.fits else ""
        kept = f". It was kept: {self.reason.rstrip('.')}" if self.reason else ""
        return f"{name_few('scene', [self.scene])}: {said}{fits}{kept}"


def find_doubted(series: Sequence[IsoSeries], readings: Sequence[Reading]) -> list[Doubted]:
    """Find the readings that disagree with the ratio of signal and reading that most scenes have."""
    light = measure_light(series)
    read: dict[str, list[float]] = {}
    reasons = {(each.scene, each.value): each.reason or "" for each in readings}
    for each in readings:
        if each.quantity == "luminance" and each.scene in light:
            read.setdefault(each.scene, []).append(each.value)
    if len(read) < points.FEWEST_SCENES:
        return []
    usual, misplaced = _compare_rows(
        light, {scene: python_statistics.median(values) for scene, values in read.items()}
    )
    frames: dict[str, set[str]] = {}
    for one in series:
        for candidate in one.candidates:
            frames.setdefault(candidate.scene, set()).add(candidate.frame)
    return [
        Doubted(
            scene=scene,
            reading_cd_m2=value,
            frames_cd_m2=light[scene] / usual,
            frames=tuple(sorted(frames[scene])),
            fits=misplaced.get(scene, ""),
            reason=reasons[scene, value],
        )
        for scene in sort_naturally(read)
        for value in sorted(set(read[scene]))
        if not _agrees(light[scene] / value, usual)
    ]


def _agrees(ratio: float, usual: float) -> bool:
    return abs(math.log(ratio / usual)) <= math.log1p(DOUBTFUL_REL)


def _compare_rows(light: dict[str, float], read: dict[str, float]) -> tuple[float, dict[str, str]]:
    """Return the ratio of light and reading that most scenes have, and what scenes misplaced readings fit.

    A list that is typed a row off may hold more wrong readings than right ones.
    """
    scenes = sort_naturally(light)
    own = {scene: light[scene] / value for scene, value in read.items()}
    usual = python_statistics.median(own.values())
    most, found = sum(_agrees(ratio, usual) for ratio in own.values()), (usual, dict[str, str]())
    for row, meant in ((scenes[1:], scenes), (scenes, scenes[1:])):
        beside = {at: (light[to] / read[at], to) for at, to in zip(row, meant, strict=False) if at in read}
        usual = python_statistics.median(ratio for ratio, _ in beside.values())
        kept = [scene for scene, ratio in own.items() if _agrees(ratio, usual)]
        moved = {at: to for at, (ratio, to) in beside.items() if at not in kept and _agrees(ratio, usual)}
        if len(moved) > 1 and len(kept) + len(moved) > most:
            most, found = len(kept) + len(moved), (usual, moved)
    return found


def expect_signals(series: IsoSeries, brightness: dict[str, dict[str, float]]) -> dict[str, float]:
    """Predict the signal above dark of clipped frames from the other frames of their scene."""
    medians = {scene: python_statistics.median(frames.values()) for scene, frames in brightness.items()}
    return {
        candidate.frame: medians[candidate.scene] * _per_luminance(candidate)
        for candidate in series.candidates
        if points.is_saturated(candidate.signal) and candidate.scene in medians
    }


def inspect_agreement(brightness: dict[str, dict[str, float]]) -> dict[str, list[Reason]]:
    """Find the frames of one ISO value that disagree with their scene, and the scene that they would fit.

    A frame is compared with the median of its scene's frames, itself among them. If two disagree, it is not
    known which is wrong, and both are named.
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
