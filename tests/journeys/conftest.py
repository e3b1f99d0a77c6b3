"""One service for all journeys, and each card written once; every journey is an organisation of its own."""

import shutil

import pytest
from playwright.sync_api import sync_playwright

from tests.journeys.client import Client
from tests.journeys.command import Command
from tests.journeys.curl import Curl
from tests.journeys.flight import write_flight
from tests.journeys.head import write_head
from tests.journeys.night import write_night
from tests.journeys.pages import Pages
from tests.support.browser import find_missing, launch
from tests.support.deployments import short_folder
from tests.support.printed import NO_CURL

DOORS = {"pages": Pages, "client": Client, "command": Command, "curl": Curl}


@pytest.fixture
def door(request, service, tmp_path):
    """The door by the name that the test gives."""
    opens = DOORS[request.param]
    if opens is Curl and shutil.which("curl") is None:
        pytest.skip(NO_CURL)
    more = {"browser": request.getfixturevalue("browser")} if opens is Pages else {}
    with service.team() as team, opens(service.url, team.key, tmp_path, **more) as opened:
        yield opened


@pytest.fixture(scope="module")
def browser():
    """It ends with the module, not with the run: while it is driven, no event loop can be run beside it."""
    if missing := find_missing():
        pytest.skip(missing)
    with sync_playwright() as started:
        opened = launch(started)
        yield opened
        opened.close()


@pytest.fixture(scope="package")
def night():
    with short_folder() as folder:
        yield write_night(folder)


@pytest.fixture(scope="package")
def flight():
    with short_folder() as folder:
        yield write_flight(folder)


@pytest.fixture(scope="package")
def head():
    with short_folder() as folder:
        yield write_head(folder)
