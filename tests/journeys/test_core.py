"""Each journey once, in `make test`; `make journeys` runs every journey through every door.

The door of the command is tried in tests/stilb, with every command of its page.
"""

import pytest

from tests.journeys import flight as flights
from tests.journeys import head as heads
from tests.journeys import night as nights

pytestmark = pytest.mark.timeout(900)


@pytest.mark.parametrize("door", ["curl"], indirect=True)
def test_night(door, night):
    nights.travel(door, night, certified=False)


@pytest.mark.parametrize("door", ["pages"], indirect=True)
def test_flight(door, flight):
    flights.travel(door, flight, certified=False)


@pytest.mark.parametrize("door", ["client"], indirect=True)
def test_head(door, head):
    heads.travel(door, head, certified=True)
