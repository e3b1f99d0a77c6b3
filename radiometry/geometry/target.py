"""The board, and the places of its corners in a picture."""

import math
from dataclasses import replace
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.opencv import cv2
from radiometry.geometry.camera import Grey
from radiometry.records import Record, about

Kind = Literal["checkerboard", "charuco"]

_MOST_PER_SIDE: Final = 100
_LARGEST_MM: Final = 10_000.0


class Target(Record):
    """Board of black and white squares."""

    kind: Kind = about(
        "Checkerboard, or charuco: a checkerboard with a marker in each white square, of which a part "
        "is enough."
    )
    columns: int = about(
        "Numbers as its makers count: INNER CORNERS of a checkerboard, SQUARES of a ChArUco board."
    )
    rows: int = about(
        "Numbers as its makers count: INNER CORNERS of a checkerboard, SQUARES of a ChArUco board."
    )
    square_size_mm: float = about("Side of a square, measured on the print [mm].")
    marker_size_mm: float | None = about("Side of a ChArUco board's markers [mm].", default=None)
    dictionary: str | None = about(
        "Dictionary of a ChArUco board's markers, OpenCV's name such as DICT_5X5_100.", default=None
    )
    legacy_pattern: bool = about(
        "True for a ChArUco board made before OpenCV 4.6, which begins with a white square.", default=False
    )

    def __post_init__(self) -> None:
        if not (min(self.columns, self.rows) >= 3 and max(self.columns, self.rows) <= _MOST_PER_SIDE):
            raise ValueError(f"columns and rows of a board lie between 3 and {_MOST_PER_SIDE}")
        if not 0.0 < self.square_size_mm <= _LARGEST_MM:
            raise ValueError("square_size_mm must be above 0 and at most 10 m")
        if self.kind == "charuco":
            _check_markers(self)
        elif self.marker_size_mm is not None or self.dictionary is not None or self.legacy_pattern:
            raise ValueError("a checkerboard has no markers: leave marker_size_mm and dictionary out")

    @property
    def corner_columns(self) -> int:
        """Inner corners in a row."""
        return self.columns - (self.kind == "charuco")

    @property
    def corner_rows(self) -> int:
        """Inner corners in a column."""
        return self.rows - (self.kind == "charuco")

    @property
    def corners(self) -> int:
        """How many inner corners the whole board has."""
        return self.corner_columns * self.corner_rows

    @property
    def is_handed(self) -> bool:
        """True if a checkerboard differs from its mirror image: odd numbers of corners, which differ."""
        odd = self.columns % 2 == 1 and self.rows % 2 == 1
        return self.kind == "checkerboard" and odd and self.columns != self.rows

    @property
    def name(self) -> str:
        """The board in words."""
        if self.kind == "charuco":
            return f"ChArUco board of {self.columns} x {self.rows} squares"
        return f"checkerboard of {self.columns} x {self.rows} inner corners"


def _check_markers(target: Target) -> None:
    if target.marker_size_mm is None or target.dictionary is None:
        raise ValueError("a charuco board needs marker_size_mm and dictionary")
    if not 0.0 < target.marker_size_mm < target.square_size_mm:
        raise ValueError("marker_size_mm must be above 0 and below square_size_mm")
    names = sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_") and name.upper() == name)
    if target.dictionary not in names:
        raise ValueError(f"dictionary must be one of {', '.join(names)}")
    words = len(_find_dictionary(target.dictionary).bytesList)
    needed = target.columns * target.rows // 2
    if needed > words:
        raise ValueError(f"{target.dictionary} has {words} markers, the board needs {needed}")


def _find_dictionary(name: str) -> "cv2.aruco.Dictionary":
    return cv2.aruco.getPredefinedDictionary(int(getattr(cv2.aruco, name)))


def make_charuco_board(target: Target) -> "cv2.aruco.CharucoBoard":
    """Return OpenCV's form of a ChArUco board, in millimetres."""
    if target.marker_size_mm is None or target.dictionary is None:
        raise ValueError(f"no ChArUco board: {target}")
    board = cv2.aruco.CharucoBoard(
        (target.columns, target.rows),
        target.square_size_mm,
        target.marker_size_mm,
        _find_dictionary(target.dictionary),
    )
    board.setLegacyPattern(target.legacy_pattern)
    return board


def locate_corners_mm(target: Target, indices: NDArray[np.int64]) -> NDArray[np.float64]:
    """Compute where corners lie on the board [mm], (corner, 3): x along its rows, y down its columns, z = 0.

    Corner i is in row i // corner_columns and column i % corner_columns; the first lies at the origin.
    Where the origin lies enters no parameter of the camera: it moves with the pose.
    """
    rows, cols = np.divmod(indices, target.corner_columns)
    places = np.column_stack((cols, rows, np.zeros_like(rows)))
    return np.asarray(places * target.square_size_mm, np.float64)


def measure_spacing_px(target: Target, indices: NDArray[np.int64], corners: NDArray[np.float64]) -> float:
    """Compute the shortest distance between neighbouring corners in a picture [px]."""
    grid = np.full((target.corner_rows, target.corner_columns, 2), math.nan)
    grid[np.divmod(indices, target.corner_columns)] = corners
    gaps = [np.linalg.norm(np.diff(grid, axis=axis), axis=2).ravel() for axis in (0, 1)]
    known = np.concatenate(gaps)
    known = known[np.isfinite(known)]
    return float(known.min()) if known.size else 0.0


FirstSquare = Literal["black", "white"]

FEWEST_CORNERS: Final = 6
_LARGEST_WINDOW_PX: Final = 11  # Half the side of the square in which a corner is placed
_SMALLEST_WINDOW_PX: Final = 3  # In a smaller one the edges of a blurred picture leave no slope
_CLEAR_PX: Final = 2.0  # Of the edge of an outer square that is a half, at a window's corner
# A corner that half the window places so far away, and so much farther than others, was drawn to another edge
_DRAWN_PX: Final = 0.5
_DRAWN_RATIO: Final = 4.0
_BLUR_PX: Final = 1.0  # that a marker's edge reaches beyond itself
# Beyond it a board is looked for in a smaller copy, and placed in the picture itself.
_LONGEST_SIDE_PX: Final = 1600
_SMALLEST_SIDE_PX: Final = 2 * _LARGEST_WINDOW_PX + 5
# Steps, and the motion at which they end; a corner that moves on is drawn to the edges of something else
_STOP: Final = (5, 1e-3)


class Found(Record, kw_only=False):
    """Corners of a board in a picture."""

    indices: NDArray[np.int64]  # Indices of the corners on the board
    fitted: NDArray[np.float64]  # Places of the corners [px], (corner, 2), row before col
    spacing_px: float  # Shortest distance between neighbouring corners [px]
    fitted_window_px: int  # Half side of the fitted window [px]
    edge_rise_px: float | None  # 10 to 90 % rise of the squares' edges [px]
    # Colour of the square between the first corners of the first two rows, of a board that differs from its
    # mirror image
    first_square: FirstSquare | None = None
    not_found: str = ""  # Reason why there are no corners, else ""


def find_corners(grey: Grey, target: Target) -> Found:
    """Find a board's inner corners; pixel (row, col) has its centre at (row, col), OpenCV's convention.

    A board is searched in a copy of at most 1600 pixels a side: a checkerboard by its squares, then by its
    edges' directions [2], a ChArUco board by its markers. Each corner is then placed in the picture
    itself, where every edge nearby points at it [1], in a window that keeps clear of the half of the view's
    shortest distance between corners, where the outer edge of many boards is; a corner that is drawn there
    all the same is placed in half the window. On a ChArUco board it is kept clear of the markers, whose
    edges point elsewhere.

    [1] W. Foerstner, E. Guelch, A fast operator for detection and precise location of distinct points,
        1987
    [2] A. Duda, U. Frese, Accurate detection and localization of checkerboard corners, BMVC 2018
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
        if not coded and min(target.columns, target.rows) > 3:
            fewer = replace(target, columns=target.columns - 1, rows=target.rows - 1)
            if len(_find_checkerboard(small, fewer)[0]):
                seen = f", but a {fewer.name}: count these, not the squares"
        return _nothing(f"the {target.name} was not found{seen}")
    rough = (rough + 0.5) * scale - 0.5
    return _place(grey, target, indices, rough)


def _nothing(reason: str) -> Found:
    none = np.empty((0, 2))
    return Found(np.empty(0, np.int64), none, 0.0, 0, None, not_found=reason)


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
    if not np.linalg.svd(rough - rough.mean(axis=0), compute_uv=False)[1] > 1.0:
        return _nothing(f"the corners of the {target.name} lie on one line")
    spacing = measure_spacing_px(target, indices, rough)
    window = _choose_window_px(target, spacing)
    fitted = refine(grey.fine, rough, window)
    near = refine(grey.fine, rough, max(_SMALLEST_WINDOW_PX, (window + 1) // 2))
    apart = np.linalg.norm(fitted - near, axis=1)
    drawn = apart > max(_DRAWN_PX, _DRAWN_RATIO * float(np.median(apart)))
    fitted[drawn] = near[drawn]
    return Found(
        indices=indices,
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
    room = (spacing_px / 2.0 - _CLEAR_PX) / math.sqrt(2.0)
    if target.marker_size_mm is not None:
        beside = (1.0 - target.marker_size_mm / target.square_size_mm) / 2.0
        room = min(room, beside * spacing_px - _BLUR_PX)
    return max(_SMALLEST_WINDOW_PX, min(_LARGEST_WINDOW_PX, int(room)))


def refine(
    fine: NDArray[np.uint8] | NDArray[np.float32], rough: NDArray[np.float64], window_px: int
) -> NDArray[np.float64]:
    """Place corners where the edges around them point."""
    start = rough.astype(np.float32).reshape(-1, 1, 2)
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, *_STOP)
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
