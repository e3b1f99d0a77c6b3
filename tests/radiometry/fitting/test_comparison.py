"""Comparing calibrations: by hand, and against two cameras simulated with a shared meter error."""

from dataclasses import replace

import pytest

from radiometry.fitting.comparison import compare_quantities
from radiometry.fitting.evidence import Quantity
from radiometry.frame.exposure import Exposure
from radiometry.luminance.application import change_luminance
from radiometry.luminance.rows import CalibrationConditions
from tests.radiometry.coefficients import COEFFICIENT

EXPOSURE = Exposure(
    exposure_time_s=0.01, f_number=4.0, iso=3200.0, f_number_apex=4.0, exposure_time_apex_s=1 / 128
)


def k(value, u):
    return Quantity(value=value, standard_uncertainty=u, unit="DN*m2/(cd*s)")


def with_k(value, **changes):
    return replace(COEFFICIENT, luminance_k=value, parameters=(value,), **changes)


def change(old, new, signal_dn=None, **given):
    return change_luminance([old], [new], exposure=EXPOSURE, signal_dn=signal_dn, **given)


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


def test_a_larger_k_makes_a_luminance_smaller():
    found = change(with_k(30.0), with_k(33.0))
    assert found.change.value == pytest.approx(100 * (30 / 33 - 1))
    assert found.basis == "k_ratio"
    # u(K)/K = 1/60 and 1/66
    expected = 100 * 30 / 33 * (1 / 60**2 + 1 / 66**2) ** 0.5
    assert found.change.standard_uncertainty == pytest.approx(expected)


def test_a_signal_brings_the_dark_signals_in():
    new = with_k(30.0, dark_signal_dn=266.0)
    assert change(COEFFICIENT, new, 1256.0).change.value == pytest.approx(-1.0)
    assert change(COEFFICIENT, new, 276.0).change.value == pytest.approx(-50.0)
    assert change(COEFFICIENT, new, 1256.0).basis == "signal"


def test_models_are_inverted_at_the_signal():
    affine = with_k(30.0, model="affine", parameter_names=("luminance_k", "offset_dn"))
    affine = replace(affine, parameters=(30.0, 100.0))
    assert change(COEFFICIENT, affine, 1256.0).change.value == pytest.approx(-10.0)
    assert "not kept" in change(COEFFICIENT, affine).why


def test_another_basis_changes_the_settings():
    # 1/128 s for 0.01 s: X is the same, L = X f^2 / (t S) is 1.28 times as large
    assert change(COEFFICIENT, with_k(30.0, exposure_basis="apex"), 1256.0).change.value == pytest.approx(
        28.0
    )


@pytest.mark.parametrize(
    ("old", "new", "signal_dn", "said"),
    [
        (with_k(30.0, iso=6400.0), COEFFICIENT, None, "The version used holds no coefficient for ISO 3200"),
        (COEFFICIENT, with_k(30.0, iso=6400.0), None, "take its place holds no coefficient for ISO 3200"),
        (COEFFICIENT, with_k(30.0, channel="grey"), 1256.0, "green signal, the other grey"),
        (COEFFICIENT, COEFFICIENT, 256.0, "near the dark"),
        (COEFFICIENT, COEFFICIENT, 200.0, "near the dark"),
    ],
)
def test_where_there_is_no_answer_the_reason_is_one(old, new, signal_dn, said):
    found = change(old, new, signal_dn)
    assert found.change is None
    assert said in found.why


def test_versions_of_other_lamps_are_not_compared_by_k():
    found = change(with_k(30.0), with_k(30.0, conditions=CalibrationConditions(lamp="A")))
    assert found.change is None
    assert "different lamps" in found.why
