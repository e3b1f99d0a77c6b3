"""Every journey through every door, with the certificates of meter and panel and without: `make journeys`."""

import pytest

from tests.journeys import flight as flights
from tests.journeys import head as heads
from tests.journeys import night as nights
from tests.journeys.conftest import DOORS

pytestmark = [
    pytest.mark.timeout(900),
    pytest.mark.parametrize("door", DOORS, indirect=True),
    pytest.mark.parametrize("certified", [True, False], ids=["certified", "uncertified"]),
]


def test_night(door, night, certified):
    nights.travel(door, night, certified=certified)


def test_flight(door, flight, certified):
    flights.travel(door, flight, certified=certified)


def test_head(door, head, certified):
    heads.travel(door, head, certified=certified)
