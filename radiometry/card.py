"""Roles and scenes of the frames of a card, and the campaign that they suit, from their headers."""

import re
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from statistics import median
from typing import Final

from radiometry.drawing.text import natural_key
from radiometry.methods import METHODS
from radiometry.records import Record
from radiometry.specification.application import PictureApplication
from radiometry.specification.method import MethodSpec
from radiometry.specification.roles import CHART, DARK, FIELD, Role

_PAUSE_S: Final = 60.0  # a pause this long starts a scene, if it is also _PAUSES times the median pause
_PAUSES: Final = 2.5
_EXPOSURE_RATIO: Final = 4.0  # a change of t S / f^2 by this factor starts a scene after two median pauses
_DARK_SIGNAL: Final = 0.002  # the centre of a dark frame is below this share of the range from black to white
_SERIES: Final = 3  # more exposure times with two frames each, at one f-number, are a series
_PICTURES: Final = (".jpg", ".jpeg", ".png", ".heic")
# folders that cameras make (DCF: three digits and five characters), which name no scene
_CAMERA_FOLDER: Final = re.compile(r"dcim|\d{3}\w{5}|\d{4}set|\d{3}|dji_\d+_.*", re.IGNORECASE)


class CardFrame(Record):
    """A frame as its header states it, with its role; ``scene`` of one that its campaign has already."""

    name: str  # path with "/", from the folder that was chosen
    size_bytes: float | None = None
    taken_s: float = 0.0
    exposure_time_s: float | None = None
    f_number: float | None = None
    iso: float | None = None
    band: str | None = None
    signal_share: float | None = None
    role: str = ""
    scene: str | None = None

    @property
    def is_dark(self) -> bool:
        return self.signal_share is not None and self.signal_share < _DARK_SIGNAL

    @property
    def exposure(self) -> float:
        """Return t S / f^2; 0 for a file that lacks the time."""
        f_number = self.f_number or 1.0
        return (self.exposure_time_s or 0.0) * (self.iso or 100.0) / f_number / f_number


def choose_methods(
    frames: Sequence[CardFrame], in_force: Collection[str]
) -> tuple[MethodSpec, MethodSpec | None, bool]:
    """Choose the campaign that the frames of a card suit.

    Parameters
    ----------
    frames : sequence of CardFrame
        At least one.
    in_force : collection of str
        Methods of which the camera has a version in force.

    Returns
    -------
    tuple[MethodSpec, MethodSpec or None, bool]
        Method to calibrate, that of a night of measurements, and whether the frames look like one.
    """
    pictures = all(frame.name.lower().endswith(_PICTURES) for frame in frames)
    able = [spec for spec in METHODS if not pictures or all(role == CHART for role in _roles(spec))]
    words = _words(able)
    named = [role for frame in frames if (role := _name_role(frame.name, words))]
    bands = len({frame.band for frame in frames if frame.band}) > 1

    def score(spec: MethodSpec) -> int:
        own = {role.name for role in spec.roles}
        suits = sum(1 if role in own else -1 for role in named if role != FIELD.name)
        return suits + bands * (len(frames) if spec.reference == "panel" else -len(frames))

    measuring = [
        spec for spec in able if spec.application and not isinstance(spec.application, PictureApplication)
    ]
    measuring.sort(key=lambda spec: (spec.name not in in_force, (spec.reference == "panel") != bands))
    night = measuring[0] if measuring else None
    if named:
        looks_like_night = all(role == FIELD.name for role in named)
    else:
        apart = len(_list_folders(_below_common_folder(frames))) > 1 or any(frame.is_dark for frame in frames)
        looks_like_night = night is not None and night.name in in_force and not apart
    best = max(able, key=score)
    lit = [frame for frame in frames if not frame.is_dark]
    times = Counter(frame.exposure_time_s for frame in lit if frame.exposure_time_s)
    paired = [time_s for time_s, count in times.items() if count > 1]
    by_time = len(paired) > _SERIES and max(paired) > _EXPOSURE_RATIO * min(paired)
    if by_time and len({frame.f_number for frame in lit}) == 1 and best.grid.rows == "f_number":
        others = [spec for spec in able if spec.grid.rows == "exposure_time_s"]
        best = next((spec for spec in others if score(spec) == score(best)), best)
    return best, night, looks_like_night and night is not None


def sort_card(
    frames: Sequence[CardFrame], spec: MethodSpec, *, night: bool, there: Sequence[CardFrame] = ()
) -> list[CardFrame]:
    """Return each frame with role and scene, in its order.

    Parameters
    ----------
    frames : sequence of CardFrame
        As the card has them.
    spec : MethodSpec
        Method of the campaign.
    night : bool
        True for a campaign of measurements.
    there : sequence of CardFrame, optional
        Frames in the scenes of the campaign, which go on.
    """
    if night:
        return [replace(frame, role=FIELD.name) for frame in frames]
    roles = {role.name: role for role in _roles(spec)}
    usual = next((role for role in roles.values() if role.has_scene), spec.roles[0])
    words = _words([spec])
    named = [_name_role(frame.name, words) for frame in frames]
    # where people name their dark frames, what else is dark is a light frame of a weak lamp
    seen_by_centre = DARK.name in roles and DARK.name not in named
    placed = []
    for frame, below, stated in zip(frames, _below_common_folder(frames), named, strict=True):
        role = stated or (DARK.name if seen_by_centre and frame.is_dark else usual.name)
        placed.append(replace(below, role=role))
    lit = [frame for frame in placed if frame.role in roles and roles[frame.role].has_scene]
    scenes = _name_scenes(lit, there)
    return [replace(frame, scene=scenes.get(frame.name)) for frame in placed]


def split_scenes(frames: Iterable[CardFrame]) -> list[list[CardFrame]]:
    """Split frames at long pauses and at changes of the exposure, in the order of their times."""
    ordered = sorted(frames, key=lambda frame: (frame.taken_s, natural_key(frame.name)))
    usual = median([after.taken_s - before.taken_s for before, after in pairwise(ordered)] or [0.0])
    scenes = [ordered[:1]] if ordered else []
    for before, after in pairwise(ordered):
        pause = after.taken_s - before.taken_s
        low, high = sorted((before.exposure, after.exposure))
        changed = low > 0 and high > _EXPOSURE_RATIO * low
        if pause >= max(_PAUSE_S, _PAUSES * usual) or (changed and usual > 0 and pause >= 2 * usual):
            scenes.append([])
        scenes[-1].append(after)
    return scenes


def _name_scenes(lit: Sequence[CardFrame], there: Sequence[CardFrame]) -> dict[str, str]:
    """Name scenes after their folders; frames of one folder, or of none, are split by time."""
    folders = _list_folders(lit)
    if len(folders) == 1:
        loose = [frame for frame in lit if _folder(frame.name) not in folders]
        folders = [] if loose or len(split_scenes(lit)) > 1 else folders
    named = {frame.name: _folder(frame.name) for frame in lit if _folder(frame.name) in folders}
    used = {frame.scene for frame in there} | set(named.values())
    fresh = (name for number in range(1, len(lit) + len(used) + 1) if (name := f"Scene {number}") not in used)
    for some in split_scenes([*(frame for frame in lit if frame.name not in named), *there]):
        known = Counter(frame.scene for frame in some if frame.scene)
        if new := [frame for frame in some if frame.scene is None]:
            scene = known.most_common(1)[0][0] if known else next(fresh)
            named |= {frame.name: scene or "" for frame in new}
    return named


def _roles(spec: MethodSpec) -> tuple[Role, ...]:
    return (*spec.roles, *spec.applied_roles)


def _words(specs: Iterable[MethodSpec]) -> list[str]:
    return [*dict.fromkeys(role.name for spec in specs for role in spec.roles if not role.has_scene)]


def _name_role(path: str, words: Sequence[str]) -> str | None:
    """Return the role that a folder's name begins with or a file's name contains; field: a folder alone."""
    *folders, file = path.lower().split("/")
    for role in (*words, FIELD.name):
        if any(folder.startswith(role) for folder in folders) or (role != FIELD.name and role in file):
            return role
    return None


def _below_common_folder(frames: Sequence[CardFrame]) -> list[CardFrame]:
    """Without the folder that was chosen: it is the card's or the night's, and names no scene."""
    heads = {frame.name.partition("/")[0] if "/" in frame.name else "" for frame in frames}
    if len(heads) != 1 or heads == {""}:
        return list(frames)
    return [replace(frame, name=frame.name.partition("/")[2]) for frame in frames]


def _folder(path: str) -> str:
    return next((part for part in path.split("/")[-2::-1] if not _CAMERA_FOLDER.fullmatch(part)), "")


def _list_folders(frames: Iterable[CardFrame]) -> list[str]:
    return [*dict.fromkeys(folder for frame in frames if (folder := _folder(frame.name)))]
