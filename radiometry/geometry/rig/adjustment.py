"""Adjustment of a rig: poses of boards and cameras that fit the corners best."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.fitting.evidence import MOST_DOF
from radiometry.frame.opencv import cv2
from radiometry.geometry.bundle import find_pose
from radiometry.geometry.camera import PARAMETERS, CameraModel
from radiometry.geometry.descent import Linear, Minimum, minimise
from radiometry.geometry.rig.start import compose, invert
from radiometry.geometry.rig.triggers import BoardPicture, Trigger

POSE: Final = 6


CAMERA: Final = len(PARAMETERS)


Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class RigCamera:
    """Calibrated camera of a rig.

    Attributes
    ----------
    serial : str
        Serial number.
    model : CameraModel
        Camera as its geometry version states it.
    covariance : ndarray of float64
        Covariance of PARAMETERS, (9, 9).
    noise_px : float
        Standard deviation of a corner in row and in col [px].
    dof : float, default: MOST_DOF
        Degrees of freedom of `covariance`.
    """

    serial: str
    model: CameraModel
    covariance: Matrix
    noise_px: float
    dof: float = MOST_DOF


def linearise_rig(
    cameras: Sequence[RigCamera], trigger: Trigger, shared: Matrix, board: Matrix, *, whole: bool = False
) -> Linear:
    """Return residuals over noise and derivatives; ``whole`` adds those by the parameters of all cameras."""
    poses = POSE * (len(cameras) - 1)
    residuals, of_shared, of_board = [], [], []
    for picture in trigger.pictures:
        number, camera = picture.camera, cameras[picture.camera]
        placed, by_board, by_camera = board, np.eye(POSE), np.zeros((POSE, POSE))
        if number:
            mine = shared[POSE * (number - 1) : POSE * number]
            parts = cv2.composeRT(board[:3], board[3:], mine[:3], mine[3:])
            placed = np.concatenate((np.ravel(parts[0]), np.ravel(parts[1])))
            by_board = np.block([[parts[2], parts[3]], [parts[6], parts[7]]])
            by_camera = np.block([[parts[4], parts[5]], [parts[8], parts[9]]])
        seen, jacobian = cv2.projectPoints(
            picture.view.points_mm, placed[:3], placed[3:], camera.model.matrix, camera.model.distortion
        )
        slopes = np.asarray(jacobian, np.float64) / camera.noise_px
        residual = picture.view.seen_px[:, ::-1] - np.asarray(seen).reshape(-1, 2)
        rows = np.zeros((len(slopes), poses + (CAMERA * len(cameras) if whole else 0)))
        if number:
            rows[:, POSE * (number - 1) : POSE * number] = slopes[:, :POSE] @ by_camera
        if whole:
            rows[:, poses + CAMERA * number : poses + CAMERA * (number + 1)] = slopes[:, POSE:]
        residuals.append(residual.ravel() / camera.noise_px)
        of_shared.append(rows)
        of_board.append(slopes[:, :POSE] @ by_board)
    return Linear(np.concatenate(residuals), np.concatenate(of_shared), np.concatenate(of_board))


def solve_rig(cameras: Sequence[RigCamera], triggers: Sequence[Trigger], shared: Matrix) -> Minimum:
    """Return the poses and intrinsics that fit the corners of all triggers best."""
    boards = [_find_board(cameras, trigger.pictures, shared) for trigger in triggers]
    return minimise(
        lambda block, values, board: linearise_rig(cameras, triggers[block], values, board),
        shared,
        np.array(boards),
    )


def read_pose(shared: Matrix, number: int) -> Matrix:
    """Return the pose of a camera; the reference, number 0, is the origin."""
    return shared[POSE * (number - 1) : POSE * number] if number else np.zeros(POSE)


def _find_board(cameras: Sequence[RigCamera], pictures: Sequence[BoardPicture], shared: Matrix) -> Matrix:
    first = pictures[0]
    seen = find_pose(cameras[first.camera].model, first.view).vector
    return compose(seen, invert(read_pose(shared, first.camera)))


def fit_board(cameras: Sequence[RigCamera], trigger: Trigger, shared: Matrix) -> Matrix:
    """Return the pose of the board that fits pictures of one trigger best, the rig fixed."""

    def linearise(_: int, __: Matrix, board: Matrix) -> Linear:
        residuals, of_shared, of_board = linearise_rig(cameras, trigger, shared, board)
        return Linear(residuals, of_shared[:, :0], of_board)

    board = _find_board(cameras, trigger.pictures, shared)
    for _ in range(20):
        residuals, _, of_board = linearise(0, shared, board)
        board = board + np.linalg.lstsq(of_board, residuals, rcond=None)[0]
    return board
