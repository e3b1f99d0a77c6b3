"""Every line of the table of intervals can be made."""

import numpy as np
import pytest

from tests.regimes import REGIMES


@pytest.mark.parametrize("name", REGIMES)
def test_a_regime_draws_what_its_interval_may_hold(name):
    work, _ = REGIMES[name]
    for drawn in work(np.random.default_rng(5)):
        assert abs(drawn.error) < 4 * drawn.u
        assert drawn.u < drawn.expanded < 4.3 * drawn.u
