"""Formulas of bands: what they may contain, their values, derivatives, and what does not exist."""

import numpy as np
import pytest

from radiometry.findings import InputRejected
from radiometry.reflectance.indices import compute, read_formula

VALUES = {"nir": np.array([0.45, 0.3, 0.0]), "red": np.array([0.05, -0.3, 0.0])}


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("", "neither a formula"),
        ("nir +", "neither a formula"),
        ("__import__('os').system('true')", "contains"),
        ("nir.real", "contains"),
        ("nir[0]", "contains"),
        ("lambda: nir", "contains"),
        ("nir if red else nir", "contains"),
        ("nir < red", "contains"),
        ("nir // red", "contains"),
        ("~nir", "contains"),
        ("max(nir, red)", "contains"),
        ("nir * 1j", "no number"),
        ("nir + True", "no band true"),
        ("nir + 'red'", "no number"),
        ("nir * 1e7", "no number"),
        ("nir ** red", "power"),
        ("nir ** 9 ** 9", "power"),
        ("nir ** 5", "power"),
        ("1 + 2", "no band"),
        ("+".join(["nir"] * 60), "characters"),
        ("nir" + " - 1" * 20, "nested"),
        ("(" * 99 + "nir" + ")" * 97, "neither a formula"),
        ("nir + blu + grin", "no band blu, grin here, but nir, red"),
        ("ndre", "no band red_edge here"),
    ],
)
def test_what_is_no_formula_is_refused(text, match):
    with pytest.raises(InputRejected, match=match) as refusal:
        read_formula(text, known=["red", "nir"])
    assert refusal.value.code == "formula_invalid"


def test_a_name_is_its_formula_and_the_near_infrared_is_first():
    named, own = read_formula(" NDVI "), read_formula("(red-nir)/(Nir+red)")
    assert (named.name, named.text, named.bands) == ("ndvi", "(nir - red) / (nir + red)", ("nir", "red"))
    assert (own.name, own.bands) == ("(red - nir) / (nir + red)", ("nir", "red"))


def test_a_division_by_zero_is_unknown_and_below_zero_too_for_a_name():
    own, _ = compute(read_formula("(nir - red) / (nir + 2 * red)"), VALUES)
    assert own == pytest.approx([0.4 / 0.55, 0.6 / -0.3, np.nan], nan_ok=True)
    assert compute(read_formula("evi2"), VALUES)[0] == pytest.approx(
        [2.5 * 0.4 / 1.57, 2.5 * 0.6 / 0.58, 0.0]
    )
    named, _ = compute(read_formula("ndvi"), VALUES)
    assert named == pytest.approx([0.8, np.nan, np.nan], nan_ok=True)


@pytest.mark.parametrize("text", ["ndvi", "savi", "-nir * 3 + red ** 2 / nir", "(nir / red) ** -0.5", "+nir"])
def test_derivatives_are_those_of_small_steps(text):
    formula, step = read_formula(text), 1e-6
    values = {"nir": np.array([0.4, 0.2]), "red": np.array([0.1, 0.3])}
    _, slopes = compute(formula, values)
    for band in formula.bands:
        ends = [compute(formula, values | {band: values[band] + way})[0] for way in (step, -step)]
        assert np.broadcast_to(slopes[band], 2) == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-6)
