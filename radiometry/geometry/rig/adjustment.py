"""Orientation of cameras that are mounted together: results, and the adjustment over their boards."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import Raised
from radiometry.fitting.evidence import MOST_DOF, Quantity
from radiometry.frame import FrameHeader
from radiometry.frame.opencv import cv2
from radiometry.geometry.camera import (
    PARAMETERS,
    CameraModel,
    Linear,
    Minimum,
    View,
    find_pose,
    minimise,
    project,
)
from radiometry.geometry.target import Target
from radiometry.records import Record, about


class RelativePose(Record):
    """Orientation of one camera against the reference: X_camera = R X_reference + t."""

    camera: str = about("Serial number of the camera.")
    rotation: tuple[float, ...] = about("Rodrigues vector of R [rad].")
    matrix: tuple[tuple[float, ...], ...] = about("R, (3, 3).")
    translation_m: tuple[float, ...] = about("t [m].")
    covariance: tuple[tuple[float, ...], ...] = about(
        "Covariance of rotation [rad] and translation [m], (6, 6), the cameras' own uncertainties included."
    )
    orientation_covariance: tuple[tuple[float, ...], ...] = about(
        "The same for the cameras exactly as calibrated."
    )
    yaw: Quantity = about(
        "Boresight angles: the camera's axes in the reference's frame are Ry(yaw) Rx(pitch) Rz(roll)."
    )
    pitch: Quantity = about(
        "Boresight angles: the camera's axes in the reference's frame are Ry(yaw) Rx(pitch) Rz(roll)."
    )
    roll: Quantity = about(
        "Boresight angles: the camera's axes in the reference's frame are Ry(yaw) Rx(pitch) Rz(roll)."
    )
    boresight: Quantity = about("Angle between the optical axes.")
    x: Quantity = about("Place of the camera's centre in the reference's frame, x right, y down, z forward.")
    y: Quantity = about("Place of the camera's centre in the reference's frame, x right, y down, z forward.")
    z: Quantity = about("Place of the camera's centre in the reference's frame, x right, y down, z forward.")
    effective_dof: dict[str, float] = about("Effective degrees of freedom of each of the quantities above.")
    triggers: int = about("Number of triggers with a picture of this camera that were used.")


class RigPoint(Record):
    """One picture of the set."""

    camera: str = about('Serial number of the camera, name of the frame, and trigger, "" if it has none.')
    frame: str = about('Serial number of the camera, name of the frame, and trigger, "" if it has none.')
    trigger: str = about('Serial number of the camera, name of the frame, and trigger, "" if it has none.')
    used: bool = about("True if the orientation used it.")
    left_out: str = about('"" for one that was used, else the reason.')
    rms_px: float | None = about("Rms distance of its corners from the model [px].", default=None)


class RigFit(Record):
    """Orientation of all cameras of a rig from one set of pictures."""

    reference: str = about("Serial number of the reference camera.")
    poses: tuple[RelativePose, ...] = about("Orientation of each other camera.")
    corner_scatter_rel: float = about(
        "Scatter of the corners about poses that are free in each trigger, over that in the cameras' "
        "own calibrations."
    )
    scatter_deg: float = about(
        "Scatter of the orientation from trigger to trigger beyond that of the corners."
    )
    scatter_mm: float = about(
        "Scatter of the orientation from trigger to trigger beyond that of the corners."
    )
    triggers: int = about("Number of triggers and of corners that were used, and degrees of freedom.")
    corners: int = about("Number of triggers and of corners that were used, and degrees of freedom.")
    degrees_of_freedom: int = about(
        "Number of triggers and of corners that were used, and degrees of freedom."
    )
    points: tuple[RigPoint, ...] = about("Every picture.")
    flags: tuple[Raised, ...] = about("Flags of the set.")


Matrix = NDArray[np.float64]

MM_PER_M: Final = 1000.0
_STEPS: Final = np.array([1e-6] * 3 + [1e-3] * 3)


def describe_pose(
    serial: str, pose: Matrix, parts: Sequence[tuple[Matrix, float]], *, triggers: int
) -> RelativePose:
    """Return a camera's orientation with its angles, from its Rodrigues vector [rad] and translation [mm].

    Covariances are of independent causes, each with its degrees of freedom; the last is of the cameras' own
    uncertainties. The camera's axes in the reference's frame are the columns of R' = Ry(yaw) Rx(pitch)
    Rz(roll): yaw turns to the right, pitch upwards, roll clockwise. The uncertainty of the angle between the
    optical axes is that of the axis in its least certain direction. Effective degrees of freedom are Welch
    and Satterthwaite's (JCGM 100, G.4.1).
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
    angles = [Quantity(math.degrees(values[place]), math.degrees(u[place]), "deg") for place in range(3)]
    places = [Quantity(values[place] / MM_PER_M, u[place] / MM_PER_M, "m") for place in range(3, 6)]
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
        boresight=Quantity(math.degrees(boresight), math.degrees(axis_u), "deg"),
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


WITHIN_S: Final = 1.0  # EXIF times are whole seconds


class BoardPicture(Record, kw_only=False):
    """Picture of a board by one camera of a rig."""

    frame: str
    camera: int  # Number of the camera in the rig
    scene: str | None  # Name of the trigger, if it was given
    header: FrameHeader
    target: Target  # Board
    view: View  # Corners


class Trigger(Record, kw_only=False):
    """Pictures that were taken together, one per camera."""

    name: str
    pictures: tuple[BoardPicture, ...]


def pair_pictures(pictures: Sequence[BoardPicture]) -> tuple[tuple[Trigger, ...], dict[str, str]]:
    """Group pictures by trigger.

    Pictures belong together that have the same scene, else the same capture identifier (multispectral
    cameras), else times that agree within `WITHIN_S`. A camera has one picture of a trigger: where it has
    two, neither counts.
    """
    groups: dict[str, list[BoardPicture]] = {}
    timed: list[tuple[datetime, BoardPicture]] = []
    why: dict[str, str] = {}
    for picture in sorted(pictures, key=lambda each: (each.camera, each.frame)):
        capture = picture.header.multispectral.capture_id if picture.header.multispectral else None
        if picture.scene or capture:
            groups.setdefault(str(picture.scene or capture), []).append(picture)
        elif picture.header.taken_at:
            timed.append((datetime.fromisoformat(picture.header.taken_at).replace(tzinfo=None), picture))
        else:
            why[picture.frame] = "it has no scene, no capture identifier and no time"
    begun: datetime | None = None
    for taken, picture in sorted(timed, key=lambda each: (each[0], each[1].camera, each[1].frame)):
        if begun is None or taken - begun > timedelta(seconds=WITHIN_S):
            begun = taken
        groups.setdefault(begun.isoformat(), []).append(picture)
    triggers = []
    for name, members in sorted(groups.items()):
        counts = Counter(each.camera for each in members)
        kept = tuple(each for each in members if counts[each.camera] == 1)
        why |= {
            each.frame: f"its camera has {counts[each.camera]} pictures of trigger {name}"
            for each in members
            if each not in kept
        }
        if len(kept) > 1:
            triggers.append(Trigger(name, kept))
        else:
            why |= {each.frame: f"no other camera has a picture of trigger {name}" for each in kept}
    return tuple(triggers), why


Vector = NDArray[np.float64]


def compose(first: Vector, then: Vector) -> Vector:
    """Return the pose of applying one pose and then another."""
    rotation, shift = cv2.composeRT(first[:3], first[3:], then[:3], then[3:])[:2]
    return np.concatenate((np.ravel(rotation), np.ravel(shift)))


def invert(pose: Vector) -> Vector:
    """Return the pose that undoes another."""
    turned, _ = cv2.Rodrigues(-pose[:3])
    return np.concatenate((-pose[:3], -turned @ pose[3:]))


def start_rig(
    cameras: Sequence[CameraModel], triggers: Sequence[Trigger]
) -> tuple[Mapping[int, Vector], tuple[Trigger, ...]]:
    """Find the pose of each camera against the first, and one numbering of the board for all its pictures.

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
        boards = [_guess_board(cameras, known, each) if chosen in each else None for each in seen]
        known[chosen], numbered = _propose(cameras[chosen], chosen, boards, seen)
        for place, picture in numbered.items():
            seen[place][chosen] = picture
    return known, tuple(
        replace(trigger, pictures=tuple(each[camera] for camera in sorted(each)))
        for trigger, each in zip(triggers, seen, strict=True)
    )


def _guess_board(
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


POSE: Final = 6


CAMERA: Final = len(PARAMETERS)


class RigCamera(Record, kw_only=False):
    """Calibrated camera of a rig."""

    serial: str
    model: CameraModel  # Camera as its geometry version states it
    covariance: Matrix  # Covariance of PARAMETERS, (9, 9)
    noise_px: float  # Standard deviation of a corner in row and in col [px]
    dof: float = MOST_DOF  # Degrees of freedom of `covariance`


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
