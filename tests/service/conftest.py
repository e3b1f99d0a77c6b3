"""The application alone, and the house for two organisations."""

from uuid import uuid4

import pytest
from starlette.testclient import TestClient

from store.database import Database
from tests.support.house import House, furnished


@pytest.fixture(scope="module")
def built_app(sqlite_house):
    """The application, for what needs no rows."""
    return sqlite_house.app


@pytest.fixture(scope="module")
def open_http(built_app):
    """Without a key."""
    return TestClient(built_app)


@pytest.fixture(scope="module")
def sqlite_house(migrated_sqlite, tmp_path_factory):
    with furnished(migrated_sqlite, tmp_path_factory.mktemp("house")) as built:
        yield built


@pytest.fixture(scope="module", params=["sqlite", "postgresql"])
def shared_house(request, tmp_path_factory):
    """One for all tests of a module, on either database: each test makes a campaign of its own."""
    if request.param == "sqlite":
        yield request.getfixturevalue("sqlite_house")
        return
    server = request.getfixturevalue("postgres")
    url = server.new_database(like=request.getfixturevalue("migrated_postgres"))
    database = Database(url)
    with House(database, tmp_path_factory.mktemp("house")) as built:
        yield built
    database.dispose()
    server.drop_database(url)


@pytest.fixture
def stranger(house):
    """A client of another organisation, with every scope."""
    founded = house.post("/v1/organisations", {"name": f"Another City {uuid4()}"})
    with house.with_key(founded["key"]["secret"]) as client:
        yield client


@pytest.fixture
def visitor(house):
    """A browser that is not signed in."""
    with house.with_key("none") as client:
        del client.headers["Authorization"]
        yield client
