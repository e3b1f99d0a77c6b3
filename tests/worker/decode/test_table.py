"""Rows of a table, which come as files: whatever is no possible row is refused."""

import json

import pytest

from radiometry.findings import InputRejected
from tests.support.reader import read_header, render_preview

ROW = {"mean_dn": 500.5, "min_dn": 400.0, "max_dn": 600.0, "pixels": 900, "white_level_dn": 4095.0}


def write(path, **changes):
    path.write_text(json.dumps({"stilb_row": 1, **ROW, **changes}))
    return path


def test_a_row_is_a_header_and_one_grey_pixel(tmp_path):
    path = write(tmp_path / "a.tif", std_dn=9.0, scene="level-1")
    header = read_header(path)
    assert (header.container, header.table.mean_dn, header.table.std_dn) == ("table", 500.5, 9.0)
    assert header.assumes_black
    assert render_preview(path).startswith(b"\x89PNG")


@pytest.mark.parametrize(
    "changes",
    [
        {"mean_dn": 700.0},
        {"mean_dn": float("nan")},
        {"max_dn": float("inf")},
        {"pixels": 0},
        {"pixels": 1.5},
        {"std_dn": -1.0},
        {"black_level_dn": 4095.0},
        {"white_level_dn": "white"},
        {"white_level_dn": 10**400},
        {"white_level_dn": None},
        {"std_dn": [9.0]},
    ],
)
def test_a_row_that_cannot_be_is_refused(tmp_path, changes):
    with pytest.raises(InputRejected):
        read_header(write(tmp_path / "a.tif", **changes))
