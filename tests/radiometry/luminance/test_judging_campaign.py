"""Each reason that lies in what a frame stands beside: scenes, readings, repeats and dark frames."""

import dataclasses

import pytest

from radiometry.findings import shared
from radiometry.fitting.evidence import Exclusion
from radiometry.frame.statistics import measure_signal
from radiometry.luminance.brightness import DOUBTFUL_REL
from radiometry.luminance.points import estimate_dark
from radiometry.luminance.verdicts import judge
from tests.radiometry.evidence import (
    DARK,
    DARKS,
    LIGHTS,
    READINGS,
    ROWS,
    SPAN,
    WHITE,
    K,
    dark,
    light,
    reading,
    statistics,
    taken,
)
from tests.radiometry.luminance.judged import PARAMS, codes, odd, only, verdicts


def test_a_light_frame_without_a_scene():
    frame = dataclasses.replace(odd(1000.0), scene=None)
    found = only((*ROWS, frame), "odd")
    assert (found.code, found.outcome) == ("scene_missing", "fail")


def test_a_scene_without_a_reading_names_those_that_have_one():
    found = verdicts(ROWS, READINGS[:2])
    assert {name for name, verdict in found.items() if verdict.reasons} == {
        row.frame for row in LIGHTS if row.scene == "dim"
    }
    (reason,) = found["dim-3200-8"].reasons
    assert (reason.code, reason.outcome) == ("reading_missing", "pending")
    assert "No luminance reading of scene dim; there are readings of bright, middle." in reason.detail
    lux_only = [*READINGS[:2], reading("dim", 10.0, quantity="illuminance")]
    assert codes(ROWS, "dim-3200-8", lux_only) == ["reading_missing"]


@pytest.mark.parametrize(("second", "drifted"), [(102.0, False), (102.1, True)])
def test_the_lamp_may_drift_by_two_percent(second, drifted):
    """(102.02 - 100) / 101.01 is 2 %."""
    lux = [reading("dim", value, quantity="illuminance") for value in (100.0, second)]
    found = verdicts(ROWS, [*READINGS, *lux])
    frames = {name for name, verdict in found.items() if verdict.reasons}
    assert frames == ({row.frame for row in LIGHTS if row.scene == "dim"} if drifted else set())
    if drifted:
        assert found["dim-3200-8"].reasons[0].code == "lamp_drift"
        assert "spread over 2.1%" in found["dim-3200-8"].reasons[0].detail


@pytest.mark.parametrize(
    ("factor", "doubtful"), [(1.249, False), (1.251, True), (0.751, False), (0.749, True)]
)
def test_a_frame_may_differ_from_its_scene_by_what_markings_err(factor, doubtful):
    signal = factor * K * 0.1 * 3200 * 5.0 / 8.0**2
    frame = light("middle", 8.0, name="odd", time_s=0.1000001, signal_dn=signal)
    assert codes((*ROWS, frame), "odd") == (["scene_doubtful"] if doubtful else [])
    assert abs(factor - 1) > DOUBTFUL_REL or not doubtful


def test_a_frame_of_another_scene_is_told_which():
    """Labelled bright, ten times too dark: it is the middle one. Time and aperture are its own."""
    frame = light("bright", 4.0, name="odd", luminance=5.0, time_s=0.03)
    found = only((*ROWS, frame), "odd")
    assert (found.code, found.outcome) == ("scene_doubtful", "warn")
    assert "0.10 times as bright as the frames of scene bright" in found.detail
    assert "It would fit scene middle." in found.detail


@pytest.mark.parametrize(("factor", "named"), [(1.09, True), (0.91, True), (1.11, False), (0.89, False)])
def test_a_scene_is_named_where_it_fits_to_what_markings_err(factor, named):
    frame = light("bright", 4.0, name="odd", luminance=5.0 * factor, time_s=0.03)
    found = only((*ROWS, frame), "odd")
    assert found.code == "scene_doubtful"
    assert ("It would fit scene middle." in found.detail) is named


def test_of_two_that_disagree_both_are_named():
    rows = (*DARKS, light("middle", 8.0), light("middle", 5.6, signal_dn=600.0))
    for frame in ("middle-3200-8", "middle-3200-5.6"):
        assert codes(rows, frame) == ["scene_doubtful"]


def test_a_clipped_frame_is_not_compared():
    frame = light("middle", 2.8, name="odd", signal_dn=SPAN, saturated_share=1.0, median_dn=WHITE)
    assert only((*ROWS, frame), "odd").code == "clipped"


def test_a_repeat_is_redundant_and_the_first_is_not():
    repeat = light("middle", 8.0, name="repeat")
    found = only((*ROWS, repeat), "repeat")
    assert (found.code, found.outcome) == ("redundant", "warn")
    assert "middle-3200-8 shows scene middle at ISO 3200, 1/10 s, f/8 already" in found.detail
    assert only((repeat, *ROWS), "repeat").code == "redundant"


def test_another_time_scene_or_iso_is_no_repeat():
    assert codes((*ROWS, light("middle", 8.0, name="x", time_s=0.05)), "x") == []
    rows = (*ROWS, *(dark(f"d{n}", iso=6400.0) for n in range(3)), light("middle", 8.0, name="x", iso=6400.0))
    assert codes(rows, "x") == []


def test_dark_frames_may_repeat():
    assert codes((*ROWS, dark("again", time_s=0.1)), "again") == []


# --- dark frames


def test_a_dark_frame_above_the_others_saw_light():
    """0.1 % of 3839 is 3.839 DN; of noise, three errors are 0.85 DN."""
    assert codes((*ROWS, dark("odd", mean_dn=DARK + 3.8)), "odd") == []
    found = only((*ROWS, dark("odd", mean_dn=DARK + 3.9)), "odd")
    assert (found.code, found.outcome) == ("dark_not_dark", "fail")
    assert "3.9 DN above that of dark-0.1-0" in found.detail


def test_noise_of_a_small_region_is_no_light():
    """100 samples of 20 DN: three errors of the difference with 0.2 DN are 6.03 DN."""
    assert codes((*ROWS, dark("odd", mean_dn=DARK + 6.0, n=100)), "odd") == []
    assert codes((*ROWS, dark("odd", mean_dn=DARK + 6.1, n=100)), "odd") == ["dark_not_dark"]


def test_dark_current_grows_with_time():
    """A dark frame at more than twice or less than half the time is no measure."""
    assert codes((*ROWS, dark("odd", mean_dn=DARK + 10.0, time_s=2.0)), "odd") == ["dark_not_dark"]
    assert codes((*ROWS, dark("odd", mean_dn=DARK + 10.0, time_s=2.01)), "odd") == []
    assert codes((*ROWS, dark("odd", mean_dn=DARK + 10.0, iso=6400.0)), "odd") == []


@pytest.mark.parametrize(
    ("above", "outcome"), [(19.1, "pass"), (19.3, "warn"), (191.0, "warn"), (193.0, "fail"), (2800.0, "fail")]
)
def test_dark_frames_that_agree_are_held_against_black(above, outcome):
    """The lamp burnt in all of them: 0.5 % of 3839 is 19.2 DN, 5 % is 192 DN."""
    rows = (*LIGHTS, *(dark(f"d{n}", mean_dn=DARK + above) for n in range(3)))
    found = verdicts(rows)
    assert {found[f"d{n}"].outcome for n in range(3)} == {outcome}


def test_a_black_level_of_zero_states_none():
    rows = tuple(dark(f"d{n}", mean_dn=512.0, black_level_dn=0.0) for n in range(3))
    assert {verdict.outcome for verdict in verdicts(rows).values()} == {"pass"}


def test_light_in_dark_frames_is_not_held_against_light_frames():
    """With these as dark, the median would be 1256 DN and half of the light frames too dark."""
    lit = tuple(dark(f"lit-{n}", mean_dn=DARK + 1000.0) for n in range(10))
    found = verdicts((*ROWS, *lit))
    assert {name for name, verdict in found.items() if verdict.reasons} == {row.frame for row in lit}


# --- what it stands on


def test_the_dark_signal_is_that_of_the_fit():
    """Without dark frames: the black level, to one step of 12 bits."""
    rows = (*LIGHTS, odd(46.0))
    assert "weak_signal" in codes(rows, "odd")
    error = estimate_dark([], [measure_signal(rows[0].statistics)]).standard_uncertainty_dn
    assert 50 * error > 46.0
    assert codes((*rows, *DARKS), "odd") == []


def test_greens_count_and_red_does_not():
    clipped = (
        statistics(WHITE, channel="R", saturated_share=1.0),
        statistics(DARK + 750.0, channel="G1"),
        statistics(DARK + 750.0, channel="G2"),
        statistics(2000.0, channel="grey", saturated_share=0.25, std_dn=900.0),
    )
    frame = dataclasses.replace(light("middle", 8.0, name="odd", time_s=0.1000001), statistics=clipped)
    assert codes((*ROWS, frame), "odd") == []


def test_order_changes_nothing():
    rows = (*ROWS, light("middle", 8.0, name="repeat"), odd(20.0), dark("lit", mean_dn=900.0))
    assert verdicts(rows) == verdicts(tuple(reversed(rows)))


def test_frames_of_other_roles_and_states_are_judged_by_themselves():
    chart = dataclasses.replace(taken(LIGHTS[0]), frame="chart", role="chart")
    auto = dataclasses.replace(chart, frame="auto", flags=(shared.EXPOSURE_NOT_MANUAL,))
    refused = dataclasses.replace(chart, frame="no", state="refused", refusal="No.", format=None)
    found = judge([chart, auto, refused, *map(taken, ROWS)], ROWS, READINGS, PARAMS)
    assert [found[name].outcome for name in ("chart", "auto", "no")] == ["pass", "warn", "fail"]


def test_a_frame_without_statistics_waits_and_says_what_is_known():
    waiting = dataclasses.replace(light("middle", 8.0, name="repeat"), statistics=None)
    frames = [*map(taken, ROWS), taken(waiting, state="read")]
    verdict = judge(frames, (*ROWS, waiting), READINGS, PARAMS)["repeat"]
    assert verdict.outcome == "pending"
    assert [reason.code for reason in verdict.reasons] == ["not_extracted", "redundant"]


def test_a_frame_excluded_by_hand_is_still_judged():
    exclude = (Exclusion(frame="odd", reason="moth", by="me"),)
    rows = (*ROWS, odd(20.0))
    assert verdicts(rows, params=dataclasses.replace(PARAMS, exclude=exclude))["odd"].outcome == "warn"
