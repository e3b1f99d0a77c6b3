"""An index of two reflectances, a pixel's noise, and what another version would make of a reflectance."""

import dataclasses
import math

import numpy as np
import pytest

from radiometry.findings import InputRejected, Raised
from radiometry.fitting.evidence import Quantity
from radiometry.reflectance import method as reflectance
from radiometry.reflectance.comparison import change_reflectance
from radiometry.reflectance.measurement import estimate_noise, measure_index
from radiometry.reflectance.results import AppliedReflectance
from tests.radiometry.reflectance.captures import READINGS, k_of, panel

HAZY = Raised(flag="panel_once", where="", detail="Once.")


def applied(band, value, u, *flags):
    return AppliedReflectance(
        band=band,
        reflectance=Quantity(value=value, standard_uncertainty=u, unit="1"),
        i_sq=1.0,
        i_ss=1.0,
        reflectance_k=value,
        effects=(),
        flags=flags,
    )


def test_an_index_by_hand():
    found = measure_index("ndvi", applied("nir", 0.5, 0.01), applied("red", 0.3, 0.02, HAZY))
    assert found.value.value == pytest.approx(0.25)
    # 2 b u_a / (a + b)^2 = 0.006 / 0.64, 2 a u_b / (a + b)^2 = 0.02 / 0.64
    assert found.value.standard_uncertainty == pytest.approx(math.hypot(0.006, 0.02) / 0.64)
    assert found.flags == (Raised(flag="panel_once", where="band red", detail="Once."),)


@pytest.mark.parametrize("red", [-0.5, -0.6])
def test_an_index_of_nothing_does_not_exist(red):
    with pytest.raises(InputRejected, match=r"NDVI does not exist here.* add up to (-0\.1|0)\.") as refusal:
        measure_index("ndvi", applied("nir", 0.5, 0.01), applied("red", red, 0.01))
    assert refusal.value.code == "index_undefined"


def test_the_noise_of_a_pixel_is_found_below_a_slope_and_a_few_outliers():
    rows, cols = np.indices((80, 80))
    values = 0.2 + 0.001 * rows + 0.002 * cols + np.random.default_rng(1).normal(0.0, 0.01, (80, 80))
    values[::20, ::20] += 5.0
    everywhere = np.ones((80, 80), dtype=bool)
    # some 12000 differences, of which neighbours share pixels: a standard error of 1 %
    assert estimate_noise(values, everywhere) == pytest.approx(0.01, rel=0.04)
    assert estimate_noise(values.T, everywhere.T) == pytest.approx(estimate_noise(values, everywhere))


def test_a_region_without_three_neighbours_has_no_noise_to_see():
    scattered = np.zeros((8, 8), dtype=bool)
    scattered[::3, ::3] = True
    assert estimate_noise(np.random.default_rng(1).normal(size=(8, 8)), scattered) == 0.0
    assert estimate_noise(np.ones((2, 2)), np.ones((2, 2), dtype=bool)) == 0.0


def test_what_another_version_makes_of_a_reflectance_by_hand():
    """K 10 % higher, so is R; 3 % and 4 % of uncertainty, of which 2 % are one panel's."""
    rows = panel()
    k = k_of(reflectance.fit(rows, READINGS, reflectance.Params())).coefficient
    old, new = (
        dataclasses.replace(
            k,
            reflectance_k=k.reflectance_k * factor,
            reflectance_k_standard_uncertainty=k.reflectance_k * factor * u_rel,
            knots=tuple(
                dataclasses.replace(knot, reflectance_k=knot.reflectance_k * factor) for knot in k.knots
            ),
        )
        for factor, u_rel in ((1.0, 0.03), (1.1, 0.04))
    )
    found = change_reflectance([old], [new], header=rows[0].header, common_u_rel=0.02)
    assert (found.value, found.unit) == (pytest.approx(10.0), "%")
    expected = 100 * 1.1 * math.sqrt(0.03**2 + 0.04**2 - 2 * 0.02**2)
    assert found.standard_uncertainty == pytest.approx(expected)
    same = change_reflectance([old], [old], header=rows[0].header, common_u_rel=0.03)
    assert (same.value, same.standard_uncertainty) == (0.0, 0.0)
