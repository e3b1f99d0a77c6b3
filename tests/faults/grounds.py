"""The two deployments as drills need them: proxies before what lies elsewhere, and ways to harm each part."""

import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from abc import abstractmethod
from collections.abc import Collection, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

import psycopg
from obstore.store import S3Store
from sqlalchemy.engine import make_url

from store.database import Database
from store.settings import Settings
from tests.faults.machine import Clock
from tests.support.compose import compose
from tests.support.deployments import SECRETS, Composed, Deployment, Embedded, spawn
from tests.support.ports import pick_port
from tests.support.postgres import PostgresServer
from tests.support.processes import alive, children, command, family
from tests.support.proxy import Proxy

BUSY = b"HTTP/1.1 503 Slow Down\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"
AS_DELIVERED = {"STILB_LEASE_S": f"{Settings.model_fields['lease_s'].default:g}"}


class Ground(Deployment):
    """A deployment with all the handles by which a drill does it harm."""

    kind: str
    disk: Path | None = None
    clock: Clock | None = None
    proxies: dict[str, Proxy]
    services: list[str]

    @property
    def ours(self) -> list[str]:
        return [*self.services, "worker"]

    @abstractmethod
    def kill_all(self) -> None:
        """Kill every process at once, as when the power goes."""

    @abstractmethod
    def stop_all(self) -> None:
        """Stop everything as an operator does, and wait for its end."""

    @abstractmethod
    def start_all(self) -> None:
        """Start everything on the same data."""

    @abstractmethod
    def locked(self):
        """Lock the database against writes until the block ends."""

    @abstractmethod
    def is_amid_a_transaction(self, pids: Collection[int]) -> bool:
        """Return whether one of these processes, which are stopped, holds locks of the database."""

    @abstractmethod
    def stored(self, sha256: str) -> bytes | None:
        """What lies in the file store under this name."""

    @abstractmethod
    def overwrite(self, sha256: str, content: bytes | None) -> None:
        """Put other bytes under this name behind the service's back, or none."""

    @abstractmethod
    def back_up(self, folder: Path) -> None:
        """Back up as docs/operations.md says, while it runs."""

    @abstractmethod
    def restore(self, folder: Path) -> None:
        """Begin anew from a backup on a machine where nothing is left. Everything is stopped."""

    def terminate(self, name: str) -> int:
        """Ask one part to end, and wait until it has; its process."""
        pid = self.pid(name)
        os.kill(pid, signal.SIGTERM)
        self.wait_until_gone(name, pid)
        return pid

    def wait_until_gone(self, name: str, pid: int, timeout_s: float = 90.0) -> None:
        self.wait_until(lambda: not alive([pid]), f"the end of {name}, process {pid}", timeout_s=timeout_s)

    def cells(self) -> set[int]:
        """The processes below the decoders' zygote."""
        zygotes = [pid for pid in children(self.pid("worker")) if "worker.decode" in command(pid)]
        return {pid for zygote in zygotes for pid in family(zygote)}


class EmbeddedGround(Ground, Embedded):
    kind = "embedded"

    def __init__(self, folder: Path, **settings: str):
        port = str(pick_port())
        super().__init__(folder / "data", **{"STILB_PORT": port} | settings)
        self.proxies = {}
        self.services = ["service"]

    def kill_all(self) -> None:
        tree = family(self.launcher.pid)
        self.tree_is_killed()
        self._wait_for_the_end(tree)

    def stop_all(self) -> None:
        tree = family(self.launcher.pid)
        self.launcher.send_signal(signal.SIGTERM)
        code = self.launcher.wait(60)
        self._close()
        assert code == 0, f"the launcher ended with {code}"
        self._wait_for_the_end(tree)

    def _wait_for_the_end(self, tree: set[int]) -> None:
        self.wait_until(lambda: not alive(tree), "the end of all processes", timeout_s=30)

    def start_all(self) -> None:
        self.start()

    @contextmanager
    def locked(self) -> Iterator[None]:
        with closing(sqlite3.connect(self.data / "stilb.sqlite", timeout=60, isolation_level=None)) as held:
            held.execute("BEGIN IMMEDIATE")
            yield
            held.execute("ROLLBACK")

    def is_amid_a_transaction(self, pids: Collection[int]) -> bool:
        # in a process of its own, as it opens and closes a file of the database
        code = "import sys; from store.pulse import find_stopped_writer as find; print(find(sys.argv[1]))"
        command = [sys.executable, "-c", code, f"sqlite:///{self.data / 'stilb.sqlite'}"]
        holder = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
        return holder in map(str, pids)

    def stored(self, sha256: str) -> bytes | None:
        try:
            return self._blob(sha256).read_bytes()
        except FileNotFoundError:
            return None

    def overwrite(self, sha256: str, content: bytes | None) -> None:
        path = self._blob(sha256)
        if content is None:
            path.unlink()
            return
        path.chmod(0o600)
        path.write_bytes(content)

    def _blob(self, sha256: str) -> Path:
        return self.blobs / sha256[:2] / sha256[2:4] / sha256

    def back_up(self, folder: Path) -> None:
        with (
            closing(sqlite3.connect(self.data / "stilb.sqlite")) as source,
            closing(sqlite3.connect(folder / "stilb.sqlite")) as target,
        ):
            source.backup(target)
        subprocess.run(["cp", "-a", self.blobs, self.data / "key", folder], check=True, timeout=120)

    def restore(self, folder: Path) -> None:
        # The watch goes on asking the database: folders change places, so that it makes no file there.
        lost, found = (self.data.with_name(name) for name in ("lost", "found"))
        shutil.copytree(folder, found)
        self.data.rename(lost)
        found.rename(self.data)
        shutil.rmtree(lost)


class ComposedGround(Ground, Composed):
    kind = "composed"

    def __init__(
        self, folder: Path, server: PostgresServer, stack: ExitStack, *, services: int = 1, **settings: str
    ):
        url = server.new_database()
        self._name = make_url(url).database
        self._server = server
        self._sockets = Path(make_url(url).query["host"])
        database = stack.enter_context(Proxy(self._sockets / ".s.PGSQL.5432"))
        through = f"postgresql+psycopg://stilb@{database.address}/{self._name}"
        super().__init__(folder, url, services=services, **{"STILB_DATABASE_URL": through} | settings)
        self.proxies = {"database": database}
        self.held_down: set[str] = set()
        self._checks: dict[str, tuple[float, subprocess.Popen | None]] = {}

    def _start_s3(self, stack: ExitStack) -> str:
        self._s3_url = super()._start_s3(stack)
        host, port = self._s3_url.removeprefix("http://").split(":")
        self.proxies["s3"] = stack.enter_context(Proxy((host, int(port)), failure=BUSY))
        return f"http://{self.proxies['s3'].address}"

    def look_after(self) -> None:
        """Start again what died, and check the health of ours, both as Compose does."""
        for name in self.ours:
            self._check_health(name)
        for name, process in list(self._running.items()):
            if process.poll() is not None and name not in self.held_down:
                self.start(name)

    def _check_health(self, name: str) -> None:
        check = compose()["services"][name.partition("-")[0]]["healthcheck"]
        now = time.monotonic()
        began, running = self._checks.get(name, (now, None))
        if running is not None and running.poll() is None and now - began > _seconds(check["timeout"]):
            _end_check(running)
        if name in self._running and now - began >= _seconds(check["interval"]):
            words = [
                self.url_of(name) + word[word.index("/readyz") :] if "/readyz" in word else word
                for word in check["test"][1:]
            ]
            command = [sys.executable, *words[1:]]
            if running is not None:
                _end_check(running)
            running = spawn(
                command, self._described(name)[1], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
            )
            began = now
        self._checks[name] = (began, running)

    def _end(self) -> None:
        for _, running in self._checks.values():
            if running is not None:
                _end_check(running)
        self._checks.clear()
        super()._end()

    def _described(self, name: str) -> tuple[list[str], dict[str, str]]:
        command, environment = super()._described(name)
        return command, environment | (self.clock.environment if self.clock else {})

    def kill_all(self) -> None:
        self._end()

    def stop_all(self) -> None:
        self.held_down |= set(self.ours)
        for name in self.ours:
            os.kill(self.pid(name), signal.SIGTERM)
        for name in self.ours:
            self.wait_until_gone(name, self.pid(name), 60)

    def start_all(self) -> None:
        self.held_down.clear()
        self.look_after()
        self.wait_until(self.serves, "readiness of the service", timeout_s=240)

    @contextmanager
    def locked(self) -> Iterator[None]:
        with psycopg.connect(self._address) as held:
            _lock_tables(held)
            yield

    def is_amid_a_transaction(self, _pids: Collection[int]) -> bool:
        held = "SELECT pid, xact_start FROM pg_stat_activity WHERE state = 'idle in transaction'"
        held += " AND datname = current_database() AND now() - state_change > interval '0.3 s'"
        with psycopg.connect(self._address, autocommit=True) as asking:
            time.sleep(0.5)
            return bool(asking.execute(held).fetchall())

    def stored(self, sha256: str) -> bytes | None:
        try:
            return bytes(self._bucket().get(self._key(sha256)).bytes())
        except FileNotFoundError:
            return None

    def overwrite(self, sha256: str, content: bytes | None) -> None:
        if content is None:
            self._bucket().delete(self._key(sha256))
        else:
            self._bucket().put(self._key(sha256), content)
        # The copies on the local disk are the same bytes until they are evicted: here they are.
        for copy in (self.folder / "data").rglob(sha256):
            copy.unlink()

    def back_up(self, folder: Path) -> None:
        dump = ["pg_dump", "-h", self._sockets, "-U", "stilb", "-f", folder / "dump.sql", self._name]
        self._run(dump)
        for found in self._objects():
            target = folder / "bucket" / found
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(bytes(self._bucket().get(found).bytes()))

    def restore(self, folder: Path) -> None:
        self._bucket().delete(self._objects())
        shutil.rmtree(self.folder / "data")
        for path in (folder / "bucket").rglob("*"):
            if path.is_file():
                self._bucket().put(str(path.relative_to(folder / "bucket")), path.read_bytes())
        self.database.dispose()
        with psycopg.connect(f"host={self._sockets} user=stilb dbname=postgres", autocommit=True) as admin:
            admin.execute(f"DROP DATABASE {self._name} WITH (FORCE)")
            admin.execute(f"CREATE DATABASE {self._name} TEMPLATE template0")
        self._run(
            ["psql", "-q", "-h", self._sockets, "-U", "stilb", "-d", self._name, "-f", folder / "dump.sql"]
        )
        self.database = Database(self._database_url)

    def _run(self, command: list[str | Path]) -> None:
        binaries = self._server.binaries
        subprocess.run([binaries / command[0], *command[1:]], check=True, timeout=120, capture_output=True)

    @property
    def _address(self) -> str:
        return f"host={self._sockets} user=stilb dbname={self._name}"

    def _objects(self) -> list[str]:
        return [found["path"] for page in self._bucket().list() for found in page]

    def _bucket(self) -> S3Store:
        return S3Store(
            "stilb",
            endpoint=self._s3_url,
            region="us-east-1",
            access_key_id=SECRETS["AWS_ACCESS_KEY_ID_FILE"],
            secret_access_key=SECRETS["AWS_SECRET_ACCESS_KEY_FILE"],
            client_options={"allow_http": True},
        )

    def _key(self, sha256: str) -> str:
        return f"raw/{sha256[:2]}/{sha256[2:4]}/{sha256}"


def _end_check(running: subprocess.Popen) -> None:
    running.kill()
    running.wait()


def _seconds(text: str) -> float:
    assert text.endswith("s"), text
    return float(text.removesuffix("s"))


def _lock_tables(connection: psycopg.Connection) -> None:
    """Lock what every write needs: one table after the other, so a deadlock may choose this as its victim."""
    for _ in range(10):
        try:
            connection.execute("LOCK TABLE job, frame, audit_chain IN ACCESS EXCLUSIVE MODE")
        except psycopg.errors.DeadlockDetected:
            connection.rollback()
        else:
            return
    raise AssertionError("the tables could not be locked")
