"""First orientation of a rig's cameras, which no wrong pairing or numbering of the board misleads."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.opencv import cv2
from radiometry.geometry.bundle import View, find_pose
from radiometry.geometry.camera import CameraModel, project
from radiometry.geometry.rig.triggers import BoardPicture, Trigger

Vector = NDArray[np.float64]


def compose(first: Vector, then: Vector) -> Vector:
    """Return the pose of applying one pose and then another.

    Parameters
    ----------
    first, then : ndarray of float64
        Rodrigues vector and shift, (6,).

    Returns
    -------
    ndarray of float64
        Pose, (6,).
    """
    rotation, shift = cv2.composeRT(first[:3], first[3:], then[:3], then[3:])[:2]
    return np.concatenate((np.ravel(rotation), np.ravel(shift)))


def invert(pose: Vector) -> Vector:
    """Return the pose that undoes another.

    Parameters
    ----------
    pose : ndarray of float64
        Rodrigues vector and shift, (6,).

    Returns
    -------
    ndarray of float64
        Pose, (6,).
    """
    turned, _ = cv2.Rodrigues(-pose[:3])
    return np.concatenate((-pose[:3], -turned @ pose[3:]))


def start_rig(
    cameras: Sequence[CameraModel], triggers: Sequence[Trigger]
) -> tuple[Mapping[int, Vector], tuple[Trigger, ...]]:
    """Find the pose of each camera against the first, and one numbering of the board for all its pictures.

    Parameters
    ----------
    cameras : sequence of CameraModel
        Cameras of the rig, the reference first.
    triggers : sequence of Trigger
        Pictures that were taken together.

    Returns
    -------
    tuple of (mapping, tuple of Trigger)
        Pose by the camera's number, cameras that no trigger links left out; and the triggers, each picture
        numbered alike.

    Notes
    -----
    A checkerboard may be numbered from either end, a square one from every corner. Every trigger and
    numbering proposes a pose for the next camera; the one whose median distance to the corners of all
    triggers is least is taken, so that up to half of the triggers may be wrong.
    """
    seen = [{each.camera: each for each in trigger.pictures} for trigger in triggers]
    known: dict[int, Vector] = {0: np.zeros(6)}
    while True:
        shared = {
            camera: sum(camera in each and bool(known.keys() & each.keys()) for each in seen)
            for camera in range(len(cameras))
            if camera not in known
        }
        if not shared or not max(shared.values()):
            break
        chosen = max(shared, key=lambda camera: (shared[camera], -camera))
        boards = [_find_board(cameras, known, each) if chosen in each else None for each in seen]
        known[chosen], numbered = _propose(cameras[chosen], chosen, boards, seen)
        for place, picture in numbered.items():
            seen[place][chosen] = picture
    return known, tuple(
        replace(trigger, pictures=tuple(each[camera] for camera in sorted(each)))
        for trigger, each in zip(triggers, seen, strict=True)
    )


def _find_board(
    cameras: Sequence[CameraModel], known: Mapping[int, Vector], pictures: Mapping[int, BoardPicture]
) -> Vector | None:
    """Return the board's pose in the reference's frame, from the first known camera that sees it."""
    for camera in sorted(known.keys() & pictures.keys()):
        return compose(find_pose(cameras[camera], pictures[camera].view).vector, invert(known[camera]))
    return None


def _propose(
    model: CameraModel,
    camera: int,
    boards: Sequence[Vector | None],
    seen: Sequence[Mapping[int, BoardPicture]],
) -> tuple[Vector, dict[int, BoardPicture]]:
    choices = {
        place: (board, [replace(seen[place][camera], view=view) for view in _number(seen[place][camera])])
        for place, board in enumerate(boards)
        if board is not None
    }

    def miss(pose: Vector, board: Vector, view: View) -> float:
        placed = compose(board, pose)
        there = project(model, view.points_mm, placed[:3], placed[3:])
        return float(np.sqrt(((view.seen_px - there) ** 2).sum(axis=1).mean()))

    best: tuple[float, Vector] | None = None
    for board, pictures in choices.values():
        for picture in pictures:
            pose = compose(invert(board), find_pose(model, picture.view).vector)
            misses = [min(miss(pose, at, each.view) for each in others) for at, others in choices.values()]
            score = float(np.median(misses))
            if best is None or score < best[0]:
                best = score, pose
    assert best is not None  # noqa: S101  the camera shares a trigger with a known one
    pose = best[1]
    return pose, {
        place: min(pictures, key=lambda each: miss(pose, board, each.view))
        for place, (board, pictures) in choices.items()
    }


def _number(picture: BoardPicture) -> list[View]:
    """Return the corners in every numbering that a finder may give."""
    target, view = picture.target, picture.view
    if target.kind != "checkerboard" or len(view.seen_px) != target.corners:
        return [view]
    grid = view.seen_px.reshape(target.corner_rows, target.corner_columns, 2)
    turns = (0, 1, 2, 3) if target.corner_rows == target.corner_columns else (0, 2)
    return [replace(view, seen_px=np.rot90(grid, turn).reshape(-1, 2)) for turn in turns]
