"""The application alone, and the house for two organisations."""

import pytest
from starlette.testclient import TestClient

from service.http.app import build_app
from service.http.context import Context
from service.http.processes import Traffic
from service.http.signatures import Sessions
from service.jobs.watch import JobWatch
from service.system.health import Health
from store.blobs import LocalBlobs
from store.database import Database
from store.settings import Settings
from tests.support.house import House


@pytest.fixture(scope="module")
def built_app(migrated_sqlite, tmp_path_factory):
    """The application over an empty database, for what needs no rows."""
    folder = tmp_path_factory.mktemp("app")
    path = folder / "stilb.sqlite"
    path.write_bytes(migrated_sqlite.read_bytes())
    database = Database(f"sqlite:///{path}")
    blobs = LocalBlobs(folder / "blobs")
    yield build_app(
        Context(
            settings=Settings(data=folder),
            database=database,
            blobs=blobs,
            watch=JobWatch(database),
            sessions=Sessions(b"a secret of the tests, 32 bytes long"),
            traffic=Traffic(),
            health=Health(database, blobs),
        )
    )
    database.dispose()


@pytest.fixture(scope="module")
def open_http(built_app):
    """Without a key."""
    with TestClient(built_app) as client:
        yield client


@pytest.fixture(scope="module")
def sqlite_house(migrated_sqlite, tmp_path_factory):
    folder = tmp_path_factory.mktemp("house")
    path = folder / "stilb.sqlite"
    path.write_bytes(migrated_sqlite.read_bytes())
    database = Database(f"sqlite:///{path}")
    with House(database, folder) as built:
        yield built
    database.dispose()


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
    founded = house.post("/v1/organisations", {"name": "Another City"})
    with house.with_key(founded["key"]["secret"]) as client:
        yield client
