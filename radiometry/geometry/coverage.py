"""Where in the frame corners were seen, and how the boards were tilted."""

import math
from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from radiometry.geometry.camera import CameraModel
from radiometry.geometry.curve import find_farthest_radius_px
from radiometry.geometry.results import Coverage
from radiometry.geometry.solving import Pose

CELLS: Final = 8
TILTED_DEG: Final = 15.0


def measure_coverage(camera: CameraModel, seen_px: Sequence[NDArray[np.float64]]) -> Coverage:
    """Count corners in a grid of 8 x 8 equal cells over the frame.

    Takes
      seen_px : of each view (corner, 2), row before col
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
    """Give how many corners lie in each cell, (row, col)."""
    places = np.concatenate([np.empty((0, 2)), *seen_px])
    cells = ((places + 0.5) / np.array([height_px, width_px]) * CELLS).astype(np.int64)
    counts = np.zeros((CELLS, CELLS), np.int64)
    np.add.at(counts, tuple(np.clip(cells, 0, CELLS - 1).T), 1)
    return counts


def find_covered_radius_px(camera: CameraModel, seen_px: Sequence[NDArray[np.float64]]) -> float:
    """Give how far from the principal point the outermost corner lies [px]."""
    principal = np.array([camera.cy_px, camera.cx_px])
    return max(float(np.linalg.norm(seen - principal, axis=1).max()) for seen in seen_px)


def measure_tilt_deg(pose: Pose) -> float:
    """Give the angle between a board's normal and the optical axis."""
    return math.degrees(math.acos(min(1.0, abs(float(_normal(pose)[2])))))


def measure_one_sidedness(poses: Sequence[Pose]) -> float:
    """Give how far the tilted boards all turn about one axis: 0 for all axes alike, 1 for one.

    |mean exp(2 i phi)| over views tilted by 15 degrees or more, phi the direction of the normal in the
    picture: turned left and turned right are one axis. 1 where no view is tilted.
    """
    normals = [_normal(pose) for pose in poses if measure_tilt_deg(pose) >= TILTED_DEG]
    if not normals:
        return 1.0
    turned = [complex(normal[0], normal[1]) ** 2 for normal in normals]
    return float(abs(np.mean([each / abs(each) for each in turned])))


def _normal(pose: Pose) -> NDArray[np.float64]:
    turned, _ = cv2.Rodrigues(pose.rotation)
    return np.asarray(turned, np.float64)[:, 2]
