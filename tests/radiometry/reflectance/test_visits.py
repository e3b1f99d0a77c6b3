"""K from several visits to the panel: its drift, its line in time, and what scatters between frames."""

import math
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from radiometry.findings import InputRejected
from radiometry.fitting.evidence import Exclusion
from radiometry.reflectance import method as reflectance
from radiometry.reflectance import results
from radiometry.reflectance.results import evaluate_k
from radiometry.reflectance.sun import read_clock_s
from radiometry.reflectance.sunshine import measure_light
from simulation.sequoia import capture, draw_change
from tests.radiometry.reflectance.captures import (
    CAMERA,
    PANEL_R,
    READINGS,
    change_band,
    change_features,
    flags_of,
    k_of,
    make_header,
    panel,
    row,
    seeded,
    take,
)

PARAMS = reflectance.Params()
# half a walk, half light that settles: the variance of K's change relative to half an hour's, by hand
V250, V600, V750, V1000, V1200 = (
    0.5 * (t / 1800 + 1 - math.exp(-t / 300)) for t in (250, 600, 750, 1000, 1200)
)


def test_drift_between_two_visits_is_reported_and_counted():
    drifted = {**CAMERA.bands, "green": replace(CAMERA.bands["green"], reflectance_k=1378.0)}
    rows = [*panel(), *panel(2, minutes=20.0, camera=replace(CAMERA, bands=drifted))]
    found = reflectance.fit(rows, READINGS, PARAMS)
    fit = k_of(found)
    assert fit.visits == 2
    assert fit.drift_rel == pytest.approx(78 / 1339, abs=0.015)
    assert [each.where for each in found.flags if each.flag == "panel_drift"] == ["band green"]
    assert fit.coefficient.reflectance_k == pytest.approx(1339, rel=0.01)
    assert "panel_once" not in flags_of(found.flags)
    assert "panel_once" in flags_of(reflectance.fit(panel(), READINGS, PARAMS).flags)


def make_linear(**changes):
    """Knots of K = 1000 and 1100 at 0 s and 1000 s, 1 % and 2 % of their own, 0.5 % shared, 3 % of drift."""
    fit = reflectance.fit(panel(), READINGS, reflectance.Params(interpolation="linear"))
    knots = tuple(
        results.Knot(at_s=at_s, reflectance_k=k, u_rel=u, half_span_s=10.0)
        for at_s, k, u in ((0.0, 1000.0, 0.01), (1000.0, 1100.0, 0.02))
    )
    fixed = {"knots": knots, "shared_u_rel": 0.005, "drift_u_rel": 0.0, "drift_half_hour_rel": 0.03}
    return replace(k_of(fit).coefficient, **fixed | changes)


@pytest.mark.parametrize(
    ("at_s", "k", "own", "drift", "outside_s"),
    [
        (0.0, 1000.0, 0.01, 0.0, 0.0),
        (250.0, 1025.0, math.hypot(7.5, 5.5) / 1025.0, 0.75 * V250 + 0.25 * V750 - 0.1875 * V1000, 0.0),
        (1000.0, 1100.0, 0.02, 0.0, 0.0),
        (-250.0, 1000.0, 0.01, V250, -240.0),
        (1750.0, 1100.0, 0.02, V750, 740.0),
    ],
)
def test_k_of_time_is_a_line_between_the_visits_and_drifts_outside(at_s, k, own, drift, outside_s):
    found = evaluate_k(make_linear(), at_s=at_s)
    assert (found.value, found.outside_s) == (pytest.approx(k), outside_s)
    assert found.u_rel == pytest.approx(math.hypot(0.005, own))
    assert found.drift_u_rel == pytest.approx(0.03 * math.sqrt(drift))


def test_k_at_an_unknown_time_is_the_mean_with_the_whole_difference():
    found = evaluate_k(make_linear(), at_s=None)
    assert (found.value, found.outside_s) == (pytest.approx(1050.0), None)
    assert found.drift_u_rel == pytest.approx(math.hypot(0.03, 100 / 1050))


def test_years_between_a_frame_and_the_visits_count_as_a_day():
    knots = make_linear().knots
    late, day = (evaluate_k(make_linear(), at_s=knots[-1].at_s + s).drift_u_rel for s in (1.5e9, 86_400.0))
    assert late == day == pytest.approx(0.03 * math.sqrt(24.5))


def test_a_version_without_an_estimate_of_drift_takes_the_usual_one():
    found = evaluate_k(make_linear(drift_half_hour_rel=None), at_s=1750.0)
    assert found.drift_u_rel == pytest.approx(0.02 * math.sqrt(V750))


def test_a_third_visit_bends_the_line():
    knots = (*make_linear().knots, results.Knot(at_s=2000.0, reflectance_k=900.0, u_rel=0.01))
    coefficient = make_linear(knots=knots)
    assert evaluate_k(coefficient, at_s=500.0).value == pytest.approx(1050.0)
    assert evaluate_k(coefficient, at_s=1500.0).value == pytest.approx(1000.0)


def test_frames_that_scatter_more_than_they_should_make_k_less_certain():
    rows = [*panel(), *panel(2, minutes=1.0), *panel(3, minutes=2.0)]
    rows = [each for each in rows if "green" in each.frame]
    spread = [
        change_features([each], i_sq=each.features.i_sq * f)[0]
        for each, f in zip(rows, (0.9, 1, 1.1), strict=True)
    ]
    fit = k_of(reflectance.fit(spread, READINGS, PARAMS))
    ks = [point.reflectance_k for point in reflectance.fit(spread, READINGS, PARAMS).points]
    own = [
        entry.u_rel
        for entry in fit.budget
        if entry.source in ("pixel noise", "sunshine readings", "repeat of the panel")
    ]
    assert math.hypot(*own) == pytest.approx(np.std(ks, ddof=1) / np.mean(ks) / math.sqrt(3))
    assert fit.coefficient.coverage_factor > 2.5  # two degrees of freedom, and four of the drift


def drift_of(fit):
    return next(entry.u_rel for entry in fit.budget if entry.source == "drift")


def test_the_difference_of_two_visits_is_in_the_budget():
    """Five degrees of freedom, four of them assumed: 10 % in 20 minutes."""
    again = panel(2, minutes=20.0)
    less = [change_features([row], i_sq=row.features.i_sq / 1.1)[0] for row in again]
    fits = [reflectance.fit([*panel(), *rows], READINGS, PARAMS) for rows in ([], again, less)]
    once, same, other = (drift_of(k_of(fit)) for fit in fits)
    middle = V600 - 0.25 * V1200
    assert (once, same) == (pytest.approx(0.02, abs=1e-4), pytest.approx(0.02 * math.sqrt(0.8 * middle)))
    expected = math.sqrt((4 * 0.02**2 + math.log(1.1) ** 2 / V1200) / 5 * middle)
    assert other == pytest.approx(expected, rel=0.07)
    detail = next(each.detail for each in fits[0].flags if each.flag == "panel_once")
    assert "2.0% of K are assumed" in detail
    assert "1.4% in between" in detail


def test_a_constant_k_has_the_difference_as_a_rectangle():
    rows = [*panel(), *panel(2, minutes=20.0)]
    linear, constant = (
        k_of(reflectance.fit(rows, READINGS, reflectance.Params(interpolation=each)))
        for each in ("linear", "constant")
    )
    more = math.sqrt(drift_of(constant) ** 2 - drift_of(linear) ** 2)
    assert more == pytest.approx(abs(constant.drift_rel) / math.sqrt(12))


def test_several_single_readings_show_their_noise():
    rows = [row for n in range(6) for row in panel(n, minutes=0.3 * n, gain_indices=(1,))]
    steady = k_of(reflectance.fit(rows, READINGS, PARAMS)).coefficient
    assert steady.reading_u_rel == pytest.approx(math.sqrt((2 * 0.025**2 + 20 * 0.01**2) / 22), rel=0.25)
    random = seeded(4)
    noisy = [
        change_features([row], i_sq=row.features.i_sq * (1 + 0.05 * random.standard_normal()))[0]
        for row in rows
    ]
    found = k_of(reflectance.fit(noisy, READINGS, PARAMS)).coefficient
    assert found.reading_u_rel == pytest.approx(math.sqrt((2 * 0.025**2 + 20 * 0.05**2) / 22), rel=0.3)
    assert k_of(reflectance.fit(panel(), READINGS, PARAMS)).coefficient.reading_u_rel is None


def test_single_readings_of_two_visits_show_in_which_bands_they_differ():
    """What all bands share is drift, and no noise of the readings."""
    before, after = panel(1, gain_indices=(1,)), panel(2, minutes=20.0, gain_indices=(1,))
    darker = [change_features([row], i_sq=row.features.i_sq / 1.1)[0] for row in after]
    found = [
        k_of(reflectance.fit([*before, *rows], READINGS, PARAMS)).coefficient for rows in ([], after, darker)
    ]
    once, same, less = (each.reading_u_rel for each in found)
    assert once == pytest.approx(0.025)
    assert same == pytest.approx(less) == pytest.approx(math.sqrt((2 * 0.025**2 + 3 * 0.01**2) / 5), rel=0.25)
    assert found[1].coverage_factor < found[0].coverage_factor


def retime(rows, taken_at, **band):
    changed = change_band(rows, **band) if band else rows
    return [replace(r, header=replace(r.header, taken_at=taken_at)) for r in changed]


def doubts_of(found):
    return [each.detail for each in found.flags if each.flag == "panel_times_doubtful"]


def test_the_order_of_upload_is_not_the_order_of_visits():
    rows = [*panel(), *panel(2, minutes=20.0)]
    there = reflectance.fit(rows, READINGS, PARAMS)
    assert reflectance.fit(rows[::-1], READINGS[::-1], PARAMS) == there
    assert doubts_of(there) == []


@pytest.mark.parametrize(
    ("before", "after", "why"),
    [
        ({"taken_at": "1970-01-01T00:01:00"}, {"taken_at": "2018-06-13T11:20:00"}, "dated before 2000"),
        (
            {"taken_at": "2018-06-13T11:00:00", "exposed_at_us": 10**8, "flight_id": "F"},
            {"taken_at": "2018-06-13T12:20:00", "exposed_at_us": 13 * 10**8, "flight_id": "F"},
            "jumped by 3600 s",
        ),
    ],
)
def test_a_clock_that_jumped_between_the_visits_leaves_k_without_times(before, after, why):
    fit = reflectance.fit(
        [*retime(panel(), **before), *retime(panel(2, minutes=20.0), **after)], READINGS, PARAMS
    )
    assert [why in detail for detail in doubts_of(fit)] == [True]
    coefficient = k_of(fit).coefficient
    assert [knot.at_s for knot in coefficient.knots] == [None, None]
    assert evaluate_k(coefficient, at_s=1.5e9).outside_s is None
    assert drift_of(k_of(fit)) >= 0.02


def test_visits_of_two_days_and_frames_without_a_time_are_said():
    days = reflectance.fit([*panel(), *panel(2, minutes=24 * 60.0)], READINGS, PARAMS)
    assert doubts_of(days) == ["Two visits to the panel are 24 hours apart."]
    assert drift_of(k_of(days)) > 0.04
    timeless = reflectance.fit(retime(panel(), None), READINGS, PARAMS)
    assert doubts_of(timeless) == ["No panel frame states its time: one visit is assumed."]
    mixed = [*panel(), *panel(2, minutes=20.0), *retime(panel(3, prefix="lost"), None)]
    found = reflectance.fit(mixed, READINGS, PARAMS)
    left_out = {point.left_out for point in found.points if "lost" in point.frame}
    assert left_out == {"its time is not known, and the panel was visited more than once"}
    assert k_of(found).visits == 2


def simulate(kind, size_rel, *, visits_s, ask_s, seed, count):
    """Return errors of K at moments of a flight in expanded uncertainties, while K changes unnoticed.

    Light, level and panel err by what the fit states of them; it is not told how K changes.
    """
    random = seeded(seed)
    base = take(seeded(), {name: PANEL_R[name] for name in ("green", "nir")})
    stated = {entry.source: entry.u_rel for entry in k_of(reflectance.fit(base, READINGS, PARAMS)).budget}
    times, start = sorted({*visits_s, *ask_s}), read_clock_s(base[0].header)
    errors = []
    for _ in range(count):
        change = dict(zip(times, draw_change(random, times, kind=kind, size_rel=size_rel), strict=True))
        panel_rel = stated["panel reflectance"] * random.standard_normal(len(base))
        angle_rel, rows = stated["panel angle"] * random.standard_normal(), []
        for at_s in visits_s:
            level_rel = stated["sunshine tilt"] * random.standard_normal()
            rest = stated["sunshine readings"] * random.standard_normal(len(base))
            taken_at = datetime.fromtimestamp(start + at_s, UTC).isoformat()
            for each, own in zip(base, panel_rel + angle_rel + level_rel + rest, strict=True):
                r = PANEL_R[each.features.band]
                i_ss = measure_light(each.header, params=PARAMS.levelling).i_ss
                rows += retime(
                    change_features([each], i_sq=r * i_ss / (1300.0 * math.exp(change[at_s] + own))), taken_at
                )
        rows = [replace(each, frame=f"{n}") for n, each in enumerate(rows)]
        fit = k_of(reflectance.fit(rows, READINGS, PARAMS)).coefficient
        for at_s in ask_s:
            found = evaluate_k(fit, at_s=start + at_s)
            u_rel = fit.coverage_factor * math.hypot(found.u_rel, found.drift_u_rel)
            errors.append((found.value / (1300.0 * math.exp(change[at_s])) - 1.0) / u_rel)
    return np.array(errors)


@pytest.mark.parametrize(
    ("kind", "size_rel", "visits_s"),
    [("walk", 0.03, (0.0, 1800.0)), ("light", 0.015, (0.0, 1800.0)), ("walk", 0.02, (0.0,))],
)
def test_k_in_flight_lies_within_its_uncertainty_as_often_as_stated(kind, size_rel, visits_s):
    """40 flights, five moments each."""
    asked = (300.0, 700.0, 900.0, 1100.0, 1500.0)
    errors = simulate(kind, size_rel, visits_s=visits_s, ask_s=asked, seed=3, count=40)
    assert 0.88 < np.mean(np.abs(errors) < 1.0) < 1.0


# --- Panel captures that a fit leaves out, flags or refuses, and what it lacks


def test_a_saturated_panel_is_left_out_by_name():
    bright = capture(CAMERA, seeded(), reflectance={"green": 0.6})["green"]
    rows = [row("bright", bright), *panel()[:1]]
    found = reflectance.fit(rows, READINGS, PARAMS)
    points = {point.frame: point for point in found.points}
    assert not points["bright"].used
    assert points["bright"].left_out.startswith("saturated")
    assert points["bright"].saturated_share > 0.5
    assert "panel_saturated" in flags_of(found.flags)
    with pytest.raises(InputRejected, match=r"saturated: .* of the region\. Take the panel again") as refusal:
        reflectance.fit(rows[:1], READINGS, PARAMS)
    assert refusal.value.code == "panel_saturated"


def test_an_uneven_panel_is_flagged_and_counted():
    ramp = np.tile(0.18 * (1 + 0.06 * (np.arange(160) - 80) / 60), (120, 1))
    rows = take(seeded(), {"green": ramp, "red": 0.18})
    found = reflectance.fit(rows, READINGS, PARAMS)
    uneven = [raised for raised in found.flags if raised.flag == "panel_uneven"]
    assert [raised.where for raised in uneven] == ["band green"]
    shares = {entry.source: entry.u_rel for entry in k_of(found).budget}
    assert shares["panel evenness"] == pytest.approx(0.06 * 59 / 60 / math.sqrt(12), rel=0.1)


def test_a_capture_that_lacks_a_band_is_flagged():
    rows = [*panel(), *(each for each in panel(2, minutes=20.0) if "nir" not in each.frame)]
    found = reflectance.fit(rows, READINGS, PARAMS)
    missing = [each for each in found.flags if each.flag == "band_missing"]
    assert [(each.where, each.detail) for each in missing] == [("capture panel-20", "Not there: nir.")]


def test_a_band_without_a_reflectance_is_named_and_left_out():
    readings = [reading for reading in READINGS if reading.band != "nir"]
    assert reflectance.missing(panel(), readings, PARAMS) == (
        f"panel {readings[0].panel} has no reflectance (band nir): register it with what it reflects there",
    )
    assert "register the panel" in reflectance.missing(panel(), (), PARAMS)[0]
    found = reflectance.fit(panel(), readings, PARAMS)
    assert [each.coefficient.band for each in found.band_fits] == ["green", "red", "red_edge"]
    (left_out,) = [point for point in found.points if not point.used]
    assert (left_out.band, left_out.left_out) == ("nir", "no reflectance of the panel in this band")


def test_two_panels_contradict_each_other():
    twice = [*READINGS, replace(READINGS[0], panel="P2", reflectance=0.5)]
    with pytest.raises(InputRejected, match="2 different panel reflectances"):
        reflectance.fit(panel(), twice, PARAMS)


def test_panel_frames_of_two_cameras_are_refused():
    other = [replace(each, header=replace(each.header, serial="OTHER")) for each in panel(2, minutes=20.0)]
    with pytest.raises(InputRejected, match="several cameras") as refusal:
        reflectance.fit([*panel(), *other], READINGS, PARAMS)
    assert refusal.value.code == "wrong_camera"


def test_panel_frames_of_two_sunshine_sensors_are_refused_unless_it_is_left_out():
    rows = [*panel(), *change_band(panel(2, minutes=20.0), sunshine_serial="OTHER")]
    with pytest.raises(InputRejected, match="several sunshine sensors") as refusal:
        reflectance.fit(rows, READINGS, PARAMS)
    assert refusal.value.code == "wrong_sunshine_sensor"
    assert reflectance.fit(rows, READINGS, reflectance.Params(normalisation="panel_only"))


def test_what_a_fit_still_lacks_is_named():
    rows = panel()
    waiting = replace(rows[0], features=None)
    regionless = replace(rows[1], features=None, has_region=False)
    params = reflectance.Params(exclude=(Exclusion(frame="nobody", reason="blurred", by="Ann"),))
    lacking = reflectance.missing([waiting, regionless, *rows[2:]], READINGS, params, unread=["new"])
    assert lacking == (
        "to be left out, but not of this campaign: frame nobody",
        "not read yet: frame new",
        "no region on the panel (give frames that do not show it the role field): frame panel-0-red",
        "not extracted yet: frame panel-0-green",
    )
    assert reflectance.missing((), (), PARAMS) == ("the campaign has no panel frame that can be used",)
    with pytest.raises(InputRejected, match="cannot start: not extracted yet: frame panel-0-green"):
        reflectance.fit([waiting], READINGS, PARAMS)


def test_an_excluded_frame_stays_in_the_record():
    rows = [*panel(), *panel(2, minutes=1.0)]
    params = reflectance.Params(exclude=(Exclusion(frame="panel-1-green", reason="shadow", by="Ann"),))
    found = reflectance.fit(rows, READINGS, params)
    (point,) = [each for each in found.points if not each.used]
    assert (point.frame, point.left_out) == ("panel-1-green", "shadow (Ann)")


def test_a_file_of_another_kind_is_no_panel_frame():
    other = replace(panel()[0], header=make_header(None))
    with pytest.raises(InputRejected, match="none of the panel frames") as refusal:
        reflectance.fit([other], READINGS, PARAMS)
    assert refusal.value.code == "fit_incomplete"


def test_frames_say_what_is_odd_about_their_files():
    (first, *_) = panel()
    model = replace(first.header.multispectral.sensor_model, a=3.1e8)
    (newer,) = change_band([first], sensor_model=model)
    header = replace(newer.header, black_level_dn=(3067.5,), serial=None)
    odd = replace(newer, header=header)
    (odd,) = change_band([odd], sunshine_serial=None)
    found = reflectance.fit([odd], READINGS, PARAMS)
    assert {
        "sensor_model_scale",
        "black_level_disagrees",
        "serial_unknown",
        "sunshine_serial_unknown",
    } <= flags_of(found.flags)
    usual = flags_of(reflectance.fit([first], READINGS, PARAMS).flags)
    assert usual == {"panel_once", "panel_not_identified"}
