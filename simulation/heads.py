"""Rigs of several cameras in front of one board."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from radiometry.geometry.camera import CameraModel, Pose, project
from radiometry.geometry.target import Target, locate_corners_mm
from simulation.boards import draw_poses, shows_all

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Mounted:
    """Camera of a rig: X_camera = R X_reference + t, as a Rodrigues vector and t [mm], (6,)."""

    model: CameraModel
    pose: Vector

    def move(self, board: Pose, *, by: Vector | None = None) -> Pose:
        """Return where this camera sees a board that the reference sees in a pose.

        ``by`` is a deviation of this camera's own pose, as a mount that gives way or a late trigger makes it.
        """
        mine = self.pose if by is None else self.pose + by
        rotation, shift = cv2.composeRT(board.rotation, board.shift, mine[:3], mine[3:])[:2]
        return Pose(np.ravel(rotation), np.ravel(shift))


def draw_boards(
    cameras: Sequence[Mounted],
    board: Target,
    random: np.random.Generator,
    *,
    count: int,
) -> tuple[Pose, ...]:
    """Draw poses, in the reference's frame, in which every camera sees the whole board."""
    corners = locate_corners_mm(board, np.arange(board.corners))
    found: list[Pose] = []
    while len(found) < count:
        (pose,) = draw_poses(cameras[0].model, board, random, count=1, tilt_deg=35.0)
        if all(shows_all(each.model, corners, each.move(pose)) for each in cameras):
            found.append(pose)
    return tuple(found)


def see(camera: Mounted, board: Target, pose: Pose, *, by: Vector | None = None) -> Vector:
    """Return the corners of a board in a camera's picture [px], (corner, 2), row before col."""
    there = camera.move(pose, by=by)
    return project(
        camera.model, locate_corners_mm(board, np.arange(board.corners)), there.rotation, there.shift
    )
