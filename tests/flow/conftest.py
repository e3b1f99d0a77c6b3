"""One service of each kind for all tests that leave it as they found it."""

import pytest

from tests.support.deployments import Composed, Embedded, short_folder
from tests.support.fieldwork import write_campaign


@pytest.fixture(scope="session")
def embedded(installed):
    """`stilb-server up` from its wheel, on SQLite, a folder and the bundled Valkey."""
    command = [str(installed / "bin" / "stilb-server"), "up"]
    with short_folder() as folder, Embedded(folder / "data", command, STILB_LOG="json") as deployment:
        yield deployment


@pytest.fixture(scope="session")
def composed(postgres):
    """docker-compose.yml, on PostgreSQL, S3 and a Valkey of its own."""
    with short_folder() as folder, Composed(folder, postgres.new_database()) as deployment:
        yield deployment


@pytest.fixture(scope="session")
def shots(tmp_path_factory):
    """Thirty frames, of which K follows at two ISO values."""
    return write_campaign(tmp_path_factory.mktemp("shots"))


@pytest.fixture(scope="session")
def shots_of_one_iso(shots):
    return shots[: len(shots) // 2]
