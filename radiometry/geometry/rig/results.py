"""Orientation of a rig, ready for JSON, and the angles that describe a pose."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import Raised
from radiometry.fitting.evidence import MOST_DOF, Quantity
from radiometry.frame.opencv import cv2
from radiometry.specification.stored import about

__all__ = ["describe_pose"]


@dataclass(frozen=True, kw_only=True)
class RelativePose:
    """Orientation of one camera against the reference: X_camera = R X_reference + t."""

    camera: str = field(metadata=about("Serial number of the camera."))
    rotation: tuple[float, ...] = field(metadata=about("Rodrigues vector of R [rad]."))
    matrix: tuple[tuple[float, ...], ...] = field(metadata=about("R, (3, 3)."))
    translation_m: tuple[float, ...] = field(metadata=about("t [m]."))
    covariance: tuple[tuple[float, ...], ...] = field(
        metadata=about(
            "Covariance of rotation [rad] and translation [m], (6, 6), the cameras' own uncertainties "
            "included."
        )
    )
    orientation_covariance: tuple[tuple[float, ...], ...] = field(
        metadata=about("The same for the cameras exactly as calibrated.")
    )
    yaw: Quantity = field(
        metadata=about(
            "Boresight angles: the camera's axes in the reference's frame are Ry(yaw) Rx(pitch) Rz(roll)."
        )
    )
    pitch: Quantity = field(
        metadata=about(
            "Boresight angles: the camera's axes in the reference's frame are Ry(yaw) Rx(pitch) Rz(roll)."
        )
    )
    roll: Quantity = field(
        metadata=about(
            "Boresight angles: the camera's axes in the reference's frame are Ry(yaw) Rx(pitch) Rz(roll)."
        )
    )
    boresight: Quantity = field(metadata=about("Angle between the optical axes."))
    x: Quantity = field(
        metadata=about("Place of the camera's centre in the reference's frame, x right, y down, z forward.")
    )
    y: Quantity = field(
        metadata=about("Place of the camera's centre in the reference's frame, x right, y down, z forward.")
    )
    z: Quantity = field(
        metadata=about("Place of the camera's centre in the reference's frame, x right, y down, z forward.")
    )
    effective_dof: dict[str, float] = field(
        metadata=about("Effective degrees of freedom of each of the quantities above.")
    )
    triggers: int = field(metadata=about("Number of triggers with a picture of this camera that were used."))


@dataclass(frozen=True, kw_only=True)
class RigPoint:
    """One picture of the set."""

    camera: str = field(
        metadata=about('Serial number of the camera, name of the frame, and trigger, "" if it has none.')
    )
    frame: str = field(
        metadata=about('Serial number of the camera, name of the frame, and trigger, "" if it has none.')
    )
    trigger: str = field(
        metadata=about('Serial number of the camera, name of the frame, and trigger, "" if it has none.')
    )
    used: bool = field(metadata=about("True if the orientation used it."))
    left_out: str = field(metadata=about('"" for one that was used, else the reason.'))
    rms_px: float | None = field(
        default=None, metadata=about("Rms distance of its corners from the model [px].")
    )


@dataclass(frozen=True, kw_only=True)
class RigFit:
    """Orientation of all cameras of a rig from one set of pictures."""

    reference: str = field(metadata=about("Serial number of the reference camera."))
    poses: tuple[RelativePose, ...] = field(metadata=about("Orientation of each other camera."))
    corner_scatter_rel: float = field(
        metadata=about(
            "Scatter of the corners about poses that are free in each trigger, over that in the cameras' "
            "own calibrations."
        )
    )
    scatter_deg: float = field(
        metadata=about("Scatter of the orientation from trigger to trigger beyond that of the corners.")
    )
    scatter_mm: float = field(
        metadata=about("Scatter of the orientation from trigger to trigger beyond that of the corners.")
    )
    triggers: int = field(
        metadata=about("Number of triggers and of corners that were used, and degrees of freedom.")
    )
    corners: int = field(
        metadata=about("Number of triggers and of corners that were used, and degrees of freedom.")
    )
    degrees_of_freedom: int = field(
        metadata=about("Number of triggers and of corners that were used, and degrees of freedom.")
    )
    points: tuple[RigPoint, ...] = field(metadata=about("Every picture."))
    flags: tuple[Raised, ...] = field(metadata=about("Flags of the set."))


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
