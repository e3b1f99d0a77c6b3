"""Photographed board: what is printed on it, and where its corners lie."""

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.opencv import cv2

Kind = Literal["checkerboard", "charuco"]

_MOST_PER_SIDE: Final = 100
_LARGEST_MM: Final = 10_000.0


@dataclass(frozen=True, kw_only=True)
class Target:
    """Board of black and white squares.

    Attributes
    ----------
    kind : Kind
        Checkerboard, or charuco: a checkerboard with a marker in each white square, of
        which a part is enough.
    columns, rows : int
        Numbers as its makers count: INNER CORNERS of a checkerboard, SQUARES of a
        ChArUco board.
    square_size_mm : float
        Side of a square, measured on the print [mm].
    marker_size_mm : float or None, default: None
        Side of a ChArUco board's markers [mm].
    dictionary : str or None, default: None
        Dictionary of a ChArUco board's markers, OpenCV's name such as DICT_5X5_100.
    legacy_pattern : bool, default: False
        True for a ChArUco board made before OpenCV 4.6, which begins with a white
        square.
    """

    kind: Kind
    columns: int
    rows: int
    square_size_mm: float
    marker_size_mm: float | None = None
    dictionary: str | None = None
    legacy_pattern: bool = False

    def __post_init__(self) -> None:
        """Check for values that no board can have; the messages are for the person who entered them."""
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
    """Return OpenCV's form of a ChArUco board, in millimetres.

    Parameters
    ----------
    target : Target
        ChArUco board.
    """
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
    """Compute where corners lie on the board.

    Parameters
    ----------
    target : Target
        Board.
    indices : ndarray of int64
        Indices of the corners.

    Returns
    -------
    ndarray of float64
        Places [mm], (corner, 3), x along its rows, y down its columns, z = 0.

    Notes
    -----
    Corner i is in row i // corner_columns and column i % corner_columns; the first lies at the origin.
    Where the origin lies enters no parameter of the camera: it moves with the pose.
    """
    rows, cols = np.divmod(indices, target.corner_columns)
    places = np.column_stack((cols, rows, np.zeros_like(rows)))
    return np.asarray(places * target.square_size_mm, np.float64)


def measure_spacing_px(target: Target, indices: NDArray[np.int64], corners: NDArray[np.float64]) -> float:
    """Compute the shortest distance between neighbouring corners in a picture [px].

    Parameters
    ----------
    target : Target
        Board.
    indices : ndarray of int64
        Indices of the corners.
    corners : ndarray of float64
        Places of the corners [px], (corner, 2), in the order of `indices`.

    Returns
    -------
    float
        Distance [px]; 0 where there are no neighbours.
    """
    grid = np.full((target.corner_rows, target.corner_columns, 2), math.nan)
    grid[np.divmod(indices, target.corner_columns)] = corners
    gaps = [np.linalg.norm(np.diff(grid, axis=axis), axis=2).ravel() for axis in (0, 1)]
    known = np.concatenate(gaps)
    known = known[np.isfinite(known)]
    return float(known.min()) if known.size else 0.0
