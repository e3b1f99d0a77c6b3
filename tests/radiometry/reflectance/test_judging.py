"""What a field team is told of each frame of a reflectance campaign, and what would make its fit good."""

from dataclasses import replace

import pytest

from radiometry.reflectance import findings as reflectance_findings
from radiometry.reflectance import method as reflectance
from radiometry.reflectance.findings import review_frame
from tests.radiometry.evidence import taken
from tests.radiometry.reflectance.captures import PANEL_R, READINGS, change_features, panel, seeded, take
from tests.radiometry.reflectance.test_sunshine import BRIGHT

PARAMS = reflectance.Params()


def verdicts(rows, readings=READINGS, params=PARAMS):
    found = reflectance_findings.judge([taken(row) for row in rows], rows, readings, params)
    return {
        frame: (verdict.outcome, [reason.code for reason in verdict.reasons])
        for frame, verdict in found.items()
    }


def test_a_good_capture_passes_as_a_whole():
    assert list(verdicts(panel()).values()) == [("pass", [])] * 4


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"saturated_share": 0.001}, ("pass", [])),
        ({"saturated_share": 0.0011}, ("fail", ["clipped"])),
        ({"i_sq": 3.1, "i_sq_standard_uncertainty": 1.0}, ("pass", [])),
        ({"i_sq": 3.0, "i_sq_standard_uncertainty": 1.0}, ("fail", ["panel_weak"])),
        ({"gradient_rel": 0.03}, ("pass", [])),
        ({"gradient_rel": 0.04}, ("warn", ["panel_uneven"])),
    ],
)
def test_a_panel_is_judged_by_its_saturation_its_signal_and_its_evenness(changes, expected):
    rows = panel()[:1]
    if "saturated_share" in changes:
        changes = {"statistics": replace(rows[0].features.statistics, **changes)}
    assert verdicts(change_features(rows, **changes)) == {"panel-0-green": expected}


def test_a_band_of_which_nobody_said_what_the_panel_reflects():
    found = verdicts(panel(), readings=[reading for reading in READINGS if reading.band != "nir"])
    assert found["panel-0-nir"] == ("warn", ["panel_unknown"])
    assert found["panel-0-red"] == ("pass", [])


def test_sunshine_that_cannot_be_used_is_said_of_every_frame_that_needs_it():
    field = take(seeded(2), PANEL_R, role="field", minutes=5.0, gain_indices=(3,) * 10)
    found = verdicts([*panel(), *field])
    assert found["field-5-green"] == ("warn", ["sunshine_unusable"])
    assert found["panel-0-green"] == ("pass", [])
    alone = verdicts([*panel(), *field], params=reflectance.Params(normalisation="panel_only"))
    assert alone["field-5-green"] == ("pass", [])


def test_frame_read_in_channel_1_alone_is_flagged_and_does_not_pass():
    """All ten readings of channel 0 stopped at 65535."""
    (row,) = take(seeded(2), PANEL_R, role="field", minutes=5.0)[:1]
    band = replace(BRIGHT, band=row.header.multispectral.band)
    row = replace(row, header=replace(row.header, multispectral=band))
    assert [raised.flag for raised in review_frame(row.header, exposure=None)] == ["sunshine_second_channel"]
    assert verdicts([row]) == {row.frame: ("warn", ["sunshine_second_channel"])}


def test_what_would_make_the_fit_good():
    once = "the panel was photographed once: take it after the flight too, to see the drift"
    assert reflectance_findings.plan(panel(), READINGS, PARAMS) == (once,)
    twice = [*panel(), *panel(2, minutes=20.0)]
    assert reflectance_findings.plan(twice, READINGS, PARAMS) == ()
    certain = [replace(reading, standard_uncertainty=None) for reading in READINGS]
    assert reflectance_findings.plan(twice, certain, PARAMS) == (
        "the panel states no uncertainty: register it with that of its certificate",
    )
    field = take(seeded(3), PANEL_R, role="field", minutes=5.0)
    lacking = [row for row in twice if not row.frame.endswith("nir")]
    assert reflectance_findings.plan([*lacking, *field], READINGS, PARAMS) == (
        "no panel frame can be used (band nir)",
    )
