"""One camera over time: trends by hand, intervals that cover the truth, dates that keep their promise."""

from datetime import timedelta

import numpy as np
import pytest
from scipy import stats

from radiometry.fleet.drift import DAYS_PER_YEAR, find_date, fit_line, judge_drift
from tests.radiometry.fleet.fleets import START, determine

DAYS = (0, 100, 200, 300)


def over(values, days=DAYS, u=0.3, **said):
    rows = zip(values, days, u if isinstance(u, tuple) else (u,) * len(values), strict=True)
    return [
        determine(value, "A", number, days=day, u=each, **said)
        for number, (value, day, each) in enumerate(rows)
    ]


def only(rows, tolerance=0.04):
    (drift,), _ = judge_drift(rows, method="luminance", tolerance=tolerance)
    return drift


def test_a_trend_is_scipy_s():
    values = [33.0, 32.8, 32.7, 32.3]
    drift = only(over(values))
    expected = stats.linregress(np.array(DAYS) / DAYS_PER_YEAR, values)
    assert drift.slope.value == pytest.approx(expected.slope)
    assert drift.slope.standard_uncertainty == pytest.approx(expected.stderr)
    assert drift.slope_p_value == pytest.approx(expected.pvalue)
    half = stats.t.ppf(0.975, 2) * expected.stderr
    assert drift.slope_interval == pytest.approx((expected.slope - half, expected.slope + half))
    assert drift.slope.unit == "DN*m2/(cd*s)/a"
    assert drift.cost_per_year.value == pytest.approx(100 * expected.slope / 32.3)
    assert drift.cost_per_year.unit == "%/a"


def test_weights_count_and_their_scale_does_not():
    """A poor version at the end: w = 1, 1, 1, 1/100. An error in all alike would change neither."""
    values, u = [33.0, 32.9, 33.1, 36.0], (0.1, 0.1, 0.1, 1.0)
    line = fit_line(over(values, u=u))
    fit = np.polyfit(np.array(DAYS) - 300.0, values, 1, w=1 / np.array(u), cov=True)
    assert (line.slope_per_day, line.value) == pytest.approx(tuple(fit[0]))
    assert np.array(line.covariance) == pytest.approx(fit[1][::-1, ::-1])
    ten = fit_line(over(values, u=tuple(10 * each for each in u)))
    assert np.array(ten.covariance) == pytest.approx(np.array(line.covariance))


def test_the_date_is_reached_by_hand():
    """Values on a line but for +-0.1: the bound b d + t u(d) reaches the limit."""
    values = [33.1, 32.9, 32.9, 33.1, 33.0]
    days = (0, 100, 200, 300, 400)
    drift = only(over(values, days))
    assert drift.why is None
    at = (drift.recalibrate_by - START) / timedelta(days=1)
    x = np.array(days) - 200.0
    slope = float(x @ values) / float(x @ x)
    s = np.sqrt(np.sum((np.array(values) - 33.0 - slope * x) ** 2) / 3)
    value, error = 33.0 + slope * (at - 200), s * np.sqrt(1 / 5 + (at - 200) ** 2 / (x @ x))
    assert abs(value - 33.0) + stats.t.ppf(0.95, 3) * error == pytest.approx(0.04 * 33.0, rel=1e-6)
    assert at > 400


def test_before_the_date_the_camera_is_within_the_tolerance_in_95_of_100():
    """True drift -0.001 a day; the true time of leaving is known; the date is later in 5 % at most."""
    rng = np.random.default_rng(4)
    late = told = 0
    days = (0, 100, 200, 300, 400, 500)
    for _ in range(500):
        rows = over(33.0 - 0.001 * np.array(days) + 0.05 * rng.standard_normal(6), days)
        date = only(rows).recalibrate_by
        if date is None:
            continue
        told += 1
        # users apply the last value; the true one is 33 - 0.001 t
        after = (date - START) / timedelta(days=1)
        late += rows[-1].value - (33.0 - 0.001 * after) > 0.04 * rows[-1].value
    assert told > 450
    assert late <= 0.05 * told + 3 * (0.05 * told) ** 0.5


@pytest.mark.parametrize(
    ("rows", "tolerance", "why"),
    [
        (over([33.0, 33.1], DAYS[:2]), 0.04, "three campaigns at different times; there are 2"),
        (over([33.0, 33.1, 33.2], (5, 5, 5)), 0.04, "three campaigns at different times"),
        (over([33.0, 33.1, 33.0, 33.1]), None, "No tolerance"),
        (over([33.0, 30.0, 36.0, 33.0]), 0.04, "known too poorly"),
        (over([33.0, 33.0, 33.0, 33.0]), 0.04, "within ten years"),
        (over([0.1, -0.1, 0.2, 0.0]), 0.04, "not clear of 0"),
    ],
)
def test_without_a_date_there_is_a_reason(rows, tolerance, why):
    drift = only(rows, tolerance)
    assert drift.recalibrate_by is None
    assert why in drift.why


def test_a_camera_that_has_left_is_due_since_its_last_version():
    """The line lies at 31 there, the value in use is 33."""
    rows = over([35.0, 34.0, 33.0, 32.0, 31.0, 33.0], (0, 100, 200, 300, 400, 401), u=(0.01,) * 5 + (1.0,))
    assert only(rows).recalibrate_by == rows[-1].source.at


def test_no_drift_and_no_scatter_is_no_p_value():
    assert only(over([33.0] * 4)).slope_p_value is None


def test_another_lens_is_no_drift():
    rows = over([33.0, 33.1, 32.9], DAYS[:3], lens="old")
    rows += [determine(30 + 0.1 * n, "A", n, days=400 + 100 * n, lens="new") for n in range(3)]
    (drift,), left_out = judge_drift(rows, method="luminance", tolerance=0.04)
    assert [each.source.lens for each in drift.determinations] == ["new"] * 3
    assert len(left_out) == 3
    assert "lens old; the last one with new" in left_out[0].why


def test_nothing_is_judged_of_nothing():
    assert judge_drift([], method="luminance", tolerance=0.04) == ((), ())


def test_a_date_is_found_from_either_side():
    rising, falling = over([33.0, 33.1, 33.3, 33.3]), over([33.3, 33.2, 33.0, 33.0])
    for rows in (rising, falling):
        line = fit_line(rows)
        date, why = find_date(line, reference=line.value, limit=1.0)
        assert why is None
        value, _ = line.at((date - line.origin) / timedelta(days=1))
        assert (value > line.value) == (rows is rising)


@pytest.mark.parametrize(
    ("values", "tolerance", "verdict", "said"),
    [
        ([33.0, 33.01, 32.99, 33.0], 0.04, "stable", "within the tolerance"),
        ([33.0, 31.0, 29.0, 27.1], 0.04, "drifts", "by more than the tolerance"),
        ([33.0, 32.9, 32.8, 32.71], None, "drifts", "from one determination to the next"),
        ([33.0, 32.9, 32.8, 32.71], 0.04, "stable", "within the tolerance"),
        ([33.0, 35.0, 31.0, 34.0], 0.04, "cannot_tell", "repeat the calibration"),
        ([33.0, 33.01, 32.99, 33.0], None, "cannot_tell", "against a tolerance only"),
        ([33.0, 32.0], 0.04, "cannot_tell", "3 determinations at different times are needed; there are 2"),
    ],
)
def test_the_verdict_on_each_coefficient(values, tolerance, verdict, said):
    drift = only(over(values, days=DAYS[: len(values)]), tolerance)
    assert drift.verdict == verdict
    assert said in drift.said
    assert (drift.change is None) == (len(values) < 3)


def test_a_wrong_verdict_is_as_rare_as_promised():
    """At a change of just the tolerance both verdicts are wrong: each in at most 5 and 2.5 of 100."""
    rng, found = np.random.default_rng(4), []
    for _ in range(600):
        values = 33.0 + 0.04 * 33.0 * np.array(DAYS) / 300 + 0.1 * rng.standard_normal(4)
        drift = only(over(values), 0.04)
        found.append(drift.verdict)
    # the tolerance is a share of the last value, which is 4 % higher; three standard deviations of 600
    assert found.count("stable") / 600 < 0.05 + 0.09
    assert found.count("drifts") / 600 < 0.025 + 0.019
