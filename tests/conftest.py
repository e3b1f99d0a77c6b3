"""What every suite shares: both databases, and the house put together without processes."""

import gc

# Thousands of tests and all that they import stay to the end: to search them for garbage again and again
# took a tenth of a test process.
gc.set_threshold(10_000)

import os
import tempfile
from collections import defaultdict
from contextlib import suppress
from pathlib import Path
from zlib import crc32

import hypothesis
import pytest

from store.database import Database
from store.migrate import migrate
from tests.support.deployments import Embedded, short_folder
from tests.support.house import House
from tests.support.postgres import postgres  # noqa: F401 (fixture)
from tests.support.s3 import s3_bucket, s3_endpoint  # noqa: F401 (fixtures)
from tests.support.stages import staged, stages  # noqa: F401 (fixtures)
from tests.support.wheels import installed, server_wheel, wheel  # noqa: F401 (fixtures)

# the same examples in every run, and no clock: a test fails because of the code, never of the day or the load
hypothesis.settings.register_profile("house", derandomize=True, deadline=None)
hypothesis.settings.load_profile("house")

# Tens of thousands of commits wait for a disk, and no test is about a power cut: their folders lie in memory,
# where a whole run keeps less than 1 GiB.
if "TMPDIR" not in os.environ:
    with suppress(OSError):
        memory = os.statvfs("/dev/shm")
        if not memory.f_flag & os.ST_NOEXEC and memory.f_bavail * memory.f_frsize > 3 << 30:
            os.environ["TMPDIR"], tempfile.tempdir = "/dev/shm", None


# what needs more than this process, and the suites that start whole deployments
SERVED = {
    "database_url",
    "migrated_sqlite",
    "postgres",
    "s3_endpoint",
    "shared_house",
    "staged",
    "stages",
    "wheel",
}
WHOLE = {"bench", "browser", "demo", "faults", "flow", "journeys"}
# What the first processes of a run begin with, in this order: such tests wait for much of their time, while
# other processes compute. Those of one deployment stay in one process, and the longest do not end the run.
FIRST = (
    ("faults", "flow", "stilb/test_wheel.py", "verify/test_every_method.py"),
    ("bench", "service/test_fuzz.py", "browser", "demo"),
)


# tests of a unit that take longer than this of a processor, their own processes included
SLOW_S = 0.35
SLOW = Path(__file__).parent / "slow.txt"
_seconds = defaultdict(float)


def pytest_addoption(parser):
    parser.addoption("--write-slow", action="store_true", help="measure the tests that run, into slow.txt")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    began = sum(os.times()[:4])
    ended = yield
    _seconds[_name_test(item)] += sum(os.times()[:4]) - began
    return ended


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item):
    """One line of the summary for each reason to skip: what a machine lacks, hundreds of tests may lack."""
    report = yield
    if report.skipped and isinstance(report.longrepr, tuple):
        report.longrepr = (str(item.config.rootpath / "tests"), None, report.longrepr[2])
    return report


def pytest_sessionfinish(session):
    if session.config.getoption("--write-slow"):
        kept = set(SLOW.read_text().split()) - _seconds.keys()
        slow = {name for name, seconds in _seconds.items() if seconds > SLOW_S}
        SLOW.write_text("".join(f"{name}\n" for name in sorted(kept | slow)))


def pytest_collection_modifyitems(items):
    """Mark the tests of `make quick`, and keep of each test marked `either_database` the run on one database.

    Both databases are for what each does in its own way: locks and what runs at once, migrations, plans,
    types and limits of columns. For a test of anything else the module's name decides: half of the modules
    run on SQLite and half on PostgreSQL, and what the tests of a module share is made once.
    """
    slow = set(SLOW.read_text().split())
    for item in items:
        room = item.path.relative_to(Path(__file__).parent).parts[0]
        if room not in WHOLE and SERVED.isdisjoint(item.fixturenames):
            item.add_marker(pytest.mark.unit)
        if _name_test(item) in slow:
            item.add_marker(pytest.mark.slow)
    offered = defaultdict(set)
    for item in items:
        if item.get_closest_marker("either_database") and not item.get_closest_marker("both_databases"):
            offered[_name_test(item)].add(_read_database(item))
    items[:] = [item for item in items if _is_kept(item, offered.get(_name_test(item)))]
    if processes := os.environ.get("PYTEST_XDIST_WORKER_COUNT"):
        items[:] = _order(items, int(processes))


def _order(items, processes):
    """Return the tests so that each of the equal parts into which worksteal cuts them begins with its own."""
    begun = {place: [] for places in FIRST for place in places}
    others, ordered = [], []
    for item in items:
        path = item.path.relative_to(Path(__file__).parent)
        begun.get(str(path), begun.get(path.parts[0], others)).append(item)
    for number, places in enumerate(FIRST, start=1):
        for place in places:
            ordered += begun[place]
        more = max(0, number * len(items) // processes - len(ordered))
        ordered += others[:more]
        del others[:more]
    return ordered + others


def pytest_collection_finish():
    gc.freeze()


def _is_kept(item, databases):
    if databases is None or None in databases:
        return True
    module = item.nodeid.partition("::")[0]
    return _read_database(item) == sorted(databases)[crc32(module.encode()) % len(databases)]


def _name_test(item):
    return item.nodeid.partition("[")[0]


def _read_database(item):
    params = item.callspec.params if hasattr(item, "callspec") else {}
    given = params.keys() & {"database_url", "shared_house"}
    return params[given.pop()] if given else None


@pytest.fixture(scope="session")
def migrated_sqlite(tmp_path_factory):
    path = tmp_path_factory.mktemp("template") / "template.sqlite"
    database = Database(f"sqlite:///{path}")
    migrate(database)
    database.dispose()
    return path


@pytest.fixture(scope="session")
def migrated_postgres(postgres):  # noqa: F811
    url = postgres.new_database()
    # a statement takes long on a busy machine; what is about that limit has a database of its own
    database = Database(url, answer_within_s=300.0)
    migrate(database)
    database.dispose()
    return url


@pytest.fixture(params=["sqlite", "postgresql"])
def database_url(request, tmp_path):
    """A migrated database for one test, on SQLite and on PostgreSQL."""
    if request.param == "sqlite":
        path = tmp_path / "stilb.sqlite"
        path.write_bytes(request.getfixturevalue("migrated_sqlite").read_bytes())
        yield f"sqlite:///{path}"
        return
    server = request.getfixturevalue("postgres")
    url = server.new_database(like=request.getfixturevalue("migrated_postgres"))
    yield url
    server.drop_database(url)


@pytest.fixture(params=["sqlite", "postgresql"])
def empty(request, tmp_path):
    """A database without tables, on SQLite and on PostgreSQL."""
    url = f"sqlite:///{tmp_path / 'empty.sqlite'}"
    if request.param == "postgresql":
        url = request.getfixturevalue("postgres").new_database()
    opened = Database(url, answer_within_s=300.0)
    yield opened
    opened.dispose()


@pytest.fixture(scope="session")
def service():
    """`make up`, for pages and journeys; whoever uses it is an organisation of its own."""
    with short_folder() as folder, Embedded(folder / "data") as deployment:
        yield deployment


@pytest.fixture
def database(database_url):
    opened = Database(database_url, answer_within_s=300.0)
    yield opened
    opened.dispose()


@pytest.fixture
def house(database, tmp_path):
    """The service and a worker over one database and one folder, called in turn by the test itself."""
    with House(database, tmp_path) as built:
        yield built
