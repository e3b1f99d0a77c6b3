"""What a field team is told of each frame of a noise campaign."""

from dataclasses import replace

import numpy as np
import pytest

from radiometry.frame.packing import pack, unpack
from radiometry.noise import verdicts as noise_verdicts
from radiometry.noise.results import Features, Params
from simulation.camera import change
from simulation.targets import COUNTING_SENSOR
from tests.radiometry.evidence import taken
from tests.radiometry.noise.series import take

SENSOR = change(COUNTING_SENSOR, height_px=32, width_px=32)


@pytest.fixture(scope="module")
def rows():
    return take(SENSOR, 1, times=(0.1, 0.3, 2.0), dark_times=(0.1,))


def verdicts(rows):
    found = noise_verdicts.judge([taken(row, region=None) for row in rows], rows, Params())
    return {
        frame: (verdict.outcome, [reason.code for reason in verdict.reasons])
        for frame, verdict in found.items()
    }


def test_good_pairs_pass_and_white_frames_alone_copies_and_lit_darks_say_so(rows):
    found = verdicts(rows)
    assert found["flat-100-0.1-0"] == found["dark-100-0.1-1"] == ("pass", [])
    assert found["flat-100-2-0"] == ("warn", ["clipped"])
    alone = verdicts([row for row in rows if row.frame != "flat-100-0.3-1"])
    assert alone["flat-100-0.3-0"] == ("warn", ["unpaired"])
    copy = replace(rows[0], frame="zz")
    assert verdicts([*rows, copy])["zz"] == ("fail", ["redundant"])
    lit = [replace(row, role="dark") if row.frame.startswith("flat-100-0.3") else row for row in rows]
    assert verdicts(lit)["flat-100-0.3-0"] == ("fail", ["dark_not_dark"])


def brighten(row, factor):
    (block,) = row.features.blocks
    samples = np.rint((unpack(block.samples_dn) - 256) * factor + 256)
    changed = replace(block, samples_dn=pack(samples, dtype="<u2"))
    return replace(row, features=Features(blocks=(changed,)))


@pytest.mark.parametrize(("factor", "outcome"), [(1.005, "pass"), (1.05, "warn"), (1.3, "fail")])
def test_light_that_drifts_between_frames_is_told(rows, factor, outcome):
    changed = [brighten(row, factor) if row.frame == "flat-100-0.1-0" else row for row in rows]
    found = verdicts(changed)
    assert found["flat-100-0.1-0"][0] == found["flat-100-0.1-1"][0] == outcome
    assert ("pair_drift" in found["flat-100-0.1-0"][1]) is (outcome != "pass")
