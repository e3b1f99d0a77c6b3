"""K from several visits to the panel: its drift, its line in time, and what scatters between frames."""

import dataclasses
import math

import numpy as np
import pytest

from radiometry.reflectance import method as reflectance
from radiometry.reflectance.evaluation import evaluate_k
from tests.radiometry.reflectance.captures import (
    CAMERA,
    READINGS,
    change_features,
    flags_of,
    k_of,
    panel,
)

PARAMS = reflectance.Params()


def test_drift_between_two_visits_is_reported_and_counted():
    drifted = {**CAMERA.bands, "green": dataclasses.replace(CAMERA.bands["green"], reflectance_k=1378.0)}
    rows = [*panel(), *panel(2, minutes=20.0, camera=dataclasses.replace(CAMERA, bands=drifted))]
    found = reflectance.fit(rows, READINGS, PARAMS)
    fit = k_of(found)
    assert fit.visits == 2
    assert fit.drift_rel == pytest.approx(78 / 1339, abs=0.015)
    assert [each.where for each in found.flags if each.flag == "panel_drift"] == ["band green"]
    assert fit.coefficient.reflectance_k == pytest.approx(1339, rel=0.01)
    assert "panel_once" not in flags_of(found.flags)
    assert "panel_once" in flags_of(reflectance.fit(panel(), READINGS, PARAMS).flags)


def make_linear(**changes):
    """Knots of K = 1000 and 1100 at 0 s and 1000 s, 1 % and 2 % of their own, 0.5 % shared."""
    fit = reflectance.fit(panel(), READINGS, reflectance.Params(interpolation="linear"))
    knots = tuple(
        reflectance.Knot(at_s=at_s, reflectance_k=k, u_rel=u)
        for at_s, k, u in ((0.0, 1000.0, 0.01), (1000.0, 1100.0, 0.02))
    )
    return dataclasses.replace(
        k_of(fit).coefficient, **{"knots": knots, "shared_u_rel": 0.005, "drift_u_rel": 0.0} | changes
    )


@pytest.mark.parametrize(
    ("at_s", "k", "own"), [(0.0, 1000.0, 10.0), (250.0, 1025.0, math.hypot(7.5, 5.5)), (1000.0, 1100.0, 22.0)]
)
def test_k_of_time_is_a_line_between_the_visits(at_s, k, own):
    found = evaluate_k(make_linear(), at_s=at_s)
    assert found.value == pytest.approx(k)
    assert found.u_rel == pytest.approx(math.hypot(0.005, own / k))
    assert not found.outside


@pytest.mark.parametrize(
    ("at_s", "k", "own"), [(-1.0, 1000.0, 0.01), (1001.0, 1100.0, 0.02), (None, 1050.0, None)]
)
def test_outside_the_visits_k_is_the_nearest_and_less_certain(at_s, k, own):
    found = evaluate_k(make_linear(), at_s=at_s)
    assert (found.value, found.outside) == (pytest.approx(k), True)
    own = math.hypot(0.01, 0.02) / 2 if own is None else own
    assert found.u_rel == pytest.approx(math.hypot(0.005, own, 100 / 1050))


def test_a_third_visit_bends_the_line():
    knots = (*make_linear().knots, reflectance.Knot(at_s=2000.0, reflectance_k=900.0, u_rel=0.01))
    coefficient = make_linear(knots=knots)
    assert evaluate_k(coefficient, at_s=500.0).value == pytest.approx(1050.0)
    assert evaluate_k(coefficient, at_s=1500.0).value == pytest.approx(1000.0)


def test_noise_averages_over_the_visits():
    first, second = (k_of(reflectance.fit(panel(seed), READINGS, PARAMS)) for seed in (1, 2))
    both = k_of(reflectance.fit([*panel(), *panel(2, minutes=20.0)], READINGS, PARAMS))
    for source in ("pixel noise", "sunshine readings"):
        one, two, mean = (
            next(entry.u_rel for entry in fit.budget if entry.source == source)
            for fit in (first, second, both)
        )
        assert mean == pytest.approx(math.hypot(one, two) / 2)


def test_frames_minutes_apart_are_one_visit():
    rows = [*panel(), *panel(2, minutes=4.0), *panel(3, minutes=30.0)]
    found = reflectance.fit(rows, READINGS, PARAMS)
    assert k_of(found).visits == 2
    assert {point.visit for point in found.points} == {1, 2}


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
    assert fit.coefficient.coverage_factor > 3.0  # two degrees of freedom
