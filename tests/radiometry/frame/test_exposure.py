"""Exposure settings and the right-hand side of the calibration equation."""

import math

import pytest

from radiometry.findings import InputRejected, shared
from radiometry.frame import exposure

F11 = exposure.Exposure(
    exposure_time_s=1 / 60, f_number=11.0, iso=3200.0, exposure_time_apex_s=2**-6, f_number_apex=2**3.5
)


def test_rhs_by_hand():
    settings = exposure.Settings(exposure_time_s=0.5, f_number=2.0, iso=100.0)
    assert exposure.compute_rhs(settings, luminance_cd_m2=8.0) == 100.0  # 0.5 * 100 * 8 / 4


def test_what_the_basis_costs():
    """At one signal L goes as f^2 / t: 5.5 % for f/11 against 2^3.5, 6.7 % for 1/60 s against 1/64 s."""
    nominal, apex = F11.on_basis("nominal"), F11.on_basis("apex")
    assert (nominal.f_number, apex.f_number) == (11.0, 2**3.5)
    assert 1 - nominal.f_number**2 / apex.f_number**2 == pytest.approx(0.055, abs=5e-4)
    assert nominal.exposure_time_s / apex.exposure_time_s - 1 == pytest.approx(0.067, abs=5e-4)
    # where APEX is missing nominal stands
    bare = exposure.Exposure(exposure_time_s=1 / 60, f_number=11.0, iso=3200.0)
    assert bare.on_basis("apex") == bare.on_basis("nominal")
    assert (F11.has_apex, bare.has_apex) == (True, False)


@pytest.mark.parametrize(
    ("black", "white", "k"),
    [(0.0, 2.0**14 - 1, 137), (0.0, 4095.0, 34), (0.0, 255.0, 2.1), (240.0, 3840.0, 30)],
)
def test_expected_k(black, white, k):
    assert exposure.expect_luminance_k(black_level_dn=black, white_level_dn=white) == pytest.approx(
        k, rel=0.015
    )


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, -math.inf, 1e30, 1e-30])
@pytest.mark.parametrize("name", exposure.PLAUSIBLE)
def test_absurd_values_are_refused_by_name(name, value):
    settings = exposure.Settings(**{"exposure_time_s": 0.1, "f_number": 2.0, "iso": 100.0, name: value})
    assert not exposure.is_plausible(name, value)
    with pytest.raises(InputRejected, match=name) as refusal:
        exposure.require_plausible(settings)
    assert refusal.value.code is shared.EXPOSURE_IMPLAUSIBLE
