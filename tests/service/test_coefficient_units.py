"""A coefficient is stored in its own model's unit: three of the four K cannot be compared."""

import pytest

from radiometry.fitting.models import K_UNITS
from tests.support.campaigns import calibrate, upload_campaign

pytestmark = pytest.mark.either_database


@pytest.mark.parametrize("model", K_UNITS)
def test_k_has_the_unit_of_its_model(house, staged, model):
    version = calibrate(house, staged(upload_campaign), model=model)
    units = {c["unit"] for c in version["coefficients"] if c["name"] == "luminance_k"}
    assert units == {K_UNITS[model]}
