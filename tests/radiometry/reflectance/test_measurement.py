"""An index of two reflectances, a pixel's noise, and what another version would make of a reflectance."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from radiometry.findings import InputRejected, Raised
from radiometry.findings.grouping import advise
from radiometry.fitting.evidence import Quantity
from radiometry.reflectance import method as reflectance
from radiometry.reflectance.indices import read_formula
from radiometry.reflectance.measurement import estimate_noise, measure_index
from radiometry.reflectance.method import change_reflectance
from radiometry.reflectance.results import AppliedReflectance, Doubt, Effect
from tests.radiometry.reflectance.captures import READINGS, k_of, panel

HAZY = Raised(flag="panel_once", where="", detail="Once.")


def applied(band, value, u, *flags, source="pixel noise"):
    effects = {"pixel noise": 0.0, source: u}
    return AppliedReflectance(
        band=band,
        reflectance=Quantity(value=value, standard_uncertainty=u, unit="1"),
        i_sq=1.0,
        i_ss=1.0,
        reflectance_k=value,
        effects=tuple(Effect(source=name, shared=name == "K", effect=of) for name, of in effects.items()),
        flags=flags,
        doubt=Doubt(u**2, 0.0, 2.0),
    )


def measure(text, *bands, shared_u_rel=0.0, angle_u_rel=None, **more):
    shares = {"shared_u_rel": shared_u_rel, "angle_u_rel": angle_u_rel}
    known = [SimpleNamespace(band=band, **shares) for band in ("nir", "red")]
    return measure_index(read_formula(text), bands, coefficients=known, **more)


def test_an_index_by_hand():
    found = measure("ndvi", applied("nir", 0.5, 0.01), applied("red", 0.3, 0.02, HAZY))
    assert (found.index, found.value.value) == ("ndvi", pytest.approx(0.25))
    # 2 b u_a / (a + b)^2 = 0.006 / 0.64, 2 a u_b / (a + b)^2 = 0.02 / 0.64
    assert found.value.standard_uncertainty == pytest.approx(math.hypot(0.006, 0.02) / 0.64)
    assert found.flags == (Raised(flag="panel_once", where="band red", detail="Once."),)
    assert found.expanded_uncertainty == pytest.approx(4.3027 * found.value.standard_uncertainty, rel=1e-4)
    assert found.effective_dof == pytest.approx(2.0)
    assert sum(share.variance_share for share in found.budget) == pytest.approx(1.0)


@pytest.mark.parametrize("red", [-0.5, -0.6])
def test_an_index_of_nothing_does_not_exist(red):
    with pytest.raises(InputRejected, match=r"NDVI does not exist here.* nir 0\.5, red -0") as refusal:
        measure("ndvi", applied("nir", 0.5, 0.01), applied("red", red, 0.01))
    assert refusal.value.code == "index_undefined"


def test_a_tilt_cancels_in_a_ratio_and_a_panel_is_taken_at_its_worse():
    bands = (("nir", 0.5, 0.01), ("red", 0.3, 0.006))
    tilted = measure("ndvi", *(applied(*each, source="sunshine tilt") for each in bands))
    assert tilted.value.standard_uncertainty == pytest.approx(0.0, abs=1e-12)
    panel = [applied(*each, source="K") for each in bands]
    ratio, total = (measure(text, *panel, shared_u_rel=0.02) for text in ("ndvi", "nir + red"))
    # both of 2 %: independent in the ratio, the same in the sum
    assert ratio.value.standard_uncertainty == pytest.approx(math.hypot(0.006, 0.006) / 0.64)
    assert total.value.standard_uncertainty == pytest.approx(0.016)
    angled = measure("ndvi", *panel, shared_u_rel=0.02, angle_u_rel=0.02)
    assert angled.value.standard_uncertainty == pytest.approx(0.0, abs=1e-9)
    assert measure("nir + red", *panel).value.standard_uncertainty == pytest.approx(math.hypot(0.01, 0.006))
    # each can be the largest source, and has its advice
    assert {share.source for share in angled.budget} >= {"K", "panel", "panel angle", "alignment"}
    assert all(advise((), budget=[(share.source, 1.0)]) for share in angled.budget)


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
        replace(
            k,
            reflectance_k=k.reflectance_k * factor,
            reflectance_k_standard_uncertainty=k.reflectance_k * factor * u_rel,
            knots=tuple(replace(knot, reflectance_k=knot.reflectance_k * factor) for knot in k.knots),
        )
        for factor, u_rel in ((1.0, 0.03), (1.1, 0.04))
    )
    found = change_reflectance([old], [new], header=rows[0].header, common_u_rel=0.02)
    assert (found.value, found.unit) == (pytest.approx(10.0), "%")
    expected = 100 * 1.1 * math.sqrt(0.03**2 + 0.04**2 - 2 * 0.02**2)
    assert found.standard_uncertainty == pytest.approx(expected)
    same = change_reflectance([old], [old], header=rows[0].header, common_u_rel=0.03)
    assert (same.value, same.standard_uncertainty) == (0.0, 0.0)
