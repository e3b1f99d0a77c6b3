"""The table says what the service says, and the demo fails when K is wrong."""

import pytest
from rich.console import Console

import stilb
from demo.luminance import as_table, compare, find_largest_errors

TRUTH = {3200: 32.0}


def compared(k, *, shown=None, truth=TRUTH):
    coefficient = {"name": "luminance_k", "value": k, "standard_uncertainty": 0.5, "unit": "u", "iso": 3200}
    series = [{"iso": 3200, "name": "luminance_k", "value": k if shown is None else shown}]
    return compare([stilb.Coefficient.of(coefficient)], series, truth=truth)


def test_the_largest_error_counts_either_way_and_only_for_points_in_use():
    points = [{"iso": 3200, "used": True, "residual_rel": residual} for residual in (0.01, -0.03)]
    left_out = {"iso": 3200, "used": False, "residual_rel": None}
    version = {"id": "k", "method": "luminance", "state": "published", "points": [*points, left_out]}
    assert find_largest_errors(stilb.Calibration.of(version)) == {3200: 0.03}


def test_a_series_that_says_something_else_is_an_error():
    with pytest.raises(ValueError, match=r"iso 3200: the series says 31\.0"):
        compared(32.0, shown=31.0)


def test_an_iso_value_without_a_coefficient_is_an_error():
    with pytest.raises(KeyError, match="6400"):
        compared(32.0, truth={3200: 32.0, 6400: 32.0})


@pytest.mark.parametrize(
    ("k", "tolerance_rel", "said"),
    [(32.5, 0.04, "within 4%"), (32.5, 0.02, "beyond 2%"), (40.0, 0.04, "far from the truth")],
)
def test_the_table_fits_a_narrow_terminal(k, tolerance_rel, said, capsys):
    table = as_table(compared(k), {3200: 0.03}, tolerance_rel=tolerance_rel)
    Console(width=80).print(table)
    text = capsys.readouterr().out
    assert f"{k:.3f}" in text
    assert "(K-truth)/u(K)" in text
    assert said in " ".join(text.split())
