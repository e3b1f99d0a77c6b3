"""Levels and variance components against hand computation and against scipy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from radiometry.fleet.determinations import are_separable, fit_effects

BALANCED = np.array([10.0, 12.0, 13.0, 15.0, 19.0, 21.0])
PAIRS = np.array([0, 0, 1, 1, 2, 2])


def test_a_balanced_fleet_by_hand():
    """Means 11, 14, 20; mean 15; MS_w = (2 + 2 + 2) / 3 = 2; MS_b = 2 (16 + 1 + 25) / 2 = 42; F = 21."""
    effects = fit_effects(BALANCED, [PAIRS])
    (factor,) = effects.factors
    assert effects.mean == pytest.approx(15.0)
    assert factor.deviations == pytest.approx([-4.0, -1.0, 5.0])
    assert (effects.dof, factor.dof) == (3, 2)
    assert effects.within_variance == pytest.approx(2.0)
    assert factor.f_statistic == effects.f_statistic == pytest.approx(21.0)
    assert factor.f_p_value == effects.f_p_value == pytest.approx(stats.f.sf(21.0, 2, 3))
    assert factor.variance == pytest.approx((42 - 2) / 2)
    # u(s_b^2) = sqrt(2 / 4 (42^2 / 2 + 2^2 / 3))
    assert factor.variance_u == pytest.approx((0.5 * (42**2 / 2 + 4 / 3)) ** 0.5)
    # of one camera's mean from the mean of three: s^2 / n (1 - 1 / k)
    assert effects.standard_errors(factor.contrasts) == pytest.approx([(2 / 2 * 2 / 3) ** 0.5] * 3)


def test_an_unbalanced_fleet_by_hand():
    """Means 2, 8 (4 and 2 values): the mean is that of the cameras, 5, not of the values, 4."""
    values = np.array([1.0, 2.0, 2.0, 3.0, 7.0, 9.0])
    effects = fit_effects(values, [np.array([0, 0, 0, 0, 1, 1])])
    (factor,) = effects.factors
    assert effects.mean == pytest.approx(5.0)
    assert factor.deviations == pytest.approx([-3.0, 3.0])
    assert effects.within_variance == pytest.approx((2 + 2) / 4)
    # SS_b = 4 * 2^2 + 2 * 4^2 = 48; n0 = (6 - (16 + 4) / 6) / 1
    assert factor.f_statistic == pytest.approx(48.0)
    assert factor.variance == pytest.approx((48 - 1) / (6 - 20 / 6))
    assert effects.standard_errors(factor.contrasts) == pytest.approx([(1 / 4 * (1 / 4 + 1 / 2)) ** 0.5] * 2)


@settings(max_examples=30)
@given(st.lists(st.lists(st.integers(-50, 50), min_size=2, max_size=6), min_size=2, max_size=5))
def test_the_f_test_is_scipy_s(fleet):
    values = np.array([value for repeats in fleet for value in repeats], dtype=float) / 7
    labels = np.repeat(np.arange(len(fleet)), [len(repeats) for repeats in fleet])
    effects = fit_effects(values + 1000.0, [labels])
    if effects.within_variance == 0.0:
        assert effects.factors[0].f_statistic is None
        return
    expected = stats.f_oneway(*(np.array(repeats) / 7 for repeats in fleet))
    assert effects.factors[0].f_statistic == pytest.approx(expected.statistic, rel=1e-6, abs=1e-8)
    assert effects.factors[0].f_p_value == pytest.approx(expected.pvalue, rel=1e-5, abs=1e-12)


def test_bodies_and_lenses_are_told_apart_by_swaps():
    """Body effects -3, 0, 3 and lens effects -1, 1, without noise: found exactly, from five of six pairs."""
    bodies, lenses = np.array([0, 0, 1, 1, 2, 2]), np.array([0, 1, 0, 1, 0, 0])
    values = 100.0 + np.array([-3.0, 0.0, 3.0])[bodies] + np.array([-1.0, 1.0])[lenses]
    effects = fit_effects(values, [bodies, lenses])
    assert effects.mean == pytest.approx(100.0)
    assert effects.factors[0].deviations == pytest.approx([-3, 0, 3])
    assert effects.factors[1].deviations == pytest.approx([-1, 1])
    assert effects.within_variance == 0.0
    assert effects.dof == 6 - (1 + 2 + 1)


def test_the_components_of_bodies_and_lenses_are_unbiased():
    """400 fleets of unbalanced swaps: mean components 9 and 4 within three standard errors."""
    rng = np.random.default_rng(3)
    bodies = np.repeat([0, 0, 0, 1, 1, 2, 3, 3, 4], 2)
    lenses = np.repeat([0, 1, 2, 0, 3, 1, 2, 3, 0], 2)
    found = []
    for _ in range(400):
        values = 3 * rng.standard_normal(5)[bodies] + 2 * rng.standard_normal(4)[lenses]
        effects = fit_effects(values + rng.standard_normal(18), [bodies, lenses])
        found.append([factor.variance for factor in effects.factors])
    mean, error = np.mean(found, axis=0), np.std(found, axis=0) / 20
    assert np.all(np.abs(mean - [9, 4]) < 3 * error)


@pytest.mark.parametrize(
    ("bodies", "lenses", "separable"),
    [
        ([0, 1, 2, 0], [0, 0, 0, 1], True),  # one lens on all bodies, two lenses on one body
        ([0, 0, 1, 1], [0, 0, 1, 1], False),  # each its own
        ([0, 0, 1, 2], [0, 1, 2, 2], False),  # body 0's lenses never came to the others
        ([0, 0, 1, 1], [0, 1, 1, 2], True),
    ],
)
def test_what_swaps_link(bodies, lenses, separable):
    assert are_separable([np.array(bodies), np.array(lenses)]) is separable


def test_equal_numbers_have_no_scatter():
    assert (
        fit_effects(np.array([0.1, 0.1, 0.3, 0.3, 0.3]), [np.array([0, 0, 1, 1, 1])]).within_variance == 0.0
    )
