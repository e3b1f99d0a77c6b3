"""Each reason that lies in one frame's signal: on its boundary, beside it, with the sentence that helps."""

import math
from dataclasses import replace

import pytest

from radiometry.drawing.text import write_exposure
from radiometry.findings import shared
from radiometry.fitting.evidence import Exclusion
from radiometry.frame.statistics import measure_signal
from radiometry.luminance.brightness import DOUBTFUL_REL
from radiometry.luminance.points import estimate_dark
from radiometry.luminance.rows import Params
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

PARAMS = Params()


def verdicts(rows, readings=READINGS, params=PARAMS):
    return judge([taken(row) for row in rows], rows, readings, params)


def codes(rows, frame, readings=READINGS):
    return [reason.code for reason in verdicts(rows, readings)[frame].reasons]


def only(rows, frame, readings=READINGS):
    """The one reason of this frame, when no other frame has any."""
    found = verdicts(rows, readings)
    assert [name for name, verdict in found.items() if verdict.reasons] == [frame]
    (reason,) = found[frame].reasons
    assert found[frame].outcome == reason.outcome
    return reason


def odd(signal_dn, **changes):
    """A frame of which the exposure fits the signal, so that nothing else can be said of it."""
    f_number = math.sqrt(K * 0.1 * 3200 * 5.0 / signal_dn)
    return light("middle", f_number, name="odd", signal_dn=signal_dn, **changes)


# --- clipped and nearly


def test_a_thousandth_is_not_clipped_and_a_little_more_is():
    for share, found in ((0.001, []), (0.00101, ["clipped"])):
        frame = odd(2000.0, saturated_share=share, max_dn=2500)
        assert codes((*ROWS, frame), "odd") == found


@pytest.mark.parametrize(
    ("share", "median", "stops"),
    [
        # std = 232.63 / 2.3263 = 100, highlights 3862.37 + 309.02 - 256 = 3915.4 = 1.275 * 80 %: 0.35 stops
        (0.01, WHITE - 232.63, "2/3 stop"),
        # one sample in ten beyond: std = 1281.55 / 1.28155 = 1000, highlights 5647.7 = 1.839 * 80 %: 0.88
        (0.1, WHITE - 1281.55, "1 stop"),
    ],
)
def test_how_far_a_region_is_clipped_follows_from_its_median(share, median, stops):
    frame = light("middle", 5.6, name="odd", signal_dn=median - DARK, saturated_share=share, median_dn=median)
    found = verdicts((*DARKS, frame))["odd"]
    assert found.outcome == "fail"
    assert found.reasons[0].code == "clipped"
    assert f"{share:.2%} of the region is clipped, more than 0.1%" in found.reasons[0].detail
    assert f"Give it {stops} less light" in found.reasons[0].detail


@pytest.mark.parametrize(
    ("f_number", "share", "median", "stops"),
    [
        # K X = 30 * 0.1 * 3200 * 5 / 2.8^2 = 6122 DN, 1.993 times 80 % of 3839 DN: 0.995 stops
        (2.8, 1.0, WHITE, "1 stop"),
        # by its own median two thirds of a stop as above, by its scene one; and the other way round
        (2.8, 0.01, WHITE - 232.63, "1 stop"),
        (4.0, 0.01, WHITE - 232.63, "2/3 stop"),
    ],
)
def test_how_far_a_region_is_clipped_follows_from_its_scene_too(f_number, share, median, stops):
    frame = light("middle", f_number, name="odd", signal_dn=SPAN, saturated_share=share, median_dn=median)
    found = only((*ROWS, frame), "odd")
    assert found.code == "clipped"
    assert f"Give it {stops} less light" in found.detail


def test_nobody_knows_how_far_a_lone_region_is_clipped():
    frame = light("middle", 2.8, name="odd", signal_dn=SPAN, saturated_share=1.0, median_dn=WHITE)
    assert "Give it at least 2 stops less light" in verdicts((*DARKS, frame))["odd"].reasons[0].detail


def test_highlights_within_five_percent_of_white():
    """0.95 * 3839 + 256 = 3903.05."""
    below, above = (odd(3600.0, max_dn=max_dn, std_dn=30.0) for max_dn in (3903, 3904))
    assert codes((*ROWS, below), "odd") == []
    found = only((*ROWS, above), "odd")
    assert (found.code, found.outcome) == ("nearly_clipped", "warn")
    assert "reach 95% of white" in found.detail
    # 0.9503 / 0.8 = 1.188: 0.25 stops
    assert "Give it 1/3 stop less light" in found.detail


def test_one_hot_pixel_is_no_highlight():
    assert codes((*ROWS, odd(2000.0, max_dn=4095)), "odd") == []
    # 3 + 2 * 3.09 * 300 = 3787 + ... reaches white by its spread: mean 3000 + 927 = 3927 > 3647
    frame = odd(3000.0, max_dn=4095, std_dn=300.0)
    assert "nearly_clipped" in codes((*ROWS, frame), "odd")


# --- too dark and weak


def test_three_standard_errors_above_dark():
    """u(N) = 20 / 100, u(D)^2 = pi / 2 * 0.2^2 (1 / 9 + (t - t_0)^2 / S) at 0.1 s of 0.01, 0.1 and 1 s."""
    lever = 3 * (0.36**2 + 0.27**2 + 0.63**2)
    error = math.hypot(0.2, math.sqrt(math.pi / 2 * 0.04 * (1 / 9 + 0.27**2 / lever)))
    for signal, code, outcome in ((2.99 * error, "too_dark", "fail"), (3.01 * error, "weak_signal", "warn")):
        found = only((*ROWS, odd(signal)), "odd")
        assert (found.code, found.outcome) == (code, outcome)


def test_one_percent_of_the_span_is_useful():
    """38.39 DN; 20 DN are 0.94 stops below."""
    assert codes((*ROWS, odd(38.4)), "odd") == []
    found = only((*ROWS, odd(20.0)), "odd")
    assert found.code == "weak_signal"
    assert "The signal is 20 DN above dark; from 38.4 DN on" in found.detail
    assert "Give it 1 stop more light: a longer time" in found.detail


def test_fifty_standard_errors_are_useful():
    """100 samples of 20 DN: u(N) = 2, with u(D) = 0.0836; fifty times is 100.1 DN."""
    assert codes((*ROWS, odd(100.2, n=100)), "odd") == []
    found = only((*ROWS, odd(100.0, n=100)), "odd")
    assert (found.code, "from 100 DN on" in found.detail) == ("weak_signal", True)


def test_what_may_be_noise_says_only_the_least_number_of_stops():
    found = only((*ROWS, odd(0.01)), "odd")
    # 38.39 / 0.2168 = 177: 7.47 stops
    assert "Give it at least 7 2/3 stops more light" in found.detail


@pytest.mark.parametrize(
    ("time_s", "text"),
    [(1 / 125, "1/125 s"), (0.008, "1/125 s"), (0.5, "0.5 s"), (8.0, "8 s"), (0.3, "0.3 s")],
)
def test_times_are_written_as_marked(time_s, text):
    assert write_exposure(time_s) == text


# --- uneven


def photon(scene, f_number, *, unevenness=0.0, gain=2.0, **changes):
    """std^2 = 20^2 + g S + (u S)^2."""
    row = light(scene, f_number, **changes)
    mean = row.statistics[0].mean_dn
    signal = mean - DARK
    std = math.sqrt(400.0 + gain * signal + (unevenness * signal) ** 2)
    found = replace(row.statistics[0], std_dn=std, max_dn=min(4000, round(mean + 5 * std)))
    return replace(row, statistics=(found,))


def test_spread_beyond_photon_noise():
    """The weakest frame is even: g = 2 DN but for 3 errors of its variance, 3 * sqrt(2 / 10000) = 4.2 %."""
    rows = tuple(photon(scene, f) for scene in ("bright", "middle", "dim") for f in (5.6, 8.0, 16.0))
    others = (*DARKS, *(row for row in rows if row.frame != "middle-3200-5.6"))
    even, uneven = (photon("middle", 5.6, unevenness=u) for u in (0.045, 0.065))
    assert codes((*others, even), even.frame) == []
    found = only((*others, uneven), uneven.frame)
    assert (found.code, found.outcome) == ("uneven", "warn")
    assert "varies over the region by at least 6% beyond noise" in found.detail


@pytest.mark.parametrize(("errors", "found"), [(2.9, False), (3.7, True)])
def test_scatter_of_a_small_region_is_not_unevenness(errors, found):
    """A variance of 100 pixels errs by sqrt(2 / 100): the weak frame's is too low, the other's too high."""

    def scattered(row, sign):
        only = row.statistics[0]
        error = math.sqrt(2 / only.n) * only.std_dn**2
        changed = replace(only, std_dn=math.sqrt(only.std_dn**2 + sign * errors * error))
        return replace(row, statistics=(changed,))

    weak, strong = (
        photon("middle", f_number, gain=40.0, name=name, n=100)
        for f_number, name in ((16.0, "weak"), (8.0, "strong"))
    )
    quiet = tuple(dark(f"quiet-{n}", std_dn=0.1) for n in range(3))
    rows = (*quiet, scattered(weak, -1), scattered(strong, 1))
    # 2.9: 42 * 0.590 * 1.424 is more than 40.5 * 1.410 * 0.576; 3.7: 42 * 0.477 * 1.424 is less by 6.9
    assert ("uneven" in codes(rows, "strong")) is found


def test_photon_noise_alone_is_never_uneven():
    """Whatever the gain, and with a single frame, of which the noise is not known."""
    for gain in (0.1, 10.0, 40.0):
        rows = (*DARKS, *(photon(scene, 8.0, gain=gain) for scene in ("bright", "middle", "dim")))
        assert {v.outcome for v in verdicts(rows).values()} == {"pass"}
    alone = (*DARKS, photon("middle", 8.0, unevenness=0.4))
    assert "uneven" not in codes(alone, "middle-3200-8")


def test_mean_and_median_of_one_surface_agree():
    """Allowed: 3 * 0.7555 * 20 / 100 + 400 / (6 * 1000) + 0.5 = 1.020 DN, then 2 % of 1000 DN."""
    mean = DARK + 1000.0
    for difference, found in ((21.0, []), (21.1, ["uneven"]), (-21.0, []), (-21.1, ["uneven"])):
        assert codes((*ROWS, odd(1000.0, median_dn=mean - difference)), "odd") == found
    (reason,) = verdicts((*ROWS, odd(1000.0, median_dn=mean + 61.02)))["odd"].reasons
    assert "the mean lies 6.0% below the median" in reason.detail.lower()


def test_evenness_is_not_judged_of_weak_signals():
    """5 % of the span are 192 DN."""
    for signal, found in ((191.0, []), (193.0, ["uneven"])):
        assert codes((*ROWS, odd(signal, median_dn=DARK + signal + 20.0)), "odd") == found


def test_a_tone_curve_says_nothing_of_the_light():
    frame = replace(odd(1000.0, median_dn=DARK + 1100.0), rendered=True)
    assert codes((*ROWS, frame), "odd") == []


# --- Each reason that lies in what a frame stands beside: scenes, readings, repeats and dark frames


def test_a_light_frame_without_a_scene():
    frame = replace(odd(1000.0), scene=None)
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


@pytest.mark.parametrize(
    ("factor", "named"), [(1.0, True), (1.09, True), (0.91, True), (1.11, False), (0.89, False)]
)
def test_a_frame_of_another_scene_is_told_which_where_it_fits_to_what_markings_err(factor, named):
    """Labelled bright, ten times too dark: it is the middle one. Time and aperture are its own."""
    frame = light("bright", 4.0, name="odd", luminance=5.0 * factor, time_s=0.03)
    found = only((*ROWS, frame), "odd")
    assert (found.code, found.outcome) == ("scene_doubtful", "warn")
    assert f"{0.1 * factor:.2f} times as bright as the frames of scene bright" in found.detail
    assert ("It would fit scene middle." in found.detail) is named


def test_of_two_that_disagree_both_are_named():
    rows = (*DARKS, light("middle", 8.0), light("middle", 5.6, signal_dn=600.0))
    for frame in ("middle-3200-8", "middle-3200-5.6"):
        assert codes(rows, frame) == ["scene_doubtful"]


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
    frame = replace(light("middle", 8.0, name="odd", time_s=0.1000001), statistics=clipped)
    assert codes((*ROWS, frame), "odd") == []


def test_order_changes_nothing():
    rows = (*ROWS, light("middle", 8.0, name="repeat"), odd(20.0), dark("lit", mean_dn=900.0))
    assert verdicts(rows) == verdicts(tuple(reversed(rows)))


def test_frames_of_other_roles_and_states_are_judged_by_themselves():
    chart = replace(taken(LIGHTS[0]), frame="chart", role="chart")
    auto = replace(chart, frame="auto", flags=(shared.EXPOSURE_NOT_MANUAL,))
    refused = replace(chart, frame="no", state="refused", refusal="No.", format=None)
    found = judge([chart, auto, refused, *map(taken, ROWS)], ROWS, READINGS, PARAMS)
    assert [found[name].outcome for name in ("chart", "auto", "no")] == ["pass", "warn", "fail"]


def test_a_frame_without_statistics_waits_and_says_what_is_known():
    waiting = replace(light("middle", 8.0, name="repeat"), statistics=None)
    frames = [*map(taken, ROWS), taken(waiting, state="read")]
    verdict = judge(frames, (*ROWS, waiting), READINGS, PARAMS)["repeat"]
    assert verdict.outcome == "pending"
    assert [reason.code for reason in verdict.reasons] == ["not_extracted", "redundant"]


def test_a_frame_excluded_by_hand_is_still_judged():
    exclude = (Exclusion(frame="odd", reason="moth", by="me"),)
    rows = (*ROWS, odd(20.0))
    assert verdicts(rows, params=replace(PARAMS, exclude=exclude))["odd"].outcome == "warn"
