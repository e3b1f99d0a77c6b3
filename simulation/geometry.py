"""Pictures of a board by a camera that is known, for tests and for the demonstration."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from radiometry.fitting.evidence import FrameEvidence
from radiometry.frame import Frame, FrameHeader
from radiometry.geometry.camera import CameraModel, find_directions, project
from radiometry.geometry.features import Features
from radiometry.geometry.rows import CHART, FrameRow
from radiometry.geometry.solving import Pose
from radiometry.geometry.target import Target, locate_corners_mm, make_charuco_board, measure_spacing_px

_PRINT_PX: Final = 40  # of a square, in the print that a ChArUco board's picture is taken of
_FINE: Final = 4  # rays along each side of a pixel
_MARGIN_SQUARES: Final = 1.0


@dataclass(frozen=True, kw_only=True)
class Light:
    """How a rendered picture is exposed [DN]; ``noise_dn`` : standard deviation of a sample."""

    black_dn: float = 20.0
    white_dn: float = 220.0
    noise_dn: float = 1.0
    blur_px: float = 0.7


def draw_poses(
    camera: CameraModel, target: Target, random: np.random.Generator, *, count: int, tilt_deg: float = 35.0
) -> tuple[Pose, ...]:
    """Draw poses that show the whole board, all over the frame, tilted up to ``tilt_deg`` about any axis."""
    board = locate_corners_mm(target, np.arange(target.corners))
    middle, extent = board.mean(axis=0), float(np.linalg.norm(np.ptp(board, axis=0)))
    poses: list[Pose] = []
    while len(poses) < count:
        angle = random.uniform(0.0, 2.0 * np.pi)
        tilt = np.radians(random.uniform(0.3, 1.0) * tilt_deg)
        turn, _ = cv2.Rodrigues(np.array([0.0, 0.0, random.normal(0.0, 0.2)]))
        lean, _ = cv2.Rodrigues(np.array([np.cos(angle), np.sin(angle), 0.0]) * tilt)
        rotation, _ = cv2.Rodrigues(lean @ turn)
        away = extent * camera.fx_px / camera.width_px * random.uniform(1.4, 2.6)
        place = np.array([random.uniform(0, camera.height_px), random.uniform(0, camera.width_px)])
        direction = find_directions(camera, place.reshape(1, 2))[0]
        shift = np.array([*direction, 1.0]) * away - lean @ turn @ middle
        pose = Pose(rotation.ravel(), shift)
        if _shows_all(camera, board, pose):
            poses.append(pose)
    return tuple(poses)


def _shows_all(camera: CameraModel, board: NDArray[np.float64], pose: Pose) -> bool:
    """Whether all corners appear well inside of the frame, and where the model does not turn back."""
    seen = project(camera, board, pose.rotation, pose.shift)
    edge = np.array([camera.height_px, camera.width_px]) * 0.03
    inside = np.all((seen > edge) & (seen < np.array([camera.height_px, camera.width_px]) - edge))
    turned, _ = cv2.Rodrigues(pose.rotation)
    placed = board @ turned.T + pose.shift
    if not inside or np.any(placed[:, 2] <= 0.0):
        return False
    found = find_directions(camera, seen)
    return bool(np.allclose(found, placed[:, :2] / placed[:, 2:], atol=1e-6))


def simulate_rows(
    camera: CameraModel,
    target: Target,
    poses: Sequence[Pose],
    random: np.random.Generator,
    *,
    noise_px: float,
) -> tuple[FrameRow, ...]:
    """Project the board's corners with normal noise of ``noise_px`` in row and in col."""
    indices = np.arange(target.corners)
    board = locate_corners_mm(target, indices)
    rows = []
    for number, pose in enumerate(poses):
        seen = project(camera, board, pose.rotation, pose.shift)
        seen = seen + random.normal(0.0, noise_px, seen.shape)
        rows.append(make_row(f"view-{number:03}", camera, target, indices, seen))
    return tuple(rows)


def make_row(
    name: str,
    camera: CameraModel,
    target: Target,
    indices: NDArray[np.int64],
    seen_px: NDArray[np.float64],
) -> FrameRow:
    """Give corners, (corner, 2) row before col, as the fit wants them."""
    places = tuple((float(row), float(col)) for row, col in seen_px)
    hull = cv2.convexHull(seen_px.astype(np.float32))
    features = Features(
        target=target,
        not_found="",
        height_px=camera.height_px,
        width_px=camera.width_px,
        indices=tuple(int(index) for index in indices),
        fixed_px=places,
        fitted_px=places,
        fitted_window_px=11,
        spacing_px=measure_spacing_px(target, indices, seen_px),
        board_share=float(cv2.contourArea(hull)) / (camera.height_px * camera.width_px),
    )
    return FrameEvidence(
        frame=name,
        role=CHART,
        scene=None,
        header=make_header(camera),
        exposure=None,
        statistics=(),
        features=features,
    )


def make_header(camera: CameraModel, *, cfa: str = "grey", bits: int = 12) -> FrameHeader:
    """Give the header of a raw frame of the camera; one of 8 bits is a picture."""
    sites = {"grey": 1, "rgb": 3}.get(cfa, 4)
    picture = bits == 8
    return FrameHeader(
        container="png" if picture else "dng",
        decoder="imagecodecs" if picture else "stilb",
        rendered=picture,
        compression="none",
        bits_per_sample=bits,
        width_px=camera.width_px,
        height_px=camera.height_px,
        cfa=cfa,
        black_level_dn=(0.0,) * sites,
        black_level_origin="default",
        white_level_dn=(float((1 << bits) - 1),) * sites,
        white_level_origin="default",
    )


def render_board(
    camera: CameraModel,
    target: Target,
    pose: Pose,
    random: np.random.Generator,
    *,
    light: Light,
) -> NDArray[np.float64]:
    """Take a picture of the board: (row, col) [DN], every pixel the mean of 4 x 4 rays.

    Each ray is followed through the lens to the board's plane, so an edge lies where the model says and not
    where a warped bitmap would put it. Around the squares is a white margin, beyond it grey.
    """
    directions = _find_rays(camera)
    turned, _ = cv2.Rodrigues(pose.rotation)
    # the board's plane is z = 0: the ray through (x, y, 1) meets it where turned^T (s ray - shift) has no z
    rays = np.column_stack((directions, np.ones(len(directions)))) @ turned
    origin = turned.T @ pose.shift
    on_board = rays * (origin[2] / rays[:, 2:]) - origin
    bright = _look_up(target, on_board[:, 0], on_board[:, 1])
    bright = bright.reshape(camera.height_px, _FINE, camera.width_px, _FINE).mean(axis=(1, 3))
    if light.blur_px > 0.0:
        bright = cv2.GaussianBlur(bright, (0, 0), light.blur_px)
    picture = light.black_dn + bright * (light.white_dn - light.black_dn)
    return np.asarray(picture + random.normal(0.0, light.noise_dn, picture.shape), np.float64)


def _find_rays(camera: CameraModel) -> NDArray[np.float64]:
    """Give the directions of 4 x 4 rays in every pixel, linear between those of pixels' centres."""
    shape = (camera.height_px, camera.width_px)
    places = np.moveaxis(np.indices(shape), 0, -1).reshape(-1, 2).astype(np.float64)
    centres = find_directions(camera, places).reshape(*shape, 2)
    size = (camera.width_px * _FINE, camera.height_px * _FINE)
    return np.asarray(cv2.resize(centres, size, interpolation=cv2.INTER_LINEAR), np.float64).reshape(-1, 2)


def _look_up(target: Target, x_mm: NDArray[np.float64], y_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give how bright the board is, 0 to 1, at places from its first inner corner."""
    across, down = target.corner_columns + 1, target.corner_rows + 1
    u, v = x_mm / target.square_size_mm + 1.0, y_mm / target.square_size_mm + 1.0
    inside = (u >= 0.0) & (u < across) & (v >= 0.0) & (v < down)
    margin = _MARGIN_SQUARES
    near = (u >= -margin) & (u < across + margin) & (v >= -margin) & (v < down + margin)
    bright = np.where(near, 1.0, 0.5)
    if target.kind == "charuco":
        size = (across * _PRINT_PX, down * _PRINT_PX)
        printed = np.asarray(make_charuco_board(target).generateImage(size)) / 255.0
        rows = np.clip((v * _PRINT_PX).astype(np.int64), 0, size[1] - 1)
        cols = np.clip((u * _PRINT_PX).astype(np.int64), 0, size[0] - 1)
        return np.where(inside, printed[rows, cols], bright)
    dark = (np.floor(u) + np.floor(v)) % 2 == 0.0
    return np.where(inside & dark, 0.0, bright)


def make_frame(picture: NDArray[np.float64], *, cfa: str = "grey", bits: int = 12) -> Frame:
    """Give a picture as a frame of whole numbers; a mosaic's sites see it with different strengths."""
    strength = np.ones(picture.shape)
    if cfa not in ("grey", "rgb"):
        for place, colour in enumerate(cfa):
            strength[place // 2 :: 2, place % 2 :: 2] = {"R": 0.5, "G": 1.0, "B": 0.6}[colour]
    white = float((1 << bits) - 1)
    samples = np.clip(np.round(picture * strength), 0.0, white).astype(np.uint16)
    sites = {"grey": 1, "rgb": 3}.get(cfa, 4)
    return Frame(
        samples_dn=np.repeat(samples[:, :, None], 3, axis=2) if cfa == "rgb" else samples,
        row0=0,
        col0=0,
        height_px=picture.shape[0],
        width_px=picture.shape[1],
        cfa=cfa,
        black_level_dn=(0.0,) * sites,
        white_level_dn=(white,) * sites,
    )
