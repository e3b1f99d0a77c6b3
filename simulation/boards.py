"""Views of calibration boards through known lenses, of one camera or of several that are mounted together."""

from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from radiometry.frame.roi import Window
from radiometry.geometry.camera import CameraModel, Pose, find_directions, project
from radiometry.geometry.target import Target, locate_corners_mm, make_charuco_board
from radiometry.geometry.target import Target as Board
from radiometry.records import Record
from simulation.camera import Camera, Lens, Plane, Sensor, change
from simulation.targets import Picture, Studio

_PRINT_PX: Final = 40  # of a square, in the print that a ChArUco board's picture is taken of
_FINE: Final = 4  # rays along each side of a pixel
_MARGIN_SQUARES: Final = 1.0


def set_up(
    projection: CameraModel,
    *,
    dark_dn: float,
    bright_dn: float,
    noise_dn: float,
    cfa: str = "grey",
    bits: int = 12,
) -> Studio:
    """Return a studio with a lens of that projection, a blur of 0.7 px and normal noise alone."""
    sensor = Sensor(
        height_px=projection.height_px,
        width_px=projection.width_px,
        cfa=cfa,
        gain_dn_per_e=1.0,
        read_noise_e=noise_dn,
        photon_noise=False,
        black_level_dn=0.0,
        white_level_dn=float((1 << bits) - 1),
    )
    camera = Camera(lens=Lens(projection=projection, blur_px=0.7), sensor=sensor)
    return Studio(camera=camera, dark_dn=dark_dn, bright_dn=bright_dn)


class View(Record):
    """A board in a pose, a white margin and grey beyond; a pixel is the mean of 4 x 4 rays."""

    board: Board
    pose: Pose

    def draw(self, camera: Camera, window: Window) -> Plane:
        if (lens := camera.lens.projection) is None:
            raise ValueError("a view of a board needs a lens with a projection")
        if camera.lens.projections and camera.sensor.cfa != "grey":
            own = [camera.lens.projections.get(colour, lens) for colour in "RGB"]
            cameras = [change(camera, projection=each, projections={}) for each in own]
            return np.stack([self.draw(each, window) for each in cameras], axis=-1)
        directions = _find_rays(lens)
        turned, _ = cv2.Rodrigues(self.pose.rotation)
        # the board is z = 0: the ray through (x, y, 1) meets it where turned^T (s ray - shift) has no z
        rays = np.column_stack((directions, np.ones(len(directions)))) @ turned
        origin = turned.T @ self.pose.shift
        on_board = rays * (origin[2] / rays[:, 2:]) - origin
        bright = _look_up(self.board, on_board[:, 0], on_board[:, 1])
        whole = bright.reshape(lens.height_px, _FINE, lens.width_px, _FINE).mean(axis=(1, 3))
        return Picture(whole).draw(camera, window)


def draw_poses(
    lens: CameraModel, board: Board, random: np.random.Generator, *, count: int, tilt_deg: float = 35.0
) -> tuple[Pose, ...]:
    """Draw poses that show the whole board, all over the frame, tilted up to ``tilt_deg`` about any axis."""
    corners = locate_corners_mm(board, np.arange(board.corners))
    middle, extent = corners.mean(axis=0), float(np.linalg.norm(np.ptp(corners, axis=0)))
    poses: list[Pose] = []
    while len(poses) < count:
        angle = random.uniform(0.0, 2.0 * np.pi)
        tilt = np.radians(random.uniform(0.3, 1.0) * tilt_deg)
        turn, _ = cv2.Rodrigues(np.array([0.0, 0.0, random.normal(0.0, 0.2)]))
        lean, _ = cv2.Rodrigues(np.array([np.cos(angle), np.sin(angle), 0.0]) * tilt)
        rotation, _ = cv2.Rodrigues(lean @ turn)
        away = extent * lens.fx_px / lens.width_px * random.uniform(1.4, 2.6)
        place = np.array([random.uniform(0, lens.height_px), random.uniform(0, lens.width_px)])
        direction = find_directions(lens, place.reshape(1, 2))[0]
        pose = Pose(rotation.ravel(), np.array([*direction, 1.0]) * away - lean @ turn @ middle)
        if shows_all(lens, corners, pose):
            poses.append(pose)
    return tuple(poses)


def shows_all(lens: CameraModel, corners: Plane, pose: Pose) -> bool:
    """Return True if all corners appear well inside the frame, and where the lens model is one to one."""
    seen = project(lens, corners, pose.rotation, pose.shift)
    size = np.array([lens.height_px, lens.width_px])
    turned, _ = cv2.Rodrigues(pose.rotation)
    placed = corners @ turned.T + pose.shift
    if not np.all((seen > 0.03 * size) & (seen < 0.97 * size)) or np.any(placed[:, 2] <= 0.0):
        return False
    return bool(np.allclose(find_directions(lens, seen), placed[:, :2] / placed[:, 2:], atol=1e-6))


def _find_rays(lens: CameraModel) -> Plane:
    """Return the directions of 4 x 4 rays in every pixel, linear between those of pixel centres."""
    shape = (lens.height_px, lens.width_px)
    places = np.moveaxis(np.indices(shape), 0, -1).reshape(-1, 2).astype(np.float64)
    centres = find_directions(lens, places).reshape(*shape, 2)
    size = (lens.width_px * _FINE, lens.height_px * _FINE)
    return np.asarray(cv2.resize(centres, size, interpolation=cv2.INTER_LINEAR), np.float64).reshape(-1, 2)


def _look_up(board: Board, x_mm: NDArray[np.float64], y_mm: NDArray[np.float64]) -> Plane:
    """Return the brightness of the board, 0 to 1, at places from its first inner corner."""
    across, down = board.corner_columns + 1, board.corner_rows + 1
    u, v = x_mm / board.square_size_mm + 1.0, y_mm / board.square_size_mm + 1.0
    inside = (u >= 0.0) & (u < across) & (v >= 0.0) & (v < down)
    margin = _MARGIN_SQUARES
    near = (u >= -margin) & (u < across + margin) & (v >= -margin) & (v < down + margin)
    bright = np.where(near, 1.0, 0.5)
    if board.kind == "charuco":
        size = (across * _PRINT_PX, down * _PRINT_PX)
        printed = np.asarray(make_charuco_board(board).generateImage(size)) / 255.0
        rows = np.clip((v * _PRINT_PX).astype(np.int64), 0, size[1] - 1)
        cols = np.clip((u * _PRINT_PX).astype(np.int64), 0, size[0] - 1)
        return np.where(inside, printed[rows, cols], bright)
    dark = (np.floor(u) + np.floor(v)) % 2 == 0.0
    return np.where(inside & dark, 0.0, bright)


Vector = NDArray[np.float64]


class Mounted(Record, kw_only=False):
    """Camera of a rig: X_camera = R X_reference + t, as a Rodrigues vector and t [mm], (6,)."""

    model: CameraModel
    pose: Vector

    def move(self, board: Pose, *, by: Vector | None = None) -> Pose:
        """Return where this camera sees a board that the reference sees in a pose; ``by``: its deviation."""
        mine = self.pose if by is None else self.pose + by
        rotation, shift = cv2.composeRT(board.rotation, board.shift, mine[:3], mine[3:])[:2]
        return Pose(np.ravel(rotation), np.ravel(shift))


def draw_boards(
    cameras: Sequence[Mounted], board: Target, random: np.random.Generator, *, count: int
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
