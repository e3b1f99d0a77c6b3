"""Two measurements against each other: figures by hand, and drawn errors."""

import math

import numpy as np
import pytest

from radiometry.fitting.comparison import Budgeted, compare_measured, scale_effects, sign_effects

OLD = Budgeted(value=10.0, unit="cd/m2", effects={"fit of K": 0.2, "f-number": 0.1, "pixel noise": 0.03})
NEW = Budgeted(value=8.0, unit="cd/m2", effects={"fit of K": 0.16, "f-number": 0.08, "pixel noise": 0.04})


def test_what_is_common_cancels():
    """K: 0.16 - 0.2; the f-number and the noise count in both."""
    found = compare_measured(OLD, NEW, common={"fit of K"})
    u = math.sqrt(0.04**2 + 0.1**2 + 0.08**2 + 0.03**2 + 0.04**2)
    assert found.difference.value == pytest.approx(-2.0)
    assert found.difference.standard_uncertainty == pytest.approx(u)
    assert found.in_standard_uncertainties == pytest.approx(2.0 / u)
    # of the ratio 0.8 the error of K is gone altogether: 1 % twice, 0.3 % and 0.5 % of it remain
    rel = math.sqrt(2 * 0.01**2 + 0.003**2 + 0.005**2)
    assert found.change.value == pytest.approx(-20.0)
    assert found.change.standard_uncertainty == pytest.approx(100 * 0.8 * rel)


def test_with_nothing_in_common_both_count():
    found = compare_measured(OLD, NEW, common=())
    squares = [*OLD.effects.values(), *NEW.effects.values()]
    assert found.difference.standard_uncertainty == pytest.approx(math.hypot(*squares))


def test_errors_that_are_drawn_spread_as_predicted():
    """4000 draws know a standard deviation to 1 / sqrt(2 4000) = 1.1 %: within four of these."""
    random = np.random.default_rng(5)
    draws = 4000
    k, dark = random.normal(0.0, [[0.02], [0.004]], (2, draws))
    own = random.normal(0.0, 0.01, (2, draws))
    old, new = (truth * (1 - k) - dark + noise for truth, noise in zip((1.0, 0.3), own, strict=True))
    budgets = [
        Budgeted(
            value=truth,
            unit="cd/m2",
            effects=sign_effects(
                truth, {"fit of K": 0.02 * truth, "dark signal": 0.004, "pixel noise": 0.01}
            ),
        )
        for truth in (1.0, 0.3)
    ]
    found = compare_measured(*budgets, common={"fit of K", "dark signal"})
    assert np.std(new - old) == pytest.approx(found.difference.standard_uncertainty, rel=0.045)


def test_a_negative_value_moves_with_k_the_other_way():
    assert sign_effects(-0.5, {"fit of K": 0.01, "dark signal": 0.2}) == {
        "fit of K": -0.01,
        "dark signal": -0.2,
    }


def test_a_cell_has_the_frames_effects_and_noise_of_its_own():
    mean = Budgeted(value=2.0, unit="cd/m2", effects={"K": 0.1, "dark signal": -0.03, "pixel noise": 0.01})
    cell = scale_effects(mean, 1.0, math.hypot(0.05, 0.03, 0.02))
    assert cell.effects == pytest.approx({"K": 0.05, "dark signal": -0.03, "pixel noise": 0.02})
    # no more is known of it than the frame's own: nothing is negative under the root
    assert scale_effects(mean, 1.0, 0.01).effects["pixel noise"] == 0.0


def test_nothing_is_divided_by_zero():
    zero = Budgeted(value=0.0, unit="cd/m2", effects={})
    found = compare_measured(zero, zero, common=())
    assert (found.change, found.in_standard_uncertainties) == (None, None)
    assert scale_effects(zero, 1.0, 0.5).effects == {"pixel noise": 0.5}
