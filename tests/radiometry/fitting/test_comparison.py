"""Comparing calibrations: by hand, and against two cameras simulated with a shared meter error."""

import numpy as np
import pytest

from radiometry.fitting.comparison import compare_quantities
from radiometry.fitting.evidence import Quantity


def k(value, u):
    return Quantity(value=value, standard_uncertainty=u, unit="DN*m2/(cd*s)")


def test_independent_values_by_hand():
    found = compare_quantities(k(30.0, 0.3), k(31.5, 0.4))
    assert found.difference == k(1.5, pytest.approx(0.5))
    assert found.change.value == pytest.approx(5.0)
    # (31.5/30) sqrt((0.4/31.5)^2 + (0.3/30)^2)
    assert found.change.standard_uncertainty == pytest.approx(1.697138, rel=1e-6)
    assert found.in_standard_uncertainties == pytest.approx(3.0)


def test_what_both_share_cancels():
    # 1 % of each is the meter's: 0.3^2 - 0.3^2 and 0.4^2 - 0.3^2 are left of the squares
    found = compare_quantities(k(30.0, 0.3), k(30.0, 0.4), common_u_rel=0.01)
    assert found.difference.standard_uncertainty == pytest.approx(0.07**0.5)
    assert compare_quantities(k(30.0, 0.3), k(30.0, 0.3), common_u_rel=0.01).in_standard_uncertainties is None


def test_nothing_is_divided_by_zero():
    found = compare_quantities(k(0.0, 0.1), k(1.0, 0.0))
    assert found.change is None
    assert found.in_standard_uncertainties == pytest.approx(10.0)


@pytest.mark.parametrize("common", [0.0, 0.01])
def test_the_predicted_scatter_is_the_scatter(common):
    n, dice = 40_000, np.random.default_rng(1)
    meter = dice.normal(0.0, common, n)
    old = 30.0 * (1 + meter) * (1 + dice.normal(0.0, 0.004, n))
    new = 31.5 * (1 + meter) * (1 + dice.normal(0.0, 0.006, n))
    u_old, u_new = 30.0 * np.hypot(common, 0.004), 31.5 * np.hypot(common, 0.006)
    found = compare_quantities(k(30.0, u_old), k(31.5, u_new), common_u_rel=common)
    # a standard deviation of n draws scatters by 1/sqrt(2 n) = 0.35 %
    assert found.difference.standard_uncertainty == pytest.approx(np.std(new - old), rel=4 / (2 * n) ** 0.5)
    assert found.change.standard_uncertainty == pytest.approx(100 * np.std(new / old), rel=4 / (2 * n) ** 0.5)
