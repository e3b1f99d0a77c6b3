"""Geometry: pictures of a checkerboard by a rig of two cameras whose lenses bend straight lines."""

import json
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

import stilb
from demo.journey import Finding, Stage, begin, calibrate, conclude, register, take
from radiometry.geometry.camera import PARAMETERS, UNITS, CameraModel, find_directions
from radiometry.geometry.rig.adjustment import describe_pose
from radiometry.geometry.rig.orientation import COMPARED
from radiometry.geometry.target import Target
from simulation.boards import Mounted, View, draw_boards, set_up
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
_SECOND = np.array([0.02, 0.1, 0.01, -80.0, 0.0, 10.0])
_SERIALS = ("0K8TF1A0010046", "0K8TF1A0010047")
_RIG = "Two cameras"


def run(stage: Stage) -> bool:
    """Calibrate two cameras of a rig and orient them; return True if all agrees.

    The distortion of the first is undone with an exported file.
    """
    lens, views = (_QUICK_LENS, 6) if stage.quick else (_LENS, 12)
    columns, rows, square_mm = (5, 4, 40.0) if stage.quick else (9, 6, 25.0)
    board = Target(kind="checkerboard", columns=columns, rows=rows, square_size_mm=square_mm)
    rig = (Mounted(lens, np.zeros(6)), Mounted(lens, _SECOND))
    poses = draw_boards(rig, board, np.random.default_rng(_SEED), count=views)
    target = {name: getattr(board, name) for name in ("kind", "columns", "rows", "square_size_mm")}
    made = []
    for number, (mounted, serial) in enumerate(zip(rig, _SERIALS, strict=True)):
        studio = set_up(lens, dark_dn=150.0, bright_dn=3000.0, noise_dn=12.0, cfa="RGGB")
        studio = change(studio, serial=serial)
        campaign_id = begin(stage, register(stage, studio.camera), "geometry", target=target)
        shots = [
            replace(
                studio.plan(View(board=board, pose=mounted.move(pose)), name=f"{serial}-{trigger}"),
                scene=f"trigger-{trigger}",
            )
            for trigger, pose in enumerate(poses, start=1)
        ]
        take(stage, campaign_id, shots, camera=studio.camera, seed=_SEED + number)
        made.append(calibrate(stage, campaign_id))
    first = made[0]
    found = {row.name: row for row in stage.client.coefficients(str(first.camera_id), method="geometry")}
    truths = dict(zip(PARAMETERS, lens.parameters, strict=True))
    findings = [Finding.of(name, found[name], truth=float(truth)) for name, truth in truths.items()]
    findings.append(_undistort(stage, first, lens))
    findings += _orient(stage, [str(each.camera_id) for each in made])
    return conclude(stage, first, findings)


def _orient(stage: Stage, camera_ids: list[str]) -> list[Finding]:
    """Return the angles and the place of the second camera against the first."""
    rig = stage.client.create_rig(_RIG, camera_ids)
    (pose,) = stage.client.rig_orientation(rig.id)["sets"][-1]["orientation"]["poses"]
    truth = describe_pose("", _SECOND, [(np.eye(len(_SECOND)), 1.0)], triggers=0)
    return [
        Finding.of(name, stilb.Quantity(**pose[name]), truth=getattr(truth, name).value) for name in COMPARED
    ]


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
