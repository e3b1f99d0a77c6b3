"""Which frames count, what is missing, what would make the fit good, and what the field team is told."""

from dataclasses import replace

import numpy as np
import pytest

from radiometry.findings import InputRejected, shared
from radiometry.fitting.evidence import Exclusion
from radiometry.frame.packing import pack
from radiometry.noise import codes, verdicts
from radiometry.noise import fit as noise
from radiometry.noise.results import Params
from tests.radiometry.evidence import taken
from tests.radiometry.noise.series import PARAMS, SMALL, TIMES, agrees, flags_of, only, repack, take


def dim(rows, name, factor):
    """The same campaign with the light of one frame changed."""

    def scale(samples, block):
        return replace(block, samples_dn=pack(np.rint((samples - 256) * factor + 256), dtype="<u2"))

    return [repack(row, scale) if row.frame == name else row for row in rows]


@pytest.mark.parametrize(("factor", "used"), [(0.97, True), (0.8, False)])
def test_light_that_drifts_is_flagged_or_left_out(factor, used):
    fit = noise.fit(dim(take(SMALL, 13), "flat-100-0.3-1", factor), PARAMS)
    assert codes.PAIR_LIGHT_DRIFT in flags_of(fit)
    agrees(only(fit).transfer.system_gain_dn_per_e, 0.5)
    (level,) = [level for level in only(fit).levels if level.exposure_time_s == 0.3]
    assert (level.left_out == "") is used
    assert used or "the light changed by 22" in level.left_out


def test_an_excluded_frame_breaks_its_pair():
    exclusion = Exclusion(frame="flat-100-0.1-0", reason="a hand in the picture", by="A. Meier")
    fit = noise.fit(take(SMALL, 14), Params(exclude=(exclusion,)))
    points = {point.frame: point for point in fit.points}
    assert points["flat-100-0.1-0"].left_out == "excluded by A. Meier: a hand in the picture"
    assert points["flat-100-0.1-1"].used  # the linearity takes a mean without a pair
    (level,) = [level for level in only(fit).levels if level.exposure_time_s == 0.1]
    assert "without a pair" in level.left_out


@pytest.mark.parametrize(
    ("keep", "message"),
    [
        (lambda row: row.role == "flat", "ISO 100 has no pair of dark frames"),
        (lambda row: not row.frame.startswith("dark-100-0.02-1"), "ISO 100 has no pair of dark frames"),
        (
            lambda row: row.role == "dark" or row.exposure.exposure_time_s < 0.1,
            "ISO 100 grey has pairs of frames at 2 light levels below white: at least 3",
        ),
        (lambda _: False, "no frame: take pairs of dark and of evenly lit frames"),
    ],
)
def test_what_is_missing_is_named_and_keeps_the_fit_from_starting(keep, message):
    rows = [row for row in take(SMALL, 17) if keep(row)]
    assert noise.missing(rows, PARAMS)[0].startswith(message)
    with pytest.raises(InputRejected, match="The fit cannot start") as refused:
        noise.fit(rows, PARAMS)
    assert refused.value.code is shared.FIT_INCOMPLETE


def test_what_waits_is_named():
    rows = [replace(row, features=None) for row in take(SMALL, 18)[:1]]
    assert noise.missing(rows, PARAMS, unread=("x",)) == (
        "not read yet: frame x",
        "not extracted yet: frame flat-100-0.02-0",
    )


def test_a_plan_names_what_would_make_the_fit_good():
    few = verdicts.plan(take(SMALL, 22, times=TIMES[:4]), PARAMS)
    assert few == (
        "ISO 100 grey has 4 usable levels: add 5 more up to white",
        "ISO 100 grey was never saturated: add a pair that reaches white",
        "ISO 100 grey has no four exposure times of one scene and f-number: no linearity error",
        "ISO 100 has dark frames of one exposure time: add some of a much longer one for the dark current",
        "ISO 100: add dark frames of one setting up to 16 for the DSNU",
        "ISO 100: add frames about half of white of one setting up to 16 for the PRNU",
    )
    two_times = take(SMALL, 22, times=TIMES[:4], dark_times=(0.02, 2.0))
    assert verdicts.plan(two_times, PARAMS) == (*few[:3], *few[4:])
    lights = [row for row in take(SMALL, 23) if row.role == "flat"]
    assert verdicts.plan(lights, PARAMS)[0].startswith("ISO 100 has no pair of dark frames: add two")


@pytest.fixture(scope="module")
def rows():
    return take(SMALL, 1, times=(0.1, 0.3, 2.0), dark_times=(0.1,))


def judge(rows):
    found = verdicts.judge([taken(row, region=None) for row in rows], rows, PARAMS)
    return {frame: (each.outcome, [reason.code for reason in each.reasons]) for frame, each in found.items()}


def test_good_pairs_pass_and_white_frames_alone_copies_and_lit_darks_say_so(rows):
    found = judge(rows)
    assert found["flat-100-0.1-0"] == found["dark-100-0.1-1"] == ("pass", [])
    assert found["flat-100-2-0"] == ("warn", ["clipped"])
    alone = judge([row for row in rows if row.frame != "flat-100-0.3-1"])
    assert alone["flat-100-0.3-0"] == ("warn", ["unpaired"])
    copy = replace(rows[0], frame="zz")
    assert judge([*rows, copy])["zz"] == ("fail", ["redundant"])
    lit = [replace(row, role="dark") if row.frame.startswith("flat-100-0.3") else row for row in rows]
    assert judge(lit)["flat-100-0.3-0"] == ("fail", ["dark_not_dark"])


@pytest.mark.parametrize(("factor", "outcome"), [(1.005, "pass"), (1.05, "warn"), (1.3, "fail")])
def test_light_that_drifts_between_frames_is_told(rows, factor, outcome):
    found = judge(dim(rows, "flat-100-0.1-0", factor))
    assert found["flat-100-0.1-0"][0] == found["flat-100-0.1-1"][0] == outcome
    assert ("pair_drift" in found["flat-100-0.1-0"][1]) is (outcome != "pass")
