"""Boresight angles and place of a camera from its pose against the reference."""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.fitting.evidence import MOST_DOF, Quantity
from radiometry.frame.opencv import cv2
from radiometry.geometry.rig.results import RelativePose

Matrix = NDArray[np.float64]

MM_PER_M: Final = 1000.0
_STEPS: Final = np.array([1e-6] * 3 + [1e-3] * 3)


def describe_pose(
    serial: str, pose: Matrix, parts: Sequence[tuple[Matrix, float]], *, triggers: int
) -> RelativePose:
    """Return a camera's orientation with its angles.

    Parameters
    ----------
    serial : str
        Serial number of the camera.
    pose : ndarray of float64
        Rodrigues vector [rad] and translation [mm], (6,).
    parts : sequence of tuple of (ndarray of float64, float)
        Covariances of independent causes, (6, 6), and their degrees of freedom; the last is of the cameras'
        own uncertainties.
    triggers : int
        Number of triggers that were used.

    Notes
    -----
    The camera's axes in the reference's frame are the columns of R' = Ry(yaw) Rx(pitch) Rz(roll): yaw turns
    to the right, pitch upwards, roll clockwise. The uncertainty of the angle between the optical axes is
    that of the axis in its least certain direction. Effective degrees of freedom are Welch and
    Satterthwaite's (JCGM 100, G.4.1).
    """
    covariance = np.sum([part for part, _ in parts], axis=0)
    slopes = np.column_stack(
        [(_compute(pose + step) - _compute(pose - step)) / (2.0 * step.sum()) for step in np.diag(_STEPS)]
    )
    spread = slopes @ covariance @ slopes.T
    restless = np.sum([np.diag(slopes @ part @ slopes.T) ** 2 / dof for part, dof in parts], axis=0)
    dofs = np.full(len(restless), MOST_DOF)
    np.divide(np.diag(spread) ** 2, restless, out=dofs, where=restless > 0.0)
    values, u = _compute(pose), np.sqrt(np.diag(spread))
    unit = np.array([1.0] * 3 + [1.0 / MM_PER_M] * 3)
    matrix = np.asarray(cv2.Rodrigues(pose[:3])[0], np.float64)
    angles = [
        Quantity(value=math.degrees(values[place]), standard_uncertainty=math.degrees(u[place]), unit="deg")
        for place in range(3)
    ]
    places = [
        Quantity(value=values[place] / MM_PER_M, standard_uncertainty=u[place] / MM_PER_M, unit="m")
        for place in range(3, 6)
    ]
    axis_u = math.sqrt(float(np.linalg.eigvalsh(spread[6:, 6:])[-1]))
    stated = dict(zip(("yaw", "pitch", "roll", "x", "y", "z"), map(float, dofs[:6]), strict=True))
    boresight = math.atan2(math.hypot(matrix[2, 0], matrix[2, 1]), matrix[2, 2])

    def list_rows(rows: Matrix) -> tuple[tuple[float, ...], ...]:
        return tuple(tuple(float(value) for value in row) for row in rows)

    return RelativePose(
        camera=serial,
        rotation=tuple(float(each) for each in pose[:3]),
        matrix=list_rows(matrix),
        translation_m=tuple(float(each) / MM_PER_M for each in pose[3:]),
        covariance=list_rows(covariance * np.outer(unit, unit)),
        orientation_covariance=list_rows((covariance - parts[-1][0]) * np.outer(unit, unit)),
        effective_dof=stated | {"boresight": float(dofs[6:].min())},
        yaw=angles[0],
        pitch=angles[1],
        roll=angles[2],
        boresight=Quantity(
            value=math.degrees(boresight), standard_uncertainty=math.degrees(axis_u), unit="deg"
        ),
        x=places[0],
        y=places[1],
        z=places[2],
        triggers=triggers,
    )


def _compute(pose: Matrix) -> Matrix:
    """Return yaw, pitch and roll [rad], the camera's centre [mm], and its optical axis."""
    axes = np.asarray(cv2.Rodrigues(pose[:3])[0], np.float64).T
    angles = [math.atan2(axes[0, 2], axes[2, 2]), math.asin(-axes[1, 2]), math.atan2(axes[1, 0], axes[1, 1])]
    return np.concatenate((angles, -axes @ pose[3:], axes[:, 2]))
