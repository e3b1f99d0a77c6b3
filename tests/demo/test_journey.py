"""A demo shows how far it is and what it found, and ends well only where everything agrees with the truth."""

import io

import pytest
from rich.console import Console

import stilb
from demo.journey import Display, Finding, Stage, as_table, conclude

VERSION = stilb.Calibration.of({"id": "k", "method": "noise", "state": "published", "version": 4})


@pytest.mark.parametrize("terminal", [False, True])
def test_a_stage_is_shown_once_it_is_done(terminal):
    text = io.StringIO()
    display = Display(Console(file=text, width=80, force_terminal=terminal))
    with display.stage("sending") as advance:
        for share in range(100):
            advance(share / 100)
    assert "sending" in text.getvalue()
    assert "100%" in text.getvalue()
    assert terminal or len(text.getvalue().splitlines()) == 1


def test_addresses_are_printed_whole():
    text = io.StringIO()
    Display(Console(file=text, width=80)).say("key [red]" + "k" * 200)
    assert "k" * 200 in text.getvalue()


@pytest.mark.parametrize(("value", "agrees"), [(32.0, True), (33.5, True), (33.6, False), (30.4, False)])
def test_three_standard_uncertainties_agree(value, agrees):
    quantity = stilb.Quantity(value=value, standard_uncertainty=0.5, unit="1/s")
    finding = Finding.of("K, green", quantity, truth=32.0)
    assert finding.difference == pytest.approx((value - 32.0) / 0.5)
    assert finding.agrees is agrees


def test_the_table_marks_what_lies_far(capsys):
    findings = [
        Finding(what=what, value=value, standard_uncertainty=0.5, truth=32.0, unit="1/s")
        for what, value in (("near", 32.5), ("off", 40.0))
    ]
    Console(width=80).print(as_table("noise", findings))
    lines = {line.split()[0]: line for line in capsys.readouterr().out.splitlines() if line.strip()}
    assert lines["noise"].strip() == "noise beside the simulated truth"
    assert "FAR" not in lines["near"]
    assert "+16.00 FAR" in lines["off"]
    assert lines["off"].split()[-1] == "1/s"


@pytest.mark.parametrize(("values", "ends_well"), [((0.0, 2.9), True), ((0.0, 3.1), False), ((), False)])
def test_every_finding_counts_and_none_is_no_success(tmp_path, values, ends_well, capsys):
    stage = Stage(client=None, folder=tmp_path, display=Display(Console(width=80)))
    findings = [Finding(what="k", value=v, standard_uncertainty=1.0, truth=0.0, unit="1") for v in values]
    assert conclude(stage, VERSION, findings) is ends_well
    assert "version 4 is published" in capsys.readouterr().out
