"""A version remembers the meters as they were when it was fitted."""

import pytest

from tests.support.campaigns import calibrate
from tests.support.meters import CERTIFICATE, METER, enter_meter, metered_campaign

pytestmark = pytest.mark.either_database


def test_a_version_keeps_the_certificate_that_it_was_made_with(house):
    meter_id = enter_meter(house)
    campaign = metered_campaign(house, meter_id)
    version = calibrate(house, campaign)
    assert version["inputs"]["meters"] == [METER | {"certificate": CERTIFICATE}]
    assert meter_id not in str(version["inputs"])
    assert calibrate(house, campaign)["id"] == version["id"]
    enter_meter(house, number="D-K-2")
    again = calibrate(house, campaign)
    assert again["id"] != version["id"]
    assert again["inputs"]["meters"][0]["certificate"]["number"] == "D-K-2"
    kept = house.get(f"/v1/calibrations/{version['id']}")
    assert kept["inputs"]["meters"][0]["certificate"]["number"] == "D-K-1"
