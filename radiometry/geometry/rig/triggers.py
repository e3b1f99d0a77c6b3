"""Pictures of several cameras that were taken together."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from radiometry.frame import FrameHeader
from radiometry.geometry.bundle import View
from radiometry.geometry.target import Target

WITHIN_S: Final = 1.0
"""EXIF times are whole seconds."""


@dataclass(frozen=True)
class BoardPicture:
    """Picture of a board by one camera of a rig.

    Attributes
    ----------
    frame : str
        Name of the frame.
    camera : int
        Number of the camera in the rig.
    scene : str or None
        Name of the trigger, if it was given.
    header : FrameHeader
        Header of the frame.
    target : Target
        Board.
    view : View
        Corners.
    """

    frame: str
    camera: int
    scene: str | None
    header: FrameHeader
    target: Target
    view: View


@dataclass(frozen=True)
class Trigger:
    """Pictures that were taken together, one per camera."""

    name: str
    pictures: tuple[BoardPicture, ...]


def pair_pictures(pictures: Sequence[BoardPicture]) -> tuple[tuple[Trigger, ...], dict[str, str]]:
    """Group pictures by trigger.

    Parameters
    ----------
    pictures : sequence of BoardPicture
        Pictures of all cameras.

    Returns
    -------
    tuple of (tuple of Trigger, dict)
        Triggers with two cameras or more, by name, and the reason why a frame is in none.

    Notes
    -----
    Pictures belong together that have the same scene, else the same capture identifier (multispectral
    cameras), else times that agree within `WITHIN_S`. A camera has one picture of a trigger: where it has
    two, neither counts.
    """
    groups: dict[str, list[BoardPicture]] = {}
    timed: list[tuple[datetime, BoardPicture]] = []
    why: dict[str, str] = {}
    for picture in sorted(pictures, key=lambda each: (each.camera, each.frame)):
        capture = picture.header.multispectral.capture_id if picture.header.multispectral else None
        if picture.scene or capture:
            groups.setdefault(str(picture.scene or capture), []).append(picture)
        elif picture.header.taken_at:
            timed.append((datetime.fromisoformat(picture.header.taken_at).replace(tzinfo=None), picture))
        else:
            why[picture.frame] = "it has no scene, no capture identifier and no time"
    begun: datetime | None = None
    for taken, picture in sorted(timed, key=lambda each: (each[0], each[1].camera, each[1].frame)):
        if begun is None or taken - begun > timedelta(seconds=WITHIN_S):
            begun = taken
        groups.setdefault(begun.isoformat(), []).append(picture)
    triggers = []
    for name, members in sorted(groups.items()):
        counts = Counter(each.camera for each in members)
        kept = tuple(each for each in members if counts[each.camera] == 1)
        why |= {
            each.frame: f"its camera has {counts[each.camera]} pictures of trigger {name}"
            for each in members
            if each not in kept
        }
        if len(kept) > 1:
            triggers.append(Trigger(name, kept))
        else:
            why |= {each.frame: f"no other camera has a picture of trigger {name}" for each in kept}
    return tuple(triggers), why
