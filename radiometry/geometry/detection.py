"""Corners of a board in a grey picture, to a fraction of a pixel."""

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.opencv import cv2
from radiometry.geometry.grey import Grey
from radiometry.geometry.target import Target, make_charuco_board, measure_spacing_px

FirstSquare = Literal["black", "white"]

FIXED_WINDOW_PX: Final = 11
"""Half the side of the square in which a corner is placed, as OpenCV's own calibration sample has it."""
FITTED_SHARE: Final = 0.4
"""Of the distance to the next corner: a window of this half side sees no other corner's edges cross."""
FEWEST_CORNERS: Final = 6
_SMALLEST_WINDOW_PX: Final = 2
_BLUR_PX: Final = 1.0  # that a marker's edge reaches beyond itself
# Beyond it a board is looked for in a smaller copy, and placed in the picture itself.
_LONGEST_SIDE_PX: Final = 1600
_SMALLEST_SIDE_PX: Final = 2 * FIXED_WINDOW_PX + 5
# OpenCV's sample: thirty steps, or until a corner moves by less than a tenth of a pixel.
_SAMPLE_STOP: Final = (30, 0.1)
FITTED_STOP: Final = (100, 1e-3)


@dataclass(frozen=True)
class Found:
    """Corners of a board in a picture.

    Attributes
    ----------
    indices : ndarray of int64
        Indices of the corners on the board.
    fixed, fitted : ndarray of float64
        Places of the corners in the fixed and in the fitted window [px], (corner, 2),
        row before col.
    spacing_px : float
        Shortest distance between neighbouring corners [px].
    fitted_window_px : int
        Half side of the fitted window [px].
    edge_rise_px : float or None
        10 to 90 % rise of the squares' edges [px].
    first_square : {"black", "white"} or None, default: None
        Colour of the square between the first corners of the first two rows, of a board that differs from
        its mirror image.
    not_found : str, default: ""
        Reason why there are no corners, else "".
    """

    indices: NDArray[np.int64]
    fixed: NDArray[np.float64]
    fitted: NDArray[np.float64]
    spacing_px: float
    fitted_window_px: int
    edge_rise_px: float | None
    first_square: FirstSquare | None = None
    not_found: str = ""


def find_corners(grey: Grey, target: Target) -> Found:
    """Find a board's inner corners; pixel (row, col) has its centre at (row, col), OpenCV's convention.

    Returns
    -------
    Found
        Corners, or the reason why there are none.

    Notes
    -----
    A board is searched in a copy of at most 1600 pixels a side: a checkerboard by its squares, then by its
    edges' directions [2]_, a ChArUco board by its markers. Each corner is then placed in the picture
    itself, where every edge nearby points at it [1]_: in a window of 11 pixels' half side, as OpenCV's
    sample does, and in one that is no larger than 0.4 of the distance to the next corner. On a ChArUco
    board both are kept clear of the markers, whose edges point elsewhere.

    References
    ----------
    .. [1] W. Foerstner, E. Guelch, A fast operator for detection and precise location of
       distinct points, 1987
    .. [2] A. Duda, U. Frese, Accurate detection and localization of checkerboard corners,
       BMVC 2018
    """
    height, width = grey.coarse.shape
    if min(height, width) < _SMALLEST_SIDE_PX:
        return _nothing("the region is too small to hold a board")
    scale = -(-max(height, width) // _LONGEST_SIDE_PX)
    small = grey.coarse if scale == 1 else _shrink(grey.coarse, scale)
    coded = target.kind == "charuco"
    indices, rough = (_find_charuco if coded else _find_checkerboard)(small, target)
    if len(indices) < FEWEST_CORNERS:
        # markers cannot be read in a mirror, while squares look the same
        if coded and len(_find_charuco(np.ascontiguousarray(small[:, ::-1]), target)[0]) >= FEWEST_CORNERS:
            return _nothing(f"the picture is mirrored: the {target.name} was found in its mirror image alone")
        seen = f": {len(indices)} of its {target.corners} corners were seen" if len(indices) else ""
        return _nothing(f"the {target.name} was not found{seen}")
    rough = (rough + 0.5) * scale - 0.5
    return _place(grey, target, indices, rough)


def _nothing(reason: str) -> Found:
    none = np.empty((0, 2))
    return Found(np.empty(0, np.int64), none, none, 0.0, 0, None, not_found=reason)


def _shrink(coarse: NDArray[np.uint8], scale: int) -> NDArray[np.uint8]:
    """Average whole cells, so that small pixel i covers pixels [i scale, (i + 1) scale) and no others."""
    height, width = (side // scale for side in coarse.shape)
    whole = coarse[: height * scale, : width * scale]
    return np.asarray(cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA), np.uint8)


def _find_checkerboard(
    small: NDArray[np.uint8], target: Target
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    size = (target.columns, target.rows)
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK
    found, corners = cv2.findChessboardCorners(small, size, flags=flags)
    if not found:
        found, corners = cv2.findChessboardCornersSB(small, size, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
    if not found:
        return np.empty(0, np.int64), np.empty((0, 2))
    return np.arange(target.corners), np.asarray(corners, np.float64).reshape(-1, 2)


def _find_charuco(small: NDArray[np.uint8], target: Target) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    detector = cv2.aruco.CharucoDetector(make_charuco_board(target))
    corners, indices, _, _ = detector.detectBoard(small)
    if indices is None or corners is None or not len(indices):
        return np.empty(0, np.int64), np.empty((0, 2))
    order = np.argsort(np.ravel(indices))
    return (
        np.asarray(np.ravel(indices)[order], np.int64),
        np.asarray(corners, np.float64).reshape(-1, 2)[order],
    )


def _place(grey: Grey, target: Target, indices: NDArray[np.int64], rough: NDArray[np.float64]) -> Found:
    if not _lie_apart(rough):
        return _nothing(f"the corners of the {target.name} lie on one line")
    spacing = measure_spacing_px(target, indices, rough)
    window = _choose_window_px(target, spacing)
    fixed_window = window if target.kind == "charuco" else FIXED_WINDOW_PX
    fixed = refine(grey.fine, rough, fixed_window, _SAMPLE_STOP)
    fitted = refine(grey.fine, rough, window, FITTED_STOP)
    return Found(
        indices=indices,
        fixed=fixed[:, ::-1],
        fitted=fitted[:, ::-1],
        spacing_px=spacing,
        fitted_window_px=window,
        edge_rise_px=_measure_rise(grey.coarse, target, fitted) if len(indices) == target.corners else None,
        first_square=_read_first_square(grey.coarse, target, fitted) if target.is_handed else None,
    )


def _read_first_square(
    coarse: NDArray[np.uint8], target: Target, corners: NDArray[np.float64]
) -> FirstSquare:
    """Return the colour of the first inner square from the means of both colours over all of them."""
    grid = corners.reshape(target.rows, target.columns, 2)
    middles = (grid[:-1, :-1] + grid[1:, :-1] + grid[:-1, 1:] + grid[1:, 1:]) / 4.0
    places = middles[..., 0].astype(np.float32), middles[..., 1].astype(np.float32)
    seen = cv2.remap(coarse, *places, cv2.INTER_LINEAR).astype(np.float64)
    like_first = np.indices(seen.shape).sum(axis=0) % 2 == 0
    return "white" if seen[like_first].mean() > seen[~like_first].mean() else "black"


def _choose_window_px(target: Target, spacing_px: float) -> int:
    room = FITTED_SHARE * spacing_px
    if target.marker_size_mm is not None:
        beside = (1.0 - target.marker_size_mm / target.square_size_mm) / 2.0
        room = min(room, beside * spacing_px - _BLUR_PX)
    return max(_SMALLEST_WINDOW_PX, min(FIXED_WINDOW_PX, int(room)))


def _lie_apart(points: NDArray[np.float64]) -> bool:
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(spread[1] > 1.0)


def refine(
    fine: NDArray[np.uint8] | NDArray[np.float32],
    rough: NDArray[np.float64],
    window_px: int,
    stop: tuple[int, float],
) -> NDArray[np.float64]:
    """Place corners where the edges around them point.

    Parameters
    ----------
    fine : ndarray of uint8 or ndarray of float32
        Picture in which corners are placed, (row, col).
    rough : ndarray of float64
        First places [px], (corner, 2), col before row.
    window_px : int
        Half side of the window [px].
    stop : tuple
        Most iterations, and the change at which they end [px].

    Returns
    -------
    ndarray of float64
        Places [px], (corner, 2), col before row.
    """
    start = rough.astype(np.float32).reshape(-1, 1, 2)
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, *stop)
    placed = cv2.cornerSubPix(fine, start, (window_px, window_px), (-1, -1), criteria)
    return np.asarray(placed, np.float64).reshape(-1, 2)


def _measure_rise(coarse: NDArray[np.uint8], target: Target, corners: NDArray[np.float64]) -> float | None:
    """Return the mean 10 to 90 % rise of the edges between squares [px]; None where it cannot be measured."""
    size = (target.corner_columns, target.corner_rows)
    try:
        mean, _ = cv2.estimateChessboardSharpness(coarse, size, corners.astype(np.float32))
    except cv2.error:
        return None
    rise = float(np.ravel(mean)[0])
    return rise if np.isfinite(rise) and rise > 0.0 else None
