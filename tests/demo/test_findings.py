"""The table says what the service says, and a figure far from its truth is one that does not agree."""

import pytest
from rich.console import Console

import stilb
from demo.findings import Finding, as_table


def finding(value, what="K, green"):
    quantity = stilb.Quantity(value=value, standard_uncertainty=0.5, unit="1/s")
    return Finding.of(what, quantity, truth=32.0)


def test_the_difference_is_in_standard_uncertainties():
    assert finding(33.0).difference == pytest.approx(2.0)
    assert finding(31.0).difference == pytest.approx(-2.0)


@pytest.mark.parametrize(("value", "agrees"), [(32.0, True), (33.5, True), (33.6, False), (30.4, False)])
def test_three_standard_uncertainties_agree(value, agrees):
    assert finding(value).agrees is agrees


def test_the_table_marks_what_lies_far(capsys):
    Console(width=80).print(as_table("noise", [finding(32.5, "near"), finding(40.0, "off")]))
    lines = {line.split()[0]: line for line in capsys.readouterr().out.splitlines() if line.strip()}
    assert lines["noise"].strip() == "noise beside the simulated truth"
    assert "FAR" not in lines["near"]
    assert "+16.00 FAR" in lines["off"]
    assert lines["off"].split()[-1] == "1/s"
