"""A demo ends well only where everything agrees."""

import pytest
from rich.console import Console

import stilb
from demo.display import Display
from demo.findings import Finding
from demo.journey import Stage, conclude

VERSION = stilb.Calibration.of({"id": "k", "method": "noise", "state": "published", "version": 4})


@pytest.fixture
def stage(tmp_path):
    return Stage(client=None, folder=tmp_path, display=Display(Console(width=80)))


def findings(*values):
    return [Finding(what="k", value=value, standard_uncertainty=1.0, truth=0.0, unit="1") for value in values]


@pytest.mark.parametrize(("values", "ends_well"), [((0.0, 2.9), True), ((0.0, 3.1), False), ((), False)])
def test_every_finding_counts_and_none_is_no_success(stage, values, ends_well, capsys):
    assert conclude(stage, VERSION, findings(*values)) is ends_well
    assert "version 4 is published" in capsys.readouterr().out
