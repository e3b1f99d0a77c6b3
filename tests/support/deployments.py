"""The service as real processes: as `make up` starts it, and as docker-compose.yml does.

They share a face, so that one test goes for both. All of them die with the test process, however it ends.
"""

import os
import signal
import subprocess
import sys
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path

import redis
from sqlalchemy import select

from service.launch.supervisor import die_with_parent
from service.launch.valkey import valkey_binary
from store.database import Database
from store.jobs import FINAL_STATES
from store.tables import Job
from tests.support.compose import ROOT, S3, command_of, compose, environment_of
from tests.support.fieldwork import Team, new_team
from tests.support.ports import pick_port
from tests.support.processes import alive, children, command
from tests.support.proxy import Proxy
from tests.support.waiting import PATIENCE_S, state_of, status_of, text_of, wait_for

# What is lost is found again within seconds.
QUICK = {"STILB_LEASE_S": "3"}
# Where many others want the processors too.
_STARTS_WITHIN_S = 240.0
SECRETS = {
    "STILB_KEY_FILE": "stilb_flow_key_of_32_characters_and_more",
    "AWS_ACCESS_KEY_ID_FILE": "id",
    "AWS_SECRET_ACCESS_KEY_FILE": "secret",
}
PARTS = {"service": ["-m", "service"], "worker": ["worker", "-Q"]}


class Deployment(ABC):
    """What runs, wherever it does: `url`, `key`, `database`, `broker`, `logs`, and its processes by name."""

    url: str
    key: str
    broker_url: str
    database: Database
    broker: redis.Redis
    logs: Path

    @abstractmethod
    def pid(self, name: str) -> int: ...

    @abstractmethod
    def look_after(self) -> None:
        """Start again what has died, where nobody else does."""

    def kill(self, name: str) -> None:
        """As the kernel does when memory runs out. It is started again by whoever looks after it."""
        pid = self.pid(name)
        os.kill(pid, signal.SIGKILL)
        wait_for(lambda: not alive([pid]), f"the end of {name}, process {pid}, which was killed")

    @contextmanager
    def stopped(self, name: str):
        """A part that is there and does nothing, until the block ends or what it is given is called."""
        pid = self.pid(name)
        os.kill(pid, signal.SIGSTOP)

        def resume() -> None:
            # On a slow machine the launcher has started another in its place.
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGCONT)

        try:
            yield resume
        finally:
            resume()

    def wait_until(
        self,
        condition: Callable[[], object],
        what: str = "",
        *,
        timeout_s: float = PATIENCE_S,
        seen: Callable[[], object] | None = None,
    ) -> None:
        """Wait while dead parts are started again; a failure ends with the logs' last words."""

        def met() -> object:
            self.look_after()
            return condition()

        def last() -> str:
            return f"{seen() if seen else state_of(condition)}\n{self.last_words()}"

        wait_for(met, what or text_of(condition), timeout_s=timeout_s, seen=last)

    def jobs(self, *, subjects: list[str] | None = None) -> list[Job]:
        """Rows, oldest first, also of other organisations unless the subjects are named."""
        rows = select(Job).order_by(Job.created_at, Job.id)
        if subjects is not None:
            rows = rows.where(Job.subject_id.in_(subjects))
        with self.database.reading() as session:
            return list(session.scalars(rows))

    def wait_for_jobs(self, subjects: list[str]) -> list[Job]:
        """Wait until every job on these frames or campaigns has ended, and give them."""

        def live() -> list[tuple[str, str, str, int]]:
            jobs = self.jobs(subjects=subjects)
            return [
                (job.id, job.kind, job.state, job.attempt) for job in jobs if job.state not in FINAL_STATES
            ]

        self.wait_until(lambda: not live(), f"the end of the jobs of {len(subjects)} subjects", seen=live)
        return self.jobs(subjects=subjects)

    def team(self, **settings) -> Team:
        return new_team(self.url, self.key, **settings)

    def url_of(self, _name: str) -> str:
        return self.url

    def serves(self, name: str = "") -> bool:
        """Return whether the service is ready; of several the one of this name."""
        return status_of(f"{self.url_of(name) if name else self.url}/readyz") == 200

    def last_words(self) -> str:
        tails = [f"--- {path.name}\n{path.read_text()[-9000:]}" for path in sorted(self.logs.glob("*.log"))]
        return "\n".join(tails)


class Embedded(Deployment):
    """`python -m service.up` on a data folder, or the same as installed."""

    def __init__(self, data: Path, command=(sys.executable, "-m", "service.up"), **settings: str):
        self.data = data
        self.logs = data / "logs"
        self.blobs = data / "blobs"
        self._command = list(command)
        self._environment = os.environ | QUICK | {"STILB_DATA": str(data), "STILB_PORT": "0"} | settings

    def __enter__(self):
        self.start()
        return self

    def start(self) -> None:
        self.launcher = spawn(
            self._command, self._environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        line = self.launcher.stdout.readline().split()
        if line[:1] != ["ready"]:
            self.launcher.kill()
            raise AssertionError(self.launcher.communicate()[1])
        _, self.url, _, self.key = line
        self.broker_url = f"redis+socket://{self.data / 'valkey.sock'}"
        self.broker = redis.Redis(unix_socket_path=str(self.data / "valkey.sock"))
        self.database = Database(f"sqlite:///{self.data / 'stilb.sqlite'}")

    def look_after(self) -> None:
        """The launcher does."""

    def pid(self, name: str) -> int:
        found: list[int] = []

        def is_there() -> bool:
            found[:] = [pid for pid in children(self.launcher.pid) if _is_part(pid, name)]
            return bool(found)

        # It may have died just now, to be started again.
        wait_for(is_there, f"a process of the part {name} below the launcher")
        return found[0]

    def tree_is_killed(self) -> None:
        """kill -9 on the launcher; the kernel takes the others along."""
        self.launcher.kill()
        self._close()

    def __exit__(self, *_):
        self.launcher.kill()
        self._close()

    def _close(self) -> None:
        self.launcher.communicate()
        self.broker.close()
        self.database.dispose()


class Composed(Deployment):
    """Commands and environment of docker-compose.yml with S3; only the addresses are this machine's.

    ``services`` : so many of them are behind one address, as with ``--scale service=2``
    """

    def __init__(self, folder: Path, database_url: str, *, services: int = 1, **settings: str):
        self.folder = folder
        self.services = ["service", *(f"service-{number}" for number in range(2, services + 1))]
        self.logs = folder / "logs"
        self.key = SECRETS["STILB_KEY_FILE"]
        self._database_url = database_url
        self._settings = settings
        self._running: dict[str, subprocess.Popen] = {}

    def __enter__(self):
        with ExitStack() as stack:
            self._start_all(stack)
            self._stack = stack.pop_all()
        return self

    def _start_all(self, stack: ExitStack) -> None:
        self.logs.mkdir()
        broker_port = pick_port()
        self._ports = {name: pick_port() for name in self.services}
        addresses = [("127.0.0.1", port) for port in self._ports.values()]
        balance = stack.enter_context(Proxy(*addresses)) if len(addresses) > 1 else None
        self.url = f"http://{balance.address}" if balance else self.url_of("service")
        self.broker_url = f"redis://127.0.0.1:{broker_port}/0"
        self.broker = stack.enter_context(redis.Redis(port=broker_port))
        self.database = Database(self._database_url)
        stack.callback(self.database.dispose)
        stack.callback(self._end)
        self._addresses = {
            "STILB_DATA": str(self.folder / "data"),
            "STILB_DATABASE_URL": self._database_url,
            "STILB_BROKER_URL": self.broker_url,
            "STILB_HOST": "127.0.0.1",
            "AWS_ENDPOINT_URL": self._start_s3(stack),
            **{name: str(self.folder / name) for name in SECRETS},
        }
        for name, secret in SECRETS.items():
            (self.folder / name).write_text(f"{secret}\n")
        self._broker_port = broker_port
        self.start("valkey")
        wait_for(self._broker_answers, "an answer of Valkey")
        self.start("migrate")
        assert self._running.pop("migrate").wait(_STARTS_WITHIN_S) == 0, self.last_words()
        for name in (*self.services, "worker"):
            self.start(name)
        for name in self.services:
            self.wait_until(
                partial(self.serves, name), f"readiness of the {name}", timeout_s=_STARTS_WITHIN_S
            )

    def start(self, name: str) -> None:
        with (self.logs / f"{name}.log").open("ab") as log:
            self._running[name] = spawn(*self._described(name), stdout=log, stderr=log)

    def pid(self, name: str) -> int:
        return self._running[name].pid

    def url_of(self, name: str) -> str:
        return f"http://127.0.0.1:{self._ports[name]}"

    def look_after(self) -> None:
        # As `restart: unless-stopped` does.
        for name, process in list(self._running.items()):
            if process.poll() is not None:
                self.start(name)

    def __exit__(self, *_):
        self._stack.close()

    def _described(self, name: str) -> tuple[list[str], dict[str, str]]:
        path = {"PATH": os.environ["PATH"]} | _choice_of_kernels()
        if name == "valkey":
            words = compose()["services"]["redis"]["command"]
            where = ["--port", str(self._broker_port), "--bind", "127.0.0.1", "--dir", str(self.folder)]
            return [str(valkey_binary()), *words[1:], *where], path
        kind = name.partition("-")[0]
        named = environment_of(kind, {"STILB_BLOBS_URL": "s3://stilb/raw", "AWS_ENDPOINT_URL": ""}, S3)
        # the address that the test was given has its password
        del named["STILB_DATABASE_PASSWORD_FILE"]
        # each container has a /tmp of its own
        addresses = self._addresses | {"STILB_PULSE": str(self.folder / f"pulse-{name}")}
        if name in self._ports:
            addresses["STILB_PORT"] = str(self._ports[name])
        here = {key: value for key, value in addresses.items() if key in named}
        return command_of(kind), path | named | here | QUICK | self._settings

    def _start_s3(self, stack: ExitStack) -> str:
        server = stack.enter_context(
            spawn(
                [sys.executable, "-m", "tests.support.s3_server"],
                {"PATH": os.environ["PATH"], "BUCKET": "stilb"},
                stdout=subprocess.PIPE,
                # a line for each request
                stderr=subprocess.DEVNULL,
                text=True,
            )
        )
        stack.callback(server.kill)
        return server.stdout.readline().strip()

    def _broker_answers(self) -> bool:
        try:
            return self.broker.ping()
        except redis.ConnectionError:
            return False

    def _end(self) -> None:
        for process in self._running.values():
            process.kill()
        for process in self._running.values():
            process.wait()


def _choice_of_kernels() -> dict[str, str]:
    """Which of its kernels OpenBLAS is told to take here: another one changes a result's last bit."""
    return {name: value for name, value in os.environ.items() if name.startswith("OPENBLAS_")}


def spawn(command: list[str], environment: dict[str, str], **pipes) -> subprocess.Popen:
    """Start a process in the checkout that ends with this one."""
    return subprocess.Popen(
        command,
        cwd=ROOT,
        env=environment,
        stdin=subprocess.DEVNULL,
        process_group=0,
        preexec_fn=die_with_parent(),  # noqa: PLW1509 (it takes no lock)
        **pipes,
    )


@contextmanager
def short_folder():
    """Short enough for a unix socket, and gone afterwards with all that was uploaded."""
    with tempfile.TemporaryDirectory(prefix="stilb-", ignore_cleanup_errors=True) as folder:
        yield Path(folder)


def _is_part(pid: int, name: str) -> bool:
    words = command(pid)
    if not words:
        return False
    if name == "valkey":
        return Path(words[0]).name == "valkey-server"
    return set(PARTS[name]) <= set(words)
