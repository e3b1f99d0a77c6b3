"""Exposure settings and the right-hand side of the calibration equation."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from radiometry.findings import InputRejected, shared
from radiometry.frame.exposure import (
    PLAUSIBLE,
    Exposure,
    Settings,
    compute_rhs,
    expect_luminance_k,
    is_plausible,
    require_plausible,
)

F11 = Exposure(
    exposure_time_s=1 / 60, f_number=11.0, iso=3200.0, exposure_time_apex_s=2**-6, f_number_apex=2**3.5
)


def test_rhs_by_hand():
    settings = Settings(exposure_time_s=0.5, f_number=2.0, iso=100.0)
    assert compute_rhs(settings, luminance_cd_m2=8.0) == 100.0  # 0.5 * 100 * 8 / 4


def test_what_the_basis_costs():
    """At one signal L goes as f^2 / t: 5.5 % for f/11 against 2^3.5, 6.7 % for 1/60 s against 1/64 s."""
    nominal, apex = F11.on_basis("nominal"), F11.on_basis("apex")
    assert (nominal.f_number, apex.f_number) == (11.0, 2**3.5)
    assert 1 - nominal.f_number**2 / apex.f_number**2 == pytest.approx(0.055, abs=5e-4)
    assert nominal.exposure_time_s / apex.exposure_time_s - 1 == pytest.approx(0.067, abs=5e-4)
    # where APEX is missing nominal stands
    bare = Exposure(exposure_time_s=1 / 60, f_number=11.0, iso=3200.0)
    assert bare.on_basis("apex") == bare.on_basis("nominal")
    assert (F11.has_apex, bare.has_apex) == (True, False)


@pytest.mark.parametrize(
    ("black", "white", "k"),
    [(0.0, 2.0**14 - 1, 137), (0.0, 4095.0, 34), (0.0, 255.0, 2.1), (240.0, 3840.0, 30)],
)
def test_expected_k(black, white, k):
    assert expect_luminance_k(black_level_dn=black, white_level_dn=white) == pytest.approx(k, rel=0.015)


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, -math.inf, 1e30, 1e-30])
@pytest.mark.parametrize("name", PLAUSIBLE)
def test_absurd_values_are_refused_by_name(name, value):
    settings = Settings(**{"exposure_time_s": 0.1, "f_number": 2.0, "iso": 100.0, name: value})
    assert not is_plausible(name, value)
    with pytest.raises(InputRejected, match=name) as refusal:
        require_plausible(settings)
    assert refusal.value.code is shared.EXPOSURE_IMPLAUSIBLE


@given(st.floats(1e-4, 8), st.floats(1.7, 16), st.sampled_from([3200.0, 6400.0, 12800.0, 25600.0]))
def test_doubling_the_time_doubles_the_rhs(time_s, f_number, iso):
    once = Settings(exposure_time_s=time_s, f_number=f_number, iso=iso)
    twice = Settings(exposure_time_s=2 * time_s, f_number=f_number, iso=iso)
    require_plausible(once)
    assert compute_rhs(twice, luminance_cd_m2=2.94) == 2 * compute_rhs(once, luminance_cd_m2=2.94)
