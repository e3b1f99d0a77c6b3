"""Geometry: pictures of a checkerboard by a camera whose lens bends straight lines."""

import json
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

import stilb
from demo.dng import Camera
from demo.findings import Finding
from demo.journey import calibrate, conclude
from demo.shots import STARTED_AT, Expose, Shot, begin, register, take
from demo.stage import Stage
from radiometry.geometry.camera import PARAMETERS, UNITS, CameraModel, find_directions
from radiometry.geometry.solving import Pose
from radiometry.geometry.target import Target
from simulation.geometry import Light, draw_poses, make_frame, render_board

_SEED = 20260504
_CFA, _BITS = "RGGB", 12
_CAMERA = Camera(black_level_dn=0, white_level_dn=(1 << _BITS) - 1, serial="0K8TF1A0010046", cfa=_CFA)
_LIGHT = Light(black_dn=150.0, white_dn=3000.0, noise_dn=12.0)
_STEP_REL = 1e-6


@dataclass(frozen=True, kw_only=True)
class _Plan:
    lens: CameraModel
    target: Target
    views: int


_FULL = _Plan(
    lens=CameraModel(
        height_px=360,
        width_px=480,
        fx_px=460.0,
        fy_px=460.0,
        cx_px=246.4,
        cy_px=173.8,
        k1=-0.21,
        k2=0.06,
        p1=0.0008,
    ),
    target=Target(kind="checkerboard", columns=9, rows=6, square_size_mm=25.0),
    views=12,
)
_QUICK = _Plan(
    lens=CameraModel(
        height_px=180, width_px=240, fx_px=230.0, fy_px=230.0, cx_px=123.4, cy_px=86.8, k1=-0.21
    ),
    target=Target(kind="checkerboard", columns=5, rows=4, square_size_mm=40.0),
    views=6,
)


def run(stage: Stage) -> bool:
    """Calibrate the camera, undo its distortion with an exported file; whether all agrees with the lens."""
    plan = _QUICK if stage.quick else _FULL
    board = plan.target
    poses = draw_poses(plan.lens, board, np.random.default_rng(_SEED), count=plan.views)
    camera_id = register(stage, _CAMERA)
    target = {
        "kind": board.kind,
        "columns": board.columns,
        "rows": board.rows,
        "square_size_mm": board.square_size_mm,
    }
    campaign_id = begin(stage, camera_id, "geometry", target=target)
    shots = [
        Shot(name=f"board-{number}", role="chart", expose=_photograph(plan, pose))
        for number, pose in enumerate(poses, start=1)
    ]
    take(stage, campaign_id, shots, camera=_CAMERA, seed=_SEED)
    calibration = calibrate(stage, campaign_id, valid_from=STARTED_AT)
    found = {row.name: row for row in stage.client.coefficients(camera_id, method="geometry")}
    truths = dict(zip(PARAMETERS, plan.lens.parameters, strict=True))
    findings = [Finding.of(name, found[name], truth=float(truth)) for name, truth in truths.items()]
    findings.append(_undistort(stage, calibration, plan.lens))
    return conclude(stage, calibration, findings)


def _photograph(plan: _Plan, pose: Pose) -> Expose:
    def expose(random: np.random.Generator) -> NDArray[np.uint16]:
        picture = render_board(plan.lens, plan.target, pose, random, light=_LIGHT)
        return make_frame(picture, cfa=_CFA, bits=_BITS).samples_dn

    return expose


def _undistort(stage: Stage, calibration: stilb.Calibration, lens: CameraModel) -> Finding:
    """Say how far OpenCV, with the exported file, moves the frame's corner to where it belongs."""
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
    """Give the distance [px] from the frame's corner to where a lens without distortion would draw it."""
    x, y = find_directions(camera, np.zeros((1, 2)))[0]
    return float(np.hypot(camera.fx_px * x + camera.cx_px, camera.fy_px * y + camera.cy_px))


def _find_slopes(values: NDArray[np.float64], lens: CameraModel) -> NDArray[np.float64]:
    """Give the change of that distance with each parameter."""

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
