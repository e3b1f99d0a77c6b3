"""One browser for the tests of this folder; each test is an organisation of its own.

It ends with the folder, not with the run: while it is driven, no event loop can be run beside it.
"""

from contextlib import suppress
from pathlib import Path

import pytest
from playwright.sync_api import sync_playwright

from tests.support.browser import DIALOG, find_missing, launch, sign_in, visit
from tests.support.deployments import short_folder
from tests.support.nightwork import work_a_night


def pytest_collection_modifyitems(items):
    """A browser on a busy machine is asked twice; the summary shows what the first answer was."""
    here = [item for item in items if Path(__file__).parent in item.path.parents]
    missing = find_missing() if here else ""
    for item in here:
        item.add_marker(pytest.mark.skip(reason=missing) if missing else pytest.mark.flaky(reruns=1))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """Beside a failure: what stands on the open pages, and the team's jobs."""
    report = yield
    if call.when == "call" and report.failed and (browser := item.funcargs.get("browser")):
        # a page that has crashed tells nothing, and must not end the run
        with suppress(Exception):
            pages = [page for context in browser.contexts for page in context.pages]
            report.sections += [
                (page.url, page.locator(f"{DIALOG}, main").last.inner_text()) for page in pages
            ]
            if team := item.funcargs.get("team"):
                report.sections.append(("jobs", "\n".join(map(str, team.client.jobs()))))
    return report


@pytest.fixture(scope="package")
def playwright():
    with sync_playwright() as started:
        yield started


@pytest.fixture(scope="package")
def browser(playwright):
    opened = launch(playwright)
    yield opened
    opened.close()


@pytest.fixture
def team(service):
    """An organisation of its own, with its client."""
    with service.team() as founded:
        yield founded


@pytest.fixture
def stranger_context(browser, service):
    """A browser in which nobody is signed in."""
    with visit(browser, service.url) as context:
        yield context


@pytest.fixture(params=["desktop"])
def context(request, browser, service):
    """A browser at 1440 px; at 390, with touch, by ``parametrize("context", ["phone"], indirect=True)``."""
    with visit(browser, service.url, width=request.param, has_touch=request.param == "phone") as opened:
        yield opened


@pytest.fixture
def page(context, team):
    """Signed in with the team's key."""
    return sign_in(context, team.key)


@pytest.fixture(scope="package")
def night(service):
    """A calibrated camera and two measurements, for all tests that look and leave them as they are."""
    with service.team() as founded, short_folder() as folder:
        yield work_a_night(founded, folder)


@pytest.fixture
def night_page(context, night):
    """Signed in with the key of the night's team."""
    return sign_in(context, night.team.key)
