"""One service for all journeys, and each card written once; every journey is an organisation of its own."""

import shutil
from pathlib import Path

import pytest
from playwright.sync_api import sync_playwright

from tests.journeys.client import Client
from tests.journeys.command import Command
from tests.journeys.curl import Curl
from tests.journeys.flight import write_flight
from tests.journeys.head import write_head
from tests.journeys.night import write_night
from tests.journeys.pages import Pages
from tests.support.browser import CHROMIUM, launch
from tests.support.deployments import Embedded, short_folder

DOORS = {"pages": Pages, "client": Client, "command": Command, "curl": Curl}


@pytest.fixture(scope="package")
def service():
    with short_folder() as folder, Embedded(folder / "data") as deployment:
        yield deployment


@pytest.fixture
def door(request, service, tmp_path):
    """The door by the name that the test gives."""
    opens = DOORS[request.param]
    if opens is Curl and shutil.which("curl") is None:
        pytest.skip("there is no curl: apt-get install curl")
    more = {"browser": request.getfixturevalue("browser")} if opens is Pages else {}
    with service.team() as team, opens(service.url, team.key, tmp_path, **more) as opened:
        yield opened


@pytest.fixture(scope="package")
def browser():
    if not Path(CHROMIUM).is_file():
        pytest.skip(f"there is no Chromium at {CHROMIUM}; STILB_CHROMIUM names another")
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
