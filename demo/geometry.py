"""Geometry: pictures of a checkerboard by a camera whose lens bends straight lines."""

import json

import cv2
import numpy as np
from numpy.typing import NDArray

import stilb
from demo.findings import Finding
from demo.journey import Stage, begin, calibrate, conclude, register, take
from radiometry.geometry.camera import PARAMETERS, UNITS, CameraModel, find_directions
from radiometry.geometry.target import Target
from simulation.boards import View, draw_poses, set_up
from simulation.camera import change

_SEED = 20260504
_STEP_REL = 1e-6
_LENS = CameraModel(
    height_px=360,
    width_px=480,
    fx_px=460.0,
    fy_px=460.0,
    cx_px=246.4,
    cy_px=173.8,
    k1=-0.21,
    k2=0.06,
    p1=0.0008,
)
_QUICK_LENS = CameraModel(
    height_px=180, width_px=240, fx_px=230.0, fy_px=230.0, cx_px=123.4, cy_px=86.8, k1=-0.21
)


def run(stage: Stage) -> bool:
    """Calibrate the camera, undo its distortion with an exported file; return True if all agrees."""
    lens, views = (_QUICK_LENS, 6) if stage.quick else (_LENS, 12)
    columns, rows, square_mm = (5, 4, 40.0) if stage.quick else (9, 6, 25.0)
    board = Target(kind="checkerboard", columns=columns, rows=rows, square_size_mm=square_mm)
    studio = set_up(lens, dark_dn=150.0, bright_dn=3000.0, noise_dn=12.0, cfa="RGGB")
    studio = change(studio, serial="0K8TF1A0010046")
    poses = draw_poses(lens, board, np.random.default_rng(_SEED), count=views)
    camera_id = register(stage, studio.camera)
    target = {name: getattr(board, name) for name in ("kind", "columns", "rows", "square_size_mm")}
    campaign_id = begin(stage, camera_id, "geometry", target=target)
    shots = [
        studio.plan(View(board=board, pose=pose), name=f"board-{number}")
        for number, pose in enumerate(poses, start=1)
    ]
    take(stage, campaign_id, shots, camera=studio.camera, seed=_SEED)
    calibration = calibrate(stage, campaign_id)
    found = {row.name: row for row in stage.client.coefficients(camera_id, method="geometry")}
    truths = dict(zip(PARAMETERS, lens.parameters, strict=True))
    findings = [Finding.of(name, found[name], truth=float(truth)) for name, truth in truths.items()]
    findings.append(_undistort(stage, calibration, lens))
    return conclude(stage, calibration, findings)


def _undistort(stage: Stage, calibration: stilb.Calibration, lens: CameraModel) -> Finding:
    """Return how far OpenCV, with the exported file, moves the corner of the frame to its place."""
    path = stage.client.save_form(calibration.id, stage.folder / "opencv.yaml")
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    matrix = storage.getNode("camera_matrix").mat()
    distortion = storage.getNode("distortion_coefficients").mat()
    corner = np.zeros((1, 1, 2))
    moved = cv2.undistortPoints(corner, matrix, distortion, P=matrix)
    path = stage.client.save_form(calibration.id, stage.folder / "camera.json")
    stated = json.loads(path.read_text(encoding="utf-8"))
    assert tuple(stated["covariance"]["order"]) == PARAMETERS  # noqa: S101  else the sum below is of others
    values = np.array([stated["parameters"][name]["value"] for name in PARAMETERS])
    slopes = _find_slopes(values, lens)
    return Finding(
        what="corner undistorted by",
        value=float(np.linalg.norm(moved)),
        standard_uncertainty=float(np.sqrt(slopes @ np.array(stated["covariance"]["matrix"]) @ slopes)),
        truth=_move_corner(lens),
        unit=UNITS["cx_px"],
    )


def _move_corner(camera: CameraModel) -> float:
    """Return the distance [px] from the corner of the frame to its image by a lens without distortion."""
    x, y = find_directions(camera, np.zeros((1, 2)))[0]
    return float(np.hypot(camera.fx_px * x + camera.cx_px, camera.fy_px * y + camera.cy_px))


def _find_slopes(values: NDArray[np.float64], lens: CameraModel) -> NDArray[np.float64]:
    """Return the derivative of that distance by each parameter."""

    def at(changed: NDArray[np.float64]) -> float:
        size = {"height_px": lens.height_px, "width_px": lens.width_px}
        return _move_corner(CameraModel.from_parameters(changed, **size))

    steps = _STEP_REL * np.maximum(np.abs(values), 1.0)
    return np.array(
        [
            (at(values + step * unit) - at(values - step * unit)) / (2.0 * step)
            for step, unit in zip(steps, np.eye(len(values)), strict=True)
        ]
    )
