"""What a board may be, and where its corners lie."""

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from radiometry.geometry.target import Target, locate_corners_mm, measure_spacing_px
from tests.radiometry.geometry.boards import BOARD, CHARUCO

ADAPTER = TypeAdapter(Target)


def test_a_checkerboard_is_counted_in_corners_and_a_charuco_board_in_squares():
    assert (BOARD.corner_columns, BOARD.corner_rows, BOARD.corners) == (9, 6, 54)
    assert (CHARUCO.corner_columns, CHARUCO.corner_rows, CHARUCO.corners) == (6, 4, 24)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"columns": 2}, "columns and rows"),
        ({"rows": 101}, "columns and rows"),
        ({"square_size_mm": 0.0}, "square_size_mm"),
        ({"square_size_mm": float("nan")}, "square_size_mm"),
        ({"square_size_mm": float("inf")}, "square_size_mm"),
        ({"dictionary": "DICT_4X4_50"}, "no markers"),
        ({"kind": "charuco"}, "needs marker_size_mm"),
        ({"kind": "charuco", "marker_size_mm": 25.0, "dictionary": "DICT_4X4_50"}, "below square_size_mm"),
        ({"kind": "charuco", "marker_size_mm": 15.0, "dictionary": "4X4"}, "DICT_4X4_50"),
        (
            {"kind": "charuco", "marker_size_mm": 15.0, "dictionary": "DICT_4X4_50", "rows": 12},
            "has 50 markers, the board needs 54",
        ),
        ({"kind": "circles"}, "checkerboard"),
    ],
)
def test_what_no_board_can_be_is_refused_with_the_reason(changes, said):
    plain = {"kind": "checkerboard", "columns": 9, "rows": 6, "square_size_mm": 25.0}
    with pytest.raises(ValidationError, match=said):
        ADAPTER.validate_python(plain | changes)


def test_corners_run_along_the_rows():
    places = locate_corners_mm(BOARD, np.array([0, 1, 9, 53]))
    assert places.tolist() == [[0, 0, 0], [25, 0, 0], [0, 25, 0], [200, 125, 0]]


def test_spacing_is_that_of_the_closest_neighbours():
    seen = np.array([[0.0, 0.0], [0.0, 30.0], [20.0, 0.0]])
    assert measure_spacing_px(BOARD, np.array([0, 1, 9]), seen) == 20.0
    assert measure_spacing_px(BOARD, np.array([0, 2]), seen[:2]) == 0.0
    # corner 9 begins the second row: it is no neighbour of corner 8
    assert measure_spacing_px(BOARD, np.array([8, 9]), seen[:2]) == 0.0
