"""A coefficient is stored in its own model's unit: three of the four K cannot be compared."""

import pytest

from radiometry.fitting.sources import K_UNITS
from tests.support.campaigns import calibrate, upload_campaign

pytestmark = pytest.mark.either_database


def test_k_has_the_unit_of_its_model(house, staged):
    campaign = staged(upload_campaign, isos=(3200,))
    for model, expected in K_UNITS.items():
        version = calibrate(house, campaign, model=model)
        units = {c["unit"] for c in version["coefficients"] if c["name"] == "luminance_k"}
        assert units == {expected}, model
