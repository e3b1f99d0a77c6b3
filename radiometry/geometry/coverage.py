"""Coverage of the frame by corners, and tilt of the boards."""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.opencv import cv2
from radiometry.geometry.bundle import Pose
from radiometry.geometry.camera import CameraModel
from radiometry.geometry.curve import find_farthest_radius_px
from radiometry.geometry.results import Coverage

CELLS: Final = 8
TILTED_DEG: Final = 15.0


def measure_coverage(camera: CameraModel, seen_px: Sequence[NDArray[np.float64]]) -> Coverage:
    """Return the counts of corners in a grid of 8 x 8 equal cells over the frame.

    Parameters
    ----------
    camera : CameraModel
        Camera model.
    seen_px : sequence of ndarray of float64
        Corners of each view [px], (corner, 2), row before col.

    Returns
    -------
    Coverage
        Counts, and what follows from them.
    """
    counts = count_cells(seen_px, height_px=camera.height_px, width_px=camera.width_px)
    farthest = find_covered_radius_px(camera, seen_px)
    return Coverage(
        counts=tuple(tuple(int(count) for count in row) for row in counts),
        share=float(np.count_nonzero(counts)) / counts.size,
        radius_share=farthest / find_farthest_radius_px(camera),
    )


def count_cells(
    seen_px: Sequence[NDArray[np.float64]], *, height_px: int, width_px: int
) -> NDArray[np.int64]:
    """Return how many corners lie in each cell.

    Parameters
    ----------
    seen_px : sequence of ndarray of float64
        Corners of each view [px], (corner, 2), row before col.
    height_px, width_px : int
        Size of the frame [px].

    Returns
    -------
    ndarray of int64
        Counts, (row, col).
    """
    places = np.concatenate([np.empty((0, 2)), *seen_px])
    cells = ((places + 0.5) / np.array([height_px, width_px]) * CELLS).astype(np.int64)
    counts = np.zeros((CELLS, CELLS), np.int64)
    np.add.at(counts, tuple(np.clip(cells, 0, CELLS - 1).T), 1)
    return counts


def find_covered_radius_px(camera: CameraModel, seen_px: Sequence[NDArray[np.float64]]) -> float:
    """Return the distance from the principal point to the outermost corner [px].

    Parameters
    ----------
    camera : CameraModel
        Camera model.
    seen_px : sequence of ndarray of float64
        Corners of each view [px], (corner, 2), row before col.

    Returns
    -------
    float
        Distance [px].
    """
    principal = np.array([camera.cy_px, camera.cx_px])
    return max(float(np.linalg.norm(seen - principal, axis=1).max()) for seen in seen_px)


def measure_tilt_deg(pose: Pose) -> float:
    """Compute the angle between a board's normal and the optical axis.

    Returns
    -------
    float
        Angle [deg].
    """
    return math.degrees(math.acos(min(1.0, abs(float(_normal(pose)[2])))))


def measure_one_sidedness(poses: Sequence[Pose]) -> float:
    """Compute how far the tilted boards all turn about one axis: 0 for all axes alike, 1 for one.

    Returns
    -------
    float
        One-sidedness; 1 where no view is tilted.

    Notes
    -----
    |mean exp(2 i phi)| over views tilted by 15 degrees or more, phi the direction of the normal in the
    picture: turned left and turned right are one axis.
    """
    normals = [_normal(pose) for pose in poses if measure_tilt_deg(pose) >= TILTED_DEG]
    if not normals:
        return 1.0
    turned = [complex(normal[0], normal[1]) ** 2 for normal in normals]
    return float(abs(np.mean([each / abs(each) for each in turned])))


def _normal(pose: Pose) -> NDArray[np.float64]:
    turned, _ = cv2.Rodrigues(pose.rotation)
    return np.asarray(turned, np.float64)[:, 2]
