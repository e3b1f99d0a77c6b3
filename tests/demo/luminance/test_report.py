"""The table says what the service says, and the demo fails when K is wrong."""

import pytest
from rich.console import Console

import stilb
from demo.luminance.journey import Outcome
from demo.luminance.report import as_table, compare

TRUTH = {3200: 32.0}


def outcome(k, *, shown=None, residuals=(0.01, -0.03)):
    coefficient = {"name": "luminance_k", "value": k, "standard_uncertainty": 0.5, "unit": "u", "iso": 3200}
    points = [{"iso": 3200, "used": True, "residual_rel": residual} for residual in residuals]
    left_out = {"iso": 3200, "used": False, "residual_rel": None}
    return Outcome(
        camera_id="c",
        calibration=stilb.Calibration.of(
            {"id": "k", "method": "luminance", "state": "published", "points": [*points, left_out]}
        ),
        in_force=[stilb.Coefficient.of(coefficient)],
        series=[{"iso": 3200, "name": "luminance_k", "value": k if shown is None else shown}],
    )


def compared(found, tolerance_rel=0.04):
    (row,) = compare(found, truth=TRUTH, tolerance_rel=tolerance_rel)
    return row


def test_the_difference_is_in_standard_uncertainties():
    assert compared(outcome(33.0)).difference == pytest.approx(2.0)


@pytest.mark.parametrize(("k", "agrees"), [(32.0, True), (33.5, True), (33.6, False), (30.4, False)])
def test_k_agrees_within_three_standard_uncertainties(k, agrees):
    assert compared(outcome(k)).agrees is agrees


def test_the_largest_error_counts_either_way_and_only_for_points_in_use():
    row = compared(outcome(32.0))
    assert row.largest_error_rel == 0.03
    assert row.passed
    assert not compared(outcome(32.0), tolerance_rel=0.02).passed


def test_a_series_that_says_something_else_is_an_error():
    with pytest.raises(ValueError, match=r"iso 3200: the series says 31\.0"):
        compared(outcome(32.0, shown=31.0))


def test_an_iso_value_without_a_coefficient_is_an_error():
    with pytest.raises(KeyError, match="6400"):
        compare(outcome(32.0), truth={3200: 32.0, 6400: 32.0}, tolerance_rel=0.04)


@pytest.mark.parametrize(("k", "said"), [(32.5, "within 4%"), (40.0, "far from the truth")])
def test_the_table_fits_a_narrow_terminal(k, said, capsys):
    Console(width=80).print(as_table([compared(outcome(k))]))
    text = capsys.readouterr().out
    assert f"{k:.3f}" in text
    assert "(K-truth)/u(K)" in text
    assert said in " ".join(text.split())
