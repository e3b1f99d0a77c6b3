"""Intervals hold the truth as often as they say; of the regimes that take long, one draw is made."""

import numpy as np
import pytest

from tests.regimes import REGIMES

QUICK = ("mean of", "L, one frame", "L at", "L of", "U_o, cells", "U_l, cells")
QUICK += ("R, 1 ", "R, 10 light readings to 5 %", "R, a Sequoia's ten counts to 2 %")
DRAWS = 60


@pytest.mark.parametrize("name", REGIMES)
def test_a_regime_draws_what_its_interval_may_hold(name):
    """Of 60 draws 95 % are held to 2.8 %; a single light reading has the U of the noisiest sensor known."""
    work, _ = REGIMES[name]
    quick = name.startswith(QUICK) and "of a road" not in name
    found = [each for seed in range(DRAWS if quick else 1) for each in work(np.random.default_rng([5, seed]))]
    errors, us, expanded, *_ = np.array(found).T
    assert ((us < expanded) & (expanded < 4.6 * us)).all()
    if not quick:
        assert (np.abs(errors) < 4 * us).all()
        return
    assert np.mean(np.abs(errors) <= expanded) >= 0.87
    rms, u = (np.sqrt(np.mean(each**2)) for each in (errors, us))
    assert 0.6 * u < rms < (1.95 if "1 light reading" in name else 1.3) * u
